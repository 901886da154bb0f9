/*@ NonlinearViscosity state */
double last, carried;
/*@ NonlinearViscosity after */
br += {stiffness_MPa} * flow(dt, b - q->last, {time_s}, {threshold}, 0.0, &q->carried);
q->last = b;
/*@ PowerLawViscosity state */
double last, carried;
/*@ PowerLawViscosity after */
br += {stiffness_MPa}
      * flow(dt, b - q->last, {time_s}, {threshold}, {exponent}, &q->carried);
q->last = b;
/*@ ThinningBranches state */
double last;
/*@ ThinningBranches before */
if (lapse > 0.0) {
    lapse += pow({thinning_s} * fabs(b - q->last), {exponent})
             * pow(lapse, 1.0 - {exponent});
}
q->last = b;
