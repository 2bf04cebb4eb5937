// How a contact depends on its inputs, followed along a motion of any kind: the scalar path, for what is not in lanes.
//
// The motion is integrated again, by the expansion, the steps and the proofs of series.cpp, so that it ends where the
// guaranteed path ends, through every turn and every border of the curve. Beside it run its small changes d of l,
//
//     M d'' + D d' + K d + D_p (g d)' = f,    d' = y - c d,   y' = (f - K d) / M,   c = (D + D_p g) / M,
//
// one for each input, each from its own start and with its own force f: x~'' for M, x~' for D, x~ for K, -d(ln xi)/dt for
// D_p, and what obstacle and plant bring with them. A parameter of the curve that adds rho(l) to g has f = -D_p rho l'.
// No identity is used to save a response, so this also tests those of lanes_series.cpp.

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

// The series of some responses and their forces over M, in tau; where their next step starts, and their largest values.
struct Responses {
    double d[ORDER + 1][SIDE], y[ORDER + 1][SIDE], force[ORDER][SIDE];
    double size[SIDE];
};

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

    double *force(int64_t response, int k) { return &blocks[response / SIDE].force[k][response % SIDE]; }
    void start();
    void expand_slope(const Piece &piece);
    void expand_forces(int64_t piece, double time, double unit);
    void expand_responses(double unit);
    double reach(double longest);
    void advance(double tau);
};

// Set the responses at t = 0: of x~(0), x~'(0), p and v to themselves.
void Following::start() {
    for (int64_t b = 0; b < count; b++) {
        Responses &block = blocks[b];
        for (int r = 0; r < SIDE; r++) block.d[0][r] = block.y[0][r] = block.size[r] = 0;
    }
    blocks->d[0][X0] = -1;
    blocks->y[0][X0] = -held[0];
    blocks->y[0][U0] = -1;
    blocks->d[0][P] = 1;
    blocks->y[0][P] = held[0];
    blocks->y[0][V] = 1;
}

// The series of c.
void Following::expand_slope(const Piece &piece) {
    for (int k = 0; k <= ORDER; k++) {
        double total = 0;
        for (int j = 1; j < TERMS; j++) total += piece.g[j] * series.powers[k][j - 1];
        held[k] = gain * total;
    }
    held[0] += m.damping + gain * piece.g[0];
    for (int k = 0; k <= ORDER; k++) held[k] /= m.mass;
}

// The series of the force of each input, over M.
void Following::expand_forces(int64_t piece, double time, double unit) {
    const double *l = series.l, *speed = series.v, velocity = obstacle_speed(m, time), bend = m.a;
    for (int k = 0; k < ORDER; k++) {
        double *force = blocks->force[k];
        for (int r = 0; r < SIDE; r++) force[r] = 0;
        force[MASS] = -(k + 1) * speed[k + 1] / unit;
        force[DAMPING] = -speed[k];
        force[STIFFNESS] = -l[k];
        force[GAIN] = -series.force[k];
    }
    double(*force)[SIDE] = blocks->force;
    force[0][MASS] += bend;
    force[0][DAMPING] += velocity;
    force[1][DAMPING] += bend * unit;
    force[0][STIFFNESS] += m.p + (m.v + bend / 2 * time) * time;
    force[1][STIFFNESS] += velocity * unit;
    force[2][STIFFNESS] += bend / 2 * unit * unit;
    force[0][P] = m.stiffness;
    force[0][V] = m.damping + m.stiffness * time;
    force[1][V] = m.stiffness * unit;
    force[0][A] = m.mass + (m.damping + m.stiffness * time / 2) * time;
    force[1][A] = (m.damping + m.stiffness * time) * unit;
    force[2][A] = m.stiffness / 2 * unit * unit;
    for (int64_t i = 0; i < parameters; i++) {
        const double *term = terms + (piece * parameters + i) * width;
        double rho[ORDER];
        for (int k = 0; k < ORDER; k++) {
            rho[k] = k == 0 ? term[0] : 0;
            double total = 0;
            for (int j = 1; j < TERMS && j < width; j++) total += term[j] * series.powers[k][j - 1];
            rho[k] += total;
            double product = 0;
            for (int s = 0; s <= k; s++) product += rho[s] * speed[k - s];
            *this->force(INPUTS + i, k) = -gain * product;
        }
    }
    for (int64_t b = 0; b < count; b++) {
        for (int k = 0; k < ORDER; k++) {
            for (int r = 0; r < SIDE; r++) blocks[b].force[k][r] /= m.mass;
        }
    }
}

