// First contact and extrema of the linear motion L(8), for a sensor curve with constant slope.
//
// With x~ = x - x_d, the motion is M x~'' + (D + c D_p) x~' + K x~ = c D_p (v_o + a_o t), and x~''' is a free response
// whose zeros have a closed form. Between two of them x~'' is monotone, so x~'' + b has at most one zero there. On each
// side of this zero, x~' + a + b t is monotone and has at most one zero, too. This chain brackets every zero of l'', l'
// and l separately, so no contact can be missed, for any damping and acceleration. The rules of pieces.hpp decide which
// distances count as zero within rounding errors.

#include <string.h>

#include "pieces.hpp"
#include "pretouch.h"
#include "response.hpp"

namespace pretouch {
namespace {

enum Status : int64_t { CONTACT, NEVER, HORIZON, LEFT_RANGE, UNRESOLVED };

constexpr double PI = 3.141592653589793;
constexpr int MAX_INTERVALS = 10000;  // half periods of an oscillation; a motion that needs more is unresolved
constexpr double VANISHED = 600.0;  // time constants after which a motion about l = 0 counts as at rest, because it has
                                    // decayed to less than 1e-260 of its start

struct Limits {
    double horizon, low, high;  // longest time [s], smallest and largest valid distance [m]
};

// One encounter of L(7).
struct Encounter {
    const Values &m;
    double coupling;  // g D_p
    Motion motion;    // x~
};

// x~ and its derivatives at one time by L(10), and l and l': position and velocity of the obstacle, L(9), minus those
// of x~.
struct Instant {
    double time;
    Response x;
    double l, speed;
    bool turns;  // whether this may be a zero of l'
};

Instant instant(const Encounter &e, double t) {
    const Response x = e.motion.at(t);
    return {t, x, e.m.p + (e.m.v + e.m.a * t / 2) * t - x.y[0], e.m.v + e.m.a * t - x.y[1], false};
}

// The function x~^(order)(t) + a + b t + c t^2: a derivative of x~ plus a parabola. close: relative tolerance of the
// time of its zero.
struct Line {
    int order;
    double a, b, c, close;

    double at(const Instant &i) const { return i.x.y[order] + a + (b + c * i.time) * i.time; }
    double slope(const Instant &i) const { return i.x.y[order + 1] + b + 2 * c * i.time; }
};

// Returns the zero of a function that changes its sign at most once between two instants, by Newton's method with
// bisection. If it does not change its sign, the result is `last`; if it is zero at `first`, the result is `first`.
Instant zero(const Encounter &e, const Line &line, const Instant &first, const Instant &last) {
    const double start = line.at(first), end = line.at(last);
    if (start == 0) return first;
    if (!((start < 0 && 0 < end) || (end < 0 && 0 < start))) return last;
    double left = first.time, right = last.time, width = right - left;
    Instant here = instant(e, left + start * (right - left) / (start - end));
    for (int k = 0; k < 200; k++) {
        const double t = here.time, value = line.at(here), step = t - value / line.slope(here);
        ((value < 0) == (start < 0) ? left : right) = t;
        if (value == 0 || fabs(step - t) <= line.close * t || right - left <= line.close * right) break;
        bool slow = false;
        // On an exponential, a Newton step has the length of its time constant, even if the zero is far away. If four
        // iterations have not halved the interval, one bisection is faster.
        if (k % 4 == 3) {
            slow = right - left > 0.5 * width;
            width = right - left;
        }
        here = instant(e, left <= step && step <= right && !slow ? step : 0.5 * (left + right));
    }
    return here;
}

// The positive zero of x~''' with index k, from 0; infinite if there is none.
double next_break(const Motion &m, int k) {
    if (m.disc < 0) {
        const double root = sqrt(-m.disc), period = PI / root;
        // x~''' ~ j0 cos(w t) - (sigma j0 + w0^2 a0) sin(w t) / w
        double first = atan2(m.j0 * root, m.sigma * m.j0 + m.square * m.a0) / root;
        first -= floor(first / period) * period;
        if (first <= 0) first += period;
        return first + k * period;
    }
    if (k > 0 || m.j0 == 0) return INFINITY;
    const double quotient = m.sigma + m.square * m.a0 / m.j0;
    if (quotient * quotient <= m.disc || quotient <= 0) return INFINITY;
    const double ratio = sqrt(m.disc) / quotient;
    const double scaled = ratio < 1e-5 ? 1.0 + ratio * ratio / 3 : atanh(ratio) / ratio;
    return scaled / quotient;
}

// The turning points of l, x~ and the plant's position x in (left, right], the extrema of their velocities, and the
// right end, in ascending order. Between neighboring instants all these quantities are monotone. x~''' must have no
// zero inside.
struct Moments {
    Instant of[10];  // one extremum and two zeros of each of the three velocities, and the right end
    int count;

