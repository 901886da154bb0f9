/*@ RelaxationBranch state */
double last, carried;
/*@ RelaxationBranch after */
{
    const double x = dt / {relaxation_time_s}, lost = -expm1(-x);
    const double gain = x > 1e-9 ? lost / x : 1.0 - 0.5 * x;
    q->carried = (1.0 - lost) * q->carried + gain * (b - q->last);
    q->last = b;
    br += {stiffness_MPa} * q->carried;
}
/*@ SpreadBranch state */
double last, carried[{elements}];
/*@ SpreadBranch after */
{
    static const double time[{elements}] = {{times}};
    static const double stiffness[{elements}] = {{stiffnesses}};
    int i;
    for (i = 0; i < {elements}; i++) {
        const double x = dt / time[i], lost = -expm1(-x);
        const double gain = x > 1e-9 ? lost / x : 1.0 - 0.5 * x;
        q->carried[i] = (1.0 - lost) * q->carried[i] + gain * (b - q->last);
        br += stiffness[i] * q->carried[i];
    }
    q->last = b;
}
/*@ TwoBranches = SpreadBranch */
