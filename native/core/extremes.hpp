// What one step of the guaranteed path adds to the largest demands, the smallest distance and the integral of x~.

#pragma once

#include "series.hpp"

namespace pretouch {

// What is written of an encounter: COLUMNS of motion/layout.py.
struct Course {
    double time, distance, displacement, displacement_velocity, displacement_acceleration, relative_velocity;
    double virtual_force;
    double largest_excursion, largest_travel, largest_speed, largest_acceleration, largest_virtual_force;
    double closest_distance, settling_distance, displacement_integral;
};

constexpr int COUNT = ORDER + 2;  // of coefficients, in pairs

// tau^k, and k tau^k.
struct Powers {
    double of[COUNT], slopes[COUNT];

    explicit Powers(double tau) {
        double power = 1;
        for (int k = 0; k < COUNT; k++) {
            of[k] = power;
            slopes[k] = k * power;
            power *= tau;
        }
    }
};

// A polynomial in tau, of an even number of coefficients, and what is added to it, shift + tilt tau.
template <int N> struct Shifted {
    const double *c;
    double shift, tilt;

    double size_at(double tau) const { return fabs(horner<N - 1>(c, tau) + shift + tilt * tau); }
    double slope_at(double tau) const { return horner_slope<N - 1>(c, tau) + tilt; }
};

// Where the slope is zero between two places of different signs of it, by regula falsi (Illinois); the peak is flat, so
// that the place is good enough where the height can no longer grow by a rounding of the largest one.
template <int N> inline double turn_between(const Shifted<N> &p, Pair places, Pair slopes, double largest) {
    constexpr int MOST = 30;
    constexpr double FLAT = 1e-17;
    double place = places[0];
    int before = -1;
    for (int i = 0; i < MOST; i++) {
        place = (places[0] * slopes[1] - places[1] * slopes[0]) / (slopes[1] - slopes[0]);
        const double slope = p.slope_at(place);
        if (!(fabs(slope) * (places[1] - places[0]) > FLAT * largest)) return place;
        const int side = slope * slopes[1] > 0;
        places[side] = place;
        slopes[side] = slope;
        if (side == before) slopes[1 - side] *= 0.5;
        before = side;
    }
    return place;
}

// The larger of best and the sizes at the places where the slope changes its sign between eight parts of a step.
template <int N> inline double turning_peak(const Shifted<N> &p, double tau, double best) {
    constexpr int PARTS = 8;
    const double *c = p.c;
    Pair places[PARTS / 2], slopes[PARTS / 2];
    for (int i = 0; i < PARTS / 2; i++) {
        places[i] = Pair{tau * (2 * i + 1) / PARTS, tau * (2 * i + 2) / PARTS};
        slopes[i] = (N - 1) * c[N - 1] - Pair{};
    }
    for (int k = N - 2; k > 0; k--) {
        for (int i = 0; i < PARTS / 2; i++) slopes[i] = slopes[i] * places[i] + k * c[k];
    }
    double left = 0, slope_left = c[1] + p.tilt;
    if (slope_left == 0) slope_left = c[2];  // from rest: the way that it bends
    for (int i = 0; i < PARTS; i++) {
        const double right = places[i / 2][i % 2], slope_right = slopes[i / 2][i % 2] + p.tilt;
        if (slope_left * slope_right < 0) {
            best = larger(best, p.size_at(turn_between(p, Pair{left, right}, Pair{slope_left, slope_right}, best)));
        }
        left = right;
        slope_left = slope_right;
    }
    return best;
}

// The larger of so_far and max |p(s) + shift + tilt s| over s in [0, tau].
template <int N> inline double peak(const Shifted<N> &p, const Powers &powers, double so_far) {
    Pair value = {}, rest = {}, bend = {};
    for (int k = 2; k < N; k += 2) {
        const Pair c = {p.c[k], p.c[k + 1]}, power = {powers.of[k], powers.of[k + 1]};
        const Pair slope = {powers.slopes[k], powers.slopes[k + 1]}, size = size_of(c);
        value += c * power;
        rest += size * power;
        bend += size * slope;
    }
    const double tau = powers.of[1], start = p.c[0] + p.shift, first = (p.c[1] + p.tilt) * tau;
    const double end = start + first + (value[0] + value[1]), best = larger(larger(so_far, fabs(start)), fabs(end));
    const bool small = fabs(start) + fabs(first) + (rest[0] + rest[1]) <= best;
    const bool monotone = fabs(first) > bend[0] + bend[1];
    return small || monotone ? best : turning_peak(p, tau, best);
}

// Raise the largest and lower the smallest quantities over one step.
inline void keep_extremes(const Values &m, double gain, const Expansion &series, double time, double unit, double tau,
                          Course &row) {
    const double *c = series.l, *v = series.v;
    const double strength = fabs(gain), position = obstacle_at(m, time), velocity = obstacle_speed(m, time);
    const Powers powers(tau);
    double x[COUNT] = {}, rate[COUNT] = {};
    for (int k = 0; k < ORDER; k++) rate[k] = -(k + 1) / unit * v[k + 1];
    rate[0] += m.a;
    row.largest_acceleration = peak<ORDER>({rate, m.own_a, 0}, powers, row.largest_acceleration);
    const double before = row.largest_virtual_force / larger(strength, 1e-300);
    row.largest_virtual_force =
        larger(row.largest_virtual_force, strength * peak<ORDER>({series.force, 0, 0}, powers, before));
    for (int k = 0; k <= ORDER; k++) {
        x[k] = -c[k];
        rate[k] = -v[k];
    }
    rate[0] += velocity;
    rate[1] += m.a * unit;
    row.largest_speed = peak<COUNT>({rate, m.own_v + m.own_a * time, m.own_a * unit}, powers, row.largest_speed);
    double far = 0;
    for (int k = 0; k <= ORDER; k++) far += fabs(c[k]) * powers.of[k];
    row.closest_distance = smaller(row.closest_distance, far - peak<COUNT>({x, far, 0}, powers, 0));
    x[0] += position;
    x[1] += velocity * unit;
    x[2] += m.a / 2 * unit * unit;
    row.largest_excursion = peak<COUNT>({x, 0, 0}, powers, row.largest_excursion);
    x[0] += (m.own_v + m.own_a * time / 2) * time - m.x0;
    x[1] += (m.own_v + m.own_a * time) * unit;
    x[2] += m.own_a / 2 * unit * unit;
    row.largest_travel = peak<COUNT>({x, 0, 0}, powers, row.largest_travel);
}

// The integral of x~ over one step.
inline double integral(const Values &m, const double *c, double time, double unit, double tau) {
    const double x0 = obstacle_at(m, time), x1 = obstacle_speed(m, time), x2 = m.a, step = unit * tau;
    double total = c[ORDER] / (ORDER + 1);
    for (int k = ORDER - 1; k >= 0; k--) total = total * tau + c[k] / (k + 1);
    return (x0 + (x1 / 2 + x2 / 6 * step) * step) * step - unit * tau * total;
}

}  // namespace pretouch
