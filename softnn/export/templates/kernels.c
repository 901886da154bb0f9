/*@ clip */
static double clip(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}
/*@ sign */
static double sign(double x)
{
    return (double)((x > 0.0) - (x < 0.0));
}
/*@ saturated */
/* A channel with a limit, bent into it over a knee. */
static double saturated(double y, double limit, double knee)
{
    const double power = 1.0 / fmax(knee, 0.01);
    double a;
    if (knee < 0.01) {
        return clip(y, -limit, limit);
    }
    if (limit >= 1e6) {
        return y;
    }
    a = power * log(fmax(fabs(y) / limit, 1e-300));
    return y * exp(-((a > 0.0 ? a : 0.0) + log1p(exp(-fabs(a)))) / power);
}
/*@ slacken */
/* Strains behind a gap: none within it, and a foot as wide as `toe` gaps. */
static void slacken(double gap, double toe, double *e, double *b)
{
    const double width = fmax(toe * gap, 1e-12);
    double *const seen[2] = {e, b};
    int i;
    for (i = 0; i < 2 && gap > 0.0; i++) {
        const double size = fabs(*seen[i]), x = size - gap;
        const double soft =
            x > width ? x : x > -width ? (x + width) * (x + width) / 4.0 / width : 0.0;
        *seen[i] = sign(*seen[i]) * fmin(soft, size);
    }
}
/*@ first_order */
/* A first-order lag of a signal that is straight between samples. */
static double first_order(double dt, double x, double tau, double *before, double *y)
{
    if (tau <= 0.0) {
        *y = x;
    } else if (dt > 0.0) {
        const double lost = -expm1(-dt / tau);
        *y = x + (1.0 - lost) * (*y - *before) - (x - *before) * lost * tau / dt;
    }
    *before = x;
    return *y;
}
/*@ second_order */
/* A filter of two poles: mean delay, and the square of its quality factor. */
static double second_order(double dt, double x, double mean, double quality,
                           double *before, double *y, double *pace)
{
    if (mean <= 0.0 || quality < 1e-6) {
        return first_order(dt, x, mean, before, y);
    }
    if (dt > 0.0) {
        const double square = quality * mean * mean, half = 0.5 * mean / square;
        const double apart = half * half - 1.0 / square, root = sqrt(fabs(apart));
        const double slope = (x - *before) / dt;
        const double e = *y - *before + mean * slope, w = *pace - slope;
        double even, odd;
        if (apart > 0.0) {
            const double fast = half + root, late = exp(-dt / (square * fast));
            even = 0.5 * (late + exp(-fast * dt));
            odd = -late * expm1(-2.0 * root * dt) / (2.0 * root);
        } else {
            const double lost = exp(-half * dt);
            even = lost * cos(root * dt);
            odd = lost * (root > 0.0 ? sin(root * dt) / root : dt);
        }
        *y = x - mean * slope + even * e + odd * (half * e + w);
        *pace = slope + even * w - odd * (e / square + half * w);
    }
    *before = x;
    return *y;
}
/*@ reversals */
/* Half cycles so far, each by a power of its range. s: extreme since the last reversal,
   direction, those of closed cycles, of an open one, largest strain, strain at the last
   reversal, largest range. */
static double reversals(double e, double power, double closed, double *s)
{
    const double band = 0.05; /* a way back of a smaller share is no reversal */
    s[4] = fmax(s[4], fabs(e));
    if (s[1] == 0.0) {
        if (fabs(e - s[0]) > band * s[4] && e != s[0]) {
            s[1] = e > s[0] ? 1.0 : -1.0;
            s[0] = e;
        }
    } else if (s[1] * (e - s[0]) > 0.0) {
        s[0] = e;
    } else if (s[1] * (s[0] - e) > band * s[4]) {
        const double length = fabs(s[0] - s[5]);
        double counts;
        s[6] = fmax(s[6], length);
        counts = pow(length / s[6], power);
        if (s[3] > 0.0) {
            s[2] += s[3] + counts;
            s[3] = 0.0;
        } else {
            s[3] = counts;
        }
        s[1] = -s[1];
        s[5] = s[0];
        s[0] = e;
    }
    return s[2] + (1.0 - closed) * s[3];
}
/*@ stops */
/* Elements that slide one after the other, from -1 to 1. */
static double stops(double increment, int elements, const double *radius,
                    const double *weight, double *carried)
{
    double loop = 0.0;
    int i;
    for (i = 0; i < elements; i++) {
        carried[i] = clip(carried[i] + increment, -radius[i], radius[i]);
        loop += weight[i] * carried[i] / radius[i];
    }
    return loop;
}
/*@ ratchet */
/* What follows a goal upwards and never falls. s: the last goal, and it. */
static double ratchet(double dt, double goal, double time, double *s)
{
    const double gap = 0.5 * (s[0] + goal) - s[1];
    if (gap > 0.0) {
        s[1] -= gap * expm1(-dt / time);
    }
    s[0] = goal;
    return s[1];
}
/*@ flow */
/* A spring in series with a nonlinear dashpot; power 0 is Eyring's, else Norton's. */
static double flow(double dt, double increment, double time, double threshold,
                   double power, double *carried)
{
    const double dx = increment / threshold;
    const double many = ceil(fabs(dx) * 1.5);
    const int parts = many < 1.0 ? 1 : many > 24.0 ? 24 : (int)many;
    const double h = dt / parts / time, d = dx / parts;
    double g = *carried / threshold;
    int i;
    for (i = 0; i < parts; i++) {
        g += 0.5 * d;
        if (h > 0.0) {
            if (power == 0.0) {
                const double u = tanh(0.5 * g) * exp(-h);
                g = fabs(u) < 1.0 ? log1p(u) - log1p(-u) : g;
            } else if (fabs(power - 1.0) < 1e-9) {
                g *= exp(-h);
            } else if (g != 0.0) {
                const double base = pow(fabs(g), 1.0 - power) + (power - 1.0) * h;
                const double a = base > 0.0 ? pow(base, 1.0 / (1.0 - power)) : 0.0;
                g = g > 0.0 ? a : -a;
            }
        }
        g += 0.5 * d;
    }
    *carried = g * threshold;
    return *carried;
}
/*@ ring */
/* The last samples of a signal; what is older than all of them is the oldest. */
static void ring_push(double *time, double *value, int capacity, int *end, int *count,
                      double t, double x)
{
    time[*end] = t;
    value[*end] = x;
    *end = (*end + 1) % capacity;
    if (*count < capacity) {
        ++*count;
    }
}

static double ring_at(const double *time, const double *value, int capacity, int end,
                      int count, double when)
{
    const int start = (end - count + capacity) % capacity;
    int low = 0, high = count, a, b;
    double gap, share;
    while (low < high) { /* the first sample after `when` */
        const int middle = (low + high) / 2;
        if (time[(start + middle) % capacity] <= when) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (low == 0 || low == count) {
        return value[(start + (low ? count - 1 : 0)) % capacity];
    }
    a = (start + low - 1) % capacity;
    b = (start + low) % capacity;
    gap = time[b] - time[a];
    share = (when - time[a]) / gap;
    return value[a] * (1.0 - share) + value[b] * share;
}
