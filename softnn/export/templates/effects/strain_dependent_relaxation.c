/*@ StrainDependentRelaxation after */
br *= fmax(1.0 + {growth} * fabs(e) + {curvature} * e * e, 0.0);
/*@ StrainDrivenBranches before */
b = b + {growth} * b * fabs(b) / 2.0 + {curvature} * b * b * b / 3.0;
/*@ StrainClock before */
lapse *= exp(clip({growth} * fabs(e), -30.0, 30.0));
/*@ Schapery before */
b = b + {growth} * b * fabs(b) / 2.0;
/*@ Schapery after */
br *= fmax(1.0 + {outer} * fabs(e), 0.0);
/*@ WholeSchapery before = StrainClock before */
/*@ WholeSchapery after = Schapery after */
/*@ DecliningBranches before */
{
    const double m = 1.0 - {inner}, by = log1p(fabs(b) / {width});
    const double measure = fabs(m) < 1e-9 ? by : expm1(m * by) / m;
    b = sign(b) * {width} * measure;
}
/*@ DecliningBranches after */
br *= pow(1.0 + fabs(e) / {width}, -{decline});