// The series of d and of y of each response.
void Following::expand_responses(double unit) {
    const double stiffness = m.stiffness / m.mass;
    for (int64_t b = 0; b < count; b++) {
        Responses &block = blocks[b];
        for (int k = 0; k < ORDER; k++) {
            double totals[SIDE];
            for (int r = 0; r < SIDE; r++) totals[r] = block.y[k][r];
            for (int i = 0; i <= k; i++) {
                for (int r = 0; r < SIDE; r++) totals[r] -= held[i] * block.d[k - i][r];
            }
            for (int r = 0; r < SIDE; r++) {
                block.d[k + 1][r] = unit * totals[r] / (k + 1);
                block.y[k + 1][r] = unit * (block.force[k][r] - stiffness * block.d[k][r]) / (k + 1);
            }
        }
    }
}

// x^k by squares.
inline double power(double x, int k) {
    double found = 1;
    for (; k > 0; k >>= 1, x *= x) {
        if (k & 1) found *= x;
    }
    return found;
}

// The largest tau, at most the longest, at which every response is at rounding beside its largest value so far.
double Following::reach(double longest) {
    double tau = longest;
    for (int64_t row = 0; row < INPUTS + parameters; row++) {
        Responses &block = blocks[row / SIDE];
        const int r = static_cast<int>(row % SIDE);
        const double now = fabs(block.d[0][r]);
        for (int i = 0; i < TRIES; i++) {
            double size = larger(block.size[r], now), rise = 1;
            for (int k = 1; k < ORDER - 3; k++) {  // a response from rest is as large as it is about to be
                rise *= tau;
                size = larger(size, fabs(block.d[k][r]) * rise);
            }
            const double before = tau;
            for (int k = ORDER - 1; k <= ORDER; k++) {
                const double last = fabs(block.d[k][r]), part = last * power(tau, k);
                if (part > LEFT_ALONE * size) tau *= pow(LEFT_ALONE * size / part, 1.0 / k);
            }
            if (tau > 0.9 * before) break;
        }
        block.size[r] = larger(block.size[r], now);
    }
    return tau;
}

// Bring the responses to the start of the next step.
void Following::advance(double tau) {
    for (int64_t b = 0; b < count; b++) {
        Responses &block = blocks[b];
        double d[SIDE], y[SIDE];
        for (int r = 0; r < SIDE; r++) {
            d[r] = block.d[ORDER][r];
            y[r] = block.y[ORDER][r];
        }
        for (int k = ORDER - 1; k >= 0; k--) {
            for (int r = 0; r < SIDE; r++) {
                d[r] = d[r] * tau + block.d[k][r];
                y[r] = y[r] * tau + block.y[k][r];
            }
        }
        for (int r = 0; r < SIDE; r++) {
            block.d[0][r] = d[r];
            block.y[0][r] = y[r];
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
        one.expand_forces(index, time, unit);
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
                const double d = one.blocks[r / SIDE].d[0][r % SIDE], y = one.blocks[r / SIDE].y[0][r % SIDE];
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
            Following one = {reinterpret_cast<const Values *>(values)[i], gains[i], terms, k, q - 2, all, count, {}, {}};
            status[i] = follow(one, curve, horizon, rows);
        }
        for (int64_t j = 0; status[i] != REACHED && j < 2 * many; j++) rows[j] = NAN;
    }
    if (count > 1) free(all);
}
