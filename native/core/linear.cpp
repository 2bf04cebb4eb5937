// First contact and extremes of the linear motion L(8) of a curve with constant slope.
//
// With x~ = x - x_d, the motion is M x~'' + (D + c D_p) x~' + K x~ = c D_p (v_o + a_o t), and x~''' is a free response:
// so its zeros are known in closed form. Between two of them x~'' is monotone, so every line a + b t has at most one
// crossing with x~' there on each side of the one zero of x~'' + b: a chain that encloses every zero of l'', l' and l,
// one each. No contact can be missed, whatever the damping or the acceleration. What lies closer to zero than rounding
// lets one tell is decided by endings.hpp.

#include <string.h>

#include "endings.hpp"
#include "pretouch.h"
#include "response.hpp"

namespace pretouch {
namespace {

enum Status : int64_t { CONTACT, NEVER, HORIZON, LEFT_RANGE, UNRESOLVED };

constexpr double PI = 3.141592653589793;
constexpr int MAX_INTERVALS = 2000000;
constexpr double VANISHED = 600.0;  // time constants after which a motion about l = 0 is below 1e-260 of its start:
                                    // it has come to rest

// A row of COLUMNS of motion/layout.py.
struct Row {
    double time, distance, displacement, displacement_velocity, displacement_acceleration, relative_velocity;
    double virtual_force, largest_excursion, largest_travel, largest_speed, largest_acceleration;
    double largest_virtual_force, closest_distance, settling_distance, displacement_integral;
};
static_assert(sizeof(Row) == 15 * sizeof(double) && sizeof(Values) == 10 * sizeof(double));

struct Limits {
    double horizon, low, high;  // time [s] and the valid distances [m]
};

// One encounter of L(7).
struct Encounter {
    const Values &values;
    System system;    // of x~
    Motion motion;    // x~
    double coupling;  // g D_p
};

struct Distance {
    double value, slope;  // l and l'
};

struct Exit {
    double time, level;
    bool touched;
};

// of equal or unordered numbers the first
inline double larger(double x, double y) { return y > x ? y : x; }
inline double smaller(double x, double y) { return y < x ? y : x; }

// l and l' by L(10): the obstacle of L(9) less the response x~.
Distance distance_at(const Encounter &e, double t) {
    const Response x = e.motion.at<2>(t);
    const Values &m = e.values;
    return {m.p + (m.v + m.a * t / 2) * t - x.y, m.v + m.a * t - x.velocity};
}

// A derivative of x~ and a line between two times: x~^(order)(t) + a + b t, order 1 or 2.
struct Line {
    int order;
    double a, b, left, right;

    double at(const Motion &motion, double t) const {
        return (order == 1 ? motion.velocity(t) : motion.acceleration(t)) + a + b * t;
    }
    bool operator==(const Line &) const = default;
};

// Finds the zero of a line that changes its sign once in between, or the right end where it does not.
double find_zero(const Motion &motion, const Line &line) {
    double left = line.left, right = line.right;
    double f_left = line.at(motion, left), f_right = line.at(motion, right);
    if (!((f_left < 0 && 0 < f_right) || (f_right < 0 && 0 < f_left))) return right;
    double width = right - left;
    for (int k = 0; k < 200; k++) {
        double guess = left + f_left * (right - left) / (f_left - f_right);
        if (k % 3 == 2) {  // regula falsi must halve the bracket in three steps, or bisection does
            if (right - left > 0.5 * width) guess = 0.5 * (left + right);
            width = right - left;
        }
        const double f_guess = line.at(motion, guess);
        if (f_guess == 0) return guess;
        if ((f_guess < 0) == (f_left < 0)) {
            left = guess, f_left = f_guess;
            f_right *= 0.5;  // Illinois: the end that stays counts half
        } else {
            right = guess, f_right = f_guess;
            f_left *= 0.5;
        }
        if (right - left <= 1e-13 * right) break;
    }
    return right;
}

// Zeros between two breaks of a motion: contact and extremes ask for the same ones.
struct Zeros {
    const Motion &motion;
    Line lines[12];  // three for first_exit, and for each of the lines of follow_extremes
    double found[12];
    int count;

