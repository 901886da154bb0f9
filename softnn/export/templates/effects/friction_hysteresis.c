/*@ FrictionHysteresis state */
double last, carried[{elements}];
/*@ FrictionHysteresis after */
{
    static const double radius[{elements}] = {{radius}};
    static const double weight[{elements}] = {{weight}};
    const double loop = stops(e - q->last, {elements}, radius, weight, q->carried);
    q->last = e;
    eq += {friction_MPa} * fmax(1.0 + {growth} * fabs(e), 0.0) * loop;
}
/*@ WallFriction state */
double last, carried[{elements}];
/*@ WallFriction after */
{
    static const double radius[{elements}] = {{radius}};
    static const double weight[{elements}] = {{weight}};
    const double loop = stops(e - q->last, {elements}, radius, weight, q->carried);
    q->last = e;
    eq += {coefficient} * fabs(eq) * loop;
}
/*@ BoucWen state */
double last, z;
/*@ BoucWen after */
{
    const double dx = (e - q->last) / {presliding};
    const double many = ceil(fabs(dx) * 2.0 * {sharpness});
    const int parts = many < 1.0 ? 1 : many > 60.0 ? 60 : (int)many;
    const double d = dx / parts;
    double z = q->z;
    int i;
    for (i = 0; i < parts; i++) { /* midpoint rule */
        const double a = d * (1.0 - (z * d > 0.0 ? pow(fabs(z), {sharpness}) : 0.0));
        const double m = z + 0.5 * a;
        z += d
             * (1.0 - (m * d > 0.0 ? pow(fmin(fabs(m), 1.0), {sharpness}) : 0.0));
        z = clip(z, -1.0, 1.0);
    }
    q->last = e;
    q->z = z;
    eq += {friction_MPa} * fmax(1.0 + {growth} * fabs(e), 0.0) * z;
}
/*@ GrownFriction state */
double last, largest, carried[{elements}];
/*@ GrownFriction after */
{
    static const double radius[{elements}] = {{radius}};
    static const double weight[{elements}] = {{weight}};
    const double loop = stops(e - q->last, {elements}, radius, weight, q->carried);
    q->last = e;
    q->largest = fmax(q->largest, fabs(e));
    eq += {friction_MPa} * q->largest * loop;
}
/*@ JointFriction state */
double last, carried[{elements}];
/*@ JointFriction after */
{
    static const double radius[{elements}] = {{radius}};
    static const double weight[{elements}] = {{weight}};
    eq += {friction_MPa} * stops(e - q->last, {elements}, radius, weight, q->carried);
    q->last = e;
}
