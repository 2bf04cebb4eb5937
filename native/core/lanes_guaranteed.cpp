// The guaranteed path: find or exclude the first contact of each encounter, for any sensor curve. The equation of
// motion, L(1) with the virtual force L(2), is integrated by Taylor series. One encounter is solved at a time, with
// equal values in all vector lanes.
//
// Each step is a polynomial with an error at rounding level (lanes_taylor.hpp). It is accepted only if its coefficients
// prove how l moves (lanes_proof.hpp). So it cannot miss two crossings of a border, or of l = 0, within one step. The
// rules of pieces.hpp detect touches and motions that decay to zero without contact.

#include <string.h>

#include "lanes_drag_course.hpp"
#include "lanes_encounter.hpp"
#include "lanes_kernels.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int64_t MOST_TAKEN = 4000;  // steps (a few milliseconds); then the motion is unresolved
constexpr int64_t PER_PIECE = 16;     // further steps for each piece of the curve
constexpr int64_t MOST_FOLLOWED = 30000;  // steps with responses; stiffer motions have no exact derivatives
constexpr double VANISHED = 1e-280;   // relative to the initial l: smaller motions about l = 0 count as rest
constexpr int INPUTS = 9;

// Upper bound of the distance [m] of an undriven l from its resting place.
double Encounter::rest(double damping) const {
    if (m.stiffness == 0) return damping > 0 ? fabs(speed) * m.mass / damping : speed != 0 ? INFINITY : 0.0;
    return sqrt((l - m.p) * (l - m.p) + speed * speed * m.mass / m.stiffness);
}

// Lower bound of D + D_p g(l) [N s/m] for all l up to a top.
double Encounter::least_damping(double top) const {
    if (gain == 0) return m.damping;
    double least = INFINITY;
    for (int64_t i = 0; i < curve.count && curve.bottom(i) < top; i++) {
        const Piece part = curve.piece(i);
        const double width = smaller(2, (top - curve.bottom(i)) / part.half);  // in z, from z = -1 upward
        double here = 0, spread = 0, steep = 0, sign = 1;
        for (int j = 0; j < COEFFICIENTS; j++) {
            here += sign * part.g[j];
            spread += j > 0 ? fabs(part.g[j]) : 0.0;
            steep += j * fabs(part.g[j]);
            sign = -sign;
        }
        const double near = gain * here - fabs(gain) * steep * width;
        least = smaller(least, larger(near, gain * part.g[0] - fabs(gain) * spread));
    }
    return m.damping + (gain < 0 ? larger(least, 0) : least);  // since g <= 0
}

// Lower bound of l for all later times if the obstacle stays at rest relative to the reference, since damping only
// dissipates energy; otherwise, or if the gain is positive, -inf.
double Encounter::floor_after() const {
    if (later.count || m.v != 0 || m.a != 0 || gain > 0) return -INFINITY;
    if (m.stiffness > 0) {
        const double displacement = m.p - l;
        return m.p - sqrt(displacement * displacement + speed * speed * m.mass / m.stiffness);
    }
    return m.damping > 0 ? l - fabs(speed) * m.mass / m.damping : -INFINITY;
}

// Whether an undriven l is proved never to reach the lower end of the curve.
bool Encounter::is_never() const {
    double top = l;
    if (speed > 0 && m.stiffness > 0) top = m.p + sqrt((l - m.p) * (l - m.p) + speed * speed * m.mass / m.stiffness);
    return never_arrives(m, least_damping(top), l, speed, curve.bottom(0));
}

// Whether the encounter can end without a contact. l must be proved to stay above 0 and within the range of the curve
// for all later times. Besides, it must be the last step, or l must have settled or passed its minimum. Writes the
// settling distance and the closest distance.
bool Encounter::is_over(bool last) {
    if (never && (curve.open_ended || speed <= 0)) {
        const double damping = least_damping(l), way = rest(damping), doubt = rest_resolution(m, damping);
        if (!(last || way <= doubt)) return false;
        if (m.stiffness == 0) {
            row.settling_distance = way <= doubt ? larger(l - way, 0) : INFINITY;
        } else {
            row.settling_distance = larger(row.settling_distance, 0);
        }
        row.closest_distance = smaller(row.closest_distance, row.settling_distance);
        return true;
    }
    const double floor = floor_after(), ceiling = m.stiffness > 0 ? 2 * m.p - floor : 2 * l - floor;
    if (!(floor > 0 && (curve.open_ended || ceiling <= curve.top(curve.count - 1)))) return false;
    const bool settled = fabs(l - floor) <= 1e-12 * l;
    if (!(settled || last || row.closest_distance <= floor)) return false;
    if (m.stiffness == 0) row.settling_distance = settled ? floor : INFINITY;
    row.closest_distance = smaller(row.closest_distance, row.settling_distance);
    return true;
}