    double of(const Line &line) {
        for (int k = 0; k < count; k++)
            if (lines[k] == line) return found[k];
        lines[count] = line;
        return found[count++] = find_zero(motion, line);
    }
};

// Finds where a monotone l passes a level between left and right: Newton's method held in the bracket.
double crossing(const Encounter &e, double level, double left, double right) {
    const bool rising = distance_at(e, right).value > level;
    double t = left, width = right - left;
    for (int k = 0; k < 200; k++) {
        const Distance l = distance_at(e, t);
        ((l.value > level) == rising ? right : left) = t;
        const double step = t - (l.value - level) / l.slope;
        if (fabs(step - t) <= 4e-16 * fabs(t)) return t;
        bool slow = false;
        if (k % 4 == 3) {  // a step on an exponential is its time constant, however far the end: bisection is faster
            slow = right - left > 0.5 * width;
            width = right - left;
        }
        t = left <= step && step <= right && !slow ? step : 0.5 * (left + right);
        if (right - left <= 4e-16 * right) return right;
    }
    return t;
}

// The k-th positive zero of x~''', infinite where there is none.
double next_break(const System &m, int k) {
    const double sigma = m.damping / (2 * m.mass), square = m.stiffness / m.mass;
    const double a0 = (m.f0 - m.stiffness * m.y0 - m.damping * m.v0) / m.mass;
    const double j0 = m.f1 / m.mass - 2 * sigma * a0 - square * m.v0;
    const double disc = (m.damping * m.damping - 4 * m.mass * m.stiffness) / (4 * m.mass * m.mass);
    if (disc < 0) {
        const double root = sqrt(-disc), period = PI / root;
        // x~''' ~ j0 cos(w t) - (sigma j0 + w0^2 a0) sin(w t) / w
        double first = atan2(j0 * root, sigma * j0 + square * a0) / root;
        first -= floor(first / period) * period;
        if (first <= 0) first += period;
        return first + k * period;
    }
    if (k > 0 || j0 == 0) return INFINITY;
    const double quotient = sigma + square * a0 / j0;
    if (quotient * quotient <= disc || quotient <= 0) return INFINITY;
    const double ratio = sqrt(disc) / quotient;
    const double scaled = ratio < 1e-5 ? 1.0 + ratio * ratio / 3 : atanh(ratio) / ratio;
    return scaled / quotient;
}

// Bounds l from below after t: a particular motion that recedes less a free rest that decays; else -inf.
double floor_after(const Encounter &e, double t) {
    const System &m = e.system;
    const Values &values = e.values;
    if (m.damping < 0 || values.a < 0 || m.stiffness == 0) return -INFINITY;
    const double drift = m.f1 / m.stiffness, center = (m.f0 - m.damping * drift) / m.stiffness + drift * t;
    const double particular = values.p + (values.v + values.a * t / 2) * t - center;
    const double speed = values.v + values.a * t - drift;
    if (speed < 0) return -INFINITY;
    const Distance l = distance_at(e, t);
    const double rest = l.value - particular, rest_slope = l.slope - speed;
    return particular - sqrt(rest * rest + rest_slope * rest_slope * m.mass / m.stiffness);
}

// The distance at which the motion comes to rest, infinite where it does not.
double settling(const Values &m, double damping) {
    if (!is_left_alone(m) || damping <= 0) return INFINITY;
    return m.stiffness > 0 ? m.p : m.p - m.x0 + (m.v - m.u0) * m.mass / damping;
}

// Raises the largest and lowers the smallest quantities of a row to those at t.
void keep_extremes(const Encounter &e, double t, Row &row) {
    const Response x = e.motion.at<2>(t);
    const Values &m = e.values;
    row.largest_excursion = larger(row.largest_excursion, fabs(x.y));
    row.largest_travel = larger(row.largest_travel, fabs(x.y - m.x0 + (m.own_v + m.own_a * t / 2) * t));
    row.largest_speed = larger(row.largest_speed, fabs(x.velocity + m.own_v + m.own_a * t));
    row.largest_acceleration = larger(row.largest_acceleration, fabs(x.acceleration + m.own_a));
    row.largest_virtual_force =
        larger(row.largest_virtual_force, fabs(e.coupling * (m.v + m.a * t - x.velocity)));
    row.closest_distance = smaller(row.closest_distance, m.p + (m.v + m.a * t / 2) * t - x.y);
}

// The first time in (left, right] at which l leaves (low, high), the level, and whether it is only touched; the time is
// infinite where l does not leave. Between left and right l'' is monotone.
Exit first_exit(const Encounter &e, Zeros &zeros, double low, double high, double left, double right) {
    const Values &m = e.values;
    const double bend = zeros.of({2, -m.a, 0.0, left, right});
    const double bend_ends[] = {bend, right};
    double start = left;
    for (const double bend_end : bend_ends) {
        const double ends[] = {zeros.of({1, -m.v, -m.a, start, bend_end}), bend_end};
        for (const double end : ends) {
            if (!(end > start)) continue;
            const Distance l = distance_at(e, end);
            const bool turns = l.slope >= 0 || end < bend_end;
            if (turns && fabs(l.value - low) <= resolution(m, end) && distance_at(e, start).slope < 0)
                return {end, low, true};
            if (l.value <= low) return {crossing(e, low, start, end), low, false};
            if (l.value > high) return {crossing(e, high, start, end), high, false};
            start = end;
        }
    }
    return {INFINITY, 0.0, false};
}

// Updates the extremes of a row over (left, stop], inside (left, right) where x~'' is monotone.
void follow_extremes(const Encounter &e, Zeros &zeros, double left, double right, double stop, Row &row) {
    const Values &m = e.values;
    keep_extremes(e, stop, row);
    const struct {
        double a, b;
    } lines[] = {{-m.v, -m.a}, {0.0, 0.0}, {m.own_v, m.own_a}};
    for (const auto &line : lines) {
        const double bend_ends[] = {zeros.of({2, line.b, 0.0, left, right}), right};
        double start = left;
        for (const double bend_end : bend_ends) {
            const double moments[] = {zeros.of({1, line.a, line.b, start, bend_end}), bend_end};
            for (const double moment : moments)
                if (moment < stop) keep_extremes(e, moment, row);
            start = bend_end;
        }
    }
}

// Writes the state at t.
void finish(const Encounter &e, double t, Row &row) {
    const Response x = e.motion.at(t);
    const Values &m = e.values;
    row.time = t;
    row.distance = m.p + (m.v + m.a * t / 2) * t - x.y;
    row.displacement = x.y;
    row.displacement_velocity = x.velocity;
    row.displacement_acceleration = x.acceleration;
    row.relative_velocity = m.v + m.a * t - x.velocity;
    row.virtual_force = e.coupling * row.relative_velocity;
    row.displacement_integral = x.integral;
}

// Whether l is proved to stay above 0 and within the range for good, at its end or close to its least.
bool is_over(const Encounter &e, double t, bool last, double high, bool never, Row &row) {
    const bool settles = row.settling_distance < INFINITY;
    const double floor =
        e.values.stiffness == 0 && settles ? row.settling_distance : floor_after(e, t);
    // what recedes leaves a range that ends; what swings about its resting place may
    bool stays = high == INFINITY || (settles && 2 * row.settling_distance - floor <= high);
    if (never) {
        stays = stays || row.relative_velocity <= 0;  // then l falls from here on
    } else if (!(floor > 0)) {
        return false;
    }
    if (!(stays && (last || row.closest_distance <= floor * (1 + 1e-12)))) return false;
    if (settles) {
        row.settling_distance = larger(row.settling_distance, 0.0);
        row.closest_distance = smaller(row.closest_distance, row.settling_distance);
    }
    row.distance = larger(row.distance, 0.0);
    row.closest_distance = larger(row.closest_distance, 0.0);
    return true;
}

// Writes how an encounter ends that leaves its range.
Status leave(const Exit &exit, double high, Row &row) {
    row.distance = exit.level;
    row.closest_distance = exit.level < high ? exit.level : smaller(row.closest_distance, exit.level);
    if (exit.touched) {
        row.displacement_velocity += row.relative_velocity;
        row.relative_velocity = row.virtual_force = 0.0;
    }
    return exit.level == 0.0 ? CONTACT : LEFT_RANGE;
}

// Solves one encounter of L(7), in the distance L(8), up to its first l = 0.
Status solve(const Encounter &e, const Limits &limits, Row &row) {
    const Values &values = e.values;
    const double sigma = e.system.damping / (2 * e.system.mass), level = larger(limits.low, 0.0);
    double horizon = limits.horizon, vanished = INFINITY, left = 0.0;
    // a motion that grows has shown its sign long before its numbers overflow
    if (sigma < 0) horizon = smaller(horizon, 300.0 / -sigma);
    const bool alone = is_left_alone(values);
    if (alone && values.p == 0 && values.stiffness > 0 && sigma > 0) {
        vanished = VANISHED / sigma;
        horizon = smaller(horizon, vanished);
    }
    row.largest_excursion = row.largest_travel = row.largest_speed = 0.0;
    row.largest_acceleration = row.largest_virtual_force = 0.0;
    row.closest_distance = INFINITY;
    row.settling_distance = settling(values, e.system.damping);
    keep_extremes(e, 0.0, row);
    bool never = false;
    for (int k = 0; k < MAX_INTERVALS; k++) {
        const double right = smaller(next_break(e.system, k), horizon);
        if (!(right > left)) continue;
        if (alone && !never) {
            const Distance l = distance_at(e, left);
            never = never_arrives(values, e.system.damping, l.value, l.slope, level);
        }
        Zeros zeros = {e.motion, {}, {}, 0};
        const Exit exit = first_exit(e, zeros, never ? -INFINITY : level, limits.high, left, right);
        const double stop = smaller(exit.time, right);
        follow_extremes(e, zeros, left, right, stop, row);
        finish(e, stop, row);
        if (exit.time < INFINITY) return leave(exit, limits.high, row);
        never = never || right >= vanished;
        if (is_over(e, right, right >= horizon, limits.high, never, row)) return NEVER;
        if (right >= horizon) return HORIZON;
        left = right;
    }
    return UNRESOLVED;
}

// What a negative damping has made of the rounding of the start until t [m]; 0 without one.
double rounding(const Values &m, double coupling, double t) {
    const double damping = m.damping + coupling;
    if (damping >= 0) return 0.0;
    const double root = sqrt(larger(damping * damping - 4 * m.mass * m.stiffness, 0.0));
    const double rate = (root - damping) / (2 * m.mass);
    const double size = fabs(m.x0) + fabs(m.p) + (fabs(m.u0) + fabs(m.v)) / rate + fabs(m.a) / (rate * rate);
    return 2e-16 * size * exp(smaller(rate * t, 700.0));
}

}  // namespace
}  // namespace pretouch