    Moments(const Encounter &e, const Instant &left, const Instant &right) : of{right}, count(1) {
        const Values &m = e.m;
        const Line lines[] = {{1, -m.v, -m.a, 0, 1e-13}, {1, 0, 0, 0, 1e-13}, {1, m.own_v, m.own_a, 0, 1e-13}};
        Instant bend = right;
        for (int k = 0; k < 3; k++) {
            const Line &line = lines[k], &before = lines[k > 0 ? k - 1 : 2];
            const bool same = k > 0 && line.b == before.b;
            if (same && line.a == before.a) continue;
            if (!same) keep(left, bend = zero(e, {2, line.b, 0, 0, 1e-13}, left, right), false);
            keep(left, zero(e, line, left, bend), k == 0);
            keep(left, zero(e, line, bend, right), k == 0);
        }
    }

  private:
    void keep(const Instant &left, Instant moment, bool turns) {
        if (!(left.time < moment.time && moment.time < of[count - 1].time)) return;
        moment.turns = turns;
        int k = count++;
        for (; k > 0 && !(of[k - 1].time < moment.time); k--) of[k] = of[k - 1];
        of[k] = moment;
    }
};

// Returns a lower bound of l from an instant on [m], -infinity if none is known. l is the sum of a particular motion
// and a free motion. If the particular motion recedes, it stays above its present value. The free motion decays if the
// damping is not negative, so its amplitude stays below the one that follows from its present energy.
double floor_after(const Encounter &e, const Instant &i) {
    const Values &m = e.m;
    const Motion &x = e.motion;
    const double t = i.time;
    if (x.sigma < 0 || m.a < 0 || m.stiffness == 0) return -INFINITY;
    const double drift = x.c1 / x.square, center = (x.c0 - 2 * x.sigma * drift) / x.square + drift * t;
    const double particular = m.p + (m.v + m.a * t / 2) * t - center;
    const double speed = m.v + m.a * t - drift;
    if (speed < 0) return -INFINITY;
    const double rest = i.l - particular, rest_slope = i.speed - speed;
    return particular - sqrt(rest * rest + rest_slope * rest_slope / x.square);
}

// The distance at which the motion comes to rest [m]; infinite if it does not come to rest.
double settling(const Values &m, double damping) {
    if (!is_left_alone(m) || damping <= 0) return INFINITY;
    return m.stiffness > 0 ? m.p : m.p - m.x0 + (m.v - m.u0) * m.mass / damping;
}

// Updates the maxima and the minimum of a row with the values at an instant.
void keep_extremes(const Encounter &e, const Instant &i, Course &row) {
    const Values &m = e.m;
    const double t = i.time, *x = i.x.y;
    row.largest_excursion = larger(row.largest_excursion, fabs(x[0]));
    row.largest_travel = larger(row.largest_travel, fabs(x[0] - m.x0 + (m.own_v + m.own_a * t / 2) * t));
    row.largest_speed = larger(row.largest_speed, fabs(x[1] + m.own_v + m.own_a * t));
    row.largest_acceleration = larger(row.largest_acceleration, fabs(x[2] + m.own_a));
    row.largest_virtual_force = larger(row.largest_virtual_force, fabs(e.coupling * i.speed));
    row.closest_distance = smaller(row.closest_distance, i.l);
}

// Returns whether l is proved to stay above 0 and within the valid range at all later times. Before the horizon (`last`
// is false), the result is true only if the closest distance is final, too: the lower bound of the later l is not
// smaller, except for rounding. never: whether l is known never to reach the level of a contact. If the result is true,
// the closest distance includes the resting place, and rounding errors below 0 of the distances in the row are removed.
bool is_over(const Encounter &e, const Instant &i, bool last, double high, bool never, Course &row) {
    const bool settles = row.settling_distance < INFINITY;
    const double floor = e.m.stiffness == 0 && settles ? row.settling_distance : floor_after(e, i);
    // A receding motion leaves any bounded range. An oscillation about a resting place stays inside if its amplitude is
    // small enough.
    bool stays = high == INFINITY || (settles && 2 * row.settling_distance - floor <= high);
    if (never) {
        stays = stays || i.speed <= 0;  // since l falls from here on
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

// Writes the state at an instant to the row.
void finish(const Encounter &e, const Instant &i, Course &row) {
    row.time = i.time;
    row.distance = i.l;
    row.displacement = i.x.y[0], row.displacement_velocity = i.x.y[1], row.displacement_acceleration = i.x.y[2];
    row.relative_velocity = i.speed;
    row.virtual_force = e.coupling * i.speed;
    row.displacement_integral = i.x.integral;
}

// Advances from one instant to the next, between which l is monotone, and updates the extrema. Returns whether l has
// left (low, high). If so, `i` becomes the instant at which it did, and the row gets its state with exactly the
// distance of the level. At a touch, which is a minimum within rounding errors of the level, l' is set to 0.
bool leaves(const Encounter &e, double low, double high, const Instant &before, Instant &i, Course &row) {
    const Values &m = e.m;
    const bool turned = (i.turns || i.speed >= 0) && before.speed < 0;
    const bool touches = turned && fabs(i.l - low) <= resolution(m, i.time), passes = !touches && i.l <= low;
    const bool outside = touches || passes || i.l > high;
    const double level = touches || passes ? low : high;
    if (outside && !touches) i = zero(e, {0, level - m.p, -m.v, -m.a / 2, 4e-16}, before, i);
    keep_extremes(e, i, row);
    if (!outside) return false;
    finish(e, i, row);
    row.distance = level;
    row.closest_distance = level < high ? level : smaller(row.closest_distance, level);
    if (touches) {
        row.displacement_velocity += row.relative_velocity;
        row.relative_velocity = row.virtual_force = 0.0;
    }
    return true;
}

// Solves one encounter of L(7) for the distance l of L(8), up to the first contact, l = 0, or to another end of the
// motion.
Status solve(const Encounter &e, const Limits &limits, Course &row) {
    const Values &m = e.m;
    const double sigma = e.motion.sigma, damping = m.damping + e.coupling, level = larger(limits.low, 0.0);
    double horizon = limits.horizon, vanished = INFINITY;
    // The sign of l of a growing motion is decided long before its numbers overflow.
    if (sigma < 0) horizon = smaller(horizon, 300.0 / -sigma);
    const bool alone = is_left_alone(m);
    if (alone && m.p == 0 && m.stiffness > 0 && sigma > 0) {
        vanished = VANISHED / sigma;
        horizon = smaller(horizon, vanished);
    }
    row.closest_distance = INFINITY;
    row.settling_distance = settling(m, damping);
    Instant left = instant(e, 0.0);
    keep_extremes(e, left, row);
    bool never = false;
    for (int k = 0; k < MAX_INTERVALS; k++) {
        const double end = smaller(next_break(e.motion, k), horizon);
        if (!(end > left.time)) continue;
        never = never || (alone && never_arrives(m, damping, left.l, left.speed, level));
        Moments moments(e, left, instant(e, end));
        for (int j = 0; j < moments.count; j++) {
            Instant &next = moments.of[j];
            if (leaves(e, never ? -INFINITY : level, limits.high, left, next, row))
                return row.distance == 0.0 ? CONTACT : LEFT_RANGE;
            left = next;
        }
        finish(e, left, row);
        never = never || end >= vanished;
        if (is_over(e, left, end >= horizon, limits.high, never, row)) return NEVER;
        if (end >= horizon) return HORIZON;
    }
    return UNRESOLVED;
}

// Rounding error of l at the time t [m], which a negative damping amplifies from the start on; 0 for other dampings.
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

using namespace pretouch;

void pretouch_solve_linear(const double *values, int64_t n, double slope, const double *gains, double horizon,
                           double low, double high, double *rows, int64_t *status) {
    for (int64_t i = 0; i < n; i++) {
        const Values &m = reinterpret_cast<const Values *>(values)[i];
        const double c = slope * gains[i];
        const Encounter one = {m, c, Motion({m.mass, m.damping + c, m.stiffness, m.x0, m.u0, c * m.v, c * m.a})};
        Course &row = reinterpret_cast<Course *>(rows)[i] = {};
        status[i] = solve(one, {horizon, low, high}, row);
        if (rounding(m, c, row.time) > 1e-6 * (m.p - m.x0)) row.time = NAN;  // the result is not reliable
    }
}

void pretouch_respond(const double *rows, int64_t n, const double *times, int64_t m, double *out, int64_t stride,
                      int64_t step, int64_t count) {
    for (int64_t i = 0; i < n; i++) {
        const Motion motion(reinterpret_cast<const System *>(rows)[i]);
        for (int64_t j = 0; j < m; j++) {
            const Response x = motion.at(times[i * m + j]);
            memcpy(out + i * stride + j * step, &x, (size_t)count * sizeof(double));
        }
    }
}
