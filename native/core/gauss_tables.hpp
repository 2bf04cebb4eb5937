// The 16 Gauss-Legendre points on [-1, 1], and matrices that integrate, differentiate and evaluate the polynomial
// through values at these points. lanes_drag.cpp uses them.
//
// The points are the zeros of the Legendre polynomial P_16. Points and weights were computed by mpmath with 40 digits
// and printed with 17. The compiler computes the matrices. For n < 16 the quadrature is exact for P_n times the
// polynomial, so the coefficient of P_n is (2 n + 1) / 2 sum_i w_i P_n(x_i) f_i. The integral of P_n from -1 is
// (P_(n+1) - P_(n-1)) / (2 n + 1).

#pragma once

namespace pretouch {

constexpr int GAUSS = 16;  // number of points
constexpr int FINE = 40;   // equally spaced places for the search of a maximum; a multiple of every vector width

struct GaussTables {
    double node[GAUSS], weight[GAUSS], share[GAUSS];  // share: (1 + node) / 2
    double coefficient[GAUSS][GAUSS];  // [point][degree]: from values to Legendre coefficients
    double so_far[GAUSS][GAUSS];       // [point][place]: integral from -1 to the place, another of the points
    double to_come[GAUSS][GAUSS];      // [point][place]: integral from the place to 1
    double change[GAUSS][GAUSS];       // [point][place]: derivative at the place
    double last[2][GAUSS];             // [degree - 14][point]: the last two Legendre coefficients
    double fine[GAUSS][FINE];          // [point][place]: value at the FINE equally spaced places
};

// Factors of the recursion P_(n+1) = a z P_n - b P_(n-1), and of the integral of P_n, which is c (P_(n+1) - P_(n-1)).
struct LegendreFactors {
    double a[GAUSS + 1], b[GAUSS + 1], c[GAUSS + 1];
};

static constexpr LegendreFactors legendre_factors() {
    LegendreFactors f = {};
    for (int n = 0; n <= GAUSS; n++)
        f.a[n] = (2 * n + 1.0) / (n + 1), f.b[n] = double(n) / (n + 1), f.c[n] = 1.0 / (2 * n + 1);
    return f;
}

constexpr LegendreFactors FACTORS = legendre_factors();

// The values of P_n and P_n' at one point, for n from 0 to GAUSS.
struct Legendre {
    double value[GAUSS + 1], slope[GAUSS + 1];
};

// The functions of this file are static, because each source that includes it is compiled for several processors.
static constexpr Legendre legendre(double z) {
    Legendre p = {};
    p.value[0] = 1.0, p.value[1] = z, p.slope[0] = 0.0, p.slope[1] = 1.0;
    for (int n = 1; n < GAUSS; n++) {
        p.value[n + 1] = FACTORS.a[n] * z * p.value[n] - FACTORS.b[n] * p.value[n - 1];
        p.slope[n + 1] = p.slope[n - 1] + (2 * n + 1) * p.value[n];
    }
    return p;
}

// Integral of P_n from -1 to z; p: the values at z.
static constexpr double legendre_integral(const Legendre &p, int n, double z) {
    return n == 0 ? 1.0 + z : (p.value[n + 1] - p.value[n - 1]) * FACTORS.c[n];
}

static constexpr double fine_place(int k) { return -1.0 + 2.0 * k / (FINE - 1); }

static constexpr GaussTables gauss_tables() {
    constexpr double node[GAUSS / 2] = {
        0.98940093499164993, 0.94457502307323258, 0.86563120238783174, 0.75540440835500303,
        0.61787624440264375, 0.45801677765722739, 0.28160355077925891, 0.09501250983763744,
    };
    constexpr double weight[GAUSS / 2] = {
        0.027152459411754095, 0.062253523938647893, 0.095158511682492785, 0.12462897125553387,
        0.14959598881657673, 0.16915651939500254, 0.18260341504492359, 0.1894506104550685,
    };
    GaussTables t = {};
    for (int i = 0; i < GAUSS / 2; i++) {
        const int j = GAUSS - 1 - i;
        t.node[i] = -node[i], t.node[j] = node[i], t.weight[i] = t.weight[j] = weight[i];
    }
    for (int i = 0; i < GAUSS; i++) {
        t.share[i] = 0.5 * (1.0 + t.node[i]);
        const Legendre at_point = legendre(t.node[i]);
        for (int n = 0; n < GAUSS; n++) t.coefficient[i][n] = 0.5 * (2 * n + 1) * t.weight[i] * at_point.value[n];
        t.last[0][i] = t.coefficient[i][GAUSS - 2], t.last[1][i] = t.coefficient[i][GAUSS - 1];
    }
    for (int place = 0; place < GAUSS; place++) {
        const Legendre p = legendre(t.node[place]);
        for (int i = 0; i < GAUSS; i++)
            for (int n = 0; n < GAUSS; n++) {
                t.so_far[i][place] += t.coefficient[i][n] * legendre_integral(p, n, t.node[place]);
                t.change[i][place] += t.coefficient[i][n] * p.slope[n];
            }
    }
    for (int i = 0; i < GAUSS; i++)
        for (int place = 0; place < GAUSS; place++)
            t.to_come[i][place] = t.so_far[GAUSS - 1 - i][GAUSS - 1 - place];
    for (int k = 0; k < FINE; k++) {
        const Legendre p = legendre(fine_place(k));
        for (int i = 0; i < GAUSS; i++)
            for (int n = 0; n < GAUSS; n++) t.fine[i][k] += t.coefficient[i][n] * p.value[n];
    }
    return t;
}

constexpr GaussTables GAUSS_TABLES = gauss_tables();

}  // namespace pretouch
