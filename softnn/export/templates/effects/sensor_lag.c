/*@ SensorLag state */
double before1, lag1, before2, lag2;
/*@ SensorLag after */
if (first) { /* the channel has settled when a recording begins */
    q->before1 = q->lag1 = q->before2 = q->lag2 = y;
}
y = first_order(dt, y, {time_constant_s}, &q->before1, &q->lag1);
y = first_order(dt, y, {time_constant_s} * {second}, &q->before2, &q->lag2);
/*@ Delay state */
double time[{capacity}], value[{capacity}];
int end, count;
/*@ Delay after */
ring_push(q->time, q->value, {capacity}, &q->end, &q->count, t, y);
y = ring_at(q->time, q->value, {capacity}, q->end, q->count, t - {time_constant_s});
/*@ DelayedLag state */
double time[{capacity}], value[{capacity}];
int end, count;
double before1, lag1, before2, lag2;
/*@ DelayedLag after */
ring_push(q->time, q->value, {capacity}, &q->end, &q->count, t, y);
y = ring_at(q->time, q->value, {capacity}, q->end, q->count, t - {time_constant_s});
if (first) {
    q->before1 = q->lag1 = q->before2 = q->lag2 = y;
}
y = first_order(dt, y, {time_constant_s} * {pole}, &q->before1, &q->lag1);
y = first_order(dt, y, {time_constant_s} * {pole} * ({second} / fmax({pole}, 1e-9)),
                &q->before2, &q->lag2);
