/* FMI 3.0 co-simulation around {name}.c. Written by softnn {version}. */
#include "{name}_fmu.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#if defined _WIN32
#define FMI3_EXPORT __declspec(dllexport)
#else
#define FMI3_EXPORT __attribute__((visibility("default")))
#endif

typedef void *component;
typedef uint32_t reference;
typedef const char *string;
typedef const uint8_t *binary;
typedef enum { OK, WARNING, DISCARD, ERROR } status;

#define API(type, name, arguments) \
    FMI3_EXPORT type name arguments; \
    FMI3_EXPORT type name arguments
#define REFUSED(name, arguments, unused) \
    API(status, name, arguments) { unused return ERROR; }
#define UNUSED(x) (void)(x);

API(string, fmi3GetVersion, (void)) { return "3.0"; }

API(status, fmi3SetDebugLogging, (component c, bool on, size_t n, const string s[]))
{
    (void)c, (void)on, (void)n, (void)s;
    return OK;
}

API(component, fmi3InstantiateCoSimulation,
    (string name, string token, string place, bool visible, bool logging, bool events,
     bool early, const reference needed[], size_t n, void *environment, void *log,
     void *update))
{
    (void)name, (void)place, (void)visible, (void)logging, (void)events, (void)early;
    (void)needed, (void)n, (void)environment, (void)log, (void)update;
    return token && strcmp(token, "{token}") == 0 ? create() : NULL;
}

API(component, fmi3InstantiateModelExchange,
    (string a, string b, string c, bool d, bool e, void *f, void *g))
{
    (void)a, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g;
    return NULL;
}

API(component, fmi3InstantiateScheduledExecution,
    (string a, string b, string c, bool d, bool e, void *f, void *g, void *h, void *i,
     void *j))
{
    (void)a, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h, (void)i;
    (void)j;
    return NULL;
}

API(void, fmi3FreeInstance, (component c)) { free(c); }

API(status, fmi3EnterInitializationMode,
    (component c, bool a, double tolerance, double start, bool b, double stop))
{
    (void)a, (void)tolerance, (void)b, (void)stop;
    ((instance *)c)->real[TIME] = start;
    return OK;
}

API(status, fmi3ExitInitializationMode, (component c))
{
    advance(c, 0.0); /* the first sample */
    return OK;
}

API(status, fmi3Terminate, (component c)) { UNUSED(c) return OK; }

API(status, fmi3Reset, (component c))
{
    restart(c);
    return OK;
}

API(status, fmi3GetFloat64,
    (component c, const reference r[], size_t n, double v[], size_t m))
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (r[i] >= REALS || i >= m) {
            return ERROR;
        }
        v[i] = ((instance *)c)->real[r[i]];
    }
    return OK;
}

API(status, fmi3SetFloat64,
    (component c, const reference r[], size_t n, const double v[], size_t m))
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (r[i] > SIMULATED || i >= m) {
            return ERROR;
        }
        ((instance *)c)->real[r[i]] = v[i];
    }
    return OK;
}

API(status, fmi3GetInt32,
    (component c, const reference r[], size_t n, int32_t v[], size_t m))
{
    size_t i;
    for (i = 0; i < n; i++) {
        long value;
        if (i >= m || !integer_of(c, r[i], &value)) {
            return ERROR;
        }
        v[i] = (int32_t)value;
    }
    return OK;
}

API(status, fmi3DoStep,
    (component c, double now, double step, bool no_way_back, bool *event, bool *ended,
     bool *early, double *last))
{
    instance *m = c;
    (void)no_way_back;
    if (!(step >= 0.0)) {
        return ERROR;
    }
    advance(m, step);
    m->real[TIME] = now + step;
    *event = *ended = *early = false;
    *last = now + step;
    return OK;
}