void pretouch_solve_linear(const double *values, int64_t n, double slope, const double *gains, double horizon,
                           double low, double high, double *rows, int64_t *status) {
    using namespace pretouch;
    for (int64_t i = 0; i < n; i++) {
        Values m;
        Row row = {};
        memcpy(&m, values + 10 * i, sizeof m);
        const double c = slope * gains[i];
        const System system = {m.mass, m.damping + c, m.stiffness, m.x0, m.u0, c * m.v, c * m.a};
        const Encounter encounter = {m, system, Motion(system), c};
        status[i] = solve(encounter, {horizon, low, high}, row);
        if (rounding(m, c, row.time) > 1e-6 * (m.p - m.x0)) row.time = NAN;  // not a number that could be trusted
        memcpy(rows + 15 * i, &row, sizeof row);
    }
}

void pretouch_respond(const double *rows, int64_t n, const double *times, int64_t m, double *out, int64_t stride,
                      int64_t step, int64_t count) {
    using namespace pretouch;
    for (int64_t i = 0; i < n; i++) {
        System system;
        memcpy(&system, rows + 7 * i, sizeof system);
        const Motion motion(system);
        for (int64_t j = 0; j < m; j++) {
            const Response x = motion.at(times[i * m + j]);
            memcpy(out + i * stride + j * step, &x, (size_t)count * sizeof(double));
        }
    }
}