// Simulate the encounter step by step until it ends; return how.
Status Encounter::run() {
    const int64_t last = curve.count - 1;
    const int64_t most = followed ? MOST_FOLLOWED : MOST_TAKEN + PER_PIECE * curve.count;
    const double bottom = curve.bottom(0), top = curve.top(last);
    for (int64_t i = 0; i < most; i++) {
        const double tau = expand_step();
        const Borders borders = curve.borders(index, never ? -INFINITY : bottom);
        Accepted step = accepted_step(m, b, borders, time, unit, tau);
        if (step.moved > 0 && index == last) {
            const double end = larger(l, top), since = step.since;
            step.tau = look_at(b, since).value < end ? zero_time(b, LEVEL, end, since, step.tau) : since;
            step.end = end;
        }
        sample(step.tau);
        if (followed) carry(step);
        else keep_extremes(step.tau);
        finish(step.tau, step.end);
        if (step.moved < 0 && (index == 0 || step.touched)) {
            row.distance = row.closest_distance = bottom;
            if (step.touched) {
                row.displacement_velocity += speed;
                row.relative_velocity = row.virtual_force = 0;
            }
            if (never) row.settling_distance = bottom;  // l has reached its resting place within rounding
            return never ? NO_CONTACT : curve.ends_in_contact ? CONTACT : LEFT_RANGE;
        }
        if (step.moved > 0 && index == last) {
            row.distance = top;
            return curve.open_ended ? UNRESOLVED : LEFT_RANGE;
        }
        if (step.moved) enter(index + step.moved);
        if (time >= section_end() && time < horizon) next_section();
        never = never || (alone && is_never());
        const bool vanished = alone && m.p == 0 && m.stiffness > 0 && rest(0) <= VANISHED * start;
        if (vanished) row.closest_distance = row.settling_distance = 0;
        if (vanished || is_over(time >= horizon)) return NO_CONTACT;
        if (time >= horizon) return LATE;
        if (!isfinite(l + speed)) return UNRESOLVED;
    }
    return never && is_over(true) ? NO_CONTACT : UNRESOLVED;
}

// Solve one encounter and write the derivatives of contact time and of l' at contact. Return 0 for a contact, 1 if l
// left the range of the curve, else 2. A touch also returns 2, since an arbitrarily small change of an input can
// prevent it.
int8_t follow(const Values &m, double gain, const pretouch_pieces &curve, double horizon, const double *shape,
              double *gradients) {
    const int64_t many = shape ? INPUTS + 1 : INPUTS;
    Course row;
    Followed followed = {};
    followed.shape = shape;
    Encounter one(m, gain, curve, horizon, {}, &followed, row);
    const Status status = one.run();
    for (int64_t j = 0; j < 2 * many; j++) gradients[j] = NOT_A_NUMBER;
    if (status == LEFT_RANGE) return 1;
    if (status != CONTACT || row.relative_velocity == 0) return 2;
    const double slope = slope_at(one.piece, row.distance).value, bend = m.a - row.displacement_acceleration;
    const Contacts contact = {all(row.time), all(row.relative_velocity), all(bend), Lanes{}, Lanes{}};
    double rows[3][INPUTS];
    write_gradient(one.motion, followed.responses, contact, 0, slope, rows[0], 1);
    memcpy(gradients, rows[0], sizeof rows[0]);
    memcpy(gradients + many, rows[2], sizeof rows[2]);
    if (shape) {
        const double d = followed.responses.of[BY_SHAPE].d[0], y = followed.responses.of[BY_SHAPE].y[0];
        gradients[INPUTS] = -d / row.relative_velocity;
        gradients[many + INPUTS] = y - (m.damping + gain * slope) / m.mass * d + bend * gradients[INPUTS];
    }
    return 0;
}

const Values &values_of(const double *values, int64_t i) { return reinterpret_cast<const Values *>(values)[i]; }

}  // namespace

void solve_series(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve, double horizon,
                  double *rows, int64_t *status, const double *times, int64_t m, double *trace, const double *sections,
                  int64_t section_count) {
    for (int64_t i = 0; i < n; i++) {
        Samples samples = {};
        const Sections later = {reinterpret_cast<const Section *>(sections) + i * section_count, section_count};
        if (times) samples = {times + i * m, m, reinterpret_cast<double(*)[4]>(trace) + i * m};
        Course &row = reinterpret_cast<Course *>(rows)[i];
        status[i] = Encounter(values_of(values, i), gains[i], *curve, horizon, samples, nullptr, row, later).run();
    }
}

void solve_drag_courses(const double *values, int64_t n, const double *drags, const pretouch_pieces *curve,
                        double horizon, const pretouch_drag_courses *wanted) {
    for (int64_t i = 0; i < n; i++) {
        Samples samples = {};
        const int64_t count = wanted->section_count, m = wanted->m;
        const Sections later = {reinterpret_cast<const Section *>(wanted->sections) + i * count, count};
        if (wanted->times) samples = {wanted->times + i * m, m, reinterpret_cast<double(*)[4]>(wanted->trace) + i * m};
        double(*nodes)[3] = reinterpret_cast<double(*)[3]>(wanted->nodes);
        const DragOutputs outputs = {wanted->impulses + i, wanted->steps + i,
                                     nodes ? nodes + wanted->first[i] * pretouch::GAUSS : nullptr};
        Course &row = reinterpret_cast<Course *>(wanted->rows)[i];
        DragEncounter one(values_of(values, i), drags[i], *curve, horizon, samples, row, later, outputs);
        wanted->status[i] = one.run_drag();
    }
}

void follow_gradients(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve,
                      const double *shape, double horizon, double *gradients, int8_t *status) {
    for (int64_t i = 0; i < n; i++) {
        double *rows = gradients + i * 2 * (shape ? INPUTS + 1 : INPUTS);
        status[i] = follow(values_of(values, i), gains[i], *curve, horizon, shape, rows);
    }
}

}  // namespace PRETOUCH_VARIANT
