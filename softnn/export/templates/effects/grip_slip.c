/*@ GripSlip before */
{
    const double lost = {slip} * clip((t - {moment_s}) / {duration_s}, 0.0, 1.0);
    e -= lost;
    b -= lost;
}
/*@ RegrippedSlip = GripSlip */
/*@ CreepingGrip state */
double last[2], carried[2];
/*@ CreepingGrip before */
if ({rate_per_s} > 0.0) {
    double *const seen[2] = {&e, &b};
    int i;
    for (i = 0; i < 2; i++) {
        const double x = *seen[i];
        *seen[i] = flow(dt, x - q->last[i], 1.0 / {rate_per_s}, 1.0, {exponent},
                        &q->carried[i]);
        q->last[i] = x;
    }
}
