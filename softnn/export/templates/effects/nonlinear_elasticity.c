/*@ NonlinearElasticity after */
eq += sign(e) * ({stiffening_MPa} * pow(fabs(e), {exponent})
                 - {foot_MPa} * expm1(-fabs(e) / {foot_width}));
/*@ OgdenSpring after */
{
    const double a = fabs({exponent}) < 1e-6 ? 1e-6 : {exponent};
    const double by = log(fmax(1.0 + e, 0.05));
    eq += {stiffening_MPa}
          * ((exp((a - 1.0) * by) - exp(-(a / 2.0 + 1.0) * by)) / (1.5 * a) - e);
}
