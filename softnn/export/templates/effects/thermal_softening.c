/*@ ThermalSoftening state */
double warmer;
/*@ ThermalSoftening after */
{
    double factor;
    if (!isnan(temperature_C)) { /* the last one known serves where there is none */
        q->warmer = temperature_C - 23.0;
    }
    factor = exp(-{softening_per_C} * q->warmer);
    eq *= factor;
    br *= factor;
}
