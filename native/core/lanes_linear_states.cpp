// States at the contacts that linear_contacts finds, and their exact derivatives, on vectors: see linear_states.hpp.
//
// At the contact l(t, q) = 0, so dt/dq = -(dl/dq) / l', and any quantity y there changes by dy/dq + y' dt/dq.

#include "lanes_linear.hpp"

#include "linear_states.hpp"

namespace PRETOUCH_VARIANT {

namespace {

// derivatives to the inputs of LINEAR_INPUTS and to the slope
enum { OF_SLOPE = LINEAR_INPUTS, DERIVATIVES };

// The motion at contact, and where its derivatives go.
struct Contact {
    Lanes velocity, acceleration, by_approach;  // x~', x~'' and 1 / l'
    Masks reached;
    double *out;
    int64_t n, left;

    // Writes the derivatives of t, x~ and l' to one input, from those of -l, -l' at a fixed time and those of x_o.
    void keep(int input, Lanes of_distance, Lanes of_speed, Lanes fixed) const {
        const Lanes none = all(NOT_A_NUMBER), of_time = of_distance * by_approach;
        double *to = out + input * n;
        store(to, where(reached, of_time, none), left);
        store(to + DERIVATIVES * n, where(reached, of_distance + fixed + velocity * of_time, none), left);
        store(to + 2 * DERIVATIVES * n, where(reached, -of_speed - acceleration * of_time, none), left);
    }
};

inline void differentiate(const Columns<LINEAR_INPUTS> &inputs, int64_t i, double slope, Lanes t, Contact &at) {
    const Lanes stiffness = inputs.get(STIFFNESS, i), x0 = inputs.get(X0, i), u0 = inputs.get(U0, i);
    const Lanes v = inputs.get(V, i), gain = inputs.get(GAIN, i), coupling = slope * gain, zero = {};
    const auto [rates, by_mass, by_extra, real] =
        decay_rates(inputs.get(MASS, i), inputs.get(DAMPING, i), stiffness, coupling, all(1.0));
    const Lanes total = rates.mu1 + rates.mu2, product = rates.mu1 * rates.mu2;
    const Lanes force = (coupling * v - stiffness * x0) * by_mass;
    const auto [h, h1, f, f3, fast, j, jf] = functions(t, rates);
    const Lanes j1 = fast - rates.mu1 * j, j2 = h - total * j1 - product * j;
    const Lanes start = force - total * u0;  // x~''(0)
    at.velocity = force * h + u0 * h1, at.acceleration = start * h1 - product * u0 * h;
    at.by_approach = 1.0 / (v - at.velocity);
    const Lanes damp = -by_mass * (force * j + u0 * j1), damp1 = -by_mass * (force * j1 + u0 * j2);
    at.keep(MASS, -by_mass * (start * j1 - product * u0 * j), -by_mass * (start * j2 - product * u0 * j1), zero);
    at.keep(DAMPING, damp, damp1, zero);
    const Lanes spring = x0 * f + u0 * j + force * jf, spring1 = x0 * h + u0 * j1 + force * j;
    at.keep(STIFFNESS, -by_mass * spring, -by_mass * spring1, zero);
    at.keep(X0, 1.0 - product * f, -product * h, zero);
    at.keep(U0, h, h1, zero);
    at.keep(P, all(-1.0), zero, all(1.0));
    const Lanes push = coupling * by_mass, half = 0.5 * t * t;
    at.keep(V, push * f - t, push * h - 1.0, t);
    at.keep(A, push * f3 - half, push * f - t, half);
    const Lanes couple = damp + v * by_mass * f, couple1 = damp1 + v * by_mass * h;
    at.keep(GAIN, slope * couple, slope * couple1, zero);
    at.keep(OF_SLOPE, gain * couple, gain * couple1, zero);
}

}  // namespace

void linear_states(const pretouch_column *inputs, int64_t n, double slope, const double *time, const int8_t *status,
                   double *states, int64_t m, int64_t first) {
    Columns<LINEAR_INPUTS> columns(inputs);
    for (int64_t i = 0; i < n; i += WIDTH) {
        columns.reach(i, n - i);
        const Lanes stiffness = columns.get(STIFFNESS, i), coupling = slope * columns.get(GAIN, i);
        const Lanes x0 = columns.get(X0, i), v = columns.get(V, i);
        const auto [rates, by_mass, by_extra, real] =
            decay_rates(columns.get(MASS, i), columns.get(DAMPING, i), stiffness, coupling, all(1.0));
        const Lanes force = (coupling * v - stiffness * x0) * by_mass;
        const States found = states_at(load(time + i, n - i), rates, force, x0, columns.get(U0, i), v);
        store_states(states + first + i, m, found, load_status(status + i, n - i), n - i);
    }
}

void linear_gradients(const pretouch_column *inputs, int64_t n, double slope, const double *time, const int8_t *status,
                      double *out) {
    Columns<LINEAR_INPUTS> columns(inputs);
    for (int64_t i = 0; i < n; i += WIDTH) {
        columns.reach(i, n - i);
        Contact at;
        at.reached = load_status(status + i, n - i), at.out = out + i, at.n = n, at.left = n - i;
        differentiate(columns, i, slope, load(time + i, n - i), at);
    }
}

}  // namespace PRETOUCH_VARIANT
