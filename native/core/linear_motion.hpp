// Rates and basis functions of over-damped motions with constant slope, vectorized.
//
// Let e_1 and e_2 be the exponentials of -mu_1 t and -mu_2 t, and * the convolution over [0, t]. With h = e_1 * e_2 and
// f = 1 * h, the sensitivity S of x~ to a coefficient is again a forced motion from rest,
//
//     M S'' + (D + c) S' + K S = -x~'' (to M),   -x~' (to D),   -x~ (to K),   v - x~' (to c = g D_p),
//
// so it is the convolution of h / M with the right-hand side. x~ is a combination of 1, h, h' and f. Only these
// convolutions are needed:
//
//     j = h * h,      h * h' = j' = e_2 * h - mu_1 j,      h * f = (f * e_1 - j) / mu_2,      1 * f,
//
// If (mu_2 - mu_1) t and mu_1 t are not small, they are quotients by mu_2 - mu_1 and mu_1. Near zero, where these lose
// digits, the functions phi_m of the exponential replace them.

#pragma once

#include "lanes_exponential.hpp"
#include "pretouch.h"

namespace PRETOUCH_VARIANT {

// The inputs: M, D, K, x~(0), x~'(0), p, v, a, D_p. The largest demands also need velocity and acceleration of the
// reference.
enum { MASS, DAMPING, STIFFNESS, X0, U0, P, V, A, GAIN, LINEAR_INPUTS, DRIFT = LINEAR_INPUTS, PULL, ALL_INPUTS };

// The roots mu_1 <= mu_2 of M mu^2 - (D + c) mu + K, their inverses, and mu_2 - mu_1 and its inverse.
struct Rates {
    Lanes mu1, mu2, by1, by2, width, by_width;
};

struct Decays {
    Rates rates;
    Lanes by_mass, by_extra;  // 1 / M and 1 / extra
    Masks real;  // whether the rates are real (over-damped or critically damped) and the damping is positive
};

// Computes the rates. A single division yields all inverses, and also that of `extra`, which the caller needs.
//
// mu_2 - mu_1 is at least 1e-9 of mu_1 + mu_2, and mu_1 at least 1e-60 of it. This avoids 0 / 0 and changes results by
// less than their rounding errors. The discriminant has two forms, so that no digits are lost: one for a small c if D
// alone is critical, and one for a small D + c if c is negative.
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

// Some encounters and the results at their contacts.
struct Encounters {
    Rates rates;
    Lanes gap, force, by_mass;  // l(0), F = (c v - K x~(0)) / M and 1 / M
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

// f and 1 * f for short t, by their series in z = -(mu_1 + mu_2) t and w = mu_1 mu_2 t^2. holds: whether t is short
// enough.
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
    Lanes fast, twice, third;  // e_2 * h, h * h and h * f, for the derivatives
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

// Output rows of the encounters from index i on. Lanes without a contact get NaN.
struct Rows {
    pretouch_rows to;
    int64_t i, left;
    Masks found;

    void keep(int64_t row, Lanes values) const {
        store(to.at + row * to.stride + i, where(found, values, all(NOT_A_NUMBER)), left);
    }
};

// States at the contacts that lanes_linear.cpp finds, and their exact derivatives.
//
// At the contact l(t, q) = 0 for any input q. Therefore dt/dq = -(dl/dq) / l', and the derivative of any quantity y at
// the contact is dy/dq + y' dt/dq.

// the derivatives: by the inputs up to D_p, and by the slope
enum { OF_SLOPE = LINEAR_INPUTS, DERIVATIVES };

// Writes x~, x~', x~'', l' and the integral of x~ at the contacts.
[[gnu::noinline]] static void write_states(const Encounters &q, const Rows &rows) {
    const auto &[mu1, mu2, by1, by2, width, by_width] = q.rates;
    const auto [h, slope, f, f3, fast, twice, third] = functions(q.time, q.rates);
    const Lanes velocity = q.force * h + q.u0 * slope;
    rows.keep(0, q.x0 + q.u0 * h + q.force * f);
    rows.keep(1, velocity);
    rows.keep(2, (q.force - (mu1 + mu2) * q.u0) * slope - mu1 * mu2 * q.u0 * h);
    rows.keep(3, q.v - velocity);
    rows.keep(4, q.x0 * q.time + q.u0 * f + q.force * f3);
}

// The motion at contact, and the rows to which its derivatives are written.
struct Contact {
    Lanes velocity, acceleration, by_approach;  // x~', x~'' and 1 / l'
    const Rows &rows;

