/*@ LoadCellDrift after */
y += {drift_MPa_per_s} * t;
/*@ OwnDrift = LoadCellDrift */
/*@ WarmUp after */
y -= {drift_MPa_per_s} * {warm_up_s} * expm1(-t / {warm_up_s});
/*@ PowerDrift after */
y += {drift_MPa_per_s} * 100.0 * pow(fmax(t, 0.0) / 100.0, {exponent});
/*@ ZeroShift after */
y += {drift_MPa_per_s} * clip(t - {moment_s}, 0.0, {duration_s});
