#include "pretouch_law.h"

#include <float.h>
#include <math.h>

#ifdef PRETOUCH_FLOAT
#define LOG logf
#define SQRT sqrtf
#define FABS fabsf
#define FLOOR floorf
#define R(x) x##f
#define EPSILON FLT_EPSILON
#define SAME_INSTANT 1e-4f
#define ROUNDING 1e-5f
#else
#define LOG log
#define SQRT sqrt
#define FABS fabs
#define FLOOR floor
#define R(x) x
#define EPSILON DBL_EPSILON
#define SAME_INSTANT 1e-6 /* of a period: closer readings are the same reading */
#define ROUNDING 1e-9     /* of an impulse or a level: a smaller remainder counts as zero */
#endif

typedef pretouch_real real;

static const real ANY_CHANGE = R(1500.0); /* upper bound of |change of ln xi| between any two numbers */
static const real ANY_FORCE = R(1e9);     /* N; a larger contact force is a fault */
static const real ANY_REFERENCE = R(1e6); /* SI; a larger reference is a fault */

/* Return the second number if it is larger (smaller), else the first: also for NaN and for zeros of both signs. */
static inline real larger(real a, real b) { return b > a ? b : a; }
static inline real smaller(real a, real b) { return b < a ? b : a; }
static inline real within(real value, real limit) { return larger(smaller(value, limit), -limit); }

/* ---- running median: removes outliers before the low-pass ---- */

static void fill_median(int32_t length, real value, pretouch_median_state *s) {
    for (int32_t i = 0; i < PRETOUCH_MEDIAN; i++) s->arrived[i] = value;
    for (int32_t i = 0; i <= PRETOUCH_MEDIAN; i++) s->ordered[i] = i < length ? value : (real)INFINITY;
    s->oldest = 0;
}

/* Adds a reading and returns the median of the last `length` readings; for an even length the mean of the middle two.
 * One pass removes the oldest reading from the sorted array by shifting the values above it, and inserts the new one.
 * The loop always visits all elements, so a step takes the same time for every reading. */
static real advance_median(int32_t length, pretouch_median_state *s, real value) {
    const real oldest = s->arrived[s->oldest];
    real before = -(real)INFINITY;
    if (length == 1) return value;
    for (int32_t i = 0; i < length; i++) {
        const real here = s->ordered[i + (s->ordered[i] >= oldest)];
        s->ordered[i] = smaller(larger(value, before), here);
        before = here;
    }
    s->arrived[s->oldest] = value;
    s->oldest = s->oldest + 1 < length ? s->oldest + 1 : 0;
    return (s->ordered[(length - 1) / 2] + s->ordered[length / 2]) / 2;
}

/* ---- Butterworth low-pass: second-order sections in transposed direct form II ---- */

/* Sets the filter to its steady state for the constant input `value`, so that it starts without a transient. */
static void fill_low_pass(const pretouch_sensing_numbers *p, real value, pretouch_sensing_state *s) {
    for (int32_t i = 0; i < p->sections; i++) {
        const pretouch_section *n = &p->low_pass[i];
        const real out = (n->b0 + n->b1 + n->b2) / (1 + n->a1 + n->a2) * value;
        s->low_pass[i][0] = out - n->b0 * value;
        s->low_pass[i][1] = n->b2 * value - n->a2 * out;
        value = out;
    }
}

static real advance_low_pass(const pretouch_sensing_numbers *p, pretouch_sensing_state *s, real value) {
    for (int32_t i = 0; i < p->sections; i++) {
        const pretouch_section *n = &p->low_pass[i];
        real *z = s->low_pass[i];
        const real out = n->b0 * value + z[0];
        z[0] = n->b1 * value - n->a1 * out + z[1];
        z[1] = n->b2 * value - n->a2 * out;
        value = out;
    }
    return value;
}

/* ---- from a reading to the change of ln xi ---- */

void pretouch_start_sensing(const pretouch_sensing_numbers *p, pretouch_sensing_state *s) {
    for (int32_t i = 0; i < PRETOUCH_SECTIONS; i++) s->low_pass[i][0] = s->low_pass[i][1] = 0;
    s->quiet = s->measured = s->log_level = 0;
    s->level = s->filtered = p->floor;
    fill_median(p->median_length, p->floor, &s->median);
    fill_low_pass(p, p->floor, s);
    s->latest = PRETOUCH_NOTHING;
}

