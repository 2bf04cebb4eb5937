// The largest demands on the robot along the Taylor steps of many encounters.
//
// During a step all demands are polynomials q(s), s in [0, 1]: with y = -x~ those of y, y shifted by the reference, y',
// y'' and F_p. Their values at the ends of the steps are recorded. Inside a step q can be larger only if q' changes its
// sign, and then by at most the smaller of max q' and max -q'. These two are bounded in Bernstein form. If the bounds
// do not suffice, the polynomial waits until all lanes are filled; find_peaks then finds its peak.

#pragma once

#include "lanes_bernstein.hpp"
#include "lanes_windows.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int TERMS_OF_PEAK = ORDER + 1;
constexpr double SPARE = 64.0;  // factor by which the tolerance of steps is reduced, since derivatives lose digits
constexpr double PEAK_ROUNDING = 1e-14;
// Relative to the largest value; estimates are the last terms used, omitted terms are 1/16 of them.
constexpr double DOUBT = 2e-10, STEEP_DOUBT = 5e-10;

enum { EXCURSION, TRAVEL, OWN_SPEED, OWN_ACCELERATION, FORCE, PEAKS };

// Quantities that are recorded with a motion.
struct Demands {
    Lanes mass, first_speed, drift, pull, x0;  // l' at the start, velocity and acceleration of the reference, x~(0)
    Lanes best[PEAKS], tail_speed, tail_bend, terms_of_force;

    // Start in a lane.
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

// The demands of one step, and the lanes in which each may have a peak inside it.
struct StepDemands {
    Polynomial<TERMS_OF_PEAK> of[PEAKS];
    uint64_t inside[PEAKS];
};

// The examined step and the lanes in which it was accepted.
struct Watched {
    Masks moved;
    StepDemands &to;
};

// Record a polynomial and its values at both ends; return the value at the end.
template <int N>
__attribute__((always_inline)) inline Lanes keep(const Watched &step, Demands &d, int row, const Polynomial<N> &q,
                                                 const Polynomial<N - 1> &slope, Lanes unit) {
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
    return end;
}

__attribute__((always_inline)) inline void raise(Lanes &kept, Lanes value, Masks moved) {
    kept = where(moved, most(value, kept), kept);
}

// x~ and x - x(0) over a step, with their signs turned
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

// Examine one step.
template <bool IS_LINE>
__attribute__((noinline)) void look_at_step(const Motion &m, Demands &d, Lanes start, const Watched &step) {
    const Lanes length = m.length, one = all(1.0), inverse = one / length, square = inverse * inverse;
    const Lanes tail = absolute(m.b[ORDER]) * double(ORDER);
    raise(d.tail_speed, tail * inverse, step.moved);
    raise(d.tail_bend, tail * double(ORDER - 1) * square, step.moved);
    Polynomial<TERMS_OF_PEAK> y, travel;
    look_at_paths(m, d, start, y, travel);
    const auto first = slope_of(y), speed = slope_of(travel);
    const Lanes way = keep(step, d, EXCURSION, y, first, one);
    keep(step, d, TRAVEL, travel, speed, one);
    const auto second = slope_of(first), acceleration = slope_of(speed);
    keep(step, d, OWN_SPEED, speed, acceleration, inverse);
    keep(step, d, OWN_ACCELERATION, acceleration, slope_of(acceleration), square);
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
        raise(d.terms_of_force, (speeds + stiffness * absolute(way)) * square, step.moved);
    }
}

// Output arrays of the demands, rows of n numbers.
struct DemandsOut {
    double *at;
    int64_t n;

    // Keep the larger value; NaN stays NaN.
    void raise_to(int row, int64_t i, double value) const {
        double &kept = at[row * n + i];
        if (value > kept || value != value) kept = value;
    }
};

// Queue of polynomials whose peaks must be found.
struct Room {
    Polynomial<TERMS_OF_PEAK> waiting;
    Lanes unit;
    int64_t whose[WIDTH];
    int which[WIDTH];
    int count;

    void settle(const DemandsOut &out) {
        if (count == 0) return;
        const Lanes found = find_peaks(waiting) * unit;
        for (int at = 0; at < count; at++) out.raise_to(which[at], whose[at], found[at]);
        count = 0;
    }
};

// Number of coefficients of a demand, and its order of differentiation.
constexpr int differentiated(int row, bool is_line) {
    return row < OWN_SPEED ? 0 : row == OWN_SPEED || (row == FORCE && is_line) ? 1 : 2;
}

// factor of the polynomial of the force, which is l' for a constant slope, else F_p / M
template <bool IS_LINE> double force_factor(const Motion &m, const Demands &d, int lane) {
    return d.mass[lane] * (IS_LINE ? absolute(m.gain[lane] * m.terms[1][lane]) : 1.0);
}

// Record the demands of an accepted step; queue those with a peak inside it.
template <bool IS_LINE>
void follow_demands(const Motion &m, Demands &d, Lanes start, Masks moved, const int64_t *owners, Room &room,
                    const DemandsOut &out) {
    StepDemands demands;
    look_at_step<IS_LINE>(m, d, start, {moved, demands});
    for (int row = 0; row < PEAKS; row++) {
        for (uint64_t left = demands.inside[row]; left; left &= left - 1) {
            const int lane = __builtin_ctzll(left), power = differentiated(row, IS_LINE), at = room.count;
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
    // rounding error of quantities that are differences of larger ones, also on the guaranteed path
    const double approach = 2 * absolute(v) + absolute(d.first_speed[lane]) + absolute(a) * time;
    const double speed = PEAK_ROUNDING * (approach + absolute(d.drift[lane]));
    const double way = PEAK_ROUNDING * (absolute(m.position[lane]) + absolute(d.x0[lane])) + speed * time;
    const double bend = (absolute(m.damping[lane]) + m.state.strongest[lane]) * speed + m.stiffness[lane] * way +
                        PEAK_ROUNDING * absolute(a);
    const double error = m.state.error[lane], slip = d.tail_speed[lane], turn = d.tail_bend[lane];
    const auto keep_if = [&](int row, double lost, double doubt, double rounding) {
        const double best = d.best[row][lane];
        out.raise_to(row, i, lost <= doubt * best + rounding ? best : NOT_A_NUMBER);
    };
    keep_if(EXCURSION, error, DOUBT, way);
    keep_if(TRAVEL, error, DOUBT, way);
    keep_if(OWN_SPEED, slip, DOUBT, speed);
    keep_if(OWN_ACCELERATION, turn, STEEP_DOUBT, bend);
    if (m.gain[lane] == 0) {
        out.at[FORCE * out.n + i] = 0.0;
        return;
    }
    const double lost = IS_LINE ? slip * (STEEP_DOUBT / DOUBT) : turn + PEAK_ROUNDING * d.terms_of_force[lane];
    const double best = d.best[FORCE][lane];
    const double force = best * force_factor<IS_LINE>(m, d, lane);
    out.raise_to(FORCE, i, lost <= STEEP_DOUBT * best ? force : NOT_A_NUMBER);
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
