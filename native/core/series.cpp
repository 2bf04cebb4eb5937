// Integrate L(1) with L(2) for any sensor curve by Taylor series, and find the first contact in them.
//
// Each step is a polynomial whose error is at rounding (series.hpp); it is accepted only when its coefficients prove
// what l does on it (polynomial.hpp), so that a border, the contact among them, is never passed twice unseen.
// Touches, and motions that come to zero but never arrive there, are told by endings.hpp.

#include "series.hpp"

#include "extremes.hpp"
#include "pretouch.h"
#include "stiff_step.hpp"

namespace pretouch {

namespace {

enum Status : int64_t { CONTACT, NEVER, LATE, LEFT_RANGE, UNRESOLVED };  // the numbers of ContactStatus

constexpr int64_t MOST_STEPS = 4000;  // some thousandths of a second; then a motion is given up
constexpr int64_t PER_PIECE = 16;     // further steps for each piece of the curve
constexpr double VANISHED = 1e-280;   // of l at the start: a motion about l = 0 that is below it has come to rest

// When to give up [s], whether the lowest border is the contact, whether the curve goes on beyond the pieces.
struct Limits {
    double horizon;
    bool contact_border, open_ended;
};

// Where a motion is asked for: ascending times, and TRACE_COLUMNS of motion/layout.py for each.
struct Samples {
    const double *times;
    int64_t count;
    double (*trace)[4];
};

// One encounter on its way.
struct Encounter {
    const Values &m;
    const double gain;
    const Curve &curve;
    const Limits &limits;
    Samples samples;
    Course &row;

    int64_t index;  // of the piece
    double time, l, speed;
    double start, taylor;  // l there; the length of the last Taylor step
    bool alone, never;     // whether nothing drives l but itself; whether it is proved never to arrive
    Pace pace;
    Expansion series;
    double unit;  // of the series [s]

