// How a contact depends on its inputs, followed along a motion of any kind: the scalar path, for what is not in lanes.
//
// The motion is integrated again, by the expansion, the steps and the proofs of series.cpp, so that it ends where the
// guaranteed path ends, through every turn and every border of the curve. Beside it run its small changes d of l,
//
//     M d'' + D d' + K d + D_p (g d)' = f,    d' = y - c d,   y' = (f - K d) / M,   c = (D + D_p g) / M,
//
// one for each input, each from its own start and with its own force f: x~'' for M, x~' for D, x~ for K, -d(ln xi)/dt
// for D_p, and what obstacle and plant bring with them. A parameter of the curve that adds rho(l) to g has f = -D_p
// rho l'. No identity is used to save a response, so this also tests those of lanes_series.cpp.

#include <stdlib.h>

#include "pretouch.h"
#include "series.hpp"

namespace pretouch {

namespace {

enum Followed { MASS, DAMPING, STIFFNESS, X0, U0, P, V, A, GAIN, INPUTS };  // and then the parameters of the curve
enum Status : int8_t { REACHED, BEYOND, NO_CONTACT };

constexpr int MOST_STEPS = 20000;  // what is stiffer is differentiated by differences
constexpr int TRIES = 8;
constexpr double LEFT_ALONE = 1e-15;  // of the largest value of a response, per step

constexpr int SIDE = 10;  // responses side by side: those of the inputs, and of one parameter
constexpr int PAIRS = SIDE / 2;

// The series of some responses and their forces over M, in tau, and their largest values.
struct Responses {
    Pair d[ORDER + 1][PAIRS], y[ORDER + 1][PAIRS], force[ORDER][PAIRS], size[PAIRS];
};

inline double at(const Pair *pairs, int64_t r) { return pairs[r / 2][r % 2]; }
inline void put(Pair *pairs, int64_t r, double value) { pairs[r / 2][r % 2] = value; }

// Of one encounter: the blocks of its responses, and the coefficients of rho in z for each parameter on each piece.
struct Following {
    const Values &m;
    const double gain;
    const double *terms;
    const int64_t parameters, width;
    Responses *blocks;
    int64_t count;  // of blocks

    Expansion series;
    double held[ORDER + 1];  // the series of c

