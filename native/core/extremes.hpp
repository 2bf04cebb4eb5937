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

// A polynomial in tau and what is added to it, shift + tilt tau.
template <int DEGREE> struct Shifted {
    const double *c;
    double shift, tilt;

    double size_at(double tau) const { return fabs(horner<DEGREE>(c, tau) + shift + tilt * tau); }
    double slope_at(double tau) const { return horner_slope<DEGREE>(c, tau) + tilt; }
};

// The larger of so_far and max |p(s) + shift + tilt s| over s in [0, tau].
template <int DEGREE> inline double peak(const Shifted<DEGREE> &p, double tau, double so_far) {
    constexpr int PARTS = 8, HALVINGS = 30;  // the peak is flat: 1e-9 in its place is 1e-18 in its height
    const double *c = p.c;
    double best = larger(larger(so_far, fabs(c[0] + p.shift)), p.size_at(tau));
    double rest = fabs(c[0] + p.shift), power = 1;
    for (int k = 1; k <= DEGREE; k++) {
        power *= tau;
        rest += (k > 1 ? fabs(c[k]) : fabs(c[1] + p.tilt)) * power;
    }
    if (rest <= best) return best;
    double places[PARTS], slopes[PARTS];
    for (int i = 0; i < PARTS; i++) {
        places[i] = tau * (i + 1) / PARTS;
        slopes[i] = DEGREE * c[DEGREE];
    }
    for (int k = DEGREE - 1; k > 0; k--) {
        for (int i = 0; i < PARTS; i++) slopes[i] = slopes[i] * places[i] + k * c[k];
    }
    double left = 0, slope_left = c[1] + p.tilt;
    if (slope_left == 0) slope_left = c[2];  // from rest: the way that it bends
    for (int i = 0; i < PARTS; i++) {
        const double right = places[i], slope_right = slopes[i] + p.tilt;
        if (slope_left * slope_right < 0) {
            double a = left, b = right;
            for (int j = 0; j < HALVINGS; j++) {
                const double middle = 0.5 * (a + b);
                (p.slope_at(middle) * slope_left > 0 ? a : b) = middle;
            }
            best = larger(best, p.size_at(a));
        }
        left = right;
        slope_left = slope_right;
    }
    return best;
}

// Raise the largest and lower the smallest quantities over one step.
inline void keep_extremes(const Values &m, double gain, const Expansion &series, double time, double unit, double tau,
                          Course &row) {
    const double *c = series.l, *v = series.v;
    const double strength = fabs(gain), position = obstacle_at(m, time), velocity = obstacle_speed(m, time);
    double x[ORDER + 1], rate[ORDER + 1];
    for (int k = 0; k <= ORDER; k++) {
        x[k] = -c[k];
        rate[k] = k < ORDER ? -(k + 1) * v[k + 1] / unit : 0.0;
    }
    x[0] += position;
    x[1] += velocity * unit;
    x[2] += m.a / 2 * unit * unit;
    rate[0] += m.a;
    row.largest_excursion = peak<ORDER>({x, 0, 0}, tau, row.largest_excursion);
    row.largest_acceleration = peak<ORDER - 1>({rate, m.own_a, 0}, tau, row.largest_acceleration);
    const double before = row.largest_virtual_force / larger(strength, 1e-300);
    row.largest_virtual_force =
        larger(row.largest_virtual_force, strength * peak<ORDER - 1>({series.force, 0, 0}, tau, before));
    for (int k = 0; k <= ORDER; k++) rate[k] = -v[k];
    rate[0] += velocity;
    rate[1] += m.a * unit;
    row.largest_speed = peak<ORDER>({rate, m.own_v + m.own_a * time, m.own_a * unit}, tau, row.largest_speed);
    x[0] += (m.own_v + m.own_a * time / 2) * time - m.x0;
    x[1] += (m.own_v + m.own_a * time) * unit;
    x[2] += m.own_a / 2 * unit * unit;
    row.largest_travel = peak<ORDER>({x, 0, 0}, tau, row.largest_travel);
    double far = 0, power = 1;
    for (int k = 0; k <= ORDER; k++) {
        x[k] = -c[k];
        far += fabs(c[k]) * power;
        power *= tau;
    }
    row.closest_distance = smaller(row.closest_distance, far - peak<ORDER>({x, far, 0}, tau, 0));
}

// The integral of x~ over one step.
inline double integral(const Values &m, const double *c, double time, double unit, double tau) {
    const double x0 = obstacle_at(m, time), x1 = obstacle_speed(m, time), x2 = m.a, step = unit * tau;
    double total = c[ORDER] / (ORDER + 1);
    for (int k = ORDER - 1; k >= 0; k--) total = total * tau + c[k] / (k + 1);
    return (x0 + (x1 / 2 + x2 / 6 * step) * step) * step - unit * tau * total;
}

}  // namespace pretouch
