/*@ FiniteStrain before */
if ({amount} != 0.0) {
    const double m = 1.0 - {amount}, hencky = log(fmax(1.0 + b, 1e-3));
    b = fabs(m) < 1e-9 ? hencky : expm1(m * hencky) / m;
}
/*@ FiniteStrain after */
br *= pow(fmax(1.0 + e, 1e-3), -({amount} * {section}));
/*@ StretchedBranches before = FiniteStrain before */
/*@ StretchedBranches after */
if ({amount} > 0.0) {
    const double kappa = fmax({amount}, 1e-9);
    const double x = clip(br / {modulus_MPa}, -2.0, 2.0);
    br = {modulus_MPa} * (expm1(2.0 * kappa * x) - expm1(-kappa * x)) / (3.0 * kappa);
}
br *= pow(fmax(1.0 + e, 1e-3), -({amount} * {section}));
/*@ PartlyFinite before */
if ({amount} != 0.0) {
    const double stretch = fmax(1.0 + b, 1e-3), m = {exponent};
    const double hencky = log(stretch);
    const double finite = fabs(m) < 1e-9 ? hencky : expm1(m * hencky) / m;
    const double both = (1.0 - {amount}) * b + {amount} * finite / stretch;
    b = both / (1.0 - {amount} + {amount} / stretch);
}
/*@ PartlyFinite after */
br *= 1.0 - {amount} + {amount} / fmax(1.0 + e, 1e-3);
/*@ MaterialBranches before */
{
    const double rubber = -expm1(-3.0 * log(fmax(1.0 + b, 0.05))) / 3.0;
    b = (1.0 - {amount}) * b + {amount} * rubber;
}
/*@ MaterialBranches after */
br *= pow(fmax(1.0 + e, 0.05), {amount});