    void start();
    double start_of(const Piece &piece) const { return (series.l[0] - piece.middle) / piece.half; }
    void compose(const double *terms, double start, double factor, double *out);
    void expand_slope(const Piece &piece);
    void expand_forces(double time, double unit);
    void expand_parameters(const Piece &piece, int64_t index);
    void expand_responses(double unit);
    double shrinks(double tau) const;
    double reach(double longest);
    void advance(double tau);
};

// Set the responses at t = 0: of x~(0), x~'(0), p and v to themselves.
void Following::start() {
    for (int64_t b = 0; b < count; b++) {
        Responses &block = blocks[b];
        for (int r = 0; r < PAIRS; r++) block.d[0][r] = block.y[0][r] = block.size[r] = Pair{};
        for (int k = 0; k < ORDER; k++) {
            for (int r = 0; r < PAIRS; r++) block.force[k][r] = Pair{};
        }
    }
    Pair *d = blocks->d[0], *y = blocks->y[0];
    put(d, X0, -1);
    put(y, X0, -held[0]);
    put(y, U0, -1);
    put(d, P, 1);
    put(y, P, held[0]);
    put(y, V, 1);
}

// The series of a polynomial in z beside that of l.
void Following::compose(const double *terms, double start, double factor, double *out) {
    double g[TERMS];
    for (int j = 0; j < TERMS; j++) g[j] = j < width ? terms[j] : 0;
    recenter(g, start);
    for (int k = 0; k <= ORDER; k++) {
        double total = 0;
        for (int j = 1; j < TERMS; j++) total += g[j] * series.power(k, j - 1);
        out[k] = factor * total;
    }
    out[0] += factor * g[0];
}

// The series of c.
void Following::expand_slope(const Piece &piece) {
    compose(piece.g, start_of(piece), gain / m.mass, held);
    held[0] += m.damping / m.mass;
}

// The series of the force of each input, over M; those of x~(0) and x~'(0) stay 0.
void Following::expand_forces(double time, double unit) {
    const double *l = series.l, *speed = series.v, velocity = obstacle_speed(m, time), bend = m.a;
    const double by_mass = 1 / m.mass, by_unit = 1 / unit, stiffness = m.stiffness * by_mass;
    const double damping = m.damping * by_mass;
    const double path[3] = {obstacle_at(m, time), velocity * unit, bend / 2 * unit * unit};
    const double by_v[3] = {damping + stiffness * time, stiffness * unit, 0};
    const double by_a[3] = {1 + (damping + stiffness * time / 2) * time, (damping + stiffness * time) * unit,
                            stiffness / 2 * unit * unit};
    for (int k = 0; k < ORDER; k++) {
        const bool early = k < 3;
        const double path_speed = k == 0 ? velocity : k == 1 ? bend * unit : 0.0, path_bend = k == 0 ? bend : 0.0;
        Pair *force = blocks->force[k];
        put(force, MASS, (path_bend - (k + 1) * speed[k + 1] * by_unit) * by_mass);
        put(force, DAMPING, (path_speed - speed[k]) * by_mass);
        put(force, STIFFNESS, ((early ? path[k] : 0.0) - l[k]) * by_mass);
        put(force, P, k == 0 ? stiffness : 0.0);
        put(force, V, early ? by_v[k] : 0.0);
        put(force, A, early ? by_a[k] : 0.0);
        put(force, GAIN, -series.force[k] * by_mass);
    }
}

// The series of the force of each parameter of the curve, over M.
void Following::expand_parameters(const Piece &piece, int64_t index) {
    for (int64_t i = 0; i < parameters; i++) {
        double rho[ORDER + 1];
        compose(terms + (index * parameters + i) * width, start_of(piece), -gain / m.mass, rho);
        const int64_t row = INPUTS + i;
        for (int k = 0; k < ORDER; k++) {
            double product = 0;
            for (int s = 0; s <= k; s++) product += rho[s] * series.v[k - s];
            put(blocks[row / SIDE].force[k], row % SIDE, product);
        }
    }
}

// The series of d and of y of each response.
void Following::expand_responses(double unit) {
    const double stiffness = m.stiffness / m.mass;
    for (int64_t b = 0; b < count; b++) {
        Responses &block = blocks[b];
        for (int k = 0; k < ORDER; k++) {
            Pair totals[PAIRS];
            for (int r = 0; r < PAIRS; r++) totals[r] = block.y[k][r];
            for (int i = 0; i <= k; i++) {
                for (int r = 0; r < PAIRS; r++) totals[r] -= held[i] * block.d[k - i][r];
            }
            const double step = unit * INVERSE.at[k + 1];
            for (int r = 0; r < PAIRS; r++) {
                block.d[k + 1][r] = step * totals[r];
                block.y[k + 1][r] = step * (block.force[k][r] - stiffness * block.d[k][r]);
            }
        }
    }
}

// How much shorter a step must be for every response to be at rounding beside its largest value so far.
double Following::shrinks(double tau) const {
    double rises[ORDER + 1] = {1}, shortest = 1;
    for (int k = 1; k <= ORDER; k++) rises[k] = rises[k - 1] * tau;
    for (int64_t b = 0; b < count; b++) {
        const Responses &block = blocks[b];
        Pair most[2] = {};  // of what the last two terms are over what they may be
        for (int r = 0; r < PAIRS; r++) {
            Pair size = larger(block.size[r], size_of(block.d[0][r]));
            for (int k = 1; k < ORDER - 3; k++) {  // a response from rest is as large as it is about to be
                size = larger(size, size_of(block.d[k][r]) * rises[k]);
            }
            for (int k = 0; k < 2; k++) {
                const int degree = ORDER - 1 + k;
                const Pair last = size_of(block.d[degree][r]) * rises[degree], allowed = LEFT_ALONE * size;
                most[k] = larger(most[k], last > allowed ? last / allowed : Pair{});
            }
        }
        for (int k = 0; k < 2; k++) {
            const double excess = larger(most[k][0], most[k][1]);
            if (excess > 1) shortest = smaller(shortest, pow(excess, -1.0 / (ORDER - 1 + k)));
        }
    }
    return shortest;
}

// The largest tau, at most the longest, at which every response is at rounding.
double Following::reach(double longest) {
    double tau = longest;
    for (int i = 0; i < TRIES; i++) {
        const double factor = shrinks(tau);
        tau *= factor;
        if (factor > 0.9) break;
    }
    for (int64_t b = 0; b < count; b++) {
        for (int r = 0; r < PAIRS; r++) blocks[b].size[r] = larger(blocks[b].size[r], size_of(blocks[b].d[0][r]));
    }
    return tau;
}

// Bring the responses to the start of the next step.
void Following::advance(double tau) {
    for (int64_t b = 0; b < count; b++) {
        Responses &block = blocks[b];
        for (int r = 0; r < PAIRS; r++) {
            Pair d = block.d[ORDER][r], y = block.y[ORDER][r];
            for (int k = ORDER - 1; k >= 0; k--) {
                d = d * tau + block.d[k][r];
                y = y * tau + block.y[k][r];
            }
            block.d[0][r] = d;
            block.y[0][r] = y;
        }
    }
}

// Follow one encounter to its contact and write its gradients, of time and then of l'; tell how it ended.
Status follow(Following &one, const Curve &curve, double horizon, double *found) {
    const Values &m = one.m;
    const double start = m.p - m.x0, bottom = curve.bottom(0);
    const int64_t last = curve.count - 1, many = INPUTS + one.parameters;
    double time = 0, l = start, speed = m.v - m.u0;
    int64_t index = curve.find(l);
    double unit = first_unit(m, one.gain, curve.piece(index), speed, horizon);
    for (int i = 0; i < MOST_STEPS; i++) {
        const Piece piece = curve.piece(index);
        expand(m, one.gain, piece, time, unit, l, speed, one.series);
        one.expand_slope(piece);
        if (i == 0) one.start();
        one.expand_forces(time, unit);
        one.expand_parameters(piece, index);
        one.expand_responses(unit);
        const double reach = one.reach(reach_of(one.series, scale_of(m, start, time, l)));
        const Accepted step = accepted_step(m, one.series.l, curve.borders(index, bottom), time, unit,
                                            smaller(reach, (horizon - time) / unit));
        one.advance(step.tau);
        time += unit * step.tau;
        l = step.end;
        speed = horner(one.series.v, step.tau);
        if (step.touched) return NO_CONTACT;  // one with l' = 0, which an arbitrarily small change turns into none
        if (step.moved < 0 && index == 0) {
            const double bend = horner_slope(one.series.v, step.tau) / unit, now = horner(one.held, step.tau);
            for (int64_t r = 0; r < many; r++) {
                const Responses &block = one.blocks[r / SIDE];
                const double d = at(block.d[0], r % SIDE), y = at(block.y[0], r % SIDE);
                found[r] = -d / speed;
                found[many + r] = y - now * d + bend * found[r];
            }
            return REACHED;
        }
        if (step.moved > 0 && index == last) return BEYOND;
        if (time >= horizon || !isfinite(l + speed)) return NO_CONTACT;
        index += step.moved;
        unit = smaller(unit * reach, horizon);
    }
    return NO_CONTACT;
}

}  // namespace

}  // namespace pretouch

using namespace pretouch;

void pretouch_follow_gradients(const double *values, int64_t n, const double *gains, const double *pieces, int64_t p,
                               int64_t q, const double *terms, int64_t k, double horizon, double *found,
                               int8_t *status) {
    const Curve curve = {pieces, p, q};
    const int64_t many = INPUTS + k, count = (many + SIDE - 1) / SIDE;
    Responses first, *all = count > 1 ? static_cast<Responses *>(calloc((size_t)count, sizeof(Responses))) : &first;
    for (int64_t i = 0; i < n; i++) {
        double *rows = found + i * 2 * many;
        status[i] = NO_CONTACT;
        if (all) {
            const Values &m = reinterpret_cast<const Values *>(values)[i];
            Following one = {m, gains[i], terms, k, q - 2, all, count, {}, {}};
            status[i] = follow(one, curve, horizon, rows);
        }
        for (int64_t j = 0; status[i] != REACHED && j < 2 * many; j++) rows[j] = NAN;
    }
    if (count > 1) free(all);
}
