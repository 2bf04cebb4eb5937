// One encounter of the guaranteed path. It takes Taylor steps with errors at rounding level, or long steps if the
// motion is stiff (stiff_step.cpp).

#pragma once

#include <string.h>

#include "lanes_bernstein.hpp"
#include "lanes_proof.hpp"
#include "lanes_responses.hpp"
#include "stiff_step.hpp"

namespace PRETOUCH_VARIANT {

namespace {

enum Status : int64_t { CONTACT, NO_CONTACT, LATE, LEFT_RANGE, UNRESOLVED };  // the values of ContactStatus

constexpr int DEGREE = LARGEST_DEGREE;  // of ln xi; pieces have a smaller degree
constexpr double LEFT_OUT = 1e-16;      // largest truncation error of l' in a step, relative
constexpr double SLOW = 1e-6;           // changes of l in a step below this part of l need no relative accuracy
constexpr double SHORTEST_UNIT = 1e-150;  // [s]; its square does not underflow
constexpr double LEFT_ALONE = 1e-13;  // truncation error of a response per step, relative to its largest value
constexpr int HALVINGS = 6;           // how often a step may be halved until its peaks are certain

// Output of a sampled motion: ascending times, and for each time a row with TRACE_COLUMNS of motion/layout.py.
struct Samples {
    const double *times;
    int64_t count;
    double (*trace)[4];
};

// A later section of the obstacle's path relative to the reference: p + v t + a t^2 / 2 for t >= since.
struct Section {
    double since, p, v, a;
};

struct Sections {
    const Section *next;
    int64_t count;
};

// Responses that are integrated with a motion. shape: the polynomial coefficients in z of dg/d(parameter) on each
// piece, for the response to a parameter of the curve; null if there is none.
struct Followed {
    Responses responses;
    const double *shape;
};

// State of one encounter.
struct Encounter {
    Values m;  // p, v and a are those of the present section of the path
    const double gain;
    const Curve curve;
    const double horizon;  // longest time [s]
    Samples samples;
    Followed *followed;
    Course &row;
    Sections later;

    int64_t index = 0;  // of the present piece of the curve
    Piece piece = {};
    double time = 0, l, speed;
    double start, taylor = 0, longest = INFINITY;  // initial l; length of a Taylor step; longest step for the responses
    bool alone, never = false;  // l is undriven from now on; l is proved never to reach contact
    Pace pace = {0, PATIENCE, PATIENCE, 0};
    Motion motion = {};
    double b[ORDER + 1], force[ORDER], unit = 0;  // the series of l and of d ln xi / dt; the unit of their time [s]

