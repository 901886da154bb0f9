/* {name}: {what}.
 * Written by softnn {version}. C99 with <math.h>; nothing is allocated.
 *
 * {name}_init once, then {name}_step for each sample, in time order: it returns
 * the engineering stress in MPa, tension positive, of a specimen that has been at rest
 * at zero strain before the first sample. All that is remembered is in {name}_state,
 * which may be copied.
 *
{notes} */
#ifndef {guard}_H
#define {guard}_H

#ifdef __cplusplus
extern "C" {
#endif

/* {name}_state.flags after a step: inputs that the model has never been shown.
 * A corrected model does not know the rates of its recordings: networks alone set RATE
 * and DIRECTION. */
#define {guard}_STRAIN 1u    /* a strain beyond those of the recordings */
#define {guard}_RATE 2u      /* a strain rate beyond them */
#define {guard}_DIRECTION 4u /* unloading, or loading, of which none was shown */
#define {guard}_UNUSABLE 8u  /* no number, or time that runs back: stress is the last */
#define {guard}_FASTER 16u   /* sampled faster than a delay was made for */

{types}
typedef struct {
    int begun;
    unsigned flags;        /* of the last step */
    unsigned long outside; /* steps so far with any flag */
    double time_s, rounding_s, stress_MPa;
    {name}_m0_t model;
} {name}_state;

void {name}_init({name}_state *state);

/* step_s: time since the last sample (not used in the first); strain: engineering;
 * temperature_C: {thermal};
 * simulated_MPa: {simulated}. */
double {name}_step({name}_state *state, double step_s, double strain,
                   double temperature_C, double simulated_MPa);

#ifdef __cplusplus
}
#endif
#endif
