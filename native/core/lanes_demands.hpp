// The largest demands on the robot along the Taylor steps of many encounters.
//
// During a step all demands are polynomials q(s), s in [0, 1]: the excursion y = -x~; the travel, which is y shifted by
// the motion of the reference; the velocity and acceleration of the robot, which are derivatives of the travel; and
// F_p. The values of |q| at both ends of each step are recorded. Inside a step, |q| can exceed them only if q' changes
// its sign, and then by at most the smaller of max q' and max -q'. These two are bounded in Bernstein form. If the
// bounds do not exclude a new maximum, the polynomial is queued. Once the queue is full, find_peaks finds the peaks.

#pragma once

#include "lanes_bernstein.hpp"
#include "lanes_windows.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int TERMS_OF_PEAK = ORDER + 1;
constexpr double SPARE = 64.0;  // the tolerance of steps is divided by this, since derivatives lose digits
constexpr double PEAK_ROUNDING = 1e-14;  // rounding error, relative to the terms of a sum
// Largest accepted truncation errors, relative to the largest value; STEEP_DOUBT is for second derivatives. An error is
// estimated by the last term that is used; the omitted terms are about 1/16 of it.
constexpr double DOUBT = 2e-10, STEEP_DOUBT = 5e-10;

enum { EXCURSION, TRAVEL, OWN_SPEED, OWN_ACCELERATION, FORCE, PEAKS };

// Quantities that are recorded with a motion. mass: M; first_speed: l' at the start; drift, pull: velocity and
// acceleration of the reference; x0: x~(0); best: the largest value of each demand so far; tail_speed, tail_bend: the
// largest last terms of y' and y''; terms_of_force: the largest sum of the magnitudes of the terms of F_p / M.
struct Demands {
    Lanes mass, first_speed, drift, pull, x0;
    Lanes best[PEAKS], tail_speed, tail_bend, terms_of_force;

    // Start the record of a new encounter in a lane.
    void start(int lane, double m, double speed, double x, double velocity, double acceleration) {
        mass[lane] = m;
        first_speed[lane] = speed;
        x0[lane] = x;
        drift[lane] = velocity;
        pull[lane] = acceleration;
        for (Lanes &value : best) value[lane] = 0.0;
        tail_speed[lane] = tail_bend[lane] = terms_of_force[lane] = 0.0;
    }
};

// Output rows of the demands, n numbers each; null for a demand that is not wanted.
struct DemandsOut {
    double *rows[PEAKS];
    int64_t n;

    bool wants(int row) const { return rows[row] != nullptr; }

    // Raise an output to a value if that is larger. NaN replaces every number, and stays.
    void raise_to(int row, int64_t i, double value) const {
        double &kept = rows[row][i];
        if (value > kept || value != value) kept = value;
    }
};

// The polynomials of the demands on one step, and the lanes in which each may have a peak inside the step.
struct StepDemands {
    Polynomial<TERMS_OF_PEAK> of[PEAKS];
    uint64_t inside[PEAKS];
};

// The lanes in which the step was accepted, the wanted demands, and the results of the examination of the step.
struct Watched {
    Masks moved;
    const DemandsOut &out;
    StepDemands &to;
};

// Record the polynomial of a demand and its values at both ends of the step. Decide whether it may have a peak inside.
// The demand is the polynomial times `unit`. If it is not wanted, nothing is done.
template <int N>
__attribute__((always_inline)) inline void keep(const Watched &step, Demands &d, int row, const Polynomial<N> &q,
                                                const Polynomial<N - 1> &slope, Lanes unit) {
    if (!step.out.wants(row)) return;
    unrolled<0, N>([&](auto k) __attribute__((always_inline)) {
        step.to.of[row].at[decltype(k)::value] = q.at[decltype(k)::value];
    });
    const Lanes end = total(q), largest = most(absolute(q.at[0]), absolute(end)) * unit;
    const Lanes best = most(d.best[row], largest);
    d.best[row] = where(step.moved, best, d.best[row]);
    const Range range = range_of(slope);
    const Lanes possible = largest + least(range.most, -range.least) * unit;
    step.to.inside[row] =
        bits(step.moved & (range.least < 0.0) & (0.0 < range.most) & (best * (1 + SMALL) < possible));
}

