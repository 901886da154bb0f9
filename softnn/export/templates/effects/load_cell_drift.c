/*@ LoadCellDrift after */
y += {drift_MPa_per_s} * t;
/*@ OwnDrift = LoadCellDrift */
/*@ WarmUp after */
y -= {drift_MPa_per_s} * {warm_up_s} * expm1(-t / {warm_up_s});
/*@ OwnWarmUp = WarmUp */
