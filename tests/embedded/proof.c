/* For CBMC: one step of an exported law in single precision, from any state within bounds and with any sample. Outputs
 * are finite and within the limits, and the state stays within the same bounds. As the first state is within them, this
 * holds for any number of steps, by induction.
 *
 * The step calls three blocks one after the other. Each block has a proof of its own, because one proof of the step would
 * take eight times as long: what is asserted of the results of a block is all that the next proof assumes. Define START,
 * OBSERVE, LAW, LIMIT or DRIVE. */
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

/* limit_motion as LIMIT proves it. For DRIVE, the law calls this function instead. */
static int limit_as_proved(const pretouch_motion_limits *p, pretouch_motion now, pretouch_motion *wanted);

#include "pretouch_law.c"

static const pretouch_sensing_numbers *const P = &pretouch_design.sensing;
static const pretouch_drive_numbers *const D = &pretouch_design.drive;

static int between(float value, float low, float high) { return low <= value && value <= high; }

/* xi of a usable reading: below the saturation, less the offset */
static int is_level(float value) { return between(value, P->floor, P->saturation + fabsf(P->offset)); }

typedef pretouch_design_state design_state;

static int sensing_invariant(const pretouch_sensing_state *n) {
    int good = between(n->quiet, 0, 2 * P->timeout) && between(n->measured, 0, 3 * P->timeout);
    good = good && is_level(n->level) && is_level(n->filtered) && between(n->log_level, 0, 89);
    good = good && PRETOUCH_NOTHING <= n->latest && n->latest <= PRETOUCH_NO_OBJECT;
    good = good && 0 <= n->median.oldest && n->median.oldest < P->median_length;
    for (int i = 0; i < P->median_length; i++)
        good = good && is_level(n->median.arrived[i]) && is_level(n->median.ordered[i]);
    return good && n->median.ordered[P->median_length] == (float)INFINITY;
}

#ifdef DRAG
static int law_invariant(const pretouch_drag_state *s) {
    const float fastest = 1500 / P->sensor_period;
    return between(s->level, -1e7f, 1e7f) && between(s->rate, -fastest, fastest) && between(s->mark, -1e7f, 1e7f) &&
           between(s->hold, 0, pretouch_design.law.hold);
}
#else
static int law_invariant(const pretouch_damper_state *s) {
    return between(s->ramp, 0, 1) && between(s->mark, 0, 89 + pretouch_design.law.release);
}
#endif

static int is_limited(pretouch_motion m) {
    return between(m.position, -D->limits.excursion, D->limits.excursion) &&
           between(m.velocity, -D->limits.speed, D->limits.speed);
}

static int drive_invariant(const pretouch_drive_state *d) {
    int good = between(d->delivery.steady, -D->largest_force, D->largest_force);
    good = good && between(d->delivery.rest, -D->largest_force * D->hold, D->largest_force * D->hold);
    good = good && isfinite(d->delivery.ahead) && between(d->delivery.fading, 0, 1);
    good = good && !((d->delivery.steady > 0 && d->delivery.rest < 0) || (d->delivery.steady < 0 && d->delivery.rest > 0));
    return good && is_limited(d->motion) && between(d->reference, -1e6f, 1e6f);
}

static int is_flag(int32_t value) { return value == 0 || value == 1; }

/* What pretouch_observe guarantees, and law and drive rely on. */
static int is_observation(const pretouch_observation *seen) {
    int good = between(seen->change, -104, 89) && between(seen->log_level, 0, 89) && is_level(seen->level);
    good = good && between(seen->elapsed, 0, 3 * P->timeout + P->period);
    good = good && is_flag(seen->usable) && is_flag(seen->restarted) && is_flag(seen->detecting);
    good = good && is_flag(seen->no_object) && is_flag(seen->stale) && is_flag(seen->lost);
    return good && 0 <= seen->status && seen->status < 64;
}

