// The response of M y'' + D y' + K y, exact to rounding for every damping, through critical and for K -> 0.
//
// The printed form of L(10) divides by lambda_2 - lambda_1 and by K_a and loses its digits where either vanishes. All
// that it needs are the divided differences G_m = exp[0^m, z1, z2] at the points z = lambda t and m zeros:
//
//     t^(m+1) G_m  is the response, from rest, to the force t^(m-1) / (m-1)!   (m = 0: to an impulse),
//
// which are entire functions of (z1, z2). They are summed as a series near the origin and by recursion over the point
// that lies farthest from zero elsewhere, where no digits are lost.

#pragma once

#include <math.h>

namespace pretouch {

// M y'' + D y' + K y = f0 + f1 t from y(0) = y0, y'(0) = v0.
struct System {
    double mass, damping, stiffness, y0, v0, f0, f1;
};

struct Response {
    double y, velocity, acceleration, jerk, integral;  // y, y', y'', y''' and the integral of y
};

struct DividedDifferences {
    double derivative;      // of t G_0: G_-1
    double h0;              // the free response to a unit displacement
    double g0, g1, g2, g3;
};

constexpr double SERIES_RADIUS = 1.5;
constexpr int SERIES_TERMS = 24;

struct InverseFactorials {
    double of[SERIES_TERMS + 4];
    constexpr InverseFactorials() : of{} {
        double factorial = 1;
        for (int k = 0; k < SERIES_TERMS + 4; k++) {
            factorial *= k > 0 ? k : 1;
            of[k] = 1 / factorial;
        }
    }
};
constexpr InverseFactorials INVERSE_FACTORIALS;

// exp[0^order, z] = sum z^k / (k + order)!, order 1 to 3.
inline double phi(double z, int order) {
    const double *inverse = INVERSE_FACTORIALS.of;
    if (fabs(z) < 1.0) {
        double total = inverse[order + 19];
        for (int k = 18; k >= 0; k--) total = total * z + inverse[order + k];
        return total;
    }
    double value = expm1(z) / z;
    for (int k = 1; k < order; k++) value = (value - inverse[k]) / z;
    return value;
}

// z1 + z2 = p, z1 z2 = q >= 0: sum (z1^k + z1^(k-1) z2 + ... + z2^k) / (k + m + 1)!, and its like.
inline DividedDifferences near_the_origin(double p, double q) {
    const double *inverse = INVERSE_FACTORIALS.of;
    double symmetric = 1.0, before = 0.0, derivative = 0.0, g0 = 0.0, g1 = 0.0, g2 = 0.0, g3 = 0.0;
    for (int k = 0; k < SERIES_TERMS; k++) {
        derivative += symmetric * inverse[k];
        g0 += symmetric * inverse[k + 1];
        g1 += symmetric * inverse[k + 2];
        g2 += symmetric * inverse[k + 3];
        g3 += symmetric * inverse[k + 4];
        const double next = p * symmetric - q * before;
        before = symmetric;
        symmetric = next;
    }
    return {derivative, 1.0 - q * g1, g0, g1, g2, g3};
}

// At z = lambda t, L(13): z1 + z2 = p, z1 z2 = q >= 0, (z1 - z2)^2 / 4 = d.
inline DividedDifferences divided_differences(double p, double q, double d) {
    if ((d > 0 ? fabs(p) / 2 + sqrt(d) : sqrt(q)) < SERIES_RADIUS) return near_the_origin(p, q);
    if (d > 0) {
        const double root = sqrt(d), far = p < 0 ? p / 2 - root : p / 2 + root, near = q / far;
        const double top = near > far ? near : far, low = near > far ? far : near;
        const double g0 = exp(top) * phi(low - top, 1);
        const double g1 = (g0 - phi(near, 1)) / far, g2 = (g1 - phi(near, 2)) / far, g3 = (g2 - phi(near, 3)) / far;
        return {exp(far) + near * g0, exp(near) - near * g0, g0, g1, g2, g3};
    }
    const double decay = exp(p / 2), angle = sqrt(-d), cosine = cos(angle), sinc = angle > 0 ? sin(angle) / angle : 1.0;
    const double g0 = decay * sinc, derivative = decay * (cosine + p / 2 * sinc);
    const double g1 = (1.0 + p * g0 - derivative) / q, g2 = (1.0 + p * g1 - g0) / q, g3 = (0.5 + p * g2 - g1) / q;
    return {derivative, decay * (cosine - p / 2 * sinc), g0, g1, g2, g3};
}

// The motion at t: L(10)-(13) without their quotients.
inline Response respond(const System &m, double t) {
    const double sigma = m.damping / (2 * m.mass), square = m.stiffness / m.mass;
    const double disc = m.damping * m.damping - 4 * m.mass * m.stiffness;
    const auto [slope, h0, g0, g1, g2, g3] =
        divided_differences(-2 * sigma * t, square * t * t, disc / (4 * m.mass * m.mass) * t * t);
    const double t2 = t * t, f1 = t * g0, f2 = t2 * g1, f3 = t2 * t * g2, f4 = t2 * t2 * g3;
    const double c0 = m.f0 / m.mass, c1 = m.f1 / m.mass;
    const double a0 = c0 - square * m.y0 - 2 * sigma * m.v0, j0 = c1 - 2 * sigma * a0 - square * m.v0;
    return {m.y0 * h0 + m.v0 * f1 + c0 * f2 + c1 * f3, -square * m.y0 * f1 + m.v0 * slope + c0 * f1 + c1 * f2,
            a0 * h0 + j0 * f1, j0 * slope - square * a0 * f1,
            m.y0 * (f1 + 2 * sigma * f2) + m.v0 * f2 + c0 * f3 + c1 * f4};
}

}  // namespace pretouch
