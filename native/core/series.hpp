// The motion along any curve as a Taylor series, to any order and without a derivative being formed.
//
// The slope of the curve is a piecewise polynomial, g = sum_j q_j z^j with z = (l - m) / h on the piece [m - h, m + h].
// Inside one piece the motion
//
//     M (x_o'' - l'') + D (x_o' - l') + K (x_o - l) = D_p d(ln xi)/dt
//
// is a polynomial differential equation, so the Taylor coefficients of l follow from each other by convolutions.

#pragma once

#include <stdint.h>

#include "polynomial.hpp"

namespace pretouch {

constexpr int TERMS = 10;         // coefficients of g on a piece, at most
constexpr double OVERLAP = 1e-9;  // of a piece's width: how far its polynomial is used beyond its border
constexpr double LEFT_OUT = 1e-16;  // of l': what a step may leave out of it
constexpr double LEAST = 1e-30;     // of y: what is smaller moves no slope, and its tenth power would be denormal
constexpr double SHORTEST_UNIT = 1e-300;  // [s]: its inverse is a number
constexpr double SLOW = 1e-6;       // of l over a step: an l' that moves less need not be known better

struct Piece {
    double middle, half, g[TERMS];
};

// A curve as an entry point is given it: middle, half width and coefficients of g of each piece, ascending.
struct Curve {
    const double *pieces;
    int64_t count, width;

    double middle(int64_t i) const { return pieces[i * width]; }
    double half(int64_t i) const { return pieces[i * width + 1]; }
    double bottom(int64_t i) const { return middle(i) - half(i); }
    double top(int64_t i) const { return middle(i) + half(i); }

    Piece piece(int64_t i) const {
        Piece found = {middle(i), half(i), {}};
        for (int j = 0; j < TERMS && j < width - 2; j++) found.g[j] = pieces[i * width + 2 + j];
        return found;
    }

    // the lowest piece whose upper border is not below l
    int64_t find(double l) const {
        int64_t low = 0, high = count - 1;
        while (low < high) {
            const int64_t between = (low + high) / 2;
            if (l <= top(between)) {
                high = between;
            } else {
                low = between + 1;
            }
        }
        return low;
    }

    // between which distances the polynomial of a piece is used: at the top as well, where an object may rest
    Borders borders(int64_t i, double contact) const {
        return {bottom(i) - (i > 0 ? OVERLAP * half(i) : 0.0), top(i) + OVERLAP * half(i), contact};
    }
};

// The series of a step in tau = (t - time) / unit: of l, of l' and of d ln xi / dt, and, of a Taylor step, of the
// powers of y = (l - l(time)) / h: powers[k][j] is the coefficient of tau^k in y^(j + 1), up to the degree of ln xi.
struct Expansion {
    double l[ORDER + 1], v[ORDER + 1], force[ORDER];
    Pair powers[ORDER + 1][TERMS / 2];

