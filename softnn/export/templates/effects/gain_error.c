/*@ GainError after */
y *= 1.0 + {error};