/* Returns whether no object can change xi so much within a time [s]. The time counts up to one sensor period: a jump does
 * not become plausible by waiting, so it lasts until the sensor is lost, and its impulse is never applied. Close to the
 * filtered xi is plausible, too, because the last reading may itself have been an extreme of the noise. */
static int is_jump(const pretouch_sensing_numbers *p, const pretouch_sensing_state *s, real level, real elapsed) {
    const real largest = p->largest_rate * smaller(elapsed, p->sensor_period);
    return largest < ANY_CHANGE && FABS(LOG(level / s->level)) > largest && FABS(LOG(level / s->filtered)) > largest;
}

/* Returns the status flag that says why a new reading, or "no object", is rejected; 0 if it is usable or if there is none.
 * measured: time since the last usable reading was measured [s]. */
static int32_t fault_of(const pretouch_sensing_numbers *p, const pretouch_sensing_state *s,
                        const pretouch_sample *sample, real level, real measured) {
    const real elapsed = measured - sample->age;
    const int in_time = 0 <= sample->age && sample->age <= p->timeout; /* false for NaN */
    const int in_order = elapsed > SAME_INSTANT * p->period || s->latest == PRETOUCH_NOTHING;
    if (!sample->fresh) return 0;
    if (!(in_time && in_order)) return PRETOUCH_INVALID;
    if (sample->fresh == PRETOUCH_NO_OBJECT) return 0;
    if (!isfinite(sample->reading)) return PRETOUCH_INVALID;
    if (sample->reading >= p->saturation) return PRETOUCH_SATURATED;
    return s->latest == PRETOUCH_READING && is_jump(p, s, level, elapsed) ? PRETOUCH_IMPLAUSIBLE : 0;
}

/* Filters a usable reading and computes its logarithm. measured: time since the previous one was measured [s]. */
static void take_in(const pretouch_sensing_numbers *p, pretouch_sensing_state *s, real age, real level,
                    real measured, pretouch_observation *seen) {
    const int32_t restarted = s->latest != PRETOUCH_READING;
    const real before = s->filtered;
    real filtered = level;
    if (restarted) {
        fill_median(p->median_length, level, &s->median);
        fill_low_pass(p, level, s);
    } else {
        filtered = advance_low_pass(p, s, advance_median(p->median_length, &s->median, level));
    }
    s->latest = PRETOUCH_READING;
    s->quiet = 0;
    s->measured = age;
    s->level = level;
    /* the low-pass may undershoot, and its rounding at the floor is no detection */
    s->filtered = filtered > p->floor * (1 + ROUNDING) ? filtered : p->floor;
    s->log_level = LOG(s->filtered / p->floor);
    seen->change = restarted ? 0 : LOG(s->filtered / before);
    seen->log_level = s->log_level;
    seen->level = s->filtered;
    seen->elapsed = restarted ? 0 : measured - age;
    seen->usable = 1;
    seen->restarted = restarted;
    seen->detecting = s->log_level > 0;
    seen->no_object = seen->stale = seen->lost = 0;
    seen->status = seen->detecting ? PRETOUCH_DETECTING : 0;
}

void pretouch_observe(const pretouch_sensing_numbers *p, pretouch_sensing_state *s, const pretouch_sample *sample,
                      pretouch_observation *seen) {
    const real quiet = s->quiet + p->period, measured = s->measured + p->period;
    const real above = sample->reading - p->offset;
    const real level = p->floor < above && above < (real)INFINITY ? above : p->floor; /* the floor also for NaN */
    const int32_t fault = fault_of(p, s, sample, level, measured);
    const int32_t usable = sample->fresh && fault == 0;
    if (usable && sample->fresh != PRETOUCH_NO_OBJECT) {
        take_in(p, s, sample->age, level, measured, seen);
        return;
    }
    /* An object that vanishes has not moved, and neither has one that appears: the law pauses, and the next reading is a
     * new start. The sensor works, so it is neither late nor lost. */
    seen->no_object = usable;
    seen->lost = !usable && quiet > p->timeout * (1 + SAME_INSTANT);
    seen->stale = !usable && quiet > p->sensor_period * (1 - SAME_INSTANT);
    if (usable) {
        s->latest = PRETOUCH_NO_OBJECT;
        s->level = s->filtered = p->floor;
    } else if (seen->lost) {
        s->latest = PRETOUCH_NOTHING;
    }
    if (usable || seen->lost) s->log_level = 0;
    s->quiet = usable ? 0 : smaller(quiet, 2 * p->timeout); /* larger values have no effect */
    s->measured = usable ? sample->age : smaller(measured, 3 * p->timeout);
    seen->change = seen->elapsed = 0;
    seen->log_level = s->log_level;
    seen->level = s->filtered;
    seen->usable = seen->restarted = 0;
    seen->detecting = s->log_level > 0;
    seen->status = (seen->detecting ? PRETOUCH_DETECTING : 0) + (seen->stale ? PRETOUCH_STALE : 0) +
                   (seen->lost ? PRETOUCH_LOST : 0) + fault;
}

