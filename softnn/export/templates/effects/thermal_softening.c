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
/*@ GlassySoftening state */
double warmer;
/*@ GlassySoftening after */
{
    const double middle = {middle_C} - 23.0;
    double way, factor;
    if (!isnan(temperature_C)) { /* the last one known serves where there is none */
        q->warmer = temperature_C - 23.0;
    }
    way = tanh((q->warmer - middle) / {width_C}) + tanh(middle / {width_C});
    factor = exp(-{softening_per_C} * {width_C} * way);
    eq *= factor;
    br *= factor;
}
