/*@ corrected */
static double {p}_step({p}_t *s, int first, double dt, double t, double strain,
                       double temperature_C, double simulated_MPa, unsigned *flags)
{
{enter}    double e = strain, b = strain, lapse = dt, eq, br, y; /* lapse: of branches */
    (void)s, (void)first, (void)dt, (void)t, (void)temperature_C, (void)simulated_MPa;
    (void)b, (void)lapse;
    if (strain < {lowest} || strain > {highest}) {
        *flags |= {guard}_STRAIN;
    }
{before}    eq = {springs};
    br = {branches};
{after}    y = eq + br;
{sensor}{correct}    return {result};
}
/*@ network */
static double {p}_step({p}_t *s, int first, double dt, double t, double strain,
                       double temperature_C, double simulated_MPa, unsigned *flags)
{
    double x[{d}], rate;
    (void)t, (void)temperature_C, (void)simulated_MPa;
{inputs}{check}    (void)rate, (void)flags, (void)dt;
    return {p}_network(x);
}
/*@ convex */
static double {p}_step({p}_t *s, int first, double dt, double t, double strain,
                       double temperature_C, double simulated_MPa, unsigned *flags)
{
    double rate;
    (void)t, (void)temperature_C, (void)simulated_MPa;
{inputs}{check}    (void)rate, (void)flags;
    return {p}_units(&s->units, dt, strain);
}
/*@ sample_lags */
    {
        int k;
        for (k = {lags}; k > 0; k--) { /* strain of the last samples */
            s->past[k] = first ? strain : s->past[k - 1];
        }
        s->past[0] = strain;
    }
    if (first) {
        s->before = strain;
    } else if (dt > 0.0) { /* samples at one time count as the first of them */
        s->rate = (strain - s->before) / dt;
        s->before = strain;
    }
    rate = s->rate;
/*@ time_lags */
    if (first || dt > 0.0) {
        if (s->count == {capacity} && s->time[s->end] > t - {longest}) {
            *flags |= {guard}_FASTER;
        }
        ring_push(s->time, s->value, {capacity}, &s->end, &s->count, t, strain);
        s->rate = (strain
                   - ring_at(s->time, s->value, {capacity}, s->end, s->count, t - {lag}))
                  / {lag};
    }
    rate = s->rate;
