// The rates of an over-damped motion of constant slope, and the numbers of encounters as vectors.

#pragma once

#include "lanes.hpp"
#include "pretouch.h"

namespace PRETOUCH_VARIANT {

// The inputs: M, D, K, x~(0), x~'(0), p, v, a and D_p.
enum { MASS, DAMPING, STIFFNESS, X0, U0, P, V, A, GAIN, LINEAR_INPUTS };

// The rates mu_1 <= mu_2 of M mu^2 - (D + c) mu + K with their inverses, mu_2 - mu_1 with its own.
struct Rates {
    Lanes mu1, mu2, by1, by2, width, by_width;
};

struct Decays {
    Rates rates;
    Lanes by_mass, by_extra;
    Masks real;  // whether the rates are: over-damped or critical, and damped at all
};

// One division makes all inverses, and that of a number besides. mu_2 - mu_1 and mu_1 are kept 1e-9 and 1e-60 of the
// others from zero, which changes nothing that can be seen in a float and leaves no 0 / 0. The discriminant is put
// together so that neither a small c beside a critical D loses its digits, nor a small rest of D and a negative c.
static inline Decays decay_rates(Lanes mass, Lanes damping, Lanes stiffness, Lanes coupling, Lanes extra) {
    const Lanes total = damping + coupling, scale = total * total;
    const Lanes held = 4.0 * mass * stiffness;
    const Lanes disc = where(-2.0 * coupling > damping, scale - held,
                             (damping * damping - held) + coupling * (2.0 * damping + coupling));
    const Masks real = (disc >= -1e-15 * scale) & (total > 0.0) & (mass > 0.0) & (stiffness >= 0.0);
    const Lanes spread = root(most(disc, 1e-18 * scale));              // M (mu_2 - mu_1)
    const Lanes fast = 0.5 * (total + spread);                         // M mu_2
    const Lanes product = most(mass * stiffness, 1e-60 * scale);       // M^2 mu_1 mu_2
    const Lanes first = mass * product, second = spread * fast, whole = first * second;
    const Lanes inverse = 1.0 / (whole * extra), by_whole = inverse * extra;
    const Lanes by_first = by_whole * second, by_second = by_whole * first;
    const Lanes by_mass = by_first * product, by_fast = by_second * spread;
    const Rates rates = {product * by_fast * by_mass,    fast * by_mass,   fast * by_first * mass * mass,
                         mass * by_fast,                 spread * by_mass, mass * by_second * fast};
    return {rates, by_mass, inverse * whole, real};
}

// Columns of numbers, WIDTH at a time. What is one number for all is spread out once, and so are the last few of the
// others: the lanes that are left over hold what the first of them holds.
template <int COUNT> struct Columns {
    const double *at[COUNT];
    int64_t step[COUNT];
    double spread[COUNT][WIDTH];

    explicit Columns(const pretouch_column *columns) {
        for (int k = 0; k < COUNT; k++) {
            at[k] = columns[k].at;
            step[k] = columns[k].stride;
            if (step[k] == 0) spread_out(k, all(*at[k]));
        }
    }

    // from the i-th on, of which only some are there
    void reach(int64_t i, int64_t count) {
        if (count >= WIDTH) return;
        for (int k = 0; k < COUNT; k++)
            if (step[k]) {
                spread_out(k, load(at[k] + i, count));
                step[k] = 0;
            }
    }

    Lanes get(int k, int64_t i) const { return load(at[k] + step[k] * i); }

  private:
    void spread_out(int k, Lanes value) {
        store(spread[k], value);
        at[k] = spread[k];
    }
};

}  // namespace PRETOUCH_VARIANT
