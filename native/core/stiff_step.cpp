// One long step of a stiff motion by the Radau IIA method: a polynomial that satisfies L(1) and L(2) at ten points.
//
// If D + D_p g is large compared with M, the initial transient decays within M / (D + D_p g), and a slow motion
// follows. A Taylor step covers only a few of these times, even if the slow motion is smooth. Here l' is a polynomial
// over the whole step, with l'' from the equation of motion at the Radau points, found by Newton's method. The method
// is L-stable, so rounding errors of the fast part decay, too.
//
// A step is accepted only if its coefficients show that it is resolved: the last Legendre coefficients of l'' must be
// negligible compared with l', or as small as its rounding error allows. A fast part of a motion, such as an
// oscillation or the transient, is therefore never skipped, because its coefficients do not decay. The damping must be
// positive at all points, because errors of an unstable motion do not decay.

#include "stiff_step.hpp"

#include <string.h>

#include "pretouch.h"
#include "radau_tables.hpp"

namespace pretouch {

namespace {

constexpr double LONG = 8;         // length of the first attempt, in Taylor steps
constexpr double WORTH = 2;        // shortest attempt, in Taylor steps; a shorter one does not pay for its ten points
constexpr double FAR = 64;         // if the longest useful step has more Taylor steps than this, the wait is shorter
constexpr double EAGER = 4;        // factor by which it is shorter
constexpr double FORGOTTEN = 0.1;  // largest share of an error of l' that remains after a long step
constexpr double UNRESOLVED = 1e-12;  // largest last coefficients of l'', relative to l'. The omitted ones are about
                                      // ten times smaller, and those of l' are ten times smaller again.
constexpr double NOISE = 300;  // amplification of rounding errors in the last two coefficients: about POINTS^2 each
constexpr double ROUNDING = 1.1e-16;
constexpr int ITERATIONS = 10;
constexpr double CLOSE = 1e-8;  // change of l', relative to l', after which one more step of Newton's method converges

// The virtual force F = gain s'^exponent with s' = d ln xi / dt.
struct Force {
    double gain;
    int exponent;
};

// Values at the points: h l'', l', l and F / gain.
struct AtPoints {
    double rise[POINTS], v[POINTS], l[POINTS], force[POINTS];
};

typedef double Pair __attribute__((vector_size(2 * sizeof(double))));  // fits the vector registers of any processor

constexpr int PAIRS = POINTS / 2;

// One equation of a linear system, in pairs of coefficients; the last pair is the right-hand side and an unused 0.
struct Row {
    Pair pairs[PAIRS + 1];
    double operator[](int j) const { return pairs[j / 2][j % 2]; }
    double right() const { return pairs[PAIRS][0]; }
};

Pair load(const double *from) { return Pair{from[0], from[1]}; }

// Scalar product of two vectors of length POINTS.
double product(const double *x, const double *y) {
    Pair sum = load(x) * load(y);
    for (int j = 1; j < PAIRS; j++) sum += load(x + 2 * j) * load(y + 2 * j);
    return sum[0] + sum[1];
}

// Solves a linear system by Gaussian elimination with pivoting; returns false if the system is singular.
bool solve(Row *rows, double *solution) {
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
        for (int j = k + 1; j < POINTS; j++) total -= (*order[k])[j] * solution[j];
        solution[k] = total / (*order[k])[k];
    }
    return true;
}

// Result of a step of Newton's method: whether it could be computed, the largest change of l' and the rounding error of
// l' [m/s].
struct Moved {
    bool valid;
    double change, noise;
};

// Sets up the equations of a step of Newton's method. Returns the rounding error of l' [m/s], or -1 if the damping
// D + g dF/ds' is not positive at all points.
double linearize(const Values &m, const Force &law, const Piece &piece, const Start &state, double h, AtPoints &at,
                 Row *rows) {
    const double inertia = m.mass / h;
    double noise = 0, terms = 0;
    for (int j = 0; j < COEFFICIENTS; j++) terms += fabs(piece.g[j]);
    for (int i = 0; i < POINTS; i++) {
        const double t = state.time + h * RADAU.nodes[i];
        const Slope slope = slope_at(piece, at.l[i]);
        const double rate = slope.value * at.v[i], gain = law.exponent == 2 ? 2 * law.gain * rate : law.gain;  // dF/ds'
        const double held = m.damping + gain * slope.value;
        if (!(held > 0)) return -1;
        at.force[i] = law.exponent == 2 ? rate * rate : rate;
        const double own = m.stiffness * obstacle_at(m, t), brought = m.damping * obstacle_speed(m, t);
        const double drive = own + brought + m.mass * m.a;
        const double brake = law.exponent == 2 ? m.damping * at.v[i] + law.gain * at.force[i] : held * at.v[i];
        const double residual = inertia * at.rise[i] + brake + m.stiffness * at.l[i] - drive;
        const double steep = terms + fabs(slope.bend * at.l[i]);  // g's rounding error: of its terms, and through l
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

Moved iterate(const Values &m, const Force &law, const Piece &piece, const Start &state, double h, AtPoints &at) {
    Row rows[POINTS];
    double correction[POINTS];
    const double noise = linearize(m, law, piece, state, h, at, rows);
    if (noise < 0 || !solve(rows, correction)) return {false, 0, 0};
    double change = 0;
    for (int j = 0; j < POINTS; j++) at.rise[j] += correction[j];
    for (int i = 0; i < POINTS; i++) {
        const double v = state.speed + product(RADAU.integrals[i], at.rise);
        change = larger(change, fabs(v - at.v[i]));
        at.v[i] = v;
    }
    for (int i = 0; i < POINTS; i++) at.l[i] = state.l + h * product(RADAU.integrals[i], at.v);
    return {isfinite(change) != 0, change, noise};
}

// Returns the largest |l'| at the points and at the start; NaN if all points have NaN.
double fastest(const Start &state, const AtPoints &at) {
    double largest = fabs(state.speed);
    for (int i = 0; i < POINTS; i++) {
        if (!(fabs(at.v[i]) <= largest)) largest = fabs(at.v[i]);  // also true for NaN
    }
    return largest;
}

// Writes the power coefficients of the polynomial through the values at the points.
void to_series(const double *at_points, double *series) {
    double parts[POINTS];
    for (int k = 0; k < POINTS; k++) parts[k] = product(RADAU.to_legendre[k], at_points);
    for (int k = 0; k < POINTS; k++) series[k] = product(RADAU.to_powers[k], parts);
}

// Tries one step of length h. Returns the ratio of the last coefficients of l'' to their limit. A ratio of at most 1
// means that the step is resolved; `l` and `force` are then filled with the series. The ratio is infinite if Newton's
// method does not converge, or if the damping is not positive.
//
// doubt: error of l' at the start [m/s]. It raises the limit, because the step damps this error: the decay of the error
// is a fast transient that need not be resolved.
double collocate(const Values &m, const Force &law, const Piece &piece, const Start &state, double h, double doubt,
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
        const Moved moved = iterate(m, law, piece, state, h, at);
        noise = moved.noise;
        if (!moved.valid) return INFINITY;
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
                 Pace &pace, double *l, double *force, int exponent) {
    if (pace.wait > 0) {
        pace.wait -= longest > FAR * taylor ? EAGER : 1;
        return 0;
    }
    double h = smaller(larger(pace.next, LONG * taylor), longest);
    if (h < WORTH * taylor) return 0;  // the border is too near for a long step
    while (h >= WORTH * taylor) {
        const double missed = collocate(m, {gain, exponent}, piece, state, h, pace.doubt, l, force);
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
