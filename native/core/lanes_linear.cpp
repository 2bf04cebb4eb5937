// First contacts of many encounters with constant slope at once: the closed form on vectors, with its own proof.
//
// Over-damped (or critical) motion, a = 0, v < 0. With the rates mu_1 <= mu_2, the roots of M mu^2 - (D + c) mu + K,
// and F = (c v - K x_0) / M, the response is built from two functions that stay finite at mu_1 = mu_2 and at K = 0,
//
//     h(t) = (e^(-mu_1 t) - e^(-mu_2 t)) / (mu_2 - mu_1),    f(t) = ((1 - e^(-mu_1 t)) / mu_1 - h) / mu_2 = int_0^t h,
//     x~ = x_0 + u_0 h + F f,      l = p - x_0 + v t - u_0 h - F f,      l' = v - u_0 e^(-mu_2 t) - (F - mu_1 u_0) h,
//
// each from the exponentials of -mu_1 t and -(mu_2 - mu_1) t less one, so that no digits are lost anywhere.
//
// **First crossing.** 0 <= e^(-mu_2 t) <= 1, and h is never above (mu_1 + mu_2) / (mu_2 (mu_2 + 3 mu_1)): its maximum
// is r^(-1 / (r - 1)) / mu_2 at r = mu_2 / mu_1, where ln r >= 2 (r - 1) / (r + 1) and e^-x <= 1 / (1 + x). Also
// e^(-mu_2 t) and (mu_2 - mu_1) h are not negative and add to e^(-mu_1 t) <= 1. Either bounds l' from above; if that is
// negative, l has one zero and it is the contact. Any over-damped plant at rest with D >= 0, c > 0 passes.
//
// **Root.** f = t^2 / (2 + (mu_1 + mu_2) t + mu_1 mu_2 t^2) has the right limits for short and long times; one step
// of Newton with it starts from the time after which steady motion would meet. Two steps of Householder's third
// order follow. The second is proved: |x~^(k)| <= mu_1^(k-2) |x~''| + (k - 2) mu_2^(k-3) |x~''' + mu_1 x~''| at one
// time bounds what its Taylor polynomial leaves out. What is not proved close goes on between two bounds, until the
// same proof holds; where l' < 0 is not proved the encounter is left open, for the guaranteed path.

#include "lanes_linear.hpp"

#include "linear_states.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int PASS = 8;  // vectors that are taken through one step before the next: a processor overlaps their turns
constexpr double TOLERANCE = 1e-11;
constexpr double LEAST_APPROACH = 1e-6;  // of |v| + |u_0|, far above rounding
constexpr int TRIES = 100;

struct Encounters {
    Rates rates;
    Lanes gap, force, size;  // l(0), F, and what l is the difference of
    Lanes x0, u0, v;
    Lanes time;
    Masks falls;  // whether l' < 0 is proved
};

struct Approach {
    Lanes weighted, plain;
};

// The two bounds of -l' from below, the first of them times (mu_2 + 3 mu_1).
inline Approach approach(const Rates &rates, Lanes u0, Lanes v, Lanes force) {
    const Lanes zero = {}, push = most(-u0, zero), pull = most(rates.mu1 * u0 - force, zero);
    return {(-v - push) * (rates.mu2 + 3.0 * rates.mu1) - pull * (rates.mu1 + rates.mu2) * rates.by2,
            -v - most(push, pull * rates.by_width)};
}

// Finds rates, l(0), F, a start for the root and whether l' < 0 is proved.
inline void prepare(const Columns<LINEAR_INPUTS> &inputs, int64_t i, double slope, Encounters &q) {
    const Lanes mass = inputs.get(MASS, i), damping = inputs.get(DAMPING, i), stiffness = inputs.get(STIFFNESS, i);
    const Lanes x0 = inputs.get(X0, i), u0 = inputs.get(U0, i), p = inputs.get(P, i), v = inputs.get(V, i);
    const Lanes a = inputs.get(A, i), coupling = slope * inputs.get(GAIN, i);
    const Lanes gap = p - x0, below = v * (v * damping - stiffness * gap);
    const auto [rates, by_mass, by_below, real] = decay_rates(mass, damping, stiffness, coupling, below);
    const Lanes force = (coupling * v - stiffness * x0) * by_mass;
    const auto [weighted, plain] = approach(rates, u0, v, force);
    const Lanes least_approach = LEAST_APPROACH * (absolute(u0) - v);
    const Masks falls = real & (v < 0.0) & (gap > 0.0) & (a == 0.0) &
                        ((weighted > least_approach * (rates.mu2 + 3.0 * rates.mu1)) | (plain > least_approach));
    const Lanes total = rates.mu1 + rates.mu2, product = rates.mu1 * rates.mu2;
    const Lanes t = gap * (stiffness * p - (damping + coupling) * v) * by_below;
    const Lanes quadratic = 2.0 + (total + product * t) * t, linear = (4.0 + total * t) * t;
    const Lanes value = quadratic * ((gap + v * t) * quadratic - force * t * t) - u0 * linear;
    const Lanes start = t - value / (v * quadratic * quadratic - force * linear - 4.0 * u0);
    q.rates.mu1 = rates.mu1, q.rates.mu2 = rates.mu2, q.rates.by1 = rates.by1, q.rates.by2 = rates.by2;
    q.rates.width = rates.width, q.rates.by_width = rates.by_width;
    q.gap = gap, q.force = force, q.size = gap + absolute(x0), q.x0 = x0, q.u0 = u0, q.v = v;
    q.time = start, q.falls = falls;
}

