// The polynomial of l on a step [0, tau]: prove from its coefficients how l moves, and find where l passes a border.
//
// A step is accepted only if one of three properties is proved:
//
//   - l is monotone. Its value at the end then decides whether it passed a border.
//   - l stays between the two borders, since the sum of all terms is too small to reach one.
//   - l'' has one sign. Then l has at most one turning point, and its values there and at the end decide.
//
// A touch needs the third property: near a touch, the other two hold only on shorter and shorter steps.

#pragma once

#include "lanes_taylor.hpp"
#include "pieces.hpp"

namespace PRETOUCH_VARIANT {

namespace {

using namespace pretouch;

constexpr double SHORTEST = 1e-14;  // smallest tau for which a proof is tried
constexpr int MOST_HALVINGS = 100;  // largest number of Newton or bisection steps

// An accepted step. tau, end: its length, and l at its end; moved: -1 or 1 if l reaches the lower or upper border
// there, else 0; touched: whether the contact is a touch; since: the time from which l is monotone.
struct Accepted {
    double tau, end;
    int moved;
    bool touched;
    double since;
};

// The proved properties of l on [0, tau]: it is monotone, it stays inside the borders, its curvature has one sign.
struct Proof {
    bool monotone, inside, bent;
    bool none() const { return !(monotone || inside || bent); }
};

// Prove these properties from the coefficients. What is not proved is false.
inline Proof certify(const double *c, const Borders &borders, double tau) {
    double below = 0, above = 0, bend = 0, turn = 0, power = 1;
    for (int k = 1; k <= ORDER; k++) {
        const double slope = k * fabs(c[k]) * power;
        if (k > 1) bend += slope;
        if (k > 2) turn += (k - 1) * slope;
        power *= tau;
        below += smaller(c[k] * power, 0.0);
        above += larger(c[k] * power, 0.0);
    }
    const bool inside = c[0] + below > borders.low && c[0] + above < borders.high;
    return {fabs(c[1]) > bend, inside, 2 * fabs(c[2]) * tau > turn};
}

// LEVEL: the time at which a polynomial that is monotone between two times passes a level. TURNING: the time at which
// its slope, which must be monotone there, changes sign. Newton's method starts from the right end; a step that leaves
// the bracket is replaced by bisection. resolved: the tolerance, relative to the right end.
enum Wanted { LEVEL, TURNING };
inline double zero_time(const double *c, Wanted wanted, double level, double left, double right,
                        double resolved = 4e-16) {
    const auto miss = [&](const Point<double> &p) { return wanted == LEVEL ? p.value - level : p.slope; };
    const double tau = right;
    double t = right;
    Point<double> p = look_at(c, t);
    const bool rising = miss(p) > 0;
    for (int i = 0; i < MOST_HALVINGS; i++) {
        ((miss(p) > 0) == rising ? right : left) = t;
        const double step = t - miss(p) / (wanted == LEVEL ? p.slope : p.bend);
        if (fabs(step - t) <= resolved * tau) return smaller(larger(step, left), right);
        t = left <= step && step <= right ? step : 0.5 * (left + right);
        p = look_at(c, t);
    }
    return t;
}

// Shorten a step until one of the properties is proved, and end it at the first border that l passes, if any. begin:
// the time at tau = 0 [s]; unit: the unit of tau [s].
inline Accepted accepted_step(const Values &m, const double *c, const Borders &borders, double begin, double unit,
                              double tau) {
    Proof proof = certify(c, borders, tau);
    while (proof.none() && tau > SHORTEST) {
        tau *= 0.5;
        proof = certify(c, borders, tau);
    }
    double end = look_at(c, tau).value;
    if (proof.inside) return {tau, end, 0, false, 0};
    double since = 0;
    const bool turns = proof.bent && !proof.monotone && c[1] != 0 && (look_at(c, tau).slope < 0) != (c[1] < 0);
    const double turn = turns ? zero_time(c, TURNING, 0, 0, tau) : tau;
    if (turn < tau) {
        const double peak = look_at(c, turn).value;
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
    if (end <= borders.low) return {zero_time(c, LEVEL, borders.low, since, tau), borders.low, -1, false, since};
    if (end >= borders.high) return {zero_time(c, LEVEL, borders.high, since, tau), borders.high, 1, false, since};
    return {tau, end, 0, false, since};
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
