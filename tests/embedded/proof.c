/* For CBMC: one step of an exported law in single precision, from any state within bounds and with any sample. Outputs
 * are finite and within the limits, and the state stays within the same bounds. As the first state is within them, this
 * holds for any number of steps, by induction. */
#include "pretouch_design.h"

#include <math.h>

/* Contracts of the functions of libm that the law calls. */
float nondet_number(void);
float logf(float x) {
    float y = nondet_number();
    __CPROVER_assert(x > 0, "log has a positive argument");
    __CPROVER_assume(y >= -104 && y <= 89 && (x < 1 || y >= 0) && (x > 1 || y <= 0));
    return y;
}
float sqrtf(float x) {
    float y = nondet_number();
    __CPROVER_assert(x >= 0, "sqrt has no negative argument");
    __CPROVER_assume(y >= 0 && (y <= x || y <= 1) && (x < 1 || y >= 1));
    return y;
}
float floorf(float x) {
    float y = nondet_number();
    __CPROVER_assume(y <= x && x - y <= 1 && (x < 0 || y >= 0));
    return y;
}

static const pretouch_sensing_numbers *const P = &pretouch_design.sensing;
static const pretouch_drive_numbers *const D = &pretouch_design.drive;

static int within(float value, float low, float high) { return low <= value && value <= high; }

/* xi of a usable reading: below the saturation, less the offset */
static int is_level(float value) { return within(value, P->floor, P->saturation + fabsf(P->offset)); }

static int invariant(const pretouch_design_state *s) {
    const pretouch_sensing_state *const n = &s->sensing;
    const pretouch_drive_state *const d = &s->drive;
    int good = within(n->quiet, 0, 2 * P->timeout) && within(n->measured, 0, 3 * P->timeout);
    good = good && is_level(n->level) && is_level(n->filtered) && within(n->log_level, 0, 89);
    good = good && (n->running == 0 || n->running == 1);
    good = good && 0 <= n->median.oldest && n->median.oldest < P->median_length;
    for (int i = 0; i < P->median_length; i++)
        good = good && is_level(n->median.arrived[i]) && is_level(n->median.ordered[i]);
    good = good && n->median.ordered[P->median_length] == (float)INFINITY;
    good = good && within(d->delivery.steady, -D->largest_force, D->largest_force);
    good = good && within(d->delivery.rest, -D->largest_force * D->hold, D->largest_force * D->hold);
    good = good && isfinite(d->delivery.ahead) && within(d->delivery.fading, 0, 1);
    good = good && !((d->delivery.steady > 0 && d->delivery.rest < 0) || (d->delivery.steady < 0 && d->delivery.rest > 0));
    good = good && within(d->motion.position, -D->limits.excursion, D->limits.excursion);
    good = good && within(d->motion.velocity, -D->limits.speed, D->limits.speed);
    good = good && within(d->reference, -1e6f, 1e6f);
#ifdef DRAG
    good = good && within(s->law.level, -1e30f, 1e30f) && within(s->law.rate, -1500 / P->sensor_period, 1500 / P->sensor_period);
    good = good && within(s->law.mark, -1e30f, 1e30f) && within(s->law.hold, 0, pretouch_design.law.hold);
#else
    good = good && within(s->law.ramp, 0, 1) && within(s->law.mark, 0, 89 + pretouch_design.law.release);
#endif
    return good;
}

pretouch_design_state any_state(void);
pretouch_sample any_sample(void);

int main(void) {
    pretouch_output out;
    const pretouch_sample sample = any_sample();
#ifdef START
    pretouch_design_state state;
    pretouch_design_start(&state);
    __CPROVER_assert(invariant(&state), "the first state is within bounds");
#else
    pretouch_design_state state = any_state();
    __CPROVER_assume(invariant(&state));
    pretouch_design_step(&state, &sample, &out);
    __CPROVER_assert(isfinite(out.position), "the position is finite");
    __CPROVER_assert(isfinite(out.velocity), "the velocity is finite");
    __CPROVER_assert(isfinite(out.acceleration), "the acceleration is finite");
    __CPROVER_assert(isfinite(out.log_level), "the log output is finite");
    __CPROVER_assert(fabsf(out.virtual_force) <= D->largest_force, "the force is within its limit");
    __CPROVER_assert(fabsf(state.drive.motion.position) <= D->limits.excursion, "the excursion is within its limit");
    __CPROVER_assert(fabsf(state.drive.motion.velocity) <= D->limits.speed, "the speed is within its limit");
    __CPROVER_assert(invariant(&state), "the state stays within bounds");
#endif
    return 0;
}
