/* {name}: {what}. Written by softnn {version}; see {name}.h. */
#include "{name}.h"

#include <math.h>
#include <string.h>

{kernels}
{functions}
void {name}_init({name}_state *state)
{
    memset(state, 0, sizeof *state);
}

double {name}_step({name}_state *state, double step_s, double strain,
                   double temperature_C, double simulated_MPa)
{
    const int first = !state->begun;
    double more, time;
    state->flags = 0u;
    if (first) {
        step_s = 0.0;
    }
    if (!isfinite(strain) || !isfinite(step_s) || step_s < 0.0{unusable}) {
        state->flags = {guard}_UNUSABLE;
        ++state->outside;
        return state->stress_MPa;
    }
    state->begun = 1;
    more = step_s - state->rounding_s; /* summed without loss, over any time */
    time = state->time_s + more;
    state->rounding_s = (time - state->time_s) - more;
    state->time_s = time;
    state->stress_MPa = {name}_m0_step(&state->model, first, step_s, time, strain,
                                       temperature_C, simulated_MPa, &state->flags);
    if (state->flags) {
        ++state->outside;
    }
    return state->stress_MPa;
}
