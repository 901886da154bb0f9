/*@ PermanentSet state */
double above, below, last, travel, low, high;
/*@ PermanentSet before */
{
    double number, shift, side;
    q->above = fmax(q->above, e);
    q->below = fmax(q->below, -e);
    q->travel += fabs(e - q->last);
    q->last = e;
    q->low = fmin(q->low, e);
    q->high = fmax(q->high, e);
    number = fmax(q->travel / fmax(2.0 * (q->high - q->low), 1e-12) - 0.5, 0.0);
    shift = pow(fmax(q->above - {yield_strain}, 0.0), {exponent})
            - pow(fmax(q->below - {yield_strain}, 0.0), {exponent});
    shift *= {ratio} * ({first} + (1.0 - {first}) * log10(1.0 + number));
    if ({on_return} >= 0.02) {
        const double largest = fmax(e >= 0.0 ? q->above : q->below, 1e-12);
        const double part = clip(fabs(e) / largest, 1e-12, 1.0);
        shift *= 1.0 - exp(log(part) / fmax({on_return}, 0.02));
    }
    e -= shift;
    b -= {viscous_share} * shift;
    side = {ratio} > 0.0 ? sign(q->above - q->below) : 0.0;
    e *= side * e < 0.0 ? 1.0 - {buckling} : 1.0;
    b *= side * b < 0.0 ? 1.0 - {buckling} : 1.0;
}
/*@ PlasticElement state */
double last, carried;
/*@ PlasticElement after */
{
    const double increment = e - q->last;
    q->last = e;
    eq += {stiffness_MPa} * flow(fabs(increment) + {pace_per_s} * dt, increment,
                                 {yield_strain}, {yield_strain}, {sharpness},
                                 &q->carried);
}
/*@ CreptSet state */
double above[2], below[2];
/*@ CreptSet before */
{
    const double shift = {ratio}
                         * (ratchet(dt, fmax(e, 0.0), {time_s}, q->above)
                            - ratchet(dt, fmax(-e, 0.0), {time_s}, q->below));
    e -= shift;
    b -= {viscous_share} * shift;
}
