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