/* What a law guarantees, and pretouch_drive relies on. */
static int is_push(const pretouch_push *push) { return isfinite(push->impulse) && isfinite(push->force); }

static int is_number(pretouch_motion m) { return isfinite(m.position) && isfinite(m.velocity); }

pretouch_motion nondet_motion(void);
int nondet_flag(void);
static int limit_as_proved(const pretouch_motion_limits *p, pretouch_motion now, pretouch_motion *wanted) {
    __CPROVER_assert(p == &D->limits && is_limited(now) && is_number(*wanted), "the motion can be limited");
    *wanted = nondet_motion();
    __CPROVER_assume(is_limited(*wanted));
    return nondet_flag() != 0;
}

pretouch_sample nondet_sample(void);
pretouch_observation nondet_observation(void);
pretouch_push nondet_push(void);
design_state nondet_state(void);

int main(void) {
#if defined(START)
    design_state state;
    pretouch_design_start(&state);
    __CPROVER_assert(sensing_invariant(&state.sensing), "the first state of the sensing is within bounds");
    __CPROVER_assert(law_invariant(&state.law), "the first state of the law is within bounds");
    __CPROVER_assert(drive_invariant(&state.drive), "the first state of the drive is within bounds");
#elif defined(OBSERVE)
    const pretouch_sample sample = nondet_sample();
    design_state state = nondet_state();
    pretouch_observation seen;
    __CPROVER_assume(sensing_invariant(&state.sensing));
    pretouch_observe(P, &state.sensing, &sample, &seen);
    __CPROVER_assert(sensing_invariant(&state.sensing), "the state of the sensing stays within bounds");
    __CPROVER_assert(is_observation(&seen), "the observation is within bounds");
#elif defined(LAW)
    const pretouch_observation seen = nondet_observation();
    design_state state = nondet_state();
    pretouch_push push;
    __CPROVER_assume(is_observation(&seen) && law_invariant(&state.law) && drive_invariant(&state.drive));
#ifdef DRAG
    pretouch_drag(&pretouch_design.law, &state.law, &seen, &state.drive, &push);
#else
    pretouch_damp(&pretouch_design.law, &state.law, &seen, &push);
#endif
    __CPROVER_assert(law_invariant(&state.law), "the state of the law stays within bounds");
    __CPROVER_assert(is_push(&push), "impulse and force of the law are finite");
#elif defined(LIMIT)
    const pretouch_motion now = nondet_motion();
    pretouch_motion wanted = nondet_motion();
    __CPROVER_assume(is_limited(now) && is_number(wanted));
    const int limited = limit_motion(&D->limits, now, &wanted);
    __CPROVER_assert(is_limited(wanted), "the motion is within its limits");
    __CPROVER_assert(limited == 0 || limited == 1, "limit_motion returns a flag");
#elif defined(DRIVE)
    const pretouch_sample sample = nondet_sample();
    const pretouch_observation seen = nondet_observation();
    const pretouch_push push = nondet_push();
    design_state state = nondet_state();
    pretouch_output out;
    __CPROVER_assume(is_observation(&seen) && is_push(&push) && drive_invariant(&state.drive));
    pretouch_drive(D, &state.drive, &seen, &push, &sample, &out);
    __CPROVER_assert(isfinite(out.position), "the position is finite");
    __CPROVER_assert(isfinite(out.velocity), "the velocity is finite");
    __CPROVER_assert(isfinite(out.acceleration), "the acceleration is finite");
    __CPROVER_assert(isfinite(out.log_level), "the log output is finite");
    __CPROVER_assert(fabsf(out.virtual_force) <= D->largest_force, "the force is within its limit");
    __CPROVER_assert(fabsf(state.drive.motion.position) <= D->limits.excursion, "the excursion is within its limit");
    __CPROVER_assert(fabsf(state.drive.motion.velocity) <= D->limits.speed, "the speed is within its limit");
    __CPROVER_assert(drive_invariant(&state.drive), "the state of the drive stays within bounds");
#endif
    return 0;
}
