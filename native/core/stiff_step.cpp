// One long step of a stiff motion by the Radau IIA method: a polynomial that satisfies L(1) with L(2) at ten points.
//
// If D + D_p g is large compared with M, the initial transient decays within M / (D + D_p g), and a slow motion follows.
// A Taylor step covers only a few of these times, even if the slow motion is smooth. Here l' is a polynomial over the
// whole step, with l'' from the equation of motion at the Radau points, found by Newton's method. The method is
// L-stable: rounding errors of the fast part decay, too.
//
// A step is accepted only if its coefficients show that it is resolved: the last Legendre coefficients of l'' must be
// negligible compared with l', or with its rounding error. A fast part of a motion, such as an oscillation or the
// transient, is therefore never skipped, since its coefficients do not decay. The damping must be positive at all
// points, since errors of an unstable motion do not decay.

#include "stiff_step.hpp"

#include <string.h>

#include "pretouch.h"
#include "radau_tables.hpp"

namespace pretouch {

namespace {

constexpr double LONG = 8;         // times a Taylor step: what a long one begins with
constexpr double WORTH = 2;        // times a Taylor step: what is shorter is not worth its ten points
constexpr double FAR = 64;         // times a Taylor step: where the next border is farther, long steps are tried
constexpr double EAGER = 4;        // times as soon
constexpr double FORGOTTEN = 0.1;  // of a wrong l': what is left of it after a long step, at most
constexpr double UNRESOLVED = 1e-12;  // of l': the last coefficients of l''; those left out are smaller by tens, and l'
                                      // by another ten
constexpr double NOISE = 300;  // what rounding is multiplied by in the last Legendre coefficient: about POINTS^2, twice
constexpr double ROUNDING = 1.1e-16;
constexpr int ITERATIONS = 10;
constexpr double CLOSE = 1e-8;  // of l': Newton's method has converged with one more step

// At the points: h l'', l', l and d ln xi / dt.
struct AtPoints {
    double rise[POINTS], v[POINTS], l[POINTS], force[POINTS];
};

typedef double Pair __attribute__((vector_size(2 * sizeof(double))));  // what the simplest processor has in a register

constexpr int PAIRS = POINTS / 2;

// A row of equations in pairs; the last pair is the right-hand side and nothing.
struct Row {
    Pair pairs[PAIRS + 1];
    double operator[](int j) const { return pairs[j / 2][j % 2]; }
    double right() const { return pairs[PAIRS][0]; }
};

Pair load(const double *from) { return Pair{from[0], from[1]}; }

// The product of two rows of numbers.
double product(const double *x, const double *y) {
    Pair sum = load(x) * load(y);
    for (int j = 1; j < PAIRS; j++) sum += load(x + 2 * j) * load(y + 2 * j);
    return sum[0] + sum[1];
}

// Solve a linear system by elimination.
bool solve(Row *rows, double *found) {
    Row *order[POINTS];
    for (int i = 0; i < POINTS; i++) order[i] = rows + i;
    for (int k = 0; k < POINTS; k++) {
        int pivot = k;
        for (int i = k + 1; i < POINTS; i++) {
            if (fabs((*order[i])[k]) > fabs((*order[pivot])[k])) pivot = i;
        }
        Row *chosen = order[pivot];
        order[pivot] = order[k];
        order[k] = chosen;
        if (!(fabs((*chosen)[k]) > 0)) return false;
        const double by_pivot = 1 / (*chosen)[k];
        for (int i = k + 1; i < POINTS; i++) {
            const double factor = (*order[i])[k] * by_pivot;
            for (int j = (k + 1) / 2; j <= PAIRS; j++) order[i]->pairs[j] -= factor * chosen->pairs[j];
        }
    }
    for (int k = POINTS - 1; k >= 0; k--) {
        double total = order[k]->right();
        for (int j = k + 1; j < POINTS; j++) total -= (*order[k])[j] * found[j];
        found[k] = total / (*order[k])[k];
    }
    return true;
}

// How far a step of Newton's method moved l', and what rounding makes of l'; whether there is one.
struct Moved {
    bool found;
    double change, noise;
};

// Set up the equations of a step of Newton's method; returns what rounding makes of l', negative where D + D_p g is not
// positive.
double linearize(const Values &m, double gain, const Piece &piece, const Start &state, double h, AtPoints &at,
                 Row *rows) {
    const double inertia = m.mass / h;
    double noise = 0, terms = 0;
    for (int j = 0; j < COEFFICIENTS; j++) terms += fabs(piece.g[j]);
    for (int i = 0; i < POINTS; i++) {
        const double t = state.time + h * RADAU.nodes[i];
        const Slope slope = slope_at(piece, at.l[i]);
        const double held = m.damping + gain * slope.value;
        if (!(held > 0)) return -1;
        at.force[i] = slope.value * at.v[i];
        const double own = m.stiffness * obstacle_at(m, t), brought = m.damping * obstacle_speed(m, t);
        const double drive = own + brought + m.mass * m.a;
        const double residual = inertia * at.rise[i] + held * at.v[i] + m.stiffness * at.l[i] - drive;
        const double steep = terms + fabs(slope.bend * at.l[i]);  // what g is a sum of, and what a rounding of l is in it
        const double size = fabs(own) + fabs(brought) + fabs(m.mass * m.a) + fabs(m.stiffness * at.l[i]) +
                            fabs(gain * at.v[i]) * steep;
        noise = larger(noise, ROUNDING * size / (held + inertia));
        const double spring = (m.stiffness + gain * slope.bend * at.v[i]) * h;
        Pair *pairs = rows[i].pairs;
        for (int j = 0; j < PAIRS; j++) {
            pairs[j] = held * load(RADAU.integrals[i] + 2 * j) + spring * load(RADAU.twice[i] + 2 * j);
        }
        pairs[i / 2][i % 2] += inertia;
        pairs[PAIRS] = Pair{-residual, 0};
    }
    return noise;
}

Moved iterate(const Values &m, double gain, const Piece &piece, const Start &state, double h, AtPoints &at) {
    Row rows[POINTS];
    double found[POINTS];
    const double noise = linearize(m, gain, piece, state, h, at, rows);
    if (noise < 0 || !solve(rows, found)) return {false, 0, 0};
    double change = 0;
    for (int j = 0; j < POINTS; j++) at.rise[j] += found[j];
    for (int i = 0; i < POINTS; i++) {
        const double v = state.speed + product(RADAU.integrals[i], at.rise);
        change = larger(change, fabs(v - at.v[i]));
        at.v[i] = v;
    }
    for (int i = 0; i < POINTS; i++) at.l[i] = state.l + h * product(RADAU.integrals[i], at.v);
    return {isfinite(change) != 0, change, noise};
}

// The largest l' at the points and at the start.
double fastest(const Start &state, const AtPoints &at) {
    double found = fabs(state.speed);
    for (int i = 0; i < POINTS; i++) {
        if (!(fabs(at.v[i]) <= found)) found = fabs(at.v[i]);  // and what is no number, where one is none
    }
    return found;
}

// Write the powers of the polynomial through the points.
void to_series(const double *at_points, double *series) {
    double parts[POINTS];
    for (int k = 0; k < POINTS; k++) parts[k] = product(RADAU.to_legendre[k], at_points);
    for (int k = 0; k < POINTS; k++) series[k] = product(RADAU.to_powers[k], parts);
}

// Try one step of any length. Returns the last coefficients of l'' over what they may be: at most 1 where the step is
// resolved, infinite where the equation has no solution that can be trusted. doubt: how well l' is known [m/s]: what is
// wrong with it is forgotten in the step. The series are filled where it is resolved.
double collocate(const Values &m, double gain, const Piece &piece, const Start &state, double h, double doubt,
                 double *l, double *force) {
    AtPoints at;
    for (int i = 0; i < POINTS; i++) {
        at.rise[i] = 0;
        at.v[i] = state.speed;
        at.l[i] = state.l + h * state.speed * RADAU.nodes[i];
    }
    double noise = 0;
    bool close = false;
    for (int i = 0; i < ITERATIONS; i++) {
        const Moved moved = iterate(m, gain, piece, state, h, at);
        noise = moved.noise;
        if (!moved.found) return INFINITY;
        if (close) break;
        double most = 0;
        for (int j = 0; j < POINTS; j++) most = larger(most, fabs(at.v[j]));
        close = moved.change <= CLOSE * (fabs(state.speed) + most) + noise;
    }
    if (!close) return INFINITY;
    const double last = fabs(product(RADAU.to_legendre[POINTS - 1], at.rise)) +
                        fabs(product(RADAU.to_legendre[POINTS - 2], at.rise));
    const double missed = last / (UNRESOLVED * fastest(state, at) + NOISE * (noise + doubt) + 1e-300);
    if (!(missed <= 1)) return missed;
    double rises[POINTS];
    to_series(at.rise, rises);
    to_series(at.force, force);
    l[0] = state.l;
    l[1] = h * state.speed;
    for (int k = 0; k < POINTS; k++) l[k + 2] = h * rises[k] / ((k + 1) * (k + 2));
    return missed;
}

}  // namespace

double long_step(const Values &m, double gain, const Piece &piece, const Start &state, double taylor, double longest,
                 Pace &pace, double *l, double *force) {
    if (pace.wait > 0) {
        pace.wait -= longest > FAR * taylor ? EAGER : 1;
        return 0;
    }
    double h = smaller(larger(pace.next, LONG * taylor), longest);
    if (h < WORTH * taylor) return 0;  // a border is near
    while (h >= WORTH * taylor) {
        const double missed = collocate(m, gain, piece, state, h, pace.doubt, l, force);
        const double factor = missed > 0 ? 0.9 * pow(missed, -0.1) : 4.0;
        if (missed <= 1) {
            if (h < longest || pace.next < h) pace.next = h * smaller(factor, 4);
            pace.patience = PATIENCE;
            pace.doubt *= FORGOTTEN;
            return h;
        }
        h *= smaller(larger(factor, 0.2), 0.5);
    }
    pace.next = 0;
    pace.wait = pace.patience;
    pace.patience *= 2;
    return 0;
}

}  // namespace pretouch

void pretouch_radau_points(double *tables) { memcpy(tables, &pretouch::RADAU, sizeof pretouch::RADAU); }
