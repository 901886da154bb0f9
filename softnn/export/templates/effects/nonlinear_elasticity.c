/*@ NonlinearElasticity after */
eq += sign(e) * ({stiffening_MPa} * pow(fabs(e), {exponent})
                 - {foot_MPa} * expm1(-fabs(e) / {foot_width}));
