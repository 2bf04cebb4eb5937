// States at the contacts of lanes_linear.cpp, and their exact derivatives: see linear_motion.hpp.
//
// At the contact l(t, q) = 0, so dt/dq = -(dl/dq) / l', and any quantity y there changes by dy/dq + y' dt/dq.

#pragma once

#include "linear_motion.hpp"

namespace PRETOUCH_VARIANT {

// derivatives to the inputs up to D_p and to the slope
enum { OF_SLOPE = LINEAR_INPUTS, DERIVATIVES };

// Writes x~, x~', x~'', l' and the integral of x~.
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

// The motion at contact, and where its derivatives go.
struct Contact {
    Lanes velocity, acceleration, by_approach;  // x~', x~'' and 1 / l'
    const Rows &rows;

    // Writes the derivatives of t, x~ and l' to one input, from those of -l, -l' at a fixed time and those of x_o.
    void keep(int input, Lanes of_distance, Lanes of_speed, Lanes fixed) const {
        const Lanes of_time = of_distance * by_approach;
        rows.keep(input, of_time);
        rows.keep(DERIVATIVES + input, of_distance + fixed + velocity * of_time);
        rows.keep(2 * DERIVATIVES + input, -of_speed - acceleration * of_time);
    }
};

[[gnu::noinline]] static void write_gradients(const Encounters &q, Lanes gain, double slope, const Rows &rows) {
    const auto [rates, gap, force, by_mass, x0, u0, v, t, found] = q;  // a copy: no store could change it
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

}  // namespace PRETOUCH_VARIANT
