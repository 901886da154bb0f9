/*@ MullinsSoftening state */
double largest;
/*@ MullinsSoftening after */
{
    double top, reach, factor;
    q->largest = fmax(q->largest, fabs(e));
    top = pow(q->largest, {power});
    reach = (top - pow(fabs(e), {power})) / (pow({scale}, {power}) + top);
    factor = 1.0 - {depth} * erf(fmax(reach, 0.0) / {sharpness});
    eq *= 1.0 - fmin(2.0 - {viscous_share}, 1.0) * (1.0 - factor);
    br *= 1.0 - fmin({viscous_share}, 1.0) * (1.0 - factor);
}
/*@ SimoDamage state */
double largest;
/*@ SimoDamage after */
{
    double factor;
    q->largest = fmax(q->largest, fabs(e));
    factor = 1.0
             + {depth} * expm1(-pow(q->largest / {scale}, fmin(1.0 / {sharpness}, 20.0)));
    eq *= 1.0 - fmin(2.0 - {viscous_share}, 1.0) * (1.0 - factor);
    br *= 1.0 - fmin({viscous_share}, 1.0) * (1.0 - factor);
}
/*@ BeattySoftening state */
double largest;
/*@ BeattySoftening after */
{
    double gap, lost;
    q->largest = fmax(q->largest, fabs(e));
    gap = fmax(q->largest * q->largest - e * e, 0.0);
    lost = -expm1(-{softening} * pow(gap, {exponent}));
    eq *= 1.0 - fmin(2.0 - {viscous_share}, 1.0) * lost;
    br *= 1.0 - fmin({viscous_share}, 1.0) * lost;
}
/*@ EnergySoftening state */
double strain, stress, work, top;
/*@ EnergySoftening after */
{
    double factor;
    q->work += (eq + q->stress) / 2.0 * (e - q->strain);
    q->strain = e;
    q->stress = eq;
    q->top = fmax(q->top, q->work);
    factor = 1.0
             - {depth} * erf((q->top - q->work)
                             / fmax({energy_MPa} + {sharpness} * q->top, 1e-300));
    eq *= factor;
    br *= factor;
}