    double rest(double damping) const;
    double least_damping(double top) const;
    double floor_after() const;
    bool is_never() const;
    bool is_over(bool last);
    double expand_step();
    void sample(double tau);
    void finish(double tau, double end);
    Status run();
};

// How far [m] an l that is left alone may still be from its resting place.
double Encounter::rest(double damping) const {
    if (m.stiffness == 0) return damping > 0 ? fabs(speed) * m.mass / damping : speed != 0 ? INFINITY : 0.0;
    return sqrt((l - m.p) * (l - m.p) + speed * speed * m.mass / m.stiffness);
}

// Bound D + D_p g(l) [N s/m] from below for all l up to a top.
double Encounter::least_damping(double top) const {
    if (gain == 0) return m.damping;
    double least = INFINITY;
    for (int64_t i = 0; i < curve.count && curve.bottom(i) < top; i++) {
        const Piece piece = curve.piece(i);
        const double width = smaller(2, (top - curve.bottom(i)) / piece.half);  // of z, from -1 upward
        double here = 0, spread = 0, steep = 0, sign = 1;
        for (int j = 0; j < TERMS; j++) {
            here += sign * piece.g[j];
            spread += j > 0 ? fabs(piece.g[j]) : 0.0;
            steep += j * fabs(piece.g[j]);
            sign = -sign;
        }
        const double near = gain * here - fabs(gain) * steep * width;
        least = smaller(least, larger(near, gain * piece.g[0] - fabs(gain) * spread));
    }
    return m.damping + (gain < 0 ? larger(least, 0) : least);  // g is never above 0
}

// Bound l from below for good: with the obstacle at rest a damping force only takes energy away; else -inf.
double Encounter::floor_after() const {
    if (m.v != 0 || m.a != 0 || gain > 0) return -INFINITY;
    if (m.stiffness > 0) {
        const double displacement = m.p - l;
        return m.p - sqrt(displacement * displacement + speed * speed * m.mass / m.stiffness);
    }
    return m.damping > 0 ? l - fabs(speed) * m.mass / m.damping : -INFINITY;
}

// Whether an l that is left alone is proved never to reach the lowest border from here on.
bool Encounter::is_never() const {
    double top = l;
    if (speed > 0 && m.stiffness > 0) top = m.p + sqrt((l - m.p) * (l - m.p) + speed * speed * m.mass / m.stiffness);
    return never_arrives(m, least_damping(top), l, speed, curve.bottom(0));
}

// Whether l is proved to stay above 0 and within the range for good, at its end or close to its least.
bool Encounter::is_over(bool last) {
    if (never && (limits.open_ended || speed <= 0)) {
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
    if (!(floor > 0 && (limits.open_ended || ceiling <= curve.top(curve.count - 1)))) return false;
    const bool settled = fabs(l - floor) <= 1e-12 * l;
    if (!(settled || last || row.closest_distance <= floor)) return false;
    if (m.stiffness == 0) row.settling_distance = settled ? floor : INFINITY;
    row.closest_distance = smaller(row.closest_distance, row.settling_distance);
    return true;
}

// Find the series of the next step; returns the largest tau at which it holds.
double Encounter::expand_step() {
    const Piece piece = curve.piece(index);
    const Borders used = curve.borders(index, 0);
    const double way = speed < 0 ? l - used.low : used.high - l;
    const double longest = smaller(limits.horizon - time, AHEAD * way / larger(fabs(speed), 1e-300));
    unit = long_step(m, gain, piece, {time, l, speed}, taylor, longest, pace, series);
    double tau = 1;
    if (unit == 0) {
        const double scale = scale_of(m, start, time, l);
        unit = taylor;
        expand(m, gain, piece, time, unit, l, speed, series);
        tau = reach_of(series, scale);
        taylor = smaller(unit * tau, limits.horizon);
        pace.doubt = LEFT_OUT * SLOW * scale / taylor;
    }
    return smaller(tau, (limits.horizon - time) / unit);
}

// Fill the trace at what times lie in the step.
void Encounter::sample(double tau) {
    for (; samples.count > 0 && *samples.times <= time + unit * tau; samples.count--) {
        const double t = *samples.times++, s = (t - time) / unit;
        double *found = *samples.trace++;
        found[0] = horner(series.l, s);
        found[1] = obstacle_at(m, t) - found[0];
        found[2] = obstacle_speed(m, t) - horner(series.v, s);
        found[3] = m.a - horner_slope(series.v, s) / unit;
    }
}

// Write the state at the end of a step, and go there.
void Encounter::finish(double tau, double end) {
    row.displacement_integral += integral(m, series.l, time, unit, tau);
    keep_extremes(m, gain, series, time, unit, tau, row);
    time += unit * tau;
    l = end;
    speed = horner(series.v, tau);
    row.time = time;
    row.distance = l;
    row.displacement = obstacle_at(m, time) - l;
    row.displacement_velocity = obstacle_speed(m, time) - speed;
    row.displacement_acceleration = m.a - horner_slope(series.v, tau) / unit;
    row.relative_velocity = speed;
    row.virtual_force = gain * horner<ORDER - 1>(series.force, tau);
}

Status Encounter::run() {
    const int64_t last = curve.count - 1, most = MOST_STEPS + PER_PIECE * curve.count;
    const double bottom = curve.bottom(0), top = curve.top(last);
    for (int64_t i = 0; i < most; i++) {
        double tau = expand_step();
        const Borders borders = curve.borders(index, never ? -INFINITY : bottom);
        const Accepted step = accepted_step(m, series.l, borders, time, unit, tau);
        double end = step.end;
        tau = step.tau;
        if (step.moved > 0 && index == last) {
            end = larger(l, top);
            tau = horner(series.l, step.since) < end ? level_time(series.l, end, step.since, tau) : step.since;
        }
        sample(tau);
        finish(tau, end);
        if (step.moved < 0 && (index == 0 || step.touched)) {
            row.distance = row.closest_distance = bottom;
            if (step.touched) {
                row.displacement_velocity += speed;
                row.relative_velocity = row.virtual_force = 0;
            }
            if (never) row.settling_distance = bottom;  // it is as close to its rest as rounding lets it come
            return never ? NEVER : limits.contact_border ? CONTACT : LEFT_RANGE;
        }
        if (step.moved > 0 && index == last) {
            row.distance = top;
            return limits.open_ended ? UNRESOLVED : LEFT_RANGE;
        }
        index += step.moved;
        never = never || (alone && is_never());
        const bool vanished = alone && m.p == 0 && m.stiffness > 0 && rest(0) <= VANISHED * start;
        if (vanished) row.closest_distance = row.settling_distance = 0;
        if (vanished || is_over(time >= limits.horizon)) return NEVER;
        if (time >= limits.horizon) return LATE;
        if (!isfinite(l + speed)) return UNRESOLVED;
    }
    return never && is_over(true) ? NEVER : UNRESOLVED;
}

// Solve one encounter. Where times are given, fill the trace at them.
Status solve(const Values &m, double gain, const Curve &curve, const Limits &limits, const Samples &samples,
             Course &row) {
    Encounter one = {m, gain, curve, limits, samples, row, 0, 0, m.p - m.x0, m.v - m.u0, 0, 0, false, false, {}, {}, 0};
    one.start = one.l;
    one.index = curve.find(one.l);
    one.alone = is_left_alone(m);
    one.never = one.alone && one.is_never();
    one.taylor = first_unit(m, gain, curve.piece(one.index), one.speed, limits.horizon);
    one.pace = {0, PATIENCE, PATIENCE, 0};
    row = {};
    row.closest_distance = one.l;
    row.settling_distance = m.v == 0 && m.a == 0 && m.stiffness > 0 && gain <= 0 ? m.p : INFINITY;
    return one.run();
}

}  // namespace

}  // namespace pretouch

using namespace pretouch;

void pretouch_solve_series(const double *values, int64_t n, const double *gains, const double *pieces, int64_t p,
                           int64_t q, double horizon, int contact_border, int open_ended, double *rows,
                           int64_t *status) {
    const Curve curve = {pieces, p, q};
    const Limits limits = {horizon, contact_border != 0, open_ended != 0};
    for (int64_t i = 0; i < n; i++) {
        status[i] = solve(reinterpret_cast<const Values *>(values)[i], gains[i], curve, limits, {nullptr, 0, nullptr},
                          reinterpret_cast<Course *>(rows)[i]);
    }
}

void pretouch_trace_series(const double *values, int64_t n, const double *gains, const double *pieces, int64_t p,
                           int64_t q, double horizon, int contact_border, int open_ended, const double *times,
                           int64_t m, double *trace) {
    const Curve curve = {pieces, p, q};
    const Limits limits = {horizon, contact_border != 0, open_ended != 0};
    Course row;
    for (int64_t i = 0; i < n; i++) {
        const Samples samples = {times + i * m, m, reinterpret_cast<double(*)[4]>(trace) + i * m};
        solve(reinterpret_cast<const Values *>(values)[i], gains[i], curve, limits, samples, row);
    }
}
