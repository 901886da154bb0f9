/*@ GainError after */
y *= 1.0 + {error};
/*@ BentGain after */
y *= 1.0
     + {bend} * pow(fmax(fabs(y), 1e-300), {exponent}) * (y < 0.0 ? {pushed} : 1.0);
/*@ GainDrift after */
y *= 1.0 - {error_per_s} * {settling_s} * expm1(-t / {settling_s});
