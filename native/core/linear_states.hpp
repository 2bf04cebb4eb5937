// What an over-damped motion of constant slope is made of, at one time, on vectors.
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
#include "linear_rates.hpp"

namespace PRETOUCH_VARIANT {

struct Early {
    Lanes f, f3;
};

// f and 1 * f by their series in z = -(mu_1 + mu_2) t and w = mu_1 mu_2 t^2, for short t.
static inline Early early_functions(Lanes t, Lanes z, Lanes w) {
    const Lanes s2 = z * z - w, s3 = z * s2 - w * z, s4 = z * s3 - w * s2, s5 = z * s4 - w * s3, s6 = z * s5 - w * s4;
    const Lanes f = (0.5 + (1.0 / 6) * z) + ((1.0 / 24) * s2 + (1.0 / 120) * s3) +
                    ((1.0 / 720) * s4 + ((1.0 / 5040) * s5 + (1.0 / 40320) * s6));
    const Lanes last = (1.0 / 5040) * s4 + ((1.0 / 40320) * s5 + (1.0 / 362880) * s6);
    const Lanes f3 = ((1.0 / 6) + (1.0 / 24) * z) + ((1.0 / 120) * s2 + (1.0 / 720) * s3) + last;
    return {t * t * f, t * t * t * f3};
}

struct Functions {
    Lanes h, slope, f, f3;     // h, h', f, 1 * f
    Lanes fast, twice, third;  // e_2 * h, h * h, h * f, which the derivatives need
};

static inline Functions functions(Lanes t, const Rates &rates) {
    const auto &[mu1, mu2, by1, by2, width, by_width] = rates;
    const Lanes total = mu1 + mu2;
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
    const Early early = early_functions(t, -total * t, mu1 * mu2 * square);
    const Masks is_short = mu2 * t < 0.03;
    return {h,    slope, where(is_short, early.f, f), where(is_short, early.f3, f3),
            fast, twice, ((ramp - slow) * by2 - twice) * by2};
}

struct States {
    Lanes displacement, velocity, acceleration, approach, integral;  // x~, x~', x~'', l' and the integral of x~
};

// force: (c v - K x~(0)) / M
static inline States states_at(Lanes t, const Rates &rates, Lanes force, Lanes x0, Lanes u0, Lanes v) {
    const Functions q = functions(t, rates);
    const Lanes velocity = force * q.h + u0 * q.slope;
    return {x0 + u0 * q.h + force * q.f, velocity,
            (force - (rates.mu1 + rates.mu2) * u0) * q.slope - rates.mu1 * rates.mu2 * u0 * q.h, v - velocity,
            x0 * t + u0 * q.f + force * q.f3};
}

// Rows of m numbers; none where nothing is found.
static inline void store_states(double *to, int64_t m, const States &states, Masks found, int64_t count) {
    const Lanes none = all(NOT_A_NUMBER);
    store(to, where(found, states.displacement, none), count);
    store(to + m, where(found, states.velocity, none), count);
    store(to + 2 * m, where(found, states.acceleration, none), count);
    store(to + 3 * m, where(found, states.approach, none), count);
    store(to + 4 * m, where(found, states.integral, none), count);
}

// Which contacts are found.
static inline Masks load_status(const int8_t *status, int64_t count) {
    Masks open = {};
    for (int k = 0; k < WIDTH && k < count; k++) open[k] = status[k];
    return open == 0;
}

}  // namespace PRETOUCH_VARIANT
