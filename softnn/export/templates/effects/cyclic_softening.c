/*@ CyclicSoftening state */
double turns[7];
/*@ CyclicSoftening after */
{
    const double number = reversals(e, {power}, {closed}, q->turns) / 2.0;
    const double factor = fmax(1.0 - {loss} * log10(1.0 + number), 0.05);
    eq *= factor;
    br *= factor;
}
/*@ SaturatingSoftening state */
double turns[7];
/*@ SaturatingSoftening after */
{
    const double number = reversals(e, {power}, {closed}, q->turns) / 2.0;
    const double lost = -{loss} * expm1(-number / {cycles});
    eq *= fmax(1.0 - fmin(2.0 - {viscous_share}, 1.0) * lost, 0.05);
    br *= fmax(1.0 - fmin({viscous_share}, 1.0) * lost, 0.05);
}
/*@ TravelSoftening state */
double last, travel, low, high;
/*@ TravelSoftening after */
{
    double number, factor;
    q->travel += fabs(e - q->last);
    q->last = e;
    q->low = fmin(q->low, e);
    q->high = fmax(q->high, e);
    number = q->travel / fmax(2.0 * (q->high - q->low), 1e-12);
    factor = fmax(1.0 - {loss} * log10(1.0 + fmax(number - 0.5, 0.0)), 0.05);
    eq *= factor;
    br *= factor;
}
/*@ PartialSoftening state */
double turns[7];
/*@ PartialSoftening after */
{
    const double number = reversals(e, {power}, {closed}, q->turns) / 2.0;
    const double lost = {loss} * log10(1.0 + number);
    eq *= fmax(1.0 - fmin(2.0 - {viscous_share}, 1.0) * lost, 0.05);
    br *= fmax(1.0 - fmin({viscous_share}, 1.0) * lost, 0.05);
}