    // Writes the derivatives of t, x~ and l' at the contact by one input. Arguments: the derivatives of -l, of -l' and
    // of the obstacle's position at a fixed time.
    void keep(int input, Lanes of_distance, Lanes of_speed, Lanes fixed) const {
        const Lanes of_time = of_distance * by_approach;
        rows.keep(input, of_time);
        rows.keep(DERIVATIVES + input, of_distance + fixed + velocity * of_time);
        rows.keep(2 * DERIVATIVES + input, -of_speed - acceleration * of_time);
    }
};

[[gnu::noinline]] static void write_gradients(const Encounters &q, Lanes gain, double slope, const Rows &rows) {
    const auto [rates, gap, force, by_mass, x0, u0, v, t, found] = q;  // a copy, so that no store can alias it
    const Lanes total = rates.mu1 + rates.mu2, product = rates.mu1 * rates.mu2, zero = {};
    const auto [h, h1, f, f3, fast, j, jf] = functions(t, rates);
    const Lanes j1 = fast - rates.mu1 * j, j2 = h - total * j1 - product * j;
    const Lanes start = force - total * u0, velocity = force * h + u0 * h1;  // x~''(0)
    const Contact at = {velocity, start * h1 - product * u0 * h, 1.0 / (v - velocity), rows};
    const Lanes damp = -by_mass * (force * j + u0 * j1), damp1 = -by_mass * (force * j1 + u0 * j2);
    at.keep(MASS, -by_mass * (start * j1 - product * u0 * j), -by_mass * (start * j2 - product * u0 * j1), zero);
    at.keep(DAMPING, damp, damp1, zero);
    const Lanes spring = x0 * f + u0 * j + force * jf, spring1 = x0 * h + u0 * j1 + force * j;
    at.keep(STIFFNESS, -by_mass * spring, -by_mass * spring1, zero);
    at.keep(X0, 1.0 - product * f, -product * h, zero);
    at.keep(U0, h, h1, zero);
    at.keep(P, all(-1.0), zero, all(1.0));
    const Lanes push = slope * gain * by_mass, half = 0.5 * t * t;
    at.keep(V, push * f - t, push * h - 1.0, t);
    at.keep(A, push * f3 - half, push * f - t, half);
    const Lanes couple = damp + v * by_mass * f, couple1 = damp1 + v * by_mass * h;
    at.keep(GAIN, slope * couple, slope * couple1, zero);
    at.keep(OF_SLOPE, gain * couple, gain * couple1, zero);
}

// The largest demands on the robot until the contact, in closed form for vectors of encounters.
//
// Every derivative of x~ is a free response. With B = F - mu_1 u_0 and the functions above,
//
//     x~' = u_0 e_2 + B h,      x~'' = A e_2 - mu_1 B h,      x~''' = J e_2 + mu_1^2 B h,
//
// where A and J are x~'' and x~''' at the start. Because h / e_2 = (e^((mu_2 - mu_1) t) - 1) / (mu_2 - mu_1) grows
// monotonically from 0, a response y e_2 + b h has at most one zero. It exists if r = -y / b is positive, and is at
//
//     t = ln(1 + (mu_2 - mu_1) r) / (mu_2 - mu_1),
//
// which is never singular. So x~, x~' and x~'' have at most one extremum each inside the motion, and the largest
// magnitude occurs at the start, at the extremum or at the end. An extremum is flat: an error of 1e-9 in its time
// causes an error of about 1e-18 in its value. The reported value is always one that the motion reaches.
//
// A moving reference adds a function of time to x~, and the sum can have two extrema. Such values are NaN here, and the
// Taylor lanes compute them.

struct Free {
    Lanes e2, h, f;
};

static inline Free free_at(Lanes t, const Rates &rates) {
    const auto [rest, h, e2] = basis<exponential>(t, rates);
    const Early early = early_functions(t, rates);
    return {e2, h, where(early.holds, early.f, (rest * rates.by1 - h) * rates.by2)};
}

// The time at which h / e_2 equals `ratio`; 0 if that is not between the start and `end`.
static inline Lanes moment(Lanes ratio, const Rates &rates, Lanes end) {
    const Lanes t = rates.by_width * rough_logarithm(rates.width * ratio);
    return where((ratio > 0.0) & (t < end), t, Lanes{});
}

static inline Lanes largest(Lanes at_start, Lanes at_peak, Lanes at_end) {
    return most(absolute(at_start), most(absolute(at_peak), absolute(at_end)));
}

// Writes the largest demands. drift and pull: velocity and acceleration of the reference.
[[gnu::noinline]] static void write_peaks(const Encounters &q, Lanes coupling, Lanes drift, Lanes pull, const Rows &rows) {
    const auto [rates, gap, force, by_mass, x0, u0, v, end, found] = q;  // a copy, so that no store can alias it
    const Lanes mu1 = rates.mu1, by1 = rates.by1, total = mu1 + rates.mu2, product = mu1 * rates.mu2;
    const Lanes b = force - mu1 * u0, start = force - total * u0;
    const Lanes jerk = -total * start - product * u0, by_b = 1.0 / b;
    const Free far = free_at(moment(-u0 * by_b, rates, end), rates);
    const Free fastest = free_at(moment(start * by1 * by_b, rates, end), rates);
    const Free bent = free_at(moment(-jerk * by1 * by1 * by_b, rates, end), rates);
    const Free last = free_at(end, rates);
    const Lanes way = u0 * far.h + force * far.f, way_end = u0 * last.h + force * last.f;
    const Lanes speed = u0 * fastest.e2 + b * fastest.h, speed_end = u0 * last.e2 + b * last.h;
    const Lanes bend = start * bent.e2 - mu1 * b * bent.h, bend_end = start * last.e2 - mu1 * b * last.h;
    const Lanes none = all(NOT_A_NUMBER);
    const Masks steady = pull == 0.0;
    rows.keep(0, largest(x0, x0 + way, x0 + way_end));
    rows.keep(1, where(steady & (drift == 0.0), most(absolute(way), absolute(way_end)), none));
    rows.keep(2, where(steady, largest(u0 + drift, speed + drift, speed_end + drift), none));
    rows.keep(3, largest(start + pull, bend + pull, bend_end + pull));
    rows.keep(4, absolute(coupling) * largest(v - u0, v - speed, v - speed_end));
}

}  // namespace PRETOUCH_VARIANT
