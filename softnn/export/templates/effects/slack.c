/*@ Slack before */
if ({gap} > 0.0) {
    const double width = fmax({toe} * {gap}, 1e-12);
    double *const seen[2] = {&e, &b};
    int i;
    for (i = 0; i < 2; i++) {
        const double size = fabs(*seen[i]), x = size - {gap};
        const double soft =
            x > width ? x : x > -width ? (x + width) * (x + width) / 4.0 / width : 0.0;
        *seen[i] = sign(*seen[i]) * fmin(soft, size);
    }
}
/*@ Foot = Slack */
/*@ Seating state */
double above[2], below[2];
/*@ Seating before */
{
    const double scale = fmax({width} * {gap}, 1e-12);
    double *const seen[2] = {&e, &b};
    int i;
    for (i = 0; i < 2; i++) {
        const double up = fmax(*seen[i], 0.0), down = fmax(-*seen[i], 0.0);
        q->above[i] = fmax(q->above[i], up);
        q->below[i] = fmax(q->below[i], down);
        *seen[i] += {gap} * (expm1(-(up + {kept} * (q->above[i] - up)) / scale)
                             - expm1(-(down + {kept} * (q->below[i] - down)) / scale));
    }
}
/*@ Backlash state */
double inner[2];
/*@ Backlash before */
{
    double *const seen[2] = {&e, &b};
    int i;
    for (i = 0; i < 2; i++) {
        const double x = *seen[i], behind = fmax(q->inner[i], x - {seat} * {gap});
        *seen[i] = q->inner[i] = fmin(behind, x + (1.0 - {seat}) * {gap});
    }
}
