/*@ TensionOnly after */
if (eq + br < 0.0) {
    eq *= 1.0 - {amount};
    br *= 1.0 - {amount};
}
/*@ CrookedStrip after */
if (eq + br < 0.0) {
    const double pushed = -(eq + br);
    const double kept = 1.0 - {amount} * pushed / (pushed + {buckling_MPa});
    eq *= kept;
    br *= kept;
}
/*@ SlackStrip after */
if (e < 0.0) {
    eq *= 1.0 - {amount};
    br *= 1.0 - {amount};
}
/*@ FoldedStrip before */
e -= {amount} * fmin(e + {buckling_strain}, 0.0);
b -= {amount} * fmin(b + {buckling_strain}, 0.0);
