// Rules for the end of an encounter, which all solvers share, and the slope g of a sensor curve in pieces, for the
// guaranteed solver.

#pragma once

#include <math.h>
#include <stdint.h>

#include "pretouch.h"

namespace pretouch {

// Which distances count as zero. All solvers use the same rules for touches and for motions that never reach contact.
//
// l is the difference of the obstacle's path p + v t + a t^2 / 2 and x~. Near l = 0 both are equally large, so the
// error of l is at least a rounding error of the terms of the path. The slope of a curve has a relative error of 1e-13,
// and l has the same error relative to these terms. The RESOLUTION is ten times as large: a minimum of l that is closer
// to zero, on either side, is a touch.
//
// A distance may also decay to zero without a minimum. If p, v and a cancel, so that the equation contains only l,
//
//     M l'' + (D + D_p g) l' + K (l - p) = 0,
//
// l tends to the resting place p (for K = 0 to l + l' M / (D + D_p g)). A resting place of zero is never reached if the
// motion is over-damped and not too fast, for the following reason. Let w = l - p > 0 and z = w' / w. Then z' = -(z^2 +
// c z + k) with c = (D + D_p g) / M and k = K / M. At z = -mu this is not negative if mu^2 - c mu + k <= 0. Let c >=
// c_0 at all distances ahead, with c_0^2 >= 4 k, and let mu_2(c_0) be the larger root for c = c_0. Then z stays at or
// above -mu_2(c_0) unless it is below it now, so w stays above 0. This suffices for a constant c; for a curve c_0 tends
// to c(0).
//
// A resting place counts as zero within the RESOLUTION, relative to the terms whose difference it is.

constexpr double RESOLUTION = 1e-12;  // relative to the terms whose difference is l; same value as in motion/layout.py

// The inputs of an encounter: a row of `values`.
struct Values {
    double mass, damping, stiffness, x0, u0, p, v, a, own_v, own_a;
};

// Distances [m] up to this one count as zero at the time t.
static inline double resolution(const Values &m, double t) {
    return RESOLUTION * (fabs(m.p) + (fabs(m.v) + fabs(m.a) / 2 * t) * t);
}

// Distances [m] of a resting place up to this one count as zero.
static inline double rest_resolution(const Values &m, double damping) {
    const double way = m.stiffness == 0 && damping > 0 ? fabs(m.v - m.u0) * m.mass / damping : 0.0;
    return RESOLUTION * (fabs(m.p) + fabs(m.x0) + way);
}

// Whether l is undriven: the obstacle is at rest relative to the reference, or there is no admittance force.
static inline bool is_left_alone(const Values &m) {
    return m.a == 0 && (m.v == 0 || (m.damping == 0 && m.stiffness == 0));
}

// Whether an undriven l is proved to tend to its resting place without ever falling below a level [m]. damping: the
// smallest D + D_p g between the level and the largest l ahead [N s/m].
static inline bool never_arrives(const Values &m, double damping, double l, double speed, double level) {
    constexpr double rounding = 1e-15;  // relative to D^2 and mu_2; critical damping within rounding errors suffices
    const double doubt = rest_resolution(m, damping);
    if (m.stiffness == 0) return speed >= 0 || (damping > 0 && l + speed * m.mass / damping >= level - doubt);
    const double square = damping * damping, product = 4 * m.mass * m.stiffness, way = l - m.p;
    if (m.p < level - doubt || way < 0 || damping <= 0 || square - product < -rounding * square) return false;
    const double fast = 0.5 * (damping + sqrt(fmax(square - product, 0.0)));  // M mu_2
    return m.mass * speed + fast * way >= -rounding * fast * way;
}

constexpr int COEFFICIENTS = 10;  // largest number of coefficients of g on a piece
constexpr double OVERLAP = 1e-9;  // by how much of its half width a piece is also used beyond its borders

// The larger and the smaller number; the first one if either is NaN.
static inline double larger(double x, double y) { return y > x ? y : x; }
static inline double smaller(double x, double y) { return y < x ? y : x; }

// Results of an encounter, in the order of COLUMNS of motion/layout.py.
struct Course {
    double time, distance, displacement, displacement_velocity, displacement_acceleration, relative_velocity;
    double virtual_force;
    double largest_excursion, largest_travel, largest_speed, largest_acceleration, largest_virtual_force;
    double closest_distance, settling_distance, displacement_integral;
};

// Position of the obstacle relative to the reference, and its velocity [m, m/s].
static inline double obstacle_at(const Values &m, double t) { return m.p + (m.v + m.a * t / 2) * t; }
static inline double obstacle_speed(const Values &m, double t) { return m.v + m.a * t; }

// g = sum_j g_j z^j with z = (l - middle) / half on [middle - half, middle + half].
struct Piece {
    double middle, half, g[COEFFICIENTS];
};

// g and dg/dl at a distance.
struct Slope {
    double value, bend;
};

static inline Slope slope_at(const Piece &piece, double l) {
    const double z = (l - piece.middle) / piece.half;
    double value = 0, bend = 0;
    for (int j = COEFFICIENTS - 1; j >= 0; j--) {
        bend = bend * z + value;
        value = value * z + piece.g[j];
    }
    return {value, bend / piece.half};
}

// Index of the lowest piece from `first` to `last` - 1 whose top is not below l; that of the highest piece if there is
// none.
template <class Top> static inline int64_t lowest_above(int64_t first, int64_t last, double l, Top top) {
    int64_t low = first, high = last - 1;
    while (low < high) {
        const int64_t between = (low + high) / 2;
        if (l <= top(between)) high = between;
        else low = between + 1;
    }
    return low;
}

// The range of distances [m] in which a step must end, and the distance of the contact, which is not above `low`.
struct Borders {
    double low, high, contact;
};

namespace {  // anonymous, because these functions are compiled for each kind of processor

// A curve in the form of the C interface.
struct Curve : pretouch_pieces {
    double bottom(int64_t i) const { return pieces[i * width] - pieces[i * width + 1]; }
    double top(int64_t i) const { return pieces[i * width] + pieces[i * width + 1]; }

    Piece piece(int64_t i) const {
        const double *row = pieces + i * width;
        Piece result = {row[0], row[1], {}};
        for (int j = 0; j < COEFFICIENTS && j < width - 2; j++) result.g[j] = row[2 + j];
        return result;
    }

    // Index of the lowest piece whose upper border is not below l; that of the highest piece if there is none.
    int64_t find(double l) const { return lowest_above(0, count, l, [this](int64_t i) { return top(i); }); }

    // The range of distances in which the polynomial of a piece is used. It extends beyond the top, because an object
    // may rest there.
    Borders borders(int64_t i, double contact) const {
        const double half = pieces[i * width + 1];
        return {bottom(i) - (i > 0 ? OVERLAP * half : 0.0), top(i) + OVERLAP * half, contact};
    }
};

}  // namespace

}  // namespace pretouch