/* ---- L(2): the impulse is D_p times the change of ln xi; this is exact at any sampling rate ---- */

void pretouch_damp(const pretouch_damper_numbers *p, pretouch_damper_state *s, const pretouch_observation *seen,
                   pretouch_push *push) {
    const real ramp = seen->detecting ? smaller(s->ramp + p->ramp_step, 1) : larger(s->ramp - p->ramp_step, 0);
    const real share = seen->detecting ? ramp : s->ramp; /* the change down to the floor still counts */
    const real before = seen->restarted ? seen->log_level : s->mark;
    /* For approach_only, a mark follows a rise of ln xi immediately, and a fall at the distance `release` above ln xi.
     * Only rises of the mark count. */
    const real mark =
        seen->usable ? smaller(larger(before, seen->log_level), seen->log_level + p->release) : before;
    const real change = p->approach_only ? larger(mark - before, 0) : seen->change;
    s->ramp = ramp;
    s->mark = mark;
    push->impulse = p->gain * share * change;
    push->force = 0;
}

/* ---- the virtual drag: the impulse is -phi times the rate of ln xi times its rise ---- */

/* Returns by how much this reading raises the smoothed ln xi beyond its dead zone. *fast: output, rate of ln xi above
 * its noise [1/s]. The prediction error of each reading corrects level and rate, so both follow a steady approach
 * without lag, for any time between readings. The width of the dead zone is proportional to the noise at this xi. A
 * mark follows a rise of the level immediately, and a fall at a distance of that width above it; only rises of the mark
 * count. */
static real advance_rise(const pretouch_drag_numbers *p, pretouch_drag_state *s, const pretouch_observation *seen,
                         real *fast) {
    const real xi = seen->level, sigma = SQRT(p->variance + p->relative_variance * xi * xi) / xi;
    const real width = p->width * sigma, still = p->still * sigma;
    const real rate = seen->restarted ? 0 : s->rate;
    const real expected = seen->restarted ? seen->log_level : s->level + rate * seen->elapsed;
    const real missed = seen->log_level - expected, every = larger(seen->elapsed, p->sensor_period);
    s->level = expected + p->level_share * missed;
    s->rate = within(rate + p->rate_share * missed / every, ANY_CHANGE / p->sensor_period);
    const real mark = seen->restarted ? s->level + width : s->mark;
    const real rise = larger(s->level - mark, 0);
    s->mark = smaller(larger(mark, s->level), s->level + width);
    *fast = s->rate > still ? SQRT((s->rate - still) * (s->rate + still)) : 0;
    return seen->detecting ? rise : 0;
}

void pretouch_drag(const pretouch_drag_numbers *p, pretouch_drag_state *s, const pretouch_observation *seen,
                   const pretouch_drive_state *driven, pretouch_push *push) {
    const real x = driven->motion.position, v = driven->motion.velocity, ahead = p->period / 2;
    real fast = 0;
    const real rise = seen->usable ? advance_rise(p, s, seen, &fast) : 0;
    const real own = v > 0 ? larger(p->own_advance * rise, -p->mass * v) : 0; /* stops the plant at most */
    const real left = rise > 0 ? p->hold : s->hold;
    const int approaching = seen->detecting && left > 0;
    /* Force that balances spring and damper of the admittance in the middle of the period. While the plant retreats, it
     * is applied if spring and damper would brake the retreat. */
    const real pull = p->stiffness * (x + ahead * v) + p->damping * (v + ahead * driven->delivery.steady / p->mass);
    const real held = v <= 0 ? smaller(pull, 0) : 0;
    s->hold = approaching ? larger(left - p->period, 0) : 0;
    push->impulse = own - p->drag * fast * rise;
    push->force = approaching ? held + p->mass * p->known_acceleration : 0;
}

