// What an over-damped motion of constant slope is made of, on vectors: its rates, and its functions at one time.
//
// With e_1, e_2 the exponentials of -mu_1 t, -mu_2 t and * the convolution over [0, t], h = e_1 * e_2 and f = 1 * h,
// the sensitivity S of x~ to a coefficient is again a forced motion from rest, M S'' + (D + c) S' + K S = -x~'' (to
// M), -x~' (to D), -x~ (to K), v - x~' (to c = g D_p): a convolution of h / M with what stands on the right. All
// that x~ is made of are 1, h, h' and f, so all that is needed are
//
//     j = h * h,      h * h' = j' = e_2 * h - mu_1 j,      h * f = (f * e_1 - j) / mu_2,      1 * f,
//
// which quotients by mu_2 - mu_1 and mu_1 give away from zero and the functions phi_m of the exponential near it.

#pragma once

#include "lanes_exponential.hpp"
#include "pretouch.h"

namespace PRETOUCH_VARIANT {

// The inputs: M, D, K, x~(0), x~'(0), p, v, a, D_p; for the largest demands velocity and acceleration of the reference.
enum { MASS, DAMPING, STIFFNESS, X0, U0, P, V, A, GAIN, LINEAR_INPUTS, DRIFT = LINEAR_INPUTS, PULL, ALL_INPUTS };

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

// Some encounters, and what is found of their contacts.
struct Encounters {
    Rates rates;
    Lanes gap, force, by_mass;  // l(0), F = (c v - K x~(0)) / M, 1 / M
    Lanes x0, u0, v;
    Lanes time;
    Masks found;
};

struct Basis {
    Lanes rest, h, e2;  // 1 - e_1, h and e_2
};

template <Exponential exponential_of(Lanes)> static inline Basis basis(Lanes t, const Rates &rates) {
    const auto [e1, rest] = exponential_of(-rates.mu1 * t);
    const Lanes decay = e1 * exponential_of(-rates.width * t).rest;
    return {rest, decay * rates.by_width, e1 - decay};
}

struct Early {
    Lanes f, f3;
    Masks holds;
};

// f and 1 * f by their series in z = -(mu_1 + mu_2) t and w = mu_1 mu_2 t^2, for short t.
static inline Early early_functions(Lanes t, const Rates &rates) {
    const Lanes z = -(rates.mu1 + rates.mu2) * t, w = rates.mu1 * rates.mu2 * t * t;
    const Lanes s2 = z * z - w, s3 = z * s2 - w * z, s4 = z * s3 - w * s2, s5 = z * s4 - w * s3, s6 = z * s5 - w * s4;
    const Lanes f = (0.5 + (1.0 / 6) * z) + ((1.0 / 24) * s2 + (1.0 / 120) * s3) +
                    ((1.0 / 720) * s4 + ((1.0 / 5040) * s5 + (1.0 / 40320) * s6));
    const Lanes last = (1.0 / 5040) * s4 + ((1.0 / 40320) * s5 + (1.0 / 362880) * s6);
    const Lanes f3 = ((1.0 / 6) + (1.0 / 24) * z) + ((1.0 / 120) * s2 + (1.0 / 720) * s3) + last;
    return {t * t * f, t * t * t * f3, rates.mu2 * t < 0.03};
}

struct Functions {
    Lanes h, slope, f, f3;     // h, h', f, 1 * f
    Lanes fast, twice, third;  // e_2 * h, h * h, h * f, which the derivatives need
};

static inline Functions functions(Lanes t, const Rates &rates) {
    const auto &[mu1, mu2, by1, by2, width, by_width] = rates;
    const auto [e1, m1, p1, cubic1, near1] = exponential_parts(-mu1 * t);
    const auto [e, m, p, cubic, near] = exponential_parts(-width * t);
    const Lanes decay = e1 * m, square = t * t, x = width * t, x1 = mu1 * t;
    const Lanes h = decay * by_width, e2 = e1 * e, slope = e2 - mu1 * h;
    const Lanes second = where(near1, square * p1, (t - m1 * by1) * by1);                             // 1 * 1 * e_1
    const Lanes ramp = where(near1, square * (1.0 - (1.0 + x1) * p1), (m1 * by1 - t * e1) * by1);     // 1 * e_1 * e_1
    const Lanes late = e1 * square;
    const Lanes fast = where(near, late * (1.0 - (1.0 + x) * p), (h - t * e2) * by_width);            // e_2 * h
    const Lanes slow = where(near, late * p, (t * e1 - h) * by_width);                                // e_1 * h
    const Lanes twice =
        where(near, late * t * (0.5 - (x + 2.0) * cubic), (t * (e1 + e2) - 2.0 * h) * by_width * by_width);
    const Lanes f = (m1 * by1 - h) * by2, f3 = (second - f) * by2;
    const Early early = early_functions(t, rates);
    return {h,    slope, where(early.holds, early.f, f), where(early.holds, early.f3, f3),
            fast, twice, ((ramp - slow) * by2 - twice) * by2};
}

// Rows of numbers, those of the encounters from the i-th on; none where nothing is found.
struct Rows {
    pretouch_rows to;
    int64_t i, left;
    Masks found;

    void keep(int64_t row, Lanes values) const {
        store(to.at + row * to.stride + i, where(found, values, all(NOT_A_NUMBER)), left);
    }
};

}  // namespace PRETOUCH_VARIANT
