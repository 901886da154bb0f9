/* FMI 2.0 co-simulation around {name}.c. Written by softnn {version}. */
#include "{name}_fmu.h"

#include <string.h>

#if defined _WIN32
#define FMI2_EXPORT __declspec(dllexport)
#else
#define FMI2_EXPORT __attribute__((visibility("default")))
#endif

typedef void *component;
typedef unsigned int reference;
typedef int boolean;
typedef const char *string;
typedef enum { OK, WARNING, DISCARD, ERROR } status;

/* Declared, then defined: a library without prototypes would not compile cleanly. */
#define API(type, name, arguments) \
    FMI2_EXPORT type name arguments; \
    FMI2_EXPORT type name arguments
#define REFUSED(name, arguments, unused) \
    API(status, name, arguments) { unused return ERROR; }
#define UNUSED(x) (void)(x);

API(string, fmi2GetTypesPlatform, (void)) { return "default"; }
API(string, fmi2GetVersion, (void)) { return "2.0"; }

API(status, fmi2SetDebugLogging, (component c, boolean on, size_t n, const string s[]))
{
    (void)c, (void)on, (void)n, (void)s;
    return OK;
}

API(component, fmi2Instantiate,
    (string name, int type, string guid, string place, const void *functions,
     boolean visible, boolean logging))
{
    (void)name, (void)place, (void)functions, (void)visible, (void)logging;
    return type == 1 && guid && strcmp(guid, "{token}") == 0 ? create() : NULL;
}

API(void, fmi2FreeInstance, (component c)) { free(c); }

API(status, fmi2SetupExperiment,
    (component c, boolean a, double tolerance, double start, boolean b, double stop))
{
    (void)a, (void)tolerance, (void)b, (void)stop;
    ((instance *)c)->real[TIME] = start;
    return OK;
}

API(status, fmi2EnterInitializationMode, (component c)) { UNUSED(c) return OK; }

API(status, fmi2ExitInitializationMode, (component c))
{
    advance(c, 0.0); /* the first sample */
    return OK;
}

API(status, fmi2Terminate, (component c)) { UNUSED(c) return OK; }

API(status, fmi2Reset, (component c))
{
    restart(c);
    return OK;
}

API(status, fmi2GetReal, (component c, const reference r[], size_t n, double v[]))
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (r[i] >= REALS) {
            return ERROR;
        }
        v[i] = ((instance *)c)->real[r[i]];
    }
    return OK;
}

API(status, fmi2SetReal, (component c, const reference r[], size_t n, const double v[]))
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (r[i] > SIMULATED) {
            return ERROR;
        }
        ((instance *)c)->real[r[i]] = v[i];
    }
    return OK;
}

API(status, fmi2GetInteger, (component c, const reference r[], size_t n, int v[]))
{
    size_t i;
    for (i = 0; i < n; i++) {
        long value;
        if (!integer_of(c, r[i], &value)) {
            return ERROR;
        }
        v[i] = (int)value;
    }
    return OK;
}

API(status, fmi2DoStep, (component c, double now, double step, boolean no_way_back))
{
    instance *m = c;
    (void)no_way_back;
    if (!(step >= 0.0)) {
        return ERROR;
    }
    advance(m, step);
    m->real[TIME] = now + step;
    return OK;
}

API(status, fmi2GetRealStatus, (component c, int kind, double *v))
{
    if (kind != 2) {
        return DISCARD;
    }
    *v = ((instance *)c)->real[TIME];
    return OK;
}

#define NONE2 UNUSED(c) UNUSED(r) UNUSED(n) UNUSED(v)
#define LIST(type) (component c, const reference r[], size_t n, type v[])
REFUSED(fmi2GetBoolean, LIST(boolean), NONE2)
REFUSED(fmi2GetString, LIST(string), NONE2)
REFUSED(fmi2SetInteger, LIST(const int), NONE2)
REFUSED(fmi2SetBoolean, LIST(const boolean), NONE2)
REFUSED(fmi2SetString, LIST(const string), NONE2)
REFUSED(fmi2GetFMUstate, (component c, void **s), UNUSED(c) UNUSED(s))
REFUSED(fmi2SetFMUstate, (component c, void *s), UNUSED(c) UNUSED(s))
REFUSED(fmi2FreeFMUstate, (component c, void **s), UNUSED(c) UNUSED(s))
REFUSED(fmi2SerializedFMUstateSize, (component c, void *s, size_t *n),
        UNUSED(c) UNUSED(s) UNUSED(n))
REFUSED(fmi2SerializeFMUstate, (component c, void *s, char b[], size_t n),
        UNUSED(c) UNUSED(s) UNUSED(b) UNUSED(n))
REFUSED(fmi2DeSerializeFMUstate, (component c, const char b[], size_t n, void **s),
        UNUSED(c) UNUSED(b) UNUSED(n) UNUSED(s))
REFUSED(fmi2GetDirectionalDerivative,
        (component c, const reference a[], size_t n, const reference b[], size_t m,
         const double x[], double y[]),
        UNUSED(c) UNUSED(a) UNUSED(n) UNUSED(b) UNUSED(m) UNUSED(x) UNUSED(y))
REFUSED(fmi2SetRealInputDerivatives,
        (component c, const reference r[], size_t n, const int o[], const double v[]),
        NONE2 UNUSED(o))
REFUSED(fmi2GetRealOutputDerivatives,
        (component c, const reference r[], size_t n, const int o[], double v[]),
        NONE2 UNUSED(o))
REFUSED(fmi2CancelStep, (component c), UNUSED(c))
#define ASKED(type) (component c, int kind, type *v)
#define NONE3 UNUSED(c) UNUSED(kind) UNUSED(v)
REFUSED(fmi2GetStatus, ASKED(status), NONE3)
REFUSED(fmi2GetIntegerStatus, ASKED(int), NONE3)
REFUSED(fmi2GetBooleanStatus, ASKED(boolean), NONE3)
REFUSED(fmi2GetStringStatus, ASKED(string), NONE3)
