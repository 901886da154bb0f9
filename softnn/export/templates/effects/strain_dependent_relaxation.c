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
