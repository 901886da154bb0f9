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
/*@ ThermalSpring state */
double warmer;
/*@ ThermalSpring after */
{
    if (!isnan(temperature_C)) { /* the last one known serves where there is none */
        q->warmer = temperature_C - 23.0;
    }
    eq *= exp(-{softening_per_C} * q->warmer);
}
/*@ ThermalBranches state */
double warmer;
/*@ ThermalBranches after */
{
    if (!isnan(temperature_C)) { /* the last one known serves where there is none */
        q->warmer = temperature_C - 23.0;
    }
    br *= exp(-{softening_per_C} * q->warmer);
}
/*@ ThermalClock state */
double warmer;
/*@ ThermalClock before */
{
    if (!isnan(temperature_C)) { /* the last one known serves where there is none */
        q->warmer = temperature_C - 23.0;
    }
    lapse *= exp({quickening_per_C} * q->warmer);
}
