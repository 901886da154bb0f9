/*@ CyclicSoftening state */
double extreme, direction, count, peak;
/*@ CyclicSoftening after */
{
    const double band = 0.05; /* a way back of a smaller share is no reversal */
    double factor;
    q->peak = fmax(q->peak, fabs(e));
    if (q->direction == 0.0) {
        if (fabs(e - q->extreme) > band * q->peak && e != q->extreme) {
            q->direction = e > q->extreme ? 1.0 : -1.0;
            q->extreme = e;
        }
    } else if (q->direction * (e - q->extreme) > 0.0) {
        q->extreme = e;
    } else if (q->direction * (q->extreme - e) > band * q->peak) {
        q->direction = -q->direction;
        q->extreme = e;
        q->count += 1.0;
    }
    factor = fmax(1.0 - {loss} * log10(1.0 + q->count / 2.0), 0.05);
    eq *= factor;
    br *= factor;
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