// One step of Householder's method of third order from the start, with rough exponentials.
inline Lanes first_step(const Encounters &q) {
    const auto &[mu1, mu2, by1, by2, width, by_width] = q.rates;
    const Lanes t = q.time;
    const auto [e1, m1] = rough_exponential(-mu1 * t);
    const Lanes decay = e1 * rough_exponential(-width * t).rest;
    const Lanes h = decay * by_width, slope = (e1 - decay) - mu1 * h;  // h'
    const Lanes value = q.gap + q.v * t - q.u0 * h - q.force * ((m1 * by1 - h) * by2);
    const Lanes y1 = q.force * h + q.u0 * slope, total = mu1 + mu2, product = mu1 * mu2;
    const Lanes y2 = (q.force - total * q.u0) * slope - (product * q.u0) * h, y3 = -total * y2 - product * y1;
    const Lanes l1 = q.v - y1, square = 6.0 * (l1 * l1), turn = value * y2;
    return t - value * (square + 3.0 * turn) / (l1 * (square + 6.0 * turn) - value * value * y3);
}

struct Step {
    Lanes end;
    Masks close;  // whether the end is proved close to the root
    Lanes value;  // l where the step began
};

// The same step with all digits, and its proof.
inline Step proved_step(const Encounters &q, Lanes t) {
    const auto &[mu1, mu2, by1, by2, width, by_width] = q.rates;
    const auto [e1, m1] = exponential(-mu1 * t);
    const Lanes decay = e1 * exponential(-width * t).rest;
    const Lanes h = decay * by_width, slope = (e1 - decay) - mu1 * h;
    const Lanes value = q.gap + q.v * t - q.u0 * h - q.force * ((m1 * by1 - h) * by2);
    const Lanes y1 = q.force * h + q.u0 * slope, total = mu1 + mu2, product = mu1 * mu2;
    const Lanes y2 = (q.force - total * q.u0) * slope - (product * q.u0) * h;
    const Lanes y3 = -total * y2 - product * y1, y4 = -total * y3 - product * y2;
    const Lanes l1 = q.v - y1, square = 6.0 * (l1 * l1), turn = value * y2;
    const Lanes step = -value * (square + 3.0 * turn) / (l1 * (square + 6.0 * turn) - value * value * y3);
    const Lanes rest = value + step * (l1 - step * (0.5 * y2 + step * ((1.0 / 6) * y3 + step * ((1.0 / 24) * y4))));
    const Lanes end = t + step, reach = absolute(step) + 1e-10 * end, fast_reach = mu2 * reach;
    const Lanes bend = absolute(y2), fast = reach * absolute(y3 + mu1 * y2);
    const Lanes growth = 1.0 + fast_reach * (1.0 + 3.1 * fast_reach);  // above its exponential up to 4
    const Lanes area = reach * fast_reach;
    const Lanes tail = area * area * (reach * (mu1 * bend) + 3.0 * fast) * (growth * (1.0 / 120));
    const Lanes rounding =
        4e-15 * (q.size - q.v * end + absolute(q.u0) * h + absolute(q.force) * (m1 * by1 + h) * by2);
    const Masks close = (t > 0.0) & (fast_reach <= 4.0) & (2.0 * reach * (bend + fast) * growth <= -l1) &
                        (absolute(rest) + tail + rounding < TOLERANCE * end * -l1);
    return {end, close, value};
}

struct Found {
    Lanes time;
    Masks found;
};

