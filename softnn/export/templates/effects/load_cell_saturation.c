/*@ LoadCellSaturation after */
y = saturated(y, {limit_MPa}, {knee});
/*@ UnevenLimits after */
{
    const double kept = saturated(y, y < 0.0 ? {pushed_MPa} : {limit_MPa}, {knee});
    y = kept + {beyond} * (y - kept);
}
/*@ OwnRange after */
{
    const double limit = 1.0 / fmax({narrowness_per_MPa}, 1e-300);
    y = clip(y, -limit, limit);
}
