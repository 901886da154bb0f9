/*@ Slack before */
slacken({gap}, {toe}, &e, &b);
/*@ Foot = Slack */
/*@ GrowingGap before */
slacken({gap} * (1.0 + {growth_per_s} * t), {toe}, &e, &b);
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