#define NONE4 UNUSED(c) UNUSED(r) UNUSED(n) UNUSED(v) UNUSED(m)
#define LIST(type) (component c, const reference r[], size_t n, type v[], size_t m)
#define TYPE(name, type) \
    REFUSED(fmi3Get##name, LIST(type), NONE4) \
    REFUSED(fmi3Set##name, LIST(const type), NONE4)
TYPE(Float32, float)
TYPE(Int8, int8_t)
TYPE(UInt8, uint8_t)
TYPE(Int16, int16_t)
TYPE(UInt16, uint16_t)
TYPE(UInt32, uint32_t)
TYPE(Int64, int64_t)
TYPE(UInt64, uint64_t)
TYPE(Boolean, bool)
REFUSED(fmi3SetInt32, LIST(const int32_t), NONE4)
REFUSED(fmi3GetString, LIST(string), NONE4)
REFUSED(fmi3SetString, LIST(const string), NONE4)
#define NONE3 UNUSED(c) UNUSED(r) UNUSED(n)
#define FEW(...) (component c, const reference r[], size_t n, __VA_ARGS__)
REFUSED(fmi3GetBinary, FEW(size_t s[], binary v[], size_t m), NONE4 UNUSED(s))
REFUSED(fmi3SetBinary, FEW(const size_t s[], const binary v[], size_t m),
        NONE4 UNUSED(s))
REFUSED(fmi3GetClock, FEW(bool v[]), NONE3 UNUSED(v))
REFUSED(fmi3SetClock, FEW(const bool v[]), NONE3 UNUSED(v))
REFUSED(fmi3GetIntervalDecimal, FEW(double v[], int q[]), NONE3 UNUSED(v) UNUSED(q))
REFUSED(fmi3GetIntervalFraction, FEW(uint64_t v[], uint64_t w[], int q[]),
        NONE3 UNUSED(v) UNUSED(w) UNUSED(q))
REFUSED(fmi3GetShiftDecimal, FEW(double v[]), NONE3 UNUSED(v))
REFUSED(fmi3GetShiftFraction, FEW(uint64_t v[], uint64_t w[]),
        NONE3 UNUSED(v) UNUSED(w))
REFUSED(fmi3SetIntervalDecimal, FEW(const double v[]), NONE3 UNUSED(v))
REFUSED(fmi3SetIntervalFraction, FEW(const uint64_t v[], const uint64_t w[]),
        NONE3 UNUSED(v) UNUSED(w))
REFUSED(fmi3SetShiftDecimal, FEW(const double v[]), NONE3 UNUSED(v))
REFUSED(fmi3SetShiftFraction, FEW(const uint64_t v[], const uint64_t w[]),
        NONE3 UNUSED(v) UNUSED(w))
REFUSED(fmi3GetNumberOfVariableDependencies, (component c, reference r, size_t *n),
        NONE3)
REFUSED(fmi3GetVariableDependencies,
        (component c, reference r, size_t a[], reference b[], size_t d[], int k[],
         size_t n),
        NONE3 UNUSED(a) UNUSED(b) UNUSED(d) UNUSED(k))
REFUSED(fmi3GetFMUState, (component c, void **s), UNUSED(c) UNUSED(s))
REFUSED(fmi3SetFMUState, (component c, void *s), UNUSED(c) UNUSED(s))
REFUSED(fmi3FreeFMUState, (component c, void **s), UNUSED(c) UNUSED(s))
REFUSED(fmi3SerializedFMUStateSize, (component c, void *s, size_t *n),
        UNUSED(c) UNUSED(s) UNUSED(n))
REFUSED(fmi3SerializeFMUState, (component c, void *s, uint8_t b[], size_t n),
        UNUSED(c) UNUSED(s) UNUSED(b) UNUSED(n))
REFUSED(fmi3DeserializeFMUState, (component c, const uint8_t b[], size_t n, void **s),
        UNUSED(c) UNUSED(b) UNUSED(n) UNUSED(s))
#define SLOPES (component c, const reference a[], size_t n, const reference b[], \
                size_t m, const double x[], size_t k, double y[], size_t l)
#define NONE9 UNUSED(c) UNUSED(a) UNUSED(n) UNUSED(b) UNUSED(m) UNUSED(x) UNUSED(k) \
    UNUSED(y) UNUSED(l)
REFUSED(fmi3GetDirectionalDerivative, SLOPES, NONE9)
REFUSED(fmi3GetAdjointDerivative, SLOPES, NONE9)
REFUSED(fmi3EnterConfigurationMode, (component c), UNUSED(c))
REFUSED(fmi3ExitConfigurationMode, (component c), UNUSED(c))
REFUSED(fmi3EnterEventMode, (component c), UNUSED(c))
REFUSED(fmi3EnterStepMode, (component c), UNUSED(c))
REFUSED(fmi3EvaluateDiscreteStates, (component c), UNUSED(c))
REFUSED(fmi3UpdateDiscreteStates,
        (component c, bool *p, bool *q, bool *r, bool *s, bool *t, double *u),
        UNUSED(c) UNUSED(p) UNUSED(q) UNUSED(r) UNUSED(s) UNUSED(t) UNUSED(u))
REFUSED(fmi3GetOutputDerivatives,
        FEW(const int32_t o[], double v[], size_t m), NONE4 UNUSED(o))
REFUSED(fmi3ActivateModelPartition, (component c, reference r, double t),
        UNUSED(c) UNUSED(r) UNUSED(t))
REFUSED(fmi3EnterContinuousTimeMode, (component c), UNUSED(c))
REFUSED(fmi3CompletedIntegratorStep, (component c, bool a, bool *b, bool *d),
        UNUSED(c) UNUSED(a) UNUSED(b) UNUSED(d))
REFUSED(fmi3SetTime, (component c, double t), UNUSED(c) UNUSED(t))
#define NUMBERS(type) (component c, type x[], size_t n)
#define NONEX UNUSED(c) UNUSED(x) UNUSED(n)
REFUSED(fmi3SetContinuousStates, NUMBERS(const double), NONEX)
REFUSED(fmi3GetContinuousStates, NUMBERS(double), NONEX)
REFUSED(fmi3GetContinuousStateDerivatives, NUMBERS(double), NONEX)
REFUSED(fmi3GetNominalsOfContinuousStates, NUMBERS(double), NONEX)
REFUSED(fmi3GetEventIndicators, NUMBERS(double), NONEX)

/* There are none: these two may be asked of any unit. */
API(status, fmi3GetNumberOfContinuousStates, (component c, size_t *n))
{
    (void)c;
    *n = 0;
    return OK;
}

API(status, fmi3GetNumberOfEventIndicators, (component c, size_t *n))
{
    (void)c;
    *n = 0;
    return OK;
}
