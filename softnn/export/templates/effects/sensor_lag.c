/*@ SensorLag state */
double before, late, pace;
/*@ SensorLag after */
if (first) { /* the channel has settled when a recording begins */
    q->before = q->late = y;
    q->pace = 0.0;
}
y = second_order(dt, y, {time_constant_s}, {quality_squared}, &q->before, &q->late,
                 &q->pace);
/*@ Delay state */
double time[{capacity}], value[{capacity}];
int end, count;
/*@ Delay after */
ring_push(q->time, q->value, {capacity}, &q->end, &q->count, t, y);
y = ring_at(q->time, q->value, {capacity}, q->end, q->count, t - {time_constant_s});
/*@ DelayedLag state */
double time[{capacity}], value[{capacity}];
int end, count;
double before, late, pace;
/*@ DelayedLag after */
ring_push(q->time, q->value, {capacity}, &q->end, &q->count, t, y);
y = ring_at(q->time, q->value, {capacity}, q->end, q->count, t - {time_constant_s});
if (first) {
    q->before = q->late = y;
    q->pace = 0.0;
}
y = second_order(dt, y, {time_constant_s} * {pole}, {quality_squared}, &q->before,
                 &q->late, &q->pace);