// Update a maximum in the lanes that moved.
__attribute__((always_inline)) inline void raise(Lanes &kept, Lanes value, Masks moved) {
    kept = where(moved, most(value, kept), kept);
}

// Compute the polynomials y = -x~ and travel = -(x - x(0)) on a step, with x the position of the robot.
__attribute__((always_inline)) inline void look_at_paths(const Motion &m, const Demands &d, Lanes start,
                                                         Polynomial<TERMS_OF_PEAK> &y,
                                                         Polynomial<TERMS_OF_PEAK> &travel) {
    const Lanes square = m.length * m.length;
    const Obstacle o = obstacle_at(m, start);
    unrolled<0, TERMS_OF_PEAK>([&](auto k) __attribute__((always_inline)) {
        y.at[decltype(k)::value] = m.b[decltype(k)::value];
    });
    y.at[0] = y.at[0] - o.position;
    y.at[1] = y.at[1] - o.velocity * m.length;
    y.at[2] = y.at[2] - m.acceleration * 0.5 * square;
    travel = y;
    travel.at[0] = (y.at[0] + d.x0) - (d.drift + (d.pull * 0.5) * start) * start;
    travel.at[1] = y.at[1] - (d.drift + d.pull * start) * m.length;
    travel.at[2] = y.at[2] - d.pull * 0.5 * square;
}

// Record all demands of one step in the lanes in which it was accepted.
template <bool IS_LINE>
__attribute__((noinline)) void look_at_step(const Motion &m, Demands &d, Lanes start, const Watched &step) {
    const Lanes length = m.length, one = all(1.0), inverse = one / length, square = inverse * inverse;
    const Lanes tail = absolute(m.b[ORDER]) * double(ORDER);
    raise(d.tail_speed, tail * inverse, step.moved);
    raise(d.tail_bend, tail * double(ORDER - 1) * square, step.moved);
    Polynomial<TERMS_OF_PEAK> y, travel;
    look_at_paths(m, d, start, y, travel);
    const auto first = slope_of(y), speed = slope_of(travel);
    keep(step, d, EXCURSION, y, first, one);
    keep(step, d, TRAVEL, travel, speed, one);
    const auto second = slope_of(first), acceleration = slope_of(speed);
    keep(step, d, OWN_SPEED, speed, acceleration, inverse);
    keep(step, d, OWN_ACCELERATION, acceleration, slope_of(acceleration), square);
    if (!step.out.wants(FORCE)) return;
    if constexpr (IS_LINE) {
        Polynomial<TERMS_OF_PEAK> l;
        unrolled<0, TERMS_OF_PEAK>([&](auto k) __attribute__((always_inline)) {
            l.at[decltype(k)::value] = m.b[decltype(k)::value];
        });
        const auto force = slope_of(l);
        keep(step, d, FORCE, force, slope_of(force), inverse);
    } else {
        const Lanes damping = m.damping * length, stiffness = m.stiffness * length * length;
        Polynomial<ORDER - 1> force;
        unrolled<0, ORDER - 1>([&](auto place) __attribute__((always_inline)) {
            constexpr int k = decltype(place)::value;
            force.at[k] = second.at[k] + damping * first.at[k] + stiffness * y.at[k];
        });
        keep(step, d, FORCE, force, slope_of(force), square);
        const Lanes speeds = absolute(total(second)) + absolute(damping) * absolute(total(first));
        raise(d.terms_of_force, (speeds + stiffness * absolute(total(y))) * square, step.moved);
    }
}

// Queue of polynomials whose peaks must be found, one per lane. unit: factor from the polynomial to the demand; whose:
// index of the encounter; which: the demand.
struct Room {
    Polynomial<TERMS_OF_PEAK> waiting;
    Lanes unit;
    int64_t whose[WIDTH];
    int which[WIDTH];
    int count;

    // Find the peaks of all queued polynomials, write them, and empty the queue.
    void settle(const DemandsOut &out) {
        if (count == 0) return;
        const Lanes peaks = find_peaks(waiting) * unit;
        for (int at = 0; at < count; at++) out.raise_to(which[at], whose[at], peaks[at]);
        count = 0;
    }
};