/* ---- delivery: an impulse as a constant force over one sensor period ---- */

/* Returns the force of this period [N]. If the next reading is late, the force continues and fades. The impulse that is
 * delivered meanwhile is subtracted from that of the next reading, so that the sum stays exact. The subtraction by
 * itself causes no force. The part of an impulse above the force limit is dropped, since it would act too late. If the
 * object vanishes, the impulse of its measured motion is still delivered; no force continues after it, and nothing is
 * subtracted from the impulses of the next object. */
static real deliver(const pretouch_drive_numbers *p, pretouch_delivery *s, const pretouch_observation *seen,
                    real impulse) {
    const real period = p->limits.period;
    if (seen->usable) {
        const real owed = impulse + s->rest, due = owed - s->ahead;
        const int covers = (owed > 0 && 0 < due) || (owed < 0 && 0 > due);
        s->steady = covers ? within(due / p->hold, p->largest_force) : 0;
        s->rest = s->steady * p->hold;
        s->ahead = covers ? 0 : -due;
        s->fading = 1;
    }
    if (seen->no_object) s->ahead = s->fading = 0;
    if (s->rest != 0) {
        const real given = s->steady * period, rest = s->rest;
        const int last = FABS(rest) <= FABS(given) * (1 + ROUNDING);
        s->rest = last ? 0 : rest - given;
        return last ? rest / period : s->steady;
    }
    s->rest = 0;
    if (!seen->stale) return 0;
    s->fading = larger(s->fading - p->fade_step, 0);
    const real force = s->steady * s->fading;
    s->ahead = seen->lost ? 0 : s->ahead + force * period;
    return force;
}

/* ---- L(1), and limits of the motion that are all met for any force ---- */

static pretouch_motion advance_admittance(const pretouch_admittance_numbers *p, pretouch_motion m, real force) {
    const real x = m.position, v = m.velocity;
    return (pretouch_motion){
        p->position_from_position * x + p->position_from_velocity * v + p->position_from_force * force,
        p->velocity_from_position * x + p->velocity_from_velocity * v + p->velocity_from_force * force,
    };
}

/* Stopping distance [m] from a speed >= 0: whole periods of the largest deceleration, and a last one for the rest. */
static real stopping_distance(const pretouch_motion_limits *p, real speed) {
    const real step = p->acceleration * p->period, whole = FLOOR(speed / step), rest = speed - whole * step;
    return p->period * (step / 2 * whole * whole + rest * (whole + R(0.5)));
}

/* Returns the largest speed v [m/s] with T v/2 + (stopping distance from v) <= room [m]. */
static real fastest(const pretouch_motion_limits *p, real room) {
    const real step = p->acceleration * p->period, left = larger(room, 0);
    const real whole = FLOOR((SQRT(1 + 8 * left / (step * p->period)) - 1) / 2);
    return step * whole + (left - step * p->period / 2 * whole * (whole + 1)) / (p->period * (whole + 1));
}

/* Limits the motion that the admittance requests; returns whether a limit acted. The admittance continues from the
 * limited motion, so there is no windup. */
static int limit_motion(const pretouch_motion_limits *p, pretouch_motion now, pretouch_motion *wanted) {
    const real step = p->acceleration * p->period, drifted = now.velocity * p->period;
    const real moved = wanted->position - now.position;
    /* so much smaller that the acceleration is within its limit also after rounding */
    const real change = larger(step - 2 * EPSILON * (FABS(now.velocity) + step), 0);
    real low = larger(-p->speed, now.velocity - change), high = smaller(p->speed, now.velocity + change);
    /* a stiff admittance can leave the limits and return within a period, so the position is checked, too */
    const int steady = FABS(moved) <= p->speed * p->period && FABS(moved - drifted) <= step * p->period / 2;
    if (steady && low <= wanted->velocity && wanted->velocity <= high) {
        const real way = stopping_distance(p, FABS(wanted->velocity));
        const real ahead = wanted->velocity >= 0 ? wanted->position : -wanted->position;
        if (FABS(wanted->position) <= p->excursion && ahead + way <= p->excursion) return 0;
    }
    high = smaller(high, fastest(p, p->excursion - now.position - drifted / 2));
    low = larger(low, -fastest(p, p->excursion + now.position + drifted / 2));
    wanted->velocity = larger(smaller(wanted->velocity, high), low);
    wanted->position = within(now.position + drifted / 2 + p->period * wanted->velocity / 2, p->excursion);
    return 1;
}

