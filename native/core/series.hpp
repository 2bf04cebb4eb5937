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

// The series of a step in tau = (t - time) / unit: of l, of l' and of d ln xi / dt, and, of a Taylor step, of the powers
// of z: powers[k][j] is the coefficient of tau^k in z^(j + 1), up to the degree of ln xi.
struct Expansion {
    double l[ORDER + 1], v[ORDER + 1], force[ORDER];
    double powers[ORDER + 1][TERMS];
};

// Position of the obstacle relative to the reference, and its velocity [m, m/s].
inline double obstacle_at(const Values &m, double t) { return m.p + (m.v + m.a * t / 2) * t; }
inline double obstacle_speed(const Values &m, double t) { return m.v + m.a * t; }

// Expand L(1) with L(2), which is L(4), L(7) or L(14) as the curve may be, with the obstacle of L(9), about a time.
inline void expand(const Values &m, double gain, const Piece &piece, double time, double unit, double l, double speed,
                   Expansion &out) {
    const double x0 = obstacle_at(m, time), x1 = obstacle_speed(m, time), x2 = m.a;
    const double drive[ORDER] = {m.damping * x1 + m.stiffness * x0 + m.mass * x2,
                                 (m.damping * x2 + m.stiffness * x1) * unit, m.stiffness * x2 / 2 * unit * unit};
    double z[ORDER + 1];
    out.l[0] = l;
    out.v[0] = speed;
    z[0] = out.powers[0][0] = (l - piece.middle) / piece.half;
    for (int j = 1; j < TERMS; j++) out.powers[0][j] = out.powers[0][j - 1] * z[0];
    for (int k = 0; k < ORDER; k++) {
        out.l[k + 1] = unit * out.v[k] / (k + 1);
        z[k + 1] = out.l[k + 1] / piece.half;
        double sums[TERMS] = {};
        for (int i = 0; i <= k; i++) {
            for (int j = 0; j < TERMS; j++) sums[j] += out.powers[i][j] * z[k + 1 - i];
        }
        double power = z[k + 1], rise = piece.g[0] * power;
        out.powers[k + 1][0] = power;
        for (int j = 1; j < TERMS; j++) {
            power = sums[j - 1] + power * z[0];
            out.powers[k + 1][j] = power;
            rise += piece.g[j] / (j + 1) * power;
        }
        out.force[k] = rise * piece.half * (k + 1) / unit;
        const double pull = m.damping * -out.v[k] - m.stiffness * out.l[k] - gain * out.force[k] + drive[k];
        out.v[k + 1] = unit / (k + 1) * pull / m.mass;
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
    return smaller(smaller(rate > 0 ? 1.0 / rate : 1.0, 2 * piece.half / larger(fabs(speed), 1e-12)), horizon);
}

}  // namespace pretouch
