/*@ springs */
/* Springs in turn, straight between the knots and beyond them. */
static double {p}_springs(double e)
{
    static const double knot[{segments}] = {{knots}};
    static const double at[{segments}] = {{at}};
    static const double slope[{segments}] = {{slopes}};
    int low = 0, high = {last};
    while (low < high) {
        const int middle = (low + high + 1) / 2;
        if (knot[middle] <= e) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    return at[low] + slope[low] * (e - knot[low]);
}
/*@ branches_type */
typedef struct {
    int known;
    double dt, last, decay[{n}], gain[{n}], carried[{n}];
} {p}_branches_t;
/*@ branches */
/* Maxwell branches, exact for strain that is straight between samples. */
static double {p}_branches({p}_branches_t *s, double dt, double b)
{
    static const double time[{n}] = {{times}};
    static const double stiffness[{n}] = {{stiffness}};
    const double jump = b - s->last;
    double sum = 0.0;
    int j;
    if (dt != s->dt || !s->known) {
        for (j = 0; j < {n}; j++) {
            const double x = dt / time[j], lost = -expm1(-x);
            s->decay[j] = 1.0 - lost;
            s->gain[j] = x > 1e-9 ? lost / x : 1.0 - x / 2.0;
        }
        s->dt = dt;
        s->known = 1;
    }
    for (j = 0; j < {n}; j++) {
        const double stress = s->decay[j] * s->carried[j] + s->gain[j] * jump;
        s->carried[j] = fabs(stress) < 1e-290 ? 0.0 : stress;
        sum += stiffness[j] * s->carried[j];
    }
    s->last = b;
    return sum;
}
/*@ network */
/* One hidden layer of tanh neurons over inputs scaled to [-1, 1]. */
static double {p}_network(const double *x)
{
    static const double middle[{d}] = {{middle}};
    static const double half[{d}] = {{half}};
    static const double hidden[{n}][{d} + 1] = {{hidden}};
    static const double output[{n} + 1] = {{output}};
{limits}    double z[{d}], sum = output[{n}];
    int i, j;
    for (j = 0; j < {d}; j++) {
        z[j] = ({known} - middle[j]) / half[j];
    }
    for (i = 0; i < {n}; i++) {
        double a = hidden[i][{d}];
        for (j = 0; j < {d}; j++) {
            a += hidden[i][j] * z[j];
        }
        sum += output[i] * tanh(a);
    }
    return {stress};
}
/*@ convex_type */
typedef struct {
    int known;
    double dt, last[{n}], decay[{n}], gain[{n}], carried[{n}];
} {p}_units_t;
/*@ convex */
/* Springs and Maxwell branches that engage at a knot; the strain of some saturates. */
static double {p}_units({p}_units_t *s, double dt, double strain)
{
    static const double knot[{n}] = {{knots}};
    static const double limit[{n}] = {{limits}}; /* 0: none */
    static const double time[{n}] = {{times}};   /* 0: a spring */
    static const double stiffness[{n}] = {{stiffness}};
    const int same = s->known && dt == s->dt;
    double sum = {rest};
    int j;
    for (j = 0; j < {n}; j++) {
        const double away = strain - knot[j];
        double b = knot[j] > 0.0   ? fmax(away, 0.0)
                   : knot[j] < 0.0 ? fmin(away, 0.0)
                                   : away;
        if (limit[j] > 0.0) {
            b = sign(b) * limit[j] * -expm1(-fabs(b) / limit[j]);
        }
        if (time[j] > 0.0) {
            double stress;
            if (!same) {
                const double x = dt / time[j], lost = -expm1(-x);
                s->decay[j] = 1.0 - lost;
                s->gain[j] = x > 1e-9 ? lost / x : 1.0 - x / 2.0;
            }
            stress = s->decay[j] * s->carried[j] + s->gain[j] * (b - s->last[j]);
            s->carried[j] = fabs(stress) < 1e-290 ? 0.0 : stress;
            s->last[j] = b;
            b = s->carried[j];
        }
        sum += stiffness[j] * b;
    }
    s->dt = dt;
    s->known = 1;
    return sum;
}
/*@ hyperelastic springs */
/* A hyperelastic law for an initial Young's modulus of 1 MPa: t is the Kirchhoff
   stress along less that across, at a stretch l. */
static double {p}_along(double l)
{
    double t = 0.0;
{law}    return t;
}
static double {p}_springs(double e)
{
    const double l = fmax(1.0 + e, {thinnest});
    return {lasting} * {p}_along(l) / l;
}
/*@ hyperelastic branches_type */
typedef struct {
    int known;
    double dt, last[2], decay[{n}], gain[{n}], carried[{n}][2];
} {p}_branches_t;
/*@ hyperelastic branches */
/* A Prony series on the second Piola-Kirchhoff stress, along and across. */
static double {p}_branches({p}_branches_t *s, double dt, double b)
{
    static const double time[{n}] = {{times}};
    static const double stiffness[{n}] = {{stiffness}};
    const double l = fmax(1.0 + b, {thinnest}), t = {p}_along(l);
    const double now[2] = {{along}, {across}}, by[2] = {l, -1.0 / (l * l)};
    double sum = 0.0;
    int j, k;
    if (dt != s->dt || !s->known) {
        for (j = 0; j < {n}; j++) {
            const double x = dt / time[j], lost = -expm1(-x);
            s->decay[j] = 1.0 - lost;
            s->gain[j] = x > 1e-9 ? lost / x : 1.0 - x / 2.0;
        }
        s->dt = dt;
        s->known = 1;
    }
    for (k = 0; k < 2; k++) {
        for (j = 0; j < {n}; j++) {
            const double stress = s->decay[j] * s->carried[j][k]
                                  + s->gain[j] * (now[k] - s->last[k]);
            s->carried[j][k] = fabs(stress) < 1e-290 ? 0.0 : stress;
            sum += stiffness[j] * by[k] * s->carried[j][k];
        }
        s->last[k] = now[k];
    }
    return sum;
}
