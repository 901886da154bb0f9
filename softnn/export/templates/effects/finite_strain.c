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
/*@ DirectedBranches state */
{p}_branches_t axial, lateral;
double felt;
/*@ DirectedBranches before */
q->felt = log(fmax(1.0 + b, 0.05));
/*@ DirectedBranches after */
{
    const double m = {strain_exponent}, n = {stress_exponent};
    const double now = log(fmax(1.0 + e, 0.05)), half = -q->felt / 2.0;
    const double axial = fabs(m) < 1e-9 ? q->felt : expm1(m * q->felt) / m;
    const double lateral = fabs(m) < 1e-9 ? half : expm1(m * half) / m;
    const double along = {p}_branches(&q->axial, lapse, axial);
    const double across = {p}_branches(&q->lateral, lapse, lateral);
    br = (1.0 - {amount}) * br
         + 2.0 / 3.0 * {amount}
           * (exp((n - 1.0) * now) * along - exp(-(n / 2.0 + 1.0) * now) * across);
}
/*@ MaterialBranches before */
{
    const double rubber = -expm1(-3.0 * log(fmax(1.0 + b, 0.05))) / 3.0;
    b = (1.0 - {amount}) * b + {amount} * rubber;
}
/*@ MaterialBranches after */
br *= pow(fmax(1.0 + e, 0.05), {amount});
