// Functions that decide whether samples resolve a function, and that find its minimum between the samples.

#pragma once

#include <math.h>
#include <stdint.h>

namespace PRETOUCH_VARIANT {

constexpr int LEAST = 11;  // smallest number of samples for which resolution can be judged: six have even indices
constexpr int NODES = 8;
constexpr double AT[NODES] = {  // cos((i + 1/2) pi / 8)
    0.98078528040323043,  0.83146961230254524,  0.55557023301960229,  0.19509032201612833,
    -0.19509032201612825, -0.55557023301960196, -0.83146961230254535, -0.98078528040323043};

namespace sampling {

constexpr double RESOLVED = 1e-3, STEEP = 0.03;
constexpr double VANISHED = 1e-7;  // largest last coefficients, relative to that of the curvature. The omitted ones are
                                   // smaller, so that the error of the minimum's place z is at most 1e-8.

struct Quintic {
    double weight[5][6];  // weights of the values at 0 to 5, for interpolated values at 0.5 to 4.5
};

constexpr Quintic quintic() {
    Quintic made{};
    for (int i = 0; i < 5; i++)
        for (int j = 0; j < 6; j++) {
            made.weight[i][j] = 1.0;
            for (int k = 0; k < 6; k++)
                if (k != j) made.weight[i][j] *= (i + 0.5 - k) / (j - k);
        }
    return made;
}

constexpr Quintic MIDDLE = quintic();

// The value of a Chebyshev series at z, by Clenshaw's recursion.
static inline double series(const double *c, double z) {
    double first = 0.0, before = 0.0;
    for (int k = NODES - 1; k > 0; k--) {
        const double next = c[k] + 2.0 * z * first - before;
        before = first;
        first = next;
    }
    return c[0] + z * first - before;
}

// Computes the Chebyshev coefficients of the derivative of a series.
static inline void differentiate(const double *c, double *slope) {
    slope[NODES - 1] = 0.0;
    for (int k = NODES - 1; k > 0; k--) slope[k - 1] = (k + 1 < NODES ? slope[k + 1] : 0.0) + 2.0 * k * c[k];
    slope[0] /= 2.0;
}

}  // namespace sampling

// Whether the quintic through the six even nodes nearest to an odd node predicts its value. The allowed error is
// relative to the objective, plus a share of its change between the neighboring nodes, because a steep part hides no
// minimum.
static inline bool is_predicted(const double *f, int used, int i) {
    int first = i - 5 > 0 ? i - 5 : 0;
    if (first > used - 11) first = used - 11;
    double guess = 0.0;
    for (int j = 0; j < 6; j++) guess += sampling::MIDDLE.weight[(i - first) / 2][j] * f[first + 2 * j];
    const double allowed = sampling::RESOLVED * fabs(f[i]) + sampling::STEEP * fabs(f[i + 1] - f[i - 1]);
    return fabs(guess - f[i]) <= allowed;
}

// The minimum of the quartic through five nodes around the best one, in node spacings from node 0. If Newton's method
// leaves the neighborhood of the best node, the result is that node.
static inline double guess_minimum(const double *f, int best, int used) {
    int c = best > 2 ? best : 2;
    if (c > used - 3) c = used - 3;
    const double y0 = f[c - 2], y1 = f[c - 1], y2 = f[c], y3 = f[c + 1], y4 = f[c + 2];
    const double a1 = (y0 - 8.0 * y1 + 8.0 * y3 - y4) / 12.0;
    const double a2 = (-y0 + 16.0 * y1 - 30.0 * y2 + 16.0 * y3 - y4) / 24.0;
    const double a3 = (-y0 + 2.0 * y1 - 2.0 * y3 + y4) / 12.0;
    const double a4 = (y0 - 4.0 * y1 + 6.0 * y2 - 4.0 * y3 + y4) / 24.0;
    const double start = best - c;
    double s = start;
    for (int k = 0; k < 6; k++)
        s -= (a1 + s * (2.0 * a2 + s * (3.0 * a3 + s * 4.0 * a4))) / (2.0 * a2 + s * (6.0 * a3 + s * 12.0 * a4));
    if (!(fabs(s - start) <= 1.0)) s = start;
    return c + s;
}

struct Bottom {
    double z, value;
    bool fits;  // whether the last coefficients are negligible (VANISHED), so that there is no corner and no noise
};

// Computes the Chebyshev coefficients of the polynomial through the values at the nodes.
static inline void chebyshev_of(const double *values, double *c) {
    for (int k = 0; k < NODES; k++) c[k] = 0.0;
    for (int j = 0; j < NODES; j++) {
        double before = AT[j], now = 1.0;  // T_k at the node, starting from T_-1 = T_1 and T_0
        for (int k = 0; k < NODES; k++) {
            c[k] += (k == 0 ? 1.0 : 2.0) / NODES * now * values[j];
            const double next = 2.0 * AT[j] * now - before;
            before = now;
            now = next;
        }
    }
}

// The minimum in [-1, 1] of the polynomial through the values at the nodes.
static inline Bottom bottom_between(const double *values) {
    double c[NODES], slope[NODES], bend[NODES];
    chebyshev_of(values, c);
    int lowest = 0;
    for (int j = 1; j < NODES; j++)
        if (values[j] < values[lowest]) lowest = j;
    sampling::differentiate(c, slope);
    sampling::differentiate(slope, bend);
    double z = AT[lowest], step = 1.0, curvature = 0.0;
    for (int k = 0; k < 12; k++) {
        curvature = sampling::series(bend, z);
        step = sampling::series(slope, z) / curvature;
        z = fmin(fmax(z - step, -1.0), 1.0);
        if (fabs(step) < 1e-14) break;
    }
    const double last = fabs(c[NODES - 1]) + fabs(c[NODES - 2]);
    const bool fits = curvature > 0.0 && last <= sampling::VANISHED * fabs(c[2]) && fabs(step) < 1e-10;
    return {z, sampling::series(c, z), fits};
}

}  // namespace PRETOUCH_VARIANT