    double power(int k, int j) const { return powers[k][j / 2][j % 2]; }
};

// Position of the obstacle relative to the reference, and its velocity [m, m/s].
inline double obstacle_at(const Values &m, double t) { return m.p + (m.v + m.a * t / 2) * t; }
inline double obstacle_speed(const Values &m, double t) { return m.v + m.a * t; }

// 1, 1/2, 1/3, ...
struct Inverses {
    double at[ORDER + 2];
    constexpr Inverses() : at{} {
        for (int k = 1; k < ORDER + 2; k++) at[k] = 1.0 / k;
    }
};
constexpr Inverses INVERSE;

// Move a polynomial in z to y = z - start: its coefficients there, by Horner's scheme.
inline void recenter(double *g, double start) {
    for (int i = 0; i < TERMS - 1; i++) {
        for (int j = TERMS - 2; j >= i; j--) g[j] += start * g[j + 1];
    }
}

// Expand L(1) with L(2), which is L(4), L(7) or L(14) as the curve may be, with the obstacle of L(9), about a time.
// The slope is taken as a polynomial in y, whose series have no constant term: so what a power of y needs of the
// others is of lower orders, and y^3, y^4, ... are found side by side, each as y^2 times the power two below it.
inline void expand(const Values &m, double gain, const Piece &piece, double time, double unit, double l, double speed,
                   Expansion &out) {
    const double x0 = obstacle_at(m, time), x1 = obstacle_speed(m, time), x2 = m.a;
    const double drive[ORDER] = {m.damping * x1 + m.stiffness * x0 + m.mass * x2,
                                 (m.damping * x2 + m.stiffness * x1) * unit, m.stiffness * x2 / 2 * unit * unit};
    const double by_half = 1 / piece.half, by_unit = 1 / unit, per_mass = unit / m.mass;
    double g[TERMS], y[ORDER + 1] = {}, square[ORDER + 1] = {};
    for (int j = 0; j < TERMS; j++) g[j] = piece.g[j];
    recenter(g, (l - piece.middle) * by_half);
    for (int j = 0; j < TERMS; j++) g[j] *= piece.half * by_unit * INVERSE.at[j + 1];  // of ln xi / unit
    Pair pairs[TERMS / 2];
    for (int j = 0; j < TERMS / 2; j++) {
        pairs[j] = Pair{g[2 * j], g[2 * j + 1]};
        out.powers[0][j] = Pair{};
    }
    out.l[0] = l;
    out.v[0] = speed;
    for (int k = 0; k < ORDER; k++) {
        Pair a = {}, b = {}, c = {}, d = {};
        for (int i = 2; i <= k; i++) {
            const Pair *other = out.powers[k + 1 - i], with = {square[i], square[i]};
            a += with * other[0];
            b += with * other[1];
            c += with * other[2];
            d += with * other[3];
        }
        double evens = 0;
        for (int i = 1; 2 * i < k + 1; i++) evens += y[i] * y[k + 1 - i];
        evens *= 2;
        if (k % 2 == 1) evens += y[(k + 1) / 2] * y[(k + 1) / 2];
        square[k + 1] = evens;
        out.l[k + 1] = unit * INVERSE.at[k + 1] * out.v[k];
        y[k + 1] = out.l[k + 1] * by_half;
        const double straight = g[0] * y[k + 1];
        Pair *powers = out.powers[k + 1];
        if (!(fabs(y[k + 1]) >= LEAST)) y[k + 1] = 0;
        powers[0] = Pair{y[k + 1], evens};
        powers[1] = a;
        powers[2] = b;
        powers[3] = c;
        powers[4] = d;
        const Pair sum = (pairs[1] * a + pairs[2] * b) + (pairs[3] * c + pairs[4] * d);
        out.force[k] = (k + 1) * ((sum[0] + sum[1] + g[1] * evens) + straight);
        const double held = m.damping * out.v[k] + m.stiffness * out.l[k];  // summed as what drives it is, to cancel
        const double pull = (drive[k] - held) - gain * out.force[k];
        out.v[k + 1] = per_mass * INVERSE.at[k + 1] * pull;
    }
}

// The largest tau at which the series of l and of l' unit are at rounding beside their scales.
inline double reach_of(const Expansion &series, double scale) {
    const double *c = series.l;
    const double size = larger(larger(fabs(c[1]), fabs(c[2])), SLOW * scale);
    double reach = 2;
    for (int k = ORDER - 1; k <= ORDER; k++) {
        if (c[k] == 0) continue;
        reach = smaller(reach, pow(1e-17 * scale / fabs(c[k]), 1.0 / k));
        reach = smaller(reach, pow(LEFT_OUT * size / (k * fabs(c[k])), 1.0 / (k - 1)));
    }
    return reach;
}

// What an error of l [m] is to be small beside: l at the start, unless all that l consists of has gone.
inline double scale_of(const Values &m, double start, double time, double l) {
    const double path = fabs(m.p) + (fabs(m.v) + fabs(m.a) / 2 * time) * time;
    return larger(l, smaller(start, path));
}

// The unit of time [s] of the first step.
inline double first_unit(const Values &m, double gain, const Piece &piece, double speed, double horizon) {
    const double rate = fabs(m.damping + gain * piece.g[0]) / m.mass + sqrt(m.stiffness / m.mass);
    const double slow = rate > 0 ? 1.0 / rate : 1.0, crossing = 2 * piece.half / larger(fabs(speed), 1e-12);
    return larger(smaller(smaller(slow, crossing), horizon), SHORTEST_UNIT);
}

}  // namespace pretouch