    Encounter(const Values &values, double strength, const pretouch_pieces &along, double until, const Samples &at,
              Followed *carried, Course &course, const Sections &sections = {});
    void enter(int64_t to);
    void enter_section();
    void next_section();
    double section_end() const;
    double rest(double damping) const;
    double least_damping(double top) const;
    double floor_after() const;
    bool is_never() const;
    bool is_over(bool last);
    double scale() const;
    double reach() const;
    double expand_step();
    void cut(double tau);
    void carry(Accepted &step);
    void sample(double tau);
    void keep_extremes(double tau);
    void finish(double tau, double end);
    Status run();
};

// Integrate the polynomial of g on a piece, or that of a change of g: set `terms` to the terms of ln xi, without the
// constant one.
inline void set_terms(const double *g, int64_t count, double half, Lanes *terms) {
    double power = 1;
    for (int64_t j = 0; j < count; j++) {
        terms[j + 1] = all(g[j] * power / double(j + 1));
        power /= half;
    }
}

// Enter a piece of the curve.
inline void Encounter::enter(int64_t to) {
    index = to;
    piece = curve.piece(to);
    motion.middle = all(piece.middle);
    set_terms(piece.g, COEFFICIENTS, piece.half, motion.terms);
    const int64_t count = curve.width - 2;
    if (followed && followed->shape) set_terms(followed->shape + to * count, count, piece.half, followed->responses.shape);
}

inline Encounter::Encounter(const Values &values, double strength, const pretouch_pieces &along, double until,
                            const Samples &at, Followed *carried, Course &course, const Sections &sections)
    : m(values),
      gain(strength),
      curve{along},
      horizon(until),
      samples(at),
      followed(carried),
      row(course),
      later(sections) {
    l = start = m.p - m.x0;
    speed = m.v - m.u0;
    motion.damping = all(m.damping / m.mass);
    motion.stiffness = all(m.stiffness / m.mass);
    motion.gain = all(gain / m.mass);
    row = {};
    row.closest_distance = l;
    enter(curve.find(l));
    enter_section();
    if (followed) followed->responses.start(0, m.mass, (m.damping + gain * slope_at(piece, l).value) / m.mass);
    const double rate = fabs(m.damping + gain * piece.g[0]) / m.mass + sqrt(m.stiffness / m.mass);
    const double slow = rate > 0 ? 1.0 / rate : 1.0, crossing = 2 * piece.half / larger(fabs(speed), 1e-12);
    taylor = larger(smaller(smaller(slow, crossing), horizon), SHORTEST_UNIT);
}

// Set the obstacle's path to the present section. Proofs for all later times are possible only in the last section.
inline void Encounter::enter_section() {
    motion.position = all(m.p);
    motion.velocity = all(m.v);
    motion.acceleration = all(m.a);
    const bool rests = !later.count && m.v == 0 && m.a == 0;
    row.settling_distance = rests && m.stiffness > 0 && gain <= 0 ? m.p : INFINITY;
    alone = !later.count && is_left_alone(m);
    never = alone && is_never();
}

inline void Encounter::next_section() {
    m.p = later.next->p;
    m.v = later.next->v;
    m.a = later.next->a;
    later = {later.next + 1, later.count - 1};
    enter_section();
}

// The time at which the present section ends [s].
inline double Encounter::section_end() const { return later.count ? later.next->since : INFINITY; }

// The length [m] to which errors of l are relative: the initial l, or less once both l and the terms of the path are
// smaller than that.
inline double Encounter::scale() const {
    const double path = fabs(m.p) + (fabs(m.v) + fabs(m.a) / 2 * time) * time;
    return larger(l, smaller(start, path));
}

// The length of the step, as a multiple of the unit, for which the truncation errors of l and l' are at rounding level;
// at most 2.
inline double Encounter::reach() const {
    const double size = larger(larger(fabs(b[1]), fabs(b[2])), SLOW * scale());
    double part = 2;
    for (int k = ORDER - 1; k <= ORDER; k++) {
        if (b[k] == 0) continue;
        part = smaller(part, pow(1e-17 * scale() / fabs(b[k]), 1.0 / k));
        part = smaller(part, pow(LEFT_OUT * size / (k * fabs(b[k])), 1.0 / (k - 1)));
    }
    return part;
}

// Compute the series of the next step, by a long step of a stiff motion if possible, else by Taylor's method. Return
// the length for which the series is accurate, as a multiple of the unit. The step also ends at the horizon and at the
// end of the section.
inline double Encounter::expand_step() {
    const Borders used = curve.borders(index, 0);
    const double way = speed < 0 ? l - used.low : used.high - l, remaining = smaller(horizon, section_end()) - time;
    const double useful = smaller(remaining, AHEAD * way / larger(fabs(speed), 1e-300));
    memset(b, 0, sizeof b);
    memset(force, 0, sizeof force);
    unit = followed ? 0 : long_step(m, gain, piece, {time, l, speed}, taylor, useful, pace, b, force);
    double tau = 1;
    if (unit == 0) {
        unit = taylor;
        motion.state.time = all(time);
        motion.state.distance = all(l);
        motion.state.speed = all(speed);
        Lanes c[ORDER + 1], rates[ORDER];
        expand<DEGREE>(motion, obstacle_at(motion, motion.state.time), c, rates);
        double power = 1;
        for (int k = 0; k <= ORDER; k++) {
            b[k] = c[k][0] * power;
            if (k < ORDER - 1) force[k] = rates[k][0] * power;
            power *= unit;
        }
        tau = reach();
        taylor = larger(smaller(unit * tau, horizon), SHORTEST_UNIT);
        pace.doubt = LEFT_OUT * SLOW * scale() / taylor;
    }
    return smaller(tau, smaller(remaining, longest) / unit);
}

// Shorten the step to the part tau of its unit. This part becomes the new unit, and the series is rescaled to it.
inline void Encounter::cut(double tau) {
    double power = 1;
    for (int k = 0; k <= ORDER; k++) {
        b[k] *= power;
        power *= tau;
        motion.b[k] = all(b[k]);
    }
    unit *= tau;
    motion.length = all(unit);
}

// Propagate the responses over a step. If they are not accurate, shorten the step until they are.
inline void Encounter::carry(Accepted &step) {
    Responses &r = followed->responses;
    const auto carried = followed->shape ? carry_responses<DEGREE, SHAPED> : carry_responses<DEGREE>;
    cut(step.tau);
    step.tau = 1;
    for (bool smooth = false; !smooth && unit > SHORTEST_UNIT;) {
        smooth = carried(motion, r, all(time), Masks{} == 0, LEFT_ALONE) & 1;
        const double part = smaller(larger(0.9 * pow(LEFT_ALONE / r.excess[0], 1.0 / ORDER), 0.1), 2);
        longest = part * unit;
        if (smooth) break;
        cut(part);
        step = {1, look_at(b, 1.0).value, 0, false, 0};
    }
}

// Write the trace at the requested times inside the step.
inline void Encounter::sample(double tau) {
    for (; samples.count > 0 && *samples.times <= time + unit * tau; samples.count--) {
        const double t = *samples.times++;
        const Point<double> now = look_at(b, (t - time) / unit);
        double *columns = *samples.trace++;
        columns[0] = now.value;
        columns[1] = obstacle_at(m, t) - now.value;
        columns[2] = obstacle_speed(m, t) - now.slope / unit;
        columns[3] = m.a - now.bend / (unit * unit);
    }
}

// Update the largest demands, the closest distance and the integral of x~ by one step. The closest distance is found as
// the maximum of far - l, where far is at least |l| on the step.
inline void Encounter::keep_extremes(double tau) {
    enum { NEAR, EXCURSION, TRAVEL, SPEED, ACCELERATION, FORCE, KEPT };
    double q[ORDER + 1][8] = {}, far = 0, area = 0, power = 1;
    const double x[3] = {obstacle_at(m, time), obstacle_speed(m, time) * unit, m.a / 2 * unit * unit};
    const double own[3] = {(m.own_v + m.own_a * time / 2) * time - m.x0, (m.own_v + m.own_a * time) * unit,
                           m.own_a / 2 * unit * unit};
    for (int k = 0; k <= ORDER; k++) {
        q[k][NEAR] = -b[k];
        q[k][EXCURSION] = k < 3 ? x[k] - b[k] : -b[k];
        q[k][TRAVEL] = k < 3 ? q[k][EXCURSION] + own[k] : -b[k];
        q[k][FORCE] = k < ORDER ? gain * force[k] : 0.0;
        far += fabs(b[k]) * power;
        power *= tau;
        area += q[k][EXCURSION] / (k + 1) * power;
    }
    q[0][NEAR] += far;
    for (int k = 0; k < ORDER; k++) q[k][SPEED] = (k + 1) * q[k + 1][TRAVEL] / unit;
    for (int k = 0; k < ORDER - 1; k++) q[k][ACCELERATION] = (k + 1) * q[k + 1][SPEED] / unit;
    double best[8] = {0, row.largest_excursion, row.largest_travel, row.largest_speed, row.largest_acceleration,
                      row.largest_virtual_force};
    for (int i = 0; i < KEPT; i += WIDTH) {
        Polynomial<ORDER + 1> several;
        power = 1;
        for (int k = 0; k <= ORDER; k++) {
            several.at[k] = load(q[k] + i) * power;
            power *= tau;
        }
        store(best + i, largest(several, load(best + i), HALVINGS));
    }
    memcpy(&row.largest_excursion, best + EXCURSION, (KEPT - EXCURSION) * sizeof *best);
    row.closest_distance = smaller(row.closest_distance, far - best[NEAR]);
    row.displacement_integral += area * unit;
}

// Write the state at the end of a step, and make it the state from which the next step starts.
inline void Encounter::finish(double tau, double end) {
    const Point<double> last = look_at(b, tau);
    time += unit * tau;
    l = end;
    speed = last.slope / unit;
    row.time = time;
    row.distance = l;
    row.displacement = obstacle_at(m, time) - l;
    row.displacement_velocity = obstacle_speed(m, time) - speed;
    row.displacement_acceleration = m.a - last.bend / (unit * unit);
    row.relative_velocity = speed;
    row.virtual_force = gain * slope_at(piece, l).value * speed;
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
