// A step's polynomial of l, on [0, tau]: its values, and what its coefficients prove of it.
//
// A step counts only where one of three things is proved: l is monotone, so that its value at the end decides whether
// it passed a border; l stays between two borders, since the sum of all moves is too small to reach one; or l'' has
// one sign, so that l turns at most once, and its values there and at the end decide. The last is what a touch needs:
// next to it the other two hold on ever shorter steps only.

#pragma once

#include <math.h>

#include "endings.hpp"

namespace pretouch {

constexpr int ORDER = 20;
constexpr double SHORTEST = 1e-14;  // tau
constexpr int MOST_HALVINGS = 100;

typedef double Pair __attribute__((vector_size(2 * sizeof(double))));  // what the simplest processor has in a register

// the larger and the smaller; the first one where either is not a number
inline double larger(double x, double y) { return y > x ? y : x; }
inline Pair larger(Pair x, Pair y) { return y > x ? y : x; }
inline Pair size_of(Pair x) { return larger(x, -x); }
inline double smaller(double x, double y) { return y < x ? y : x; }

// A polynomial of tau: by Horner's scheme in tau^2, even and odd powers side by side.
template <int DEGREE = ORDER> inline double horner(const double *c, double tau) {
    constexpr int TOP = DEGREE / 2 * 2;
    const double square = tau * tau;
    Pair value = {c[TOP], DEGREE > TOP ? c[DEGREE] : 0.0};
    for (int k = TOP - 2; k >= 0; k -= 2) value = value * square + Pair{c[k], c[k + 1]};
    return value[0] + tau * value[1];
}

template <int DEGREE = ORDER> inline double horner_slope(const double *c, double tau) {
    constexpr int TOP = (DEGREE - 1) / 2 * 2 + 1;
    const double square = tau * tau;
    Pair value = {TOP * c[TOP], DEGREE > TOP ? DEGREE * c[DEGREE] : 0.0};
    for (int k = TOP - 2; k >= 1; k -= 2) value = value * square + Pair{k * c[k], (k + 1) * c[k + 1]};
    return value[0] + tau * value[1];
}

// Between which distances [m] a step must end, and where l comes into contact, at or below the lower one.
struct Borders {
    double low, high, contact;
};

// A step that counts: how long, and l at its end; -1 or 1 where that is the lower or the upper border and 0 elsewhere;
// whether the contact is only touched; since when l is monotone.
struct Accepted {
    double tau, end;
    int moved;
    bool touched;
    double since;
};

// Whether l is monotone on [0, tau], stays between the borders, and bends one way only.
struct Proof {
    bool monotone, inside, bent;
    bool none() const { return !(monotone || inside || bent); }
};

inline Proof certify(const double *c, const Borders &borders, double tau) {
    double rest = 0, bend = 0, turn = 0, power = 1;
    for (int k = 1; k <= ORDER; k++) {
        if (k > 1) bend += k * fabs(c[k]) * power;
        if (k > 2) turn += k * (k - 1) * fabs(c[k]) * power;
        power *= tau;
        rest += fabs(c[k]) * power;
    }
    return {fabs(c[1]) > bend, c[0] - rest > borders.low && c[0] + rest < borders.high, 2 * fabs(c[2]) * tau > turn};
}

// Where a series that is monotone between two times passes a level there.
inline double level_time(const double *c, double level, double left, double right) {
    double tau = right, t = right;
    const bool rising = horner(c, right) > level;
    for (int i = 0; i < MOST_HALVINGS; i++) {
        const double value = horner(c, t) - level;
        ((value > 0) == rising ? right : left) = t;
        const double step = t - value / horner_slope(c, t);
        if (fabs(step - t) <= 4e-16 * tau) return t;
        t = left <= step && step <= right ? step : 0.5 * (left + right);
    }
    return t;
}

// Where the slope of a series, monotone on [0, tau], changes its sign; tau where it does not.
inline double turn_time(const double *c, double tau) {
    const bool rising = c[1] < 0;
    if ((horner_slope(c, tau) < 0) == rising || c[1] == 0) return tau;
    double left = 0, right = tau, t = 0.5 * tau;
    for (int i = 0; i < MOST_HALVINGS; i++) {
        double value = ORDER * c[ORDER], bend = 0;
        for (int k = ORDER - 1; k > 0; k--) {
            bend = bend * t + value;
            value = value * t + k * c[k];
        }
        ((value < 0) == rising ? left : right) = t;
        const double step = t - value / bend;
        if (fabs(step - t) <= 4e-16 * tau) return t;
        t = left <= step && step <= right ? step : 0.5 * (left + right);
    }
    return t;
}

// Shorten a step until what l does on it is proved, and end it at the border that l passes first, if any; begin and
// unit: the time at tau = 0 and the unit of tau [s].
inline Accepted accepted_step(const Values &m, const double *c, const Borders &borders, double begin, double unit,
                              double tau) {
    Proof proof = certify(c, borders, tau);
    while (proof.none() && tau > SHORTEST) {
        tau *= 0.5;
        proof = certify(c, borders, tau);
    }
    double end = horner(c, tau);
    if (proof.inside) return {tau, end, 0, false, 0};
    double since = 0;
    const double turn = proof.bent && !proof.monotone ? turn_time(c, tau) : tau;
    if (turn < tau) {
        const double peak = horner(c, turn);
        const bool falls = c[1] < 0;
        if (falls && fabs(peak - borders.contact) <= resolution(m, begin + unit * turn)) {
            return {turn, borders.contact, -1, true, 0};
        }
        if (falls ? peak <= borders.low : peak >= borders.high) {
            tau = turn;
            end = peak;
        } else {
            since = turn;
        }
    }
    if (end <= borders.low) return {level_time(c, borders.low, since, tau), borders.low, -1, false, since};
    if (end >= borders.high) return {level_time(c, borders.high, since, tau), borders.high, 1, false, since};
    return {tau, end, 0, false, since};
}

}  // namespace pretouch
