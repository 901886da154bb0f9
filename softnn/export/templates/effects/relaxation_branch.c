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