/* ---- from the impulse to the motion ---- */

void pretouch_start_drive(real position, real velocity, pretouch_drive_state *s) {
    s->delivery = (pretouch_delivery){0, 0, 0, 0};
    s->motion = (pretouch_motion){position, velocity};
    s->reference = 0;
}

static inline int is_fault(real value, real largest) { return !(isfinite(value) && FABS(value) <= largest); }

void pretouch_drive(const pretouch_drive_numbers *p, pretouch_drive_state *s, const pretouch_observation *seen,
                    const pretouch_push *push, const pretouch_sample *sample, pretouch_output *out) {
    const real period = p->limits.period, before = s->motion.velocity;
    const real virtual_force = within(deliver(p, &s->delivery, seen, push->impulse) + push->force, p->largest_force);
    const int no_force = is_fault(sample->contact_force, ANY_FORCE);
    const real contact_force = no_force ? 0 : sample->contact_force;
    const real force = virtual_force + p->contact_gain * contact_force;
    pretouch_motion next = advance_admittance(&p->admittance, s->motion, force);
    const int limited = limit_motion(&p->limits, s->motion, &next);
    const int no_reference = is_fault(sample->reference_position, ANY_REFERENCE) ||
                             is_fault(sample->reference_velocity, ANY_REFERENCE) ||
                             is_fault(sample->reference_acceleration, ANY_REFERENCE);
    const real x = no_reference ? s->reference : sample->reference_position;
    const real v = no_reference ? 0 : sample->reference_velocity;
    const real a = no_reference ? 0 : sample->reference_acceleration;
    out->position = x + period * (v + period / 2 * a) + next.position;
    out->velocity = v + period * a + next.velocity;
    out->acceleration = a + (next.velocity - before) / period;
    out->virtual_force = virtual_force;
    out->log_level = seen->log_level;
    out->status = seen->status + (FABS(virtual_force) >= p->largest_force ? PRETOUCH_FORCE_LIMITED : 0) +
                  (FABS(contact_force) >= p->contact_threshold ? PRETOUCH_IN_CONTACT : 0) +
                  (limited ? PRETOUCH_MOTION_LIMITED : 0) + (no_force || no_reference ? PRETOUCH_INPUT_FAULT : 0);
    s->motion = next;
    s->reference = x;
}

/* ---- the controller ---- */

void pretouch_start(const pretouch_parameters *p, real position, real velocity, pretouch_state *s) {
    pretouch_start_sensing(&p->sensing, &s->sensing);
    pretouch_start_drive(position, velocity, &s->drive);
    s->law = (pretouch_damper_state){0, 0};
}

void pretouch_step(const pretouch_parameters *p, pretouch_state *s, const pretouch_sample *sample,
                   pretouch_output *out) {
    pretouch_observation seen;
    pretouch_push push;
    pretouch_observe(&p->sensing, &s->sensing, sample, &seen);
    pretouch_damp(&p->law, &s->law, &seen, &push);
    pretouch_drive(&p->drive, &s->drive, &seen, &push, sample, out);
}

void pretouch_step_damper(const void *parameters, void *state, const pretouch_sample *sample, pretouch_output *out) {
    pretouch_step(parameters, state, sample, out);
}

void pretouch_start_drag(const pretouch_parameters_drag *p, real position, real velocity, pretouch_state_drag *s) {
    pretouch_start_sensing(&p->sensing, &s->sensing);
    pretouch_start_drive(position, velocity, &s->drive);
    s->law = (pretouch_drag_state){0, 0, 0, 0};
}

void pretouch_step_drag(const void *parameters, void *state, const pretouch_sample *sample, pretouch_output *out) {
    const pretouch_parameters_drag *p = parameters;
    pretouch_state_drag *s = state;
    pretouch_observation seen;
    pretouch_push push;
    pretouch_observe(&p->sensing, &s->sensing, sample, &seen);
    pretouch_drag(&p->law, &s->law, &seen, &s->drive, &push);
    pretouch_drive(&p->drive, &s->drive, &seen, &push, sample, out);
}
