/*@ GripSlip before */
{
    const double lost = {slip} * clip((t - {moment_s}) / {duration_s}, 0.0, 1.0);
    e -= lost;
    b -= lost;
}
/*@ RegrippedSlip = GripSlip */