// Finds the one zero of each l that waits, and is proved to fall, between two bounds.
__attribute__((noinline)) Found refine(const Encounters &q, Lanes t, Masks waits, double horizon) {
    const Lanes latest = all(horizon);
    const auto [weighted, plain] = approach(q.rates, q.u0, q.v, q.force);
    Lanes low = all(0.0), high = 1.001 * q.gap / most(weighted / (q.rates.mu2 + 3.0 * q.rates.mu1), plain);
    const Masks late = high > latest;
    waits &= ~late | (proved_step(q, latest).value <= 0.0);
    high = where(late, latest, high);
    t = where((low < t) & (t < high), t, least(q.gap / (absolute(q.u0) - q.v), 0.5 * high));
    Found result = {all(NOT_A_NUMBER), Masks{}};
    for (int k = 0; k < TRIES && any(waits); k++) {
        const auto [end, close, value] = proved_step(q, t);
        const Masks done = waits & close, good = done & (end > 0.0) & (end <= latest);
        result.time = where(good, end, result.time);
        result.found |= good;
        waits &= ~done;
        const Masks early = value > 0.0;
        low = where(early, t, low);
        high = where(early, high, t);
        const bool slow = k % 4 == 3;  // halves what steps of no use would leave as it is
        const Lanes middle = 0.5 * (low + high);
        t = slow ? middle : where((low < end) & (end < high), end, middle);
    }
    return result;
}

inline void store_status(int8_t *status, Masks found, int64_t count) {
    if (count >= WIDTH && bits(~found) == 0) {
        __builtin_memset(status, 0, WIDTH);
        return;
    }
    for (int k = 0; k < WIDTH && k < count; k++) status[k] = found[k] ? 0 : -1;
}

// Finds the contacts of encounters from where the first step ended; `falls` then says which are found.
inline void contact(Encounters &q, double horizon) {
    const auto [end, close, value] = proved_step(q, q.time);
    Masks found = close & (end > 0.0) & (end <= horizon) & q.falls;
    q.time = end;
    if (bits(q.falls & ~found) != 0) {
        const Found more = refine(q, end, q.falls & ~found, horizon);
        q.time = where(found, end, more.time);
        found |= more.found;
    }
    q.falls = found;
}

// l' at the end.
inline Lanes approach_at_end(const Encounters &q) {
    const auto [e1, m1] = exponential(-q.rates.mu1 * q.time);
    const Lanes decay = e1 * exponential(-q.rates.width * q.time).rest, h = decay * q.rates.by_width;
    return q.v - (q.force * h + q.u0 * ((e1 - decay) - q.rates.mu1 * h));
}

// What a contact has beside its time; null where that is not asked for.
struct Wanted {
    double *approach;  // l'
    double *states;    // rows of m numbers
    int64_t m;
};

__attribute__((noinline)) void contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                                        double *time, int8_t *status, Wanted wanted) {
    Columns<LINEAR_INPUTS> columns(inputs);
    Encounters batch[PASS];
    for (int64_t start = 0; start < n; start += PASS * WIDTH) {
        int many = 0;
        for (int64_t i = start; i < n && many < PASS; i += WIDTH) {
            columns.reach(i, n - i);
            prepare(columns, i, slope, batch[many++]);
        }
        for (int k = 0; k < many; k++) batch[k].time = first_step(batch[k]);
        for (int k = 0; k < many; k++) {
            Encounters &q = batch[k];
            const int64_t i = start + k * WIDTH;
            contact(q, horizon);
            store(time + i, where(q.falls, q.time, all(NOT_A_NUMBER)), n - i);
            store_status(status + i, q.falls, n - i);
        }
        for (int k = 0; k < many && wanted.approach != nullptr; k++) {
            const int64_t i = start + k * WIDTH;
            const Lanes found = where(batch[k].falls, approach_at_end(batch[k]), all(NOT_A_NUMBER));
            store(wanted.approach + i, found, n - i);
        }
        for (int k = 0; k < many && wanted.states != nullptr; k++) {
            const Encounters &q = batch[k];
            const int64_t i = start + k * WIDTH;
            const States found = states_at(q.time, q.rates, q.force, q.x0, q.u0, q.v);
            store_states(wanted.states + i, wanted.m, found, q.falls, n - i);
        }
    }
}

}  // namespace

void linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon, double *time,
                     int8_t *status, double *states, int64_t m, int64_t first) {
    contacts(inputs, n, slope, horizon, time, status, {nullptr, states == nullptr ? nullptr : states + first, m});
}

void linear_approaches(const pretouch_column *inputs, int64_t n, double slope, double horizon, double *time,
                       int8_t *status, double *approach) {
    contacts(inputs, n, slope, horizon, time, status, {approach, nullptr, 0});
}

}  // namespace PRETOUCH_VARIANT
