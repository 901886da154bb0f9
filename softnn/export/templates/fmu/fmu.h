/* What both versions of FMI share: an instance of the model and its variables. */
#ifndef {guard}_FMU_H
#define {guard}_FMU_H

#include "{name}.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>

enum { STRAIN, TEMPERATURE, SIMULATED, STRESS, TIME, REALS, FLAGS = 10, OUTSIDE = 11 };

typedef struct {
    {name}_state state;
    double real[REALS];
} instance;

static void restart(instance *m)
{
    {name}_init(&m->state);
    m->real[STRAIN] = m->real[SIMULATED] = m->real[STRESS] = m->real[TIME] = 0.0;
    m->real[TEMPERATURE] = 23.0;
}

static instance *create(void)
{
    instance *m = calloc(1, sizeof *m);
    if (m) {
        restart(m);
    }
    return m;
}

/* The strain that is set is the one reached at the end of the step. */
static void advance(instance *m, double step_s)
{
    m->real[STRESS] = {name}_step(&m->state, step_s, m->real[STRAIN],
                                  m->real[TEMPERATURE], m->real[SIMULATED]);
}

static int integer_of(const instance *m, unsigned reference, long *value)
{
    if (reference != FLAGS && reference != OUTSIDE) {
        return 0;
    }
    *value = reference == FLAGS ? (long)m->state.flags : (long)m->state.outside;
    return 1;
}
#endif
