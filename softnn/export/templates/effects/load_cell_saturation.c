/*@ LoadCellSaturation after */
if ({knee} < 0.01) {
    y = clip(y, -{limit_MPa}, {limit_MPa});
} else if ({limit_MPa} < 1e6) {
    const double power = 1.0 / fmax({knee}, 0.01);
    const double a = power * log(fmax(fabs(y) / {limit_MPa}, 1e-300));
    y *= exp(-((a > 0.0 ? a : 0.0) + log1p(exp(-fabs(a)))) / power);
}
