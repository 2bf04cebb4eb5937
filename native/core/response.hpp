// The response of M y'' + D y' + K y = f0 + f1 t, accurate to rounding errors for every damping, including critical
// damping and K -> 0.
//
// The form in which L(10) is printed divides by lambda_2 - lambda_1 and by K_a, and loses digits if either is near
// zero. The response can also be expressed by the divided differences G_m = exp[0^m, z1, z2] of the exponential, at the
// points z = lambda t and m zeros:
//
//     t^(m+1) G_m  is the response, from rest, to the force t^(m-1) / (m-1)!   (m = 0: to an impulse).
//
// They are entire functions of (z1, z2). Near the origin they are computed by a series, elsewhere by a recursion that
// divides by the point farthest from zero, so that no digits are lost.

#pragma once

#include <math.h>

namespace pretouch {

// M y'' + D y' + K y = f0 + f1 t from y(0) = y0, y'(0) = v0.
struct System {
    double mass, damping, stiffness, y0, v0, f0, f1;
};

struct Response {
    double y[4], integral;  // y, y', y'', y''' and the integral of y
};

struct DividedDifferences {
    double derivative;  // G_-1, the derivative of t G_0 by t
    double h0;          // the free response to a unit displacement
    double g0, g1, g2, g3;
};

constexpr double SERIES_RADIUS = 1.5;
constexpr int SERIES_TERMS = 24, PHI_TERMS = 20;

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

// Computes exp[0^k, z] = sum_j z^j / (j + k)! = 1 / k! + z exp[0^(k+1), z] for k = 1 to LAST. phi[0] has k = 1.
template <int LAST> inline void find_phi(double z, double *phi) {
    const double *inverse = INVERSE_FACTORIALS.of;
    if (fabs(z) < 1.0) {
        double total = inverse[LAST + PHI_TERMS - 1];
        for (int k = PHI_TERMS - 2; k >= 0; k--) total = total * z + inverse[LAST + k];
        phi[LAST - 1] = total;
        for (int k = LAST - 1; k > 0; k--) phi[k - 1] = phi[k] * z + inverse[k];
        return;
    }
    phi[0] = expm1(z) / z;
    for (int k = 1; k < LAST; k++) phi[k] = (phi[k - 1] - inverse[k]) / z;
}

// G_m near the origin by its series, the sum over k of (z1^k + z1^(k-1) z2 + ... + z2^k) / (k + m + 1)!,
// with z1 + z2 = p and z1 z2 = q >= 0.
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

// The divided differences at z = lambda t, L(13), with z1 + z2 = p, z1 z2 = q >= 0 and (z1 - z2)^2 / 4 = d.
inline DividedDifferences divided_differences(double p, double q, double d) {
    if ((d > 0 ? fabs(p) / 2 + sqrt(d) : sqrt(q)) < SERIES_RADIUS) return near_the_origin(p, q);
    DividedDifferences g;
    if (d > 0) {
        const double root = sqrt(d), far = p < 0 ? p / 2 - root : p / 2 + root, near = q / far;
        const double e_far = exp(far), e_near = exp(near);
        double between, phi[3];
        find_phi<1>(near > far ? far - near : near - far, &between);
        find_phi<3>(near, phi);
        g.g0 = (near > far ? e_near : e_far) * between;
        g.derivative = e_far + near * g.g0, g.h0 = e_near - near * g.g0;
        g.g1 = (g.g0 - phi[0]) / far, g.g2 = (g.g1 - phi[1]) / far, g.g3 = (g.g2 - phi[2]) / far;
        return g;
    }
    const double decay = exp(p / 2), angle = sqrt(-d), cosine = cos(angle), sinc = angle > 0 ? sin(angle) / angle : 1.0;
    g.g0 = decay * sinc, g.derivative = decay * (cosine + p / 2 * sinc), g.h0 = decay * (cosine - p / 2 * sinc);
    g.g1 = (1.0 + p * g.g0 - g.derivative) / q;
    g.g2 = (1.0 + p * g.g1 - g.g0) / q;
    g.g3 = (0.5 + p * g.g2 - g.g1) / q;
    return g;
}

// The response of a system by L(10)-(13), in the form without divisions by small numbers.
struct Motion {
    double y0, v0, a0, j0;  // y and its derivatives at the start
    double sigma, square;   // coefficients of y'' + 2 sigma y' + square y = c0 + c1 t
    double c0, c1, disc;    // disc: sigma^2 - square

    explicit Motion(const System &m)
        : y0(m.y0), v0(m.v0), sigma(m.damping / (2 * m.mass)), square(m.stiffness / m.mass), c0(m.f0 / m.mass),
          c1(m.f1 / m.mass), disc((m.damping * m.damping - 4 * m.mass * m.stiffness) / (4 * m.mass * m.mass)) {
        a0 = c0 - square * y0 - 2 * sigma * v0;
        j0 = c1 - 2 * sigma * a0 - square * v0;
    }

    Response at(double t) const {
        const DividedDifferences g = divided_differences(-2 * sigma * t, square * t * t, disc * t * t);
        const double t2 = t * t, f1 = t * g.g0, f2 = t2 * g.g1, f3 = t2 * t * g.g2, f4 = t2 * t2 * g.g3;
        return {{y0 * g.h0 + v0 * f1 + c0 * f2 + c1 * f3, -square * y0 * f1 + v0 * g.derivative + c0 * f1 + c1 * f2,
                 a0 * g.h0 + j0 * f1, j0 * g.derivative - square * a0 * f1},
                y0 * (f1 + 2 * sigma * f2) + v0 * f2 + c0 * f3 + c1 * f4};
    }
};

}  // namespace pretouch
