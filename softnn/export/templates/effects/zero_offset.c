/*@ ZeroOffset after */
y += {offset_MPa};
/*@ SettlingOffset after */
y += {offset_MPa} * (1.0 + {returning} * expm1(-t / {settling_s}));