// How often the motion is differentiated for a demand: 0, 1 or 2 times. Its polynomial has that many coefficients fewer
// than TERMS_OF_PEAK.
constexpr int differentiated(int row, bool is_line) {
    return row < OWN_SPEED ? 0 : row == OWN_SPEED || (row == FORCE && is_line) ? 1 : 2;
}

// The factor from the recorded polynomial to the force |F_p|. The polynomial is l' for a constant slope, else F_p / M.
template <bool IS_LINE> double force_factor(const Motion &m, const Demands &d, int lane) {
    return d.mass[lane] * (IS_LINE ? absolute(m.gain[lane] * m.terms[1][lane]) : 1.0);
}

// Record the demands of an accepted step. Queue the polynomials that may have a peak inside it.
template <bool IS_LINE>
void follow_demands(const Motion &m, Demands &d, Lanes start, Masks moved, const int64_t *owners, Room &room,
                    const DemandsOut &out) {
    StepDemands demands;
    look_at_step<IS_LINE>(m, d, start, {moved, out, demands});
    for (int row = 0; row < PEAKS; row++) {
        if (!out.wants(row)) continue;
        for (uint64_t remaining = demands.inside[row]; remaining; remaining &= remaining - 1) {
            const int lane = __builtin_ctzll(remaining), power = differentiated(row, IS_LINE), at = room.count;
            if (row == FORCE && m.gain[lane] == 0) continue;
            for (int k = 0; k < TERMS_OF_PEAK; k++) {
                room.waiting.at[k][at] = k < TERMS_OF_PEAK - power ? demands.of[row].at[k][lane] : 0.0;
            }
            const double length = m.length[lane];
            const double unit = power == 0 ? 1.0 : 1.0 / (power == 1 ? length : length * length);
            room.unit[at] = unit * (row == FORCE ? force_factor<IS_LINE>(m, d, lane) : 1.0);
            room.whose[at] = owners[lane];
            room.which[at] = row;
            if (++room.count == WIDTH) room.settle(out);
        }
    }
}

// Write the demands of an encounter that has reached its contact, if they are accurate enough.
template <bool IS_LINE>
void write_demands(const Motion &m, const Demands &d, int lane, double time, int64_t i, const DemandsOut &out) {
    const double v = m.velocity[lane], a = m.acceleration[lane];
    // Rounding errors of quantities that are differences of larger ones. The guaranteed path has the same errors.
    const double approach = 2 * absolute(v) + absolute(d.first_speed[lane]) + absolute(a) * time;
    const double speed = PEAK_ROUNDING * (approach + absolute(d.drift[lane]));
    const double way = PEAK_ROUNDING * (absolute(m.position[lane]) + absolute(d.x0[lane])) + speed * time;
    const double bend = (absolute(m.damping[lane]) + m.state.strongest[lane]) * speed + m.stiffness[lane] * way +
                        PEAK_ROUNDING * absolute(a);
    const double error = m.state.error[lane], slip = d.tail_speed[lane], turn = d.tail_bend[lane];
    const auto keep_if = [&](int row, double lost, double doubt, double rounding) {
        if (!out.wants(row)) return;
        const double best = d.best[row][lane];
        out.raise_to(row, i, lost <= doubt * best + rounding ? best : NOT_A_NUMBER);
    };
    keep_if(EXCURSION, error, DOUBT, way);
    keep_if(TRAVEL, error, DOUBT, way);
    keep_if(OWN_SPEED, slip, DOUBT, speed);
    keep_if(OWN_ACCELERATION, turn, STEEP_DOUBT, bend);
    if (!out.wants(FORCE)) return;
    if (m.gain[lane] == 0) {
        out.rows[FORCE][i] = 0.0;
        return;
    }
    const double lost = IS_LINE ? slip * (STEEP_DOUBT / DOUBT) : turn + PEAK_ROUNDING * d.terms_of_force[lane];
    const double best = d.best[FORCE][lane];
    const double force = best * force_factor<IS_LINE>(m, d, lane);
    out.raise_to(FORCE, i, lost <= STEEP_DOUBT * best ? force : NOT_A_NUMBER);
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
