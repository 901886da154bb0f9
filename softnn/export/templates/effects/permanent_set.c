/*@ PermanentSet state */
double above, below, far_above, far_below;
/*@ PermanentSet before */
{
    double shift;
    q->above = fmax(q->above, e);
    q->below = fmax(q->below, -e);
    shift = pow(fmax(q->above - {yield_strain}, 0.0), {exponent})
            - pow(fmax(q->below - {yield_strain}, 0.0), {exponent});
    shift *= {ratio};
    if ({on_return} >= 0.02) {
        const double largest = fmax(e >= 0.0 ? q->above : q->below, 1e-12);
        const double part = clip(fabs(e) / largest, 1e-12, 1.0);
        shift *= 1.0 - exp(log(part) / fmax({on_return}, 0.02));
    }
    e -= shift;
    b -= {viscous_share} * shift;
}
/*@ PermanentSet after */
{
    double side;
    q->far_above = fmax(q->far_above, e);
    q->far_below = fmax(q->far_below, -e);
    side = sign(q->far_above - q->far_below);
    if (side * e < 0.0 && side * (eq + br) < 0.0 && {ratio} > 0.0) {
        eq *= 1.0 - {buckling};
        br *= 1.0 - {buckling};
    }
}
/*@ PlasticElement state */
double last, carried;
/*@ PlasticElement after */
{
    const double increment = e - q->last;
    q->last = e;
    eq += {stiffness_MPa} * flow(fabs(increment), increment, {yield_strain},
                                 {yield_strain}, {sharpness}, &q->carried);
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
/*@ CyclicSet state */
double above, below, last, travel, low, high;
/*@ CyclicSet before */
{
    double number, shift;
    q->above = fmax(q->above, e);
    q->below = fmax(q->below, -e);
    q->travel += fabs(e - q->last);
    q->last = e;
    q->low = fmin(q->low, e);
    q->high = fmax(q->high, e);
    number = fmax(q->travel / fmax(2.0 * (q->high - q->low), 1e-12) - 0.5, 0.0);
    shift = {ratio} * (q->above - q->below)
            * ({first} + (1.0 - {first}) * log10(1.0 + number));
    e -= shift;
    b -= {viscous_share} * shift;
}
