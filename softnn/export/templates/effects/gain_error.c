/*@ GainError after */
y *= 1.0 + {error};
/*@ GainDrift after */
y *= 1.0 - {error} * expm1(-t / {settling_s});
