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
