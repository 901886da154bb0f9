/*@ ZeroOffset after */
y += {offset_MPa};
/*@ SettlingOffset after */
y += {offset_MPa} * (1.0 + {returning} * expm1(-t / {settling_s}));
/*@ ZeroShift after */
y += {offset_MPa} * clip((t - {moment_s}) / {duration_s}, 0.0, 1.0);
