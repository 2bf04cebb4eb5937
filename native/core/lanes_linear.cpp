// Find and prove the first contacts of many encounters with a constant slope, by the vectorized closed form.
//
// It covers over-damped and critically damped motions with a = 0 and v < 0. Let mu_1 <= mu_2 be the rates, which are
// the roots of M mu^2 - (D + c) mu + K, and F = (c v - K x_0) / M. The response is built from two functions that stay
// finite at mu_1 = mu_2 and at K = 0,
//
//     h(t) = (e^(-mu_1 t) - e^(-mu_2 t)) / (mu_2 - mu_1),    f(t) = ((1 - e^(-mu_1 t)) / mu_1 - h) / mu_2 = int_0^t h,
//     x~ = x_0 + u_0 h + F f,      l = p - x_0 + v t - u_0 h - F f,      l' = v - u_0 e^(-mu_2 t) - (F - mu_1 u_0) h,
//
// Both are computed from 1 minus the exponentials of -mu_1 t and of -(mu_2 - mu_1) t, so that no digits are lost.
//
// **Proof that the contact is the first.** There are two upper bounds of l'. The first uses 0 <= e^(-mu_2 t) <= 1 and
// h <= (mu_1 + mu_2) / (mu_2 (mu_2 + 3 mu_1)). The latter holds since the maximum of h is r^(-1 / (r - 1)) / mu_2 with
// r = mu_2 / mu_1, where ln r >= 2 (r - 1) / (r + 1) and e^-x <= 1 / (1 + x). The second bound uses that e^(-mu_2 t)
// and (mu_2 - mu_1) h are not negative and that their sum is e^(-mu_1 t) <= 1. If one of the bounds is negative, l has
// only one zero, and this is the contact. The proof succeeds for every over-damped plant at rest with D >= 0, c > 0.
//
// **Root.** The initial guess is the time at which the steady motion would reach the contact. A Newton step follows
// that uses the approximation f = t^2 / (2 + (mu_1 + mu_2) t + mu_1 mu_2 t^2), which has the exact limits for short and
// long times. Then two steps of Householder's method of third order follow. The error of the second is bounded: with
// the derivatives of x~ at its start,
//
//     |x~^(k)| <= mu_1^(k-2) |x~''| + (k - 2) mu_2^(k-3) |x~''' + mu_1 x~''|
//
// bounds the remainder of the Taylor polynomial of l. If the bound is too large, a bracketed search continues until the
// same proof succeeds. If l' < 0 is not proved, the encounter stays open for the guaranteed path.

#include "lanes_kernels.hpp"

#include "linear_motion.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int PASS = 8;  // vectors that are processed together, so that the processor overlaps their operations
constexpr double TOLERANCE = 1e-11;  // of the contact time, relative
constexpr double LEAST_APPROACH = 1e-6;  // smallest provable -l', relative to |v| + |u_0|; far above rounding
constexpr int TRIES = 100;

struct Approach {
    Lanes weighted, plain;
};

// The two lower bounds of -l'. The first one is multiplied by (mu_2 + 3 mu_1).
inline Approach approach(const Rates &rates, Lanes u0, Lanes v, Lanes force) {
    const Lanes zero = {}, push = most(-u0, zero), pull = most(rates.mu1 * u0 - force, zero);
    return {(-v - push) * (rates.mu2 + 3.0 * rates.mu1) - pull * (rates.mu1 + rates.mu2) * rates.by2,
            -v - most(push, pull * rates.by_width)};
}

// Columns of input numbers, which are loaded as vectors. A number that all encounters share is broadcast only once.
struct Columns {
    const int many;
    const double *at[ALL_INPUTS] = {};
    int64_t step[ALL_INPUTS] = {};
    double spread[ALL_INPUTS][WIDTH];

    Columns(const pretouch_column *columns, int count) : many(count) {
        for (int k = 0; k < many; k++) {
            at[k] = columns[k].at;
            step[k] = columns[k].stride;
            if (step[k] == 0) spread_out(k, all(*at[k]));
        }
    }

    // The last numbers of other columns, from the i-th on. Unused lanes are filled with the first of these numbers.
    Columns(const Columns &others, int64_t i, int64_t count) : many(others.many) {
        for (int k = 0; k < many && count > 0; k++)
            spread_out(k, others.step[k] ? load(others.at[k] + i, count) : others.get(k, 0));
    }

    Lanes get(int k, int64_t i) const { return load(at[k] + step[k] * i); }

  private:
    void spread_out(int k, Lanes value) {
        store(spread[k], value);
        at[k] = spread[k];
        step[k] = 0;
    }
};

// Compute the rates, l(0) and F. If the contacts are not available yet, also compute the first approximation of the
// root, and whether l' < 0 is proved.
inline void prepare(const Columns &inputs, int64_t i, double slope, bool has_contacts, Encounters &q) {
    const Lanes mass = inputs.get(MASS, i), damping = inputs.get(DAMPING, i), stiffness = inputs.get(STIFFNESS, i);
    const Lanes x0 = inputs.get(X0, i), u0 = inputs.get(U0, i), p = inputs.get(P, i), v = inputs.get(V, i);
    const Lanes coupling = slope * inputs.get(GAIN, i), gap = p - x0;
    const Lanes below = has_contacts ? all(1.0) : v * (v * damping - stiffness * gap);
    const auto [rates, by_mass, by_below, real] = decay_rates(mass, damping, stiffness, coupling, below);
    const Lanes force = (coupling * v - stiffness * x0) * by_mass;
    q.rates.mu1 = rates.mu1, q.rates.mu2 = rates.mu2, q.rates.by1 = rates.by1, q.rates.by2 = rates.by2;
    q.rates.width = rates.width, q.rates.by_width = rates.by_width;
    q.gap = gap, q.force = force, q.by_mass = by_mass, q.x0 = x0, q.u0 = u0, q.v = v;
    if (has_contacts) return;
    const auto [weighted, plain] = approach(rates, u0, v, force);
    const Lanes least_approach = LEAST_APPROACH * (absolute(u0) - v);
    const Masks falls = real & (v < 0.0) & (gap > 0.0) & (inputs.get(A, i) == 0.0) &
                        ((weighted > least_approach * (rates.mu2 + 3.0 * rates.mu1)) | (plain > least_approach));
    const Lanes total = rates.mu1 + rates.mu2, product = rates.mu1 * rates.mu2;
    const Lanes t = gap * (stiffness * p - (damping + coupling) * v) * by_below;
    const Lanes quadratic = 2.0 + (total + product * t) * t, linear = (4.0 + total * t) * t;
    const Lanes value = quadratic * ((gap + v * t) * quadratic - force * t * t) - u0 * linear;
    q.time = t - value / (v * quadratic * quadratic - force * linear - 4.0 * u0);
    q.found = falls;
}

// l and the derivatives of x~ (y1 to y3) at one time.
struct Course {
    Lanes l, y1, y2, y3;
    Lanes h, rest;  // see Basis

    // The step of Householder's method of third order toward l = 0.
    Lanes step(Lanes v) const {
        const Lanes l1 = v - y1, square = 6.0 * (l1 * l1), turn = l * y2;
        return -l * (square + 3.0 * turn) / (l1 * (square + 6.0 * turn) - l * l * y3);
    }
};

// Compute the motion at a time t.
template <Exponential exponential_of(Lanes)> inline Course course(const Encounters &q, Lanes t) {
    const auto &[mu1, mu2, by1, by2, width, by_width] = q.rates;
    const auto [rest, h, e2] = basis<exponential_of>(t, q.rates);
    const Lanes slope = e2 - mu1 * h, total = mu1 + mu2, product = mu1 * mu2;  // slope: h'
    const Lanes l = q.gap + q.v * t - q.u0 * h - q.force * ((rest * by1 - h) * by2);
    const Lanes y1 = q.force * h + q.u0 * slope;
    const Lanes y2 = (q.force - total * q.u0) * slope - (product * q.u0) * h, y3 = -total * y2 - product * y1;
    return {l, y1, y2, y3, h, rest};
}

struct Step {
    Lanes end;
    Masks close;  // whether the end is proved to be close to the root
    Lanes value;  // l at the start of the step
};

// One Householder step with full accuracy, and a proof that its end is close to the root: the Taylor polynomial of l at
// the end, plus bounds of its remainder and of rounding errors, is smaller than the tolerance of the time times |l'|.
[[gnu::always_inline]] inline Step proved_step(const Encounters &q, Lanes t) {
    const auto &[mu1, mu2, by1, by2, width, by_width] = q.rates;
    const Course at = course<exponential>(q, t);
    const Lanes y4 = -(mu1 + mu2) * at.y3 - mu1 * mu2 * at.y2, l1 = q.v - at.y1, step = at.step(q.v);
    const Lanes rest =
        at.l + step * (l1 - step * (0.5 * at.y2 + step * ((1.0 / 6) * at.y3 + step * ((1.0 / 24) * y4))));
    const Lanes end = t + step, reach = absolute(step) + 1e-10 * end, fast_reach = mu2 * reach;
    const Lanes bend = absolute(at.y2), fast = reach * absolute(at.y3 + mu1 * at.y2);
    const Lanes growth = 1.0 + fast_reach * (1.0 + 3.1 * fast_reach);  // at least e^fast_reach for fast_reach <= 4
    const Lanes area = reach * fast_reach;
    const Lanes tail = area * area * (reach * (mu1 * bend) + 3.0 * fast) * (growth * (1.0 / 120));
    const Lanes size = q.gap + absolute(q.x0) - q.v * end;  // with the terms in `rounding`: the size of the terms of l
    const Lanes rounding =
        4e-15 * (size + absolute(q.u0) * at.h + absolute(q.force) * (at.rest * by1 + at.h) * by2);
    const Masks close = (t > 0.0) & (fast_reach <= 4.0) & (2.0 * reach * (bend + fast) * growth <= -l1) &
                        (absolute(rest) + tail + rounding < TOLERANCE * end * -l1);
    return {end, close, at.l};
}

// Zeros of l, and the lanes in which they are proved.
struct Roots {
    Lanes time;
    Masks proved;
};

// Find the only zero of l in the lanes of `waits`, where l is proved to fall, by a bracketed search. A zero after the
// horizon is not a result.
__attribute__((noinline)) Roots refine(const Encounters &q, Lanes t, Masks waits, double horizon) {
    const Lanes latest = all(horizon);
    const auto [weighted, plain] = approach(q.rates, q.u0, q.v, q.force);
    Lanes low = all(0.0), high = 1.001 * q.gap / most(weighted / (q.rates.mu2 + 3.0 * q.rates.mu1), plain);
    const Masks late = high > latest;
    waits &= ~late | (proved_step(q, latest).value <= 0.0);
    high = where(late, latest, high);
    t = where((low < t) & (t < high), t, least(q.gap / (absolute(q.u0) - q.v), 0.5 * high));
    Roots result = {all(NOT_A_NUMBER), Masks{}};
    for (int k = 0; k < TRIES && any(waits); k++) {
        const auto [end, close, value] = proved_step(q, t);
        const Masks done = waits & close, good = done & (end > 0.0) & (end <= latest);
        result.time = where(good, end, result.time);
        result.proved |= good;
        waits &= ~done;
        const Masks early = value > 0.0;
        low = where(early, t, low);
        high = where(early, high, t);
        const bool slow = k % 4 == 3;  // bisection, in case the other steps make no progress
        const Lanes middle = 0.5 * (low + high);
        t = slow ? middle : where((low < end) & (end < high), end, middle);
    }
    return result;
}

// Write the status: 0 for a proved contact, -1 for an open encounter.
inline void store_status(int8_t *status, Masks proved, int64_t count) {
    if (count >= WIDTH && bits(~proved) == 0) {
        __builtin_memset(status, 0, WIDTH);
        return;
    }
    for (int k = 0; k < WIDTH && k < count; k++) status[k] = proved[k] ? 0 : -1;
}

inline Masks load_status(const int8_t *status, int64_t count) {
    Masks open = {};
    for (int k = 0; k < WIDTH && k < count; k++) open[k] = status[k];
    return open == 0;
}

// Find the contacts of one vector of encounters, starting from the end of the first Householder step.
inline void contact(Encounters &q, double horizon) {
    const auto [end, close, value] = proved_step(q, q.time);
    const Masks waits = q.found, proved = close & (end > 0.0) & (end <= horizon) & waits;
    q.time = end, q.found = proved;
    if (bits(waits & ~proved) != 0) {
        const Roots more = refine(q, end, waits & ~proved, horizon);
        q.time = where(proved, end, more.time);
        q.found |= more.proved;
    }
}

// Find the contacts of several vectors of encounters, from the i-th encounter on, or load earlier results.
inline void find(Encounters *batch, int many, int64_t i, int64_t n, double horizon, const pretouch_linear &to) {
    if (to.given) {
        for (Encounters *q = batch; q < batch + many; q++, i += WIDTH)
            q->time = load(to.time + i, n - i), q->found = load_status(to.status + i, n - i);
        return;
    }
    for (Encounters *q = batch; q < batch + many; q++) q->time += course<rough_exponential>(*q, q->time).step(q->v);
    for (Encounters *q = batch; q < batch + many; q++, i += WIDTH) {
        contact(*q, horizon);
        store(to.time + i, where(q->found, q->time, all(NOT_A_NUMBER)), n - i);
        store_status(to.status + i, q->found, n - i);
    }
}

}  // namespace

void linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                     const pretouch_linear *wanted) {
    const pretouch_linear to = *wanted;
    const Columns columns(inputs, to.peaks.at ? ALL_INPUTS : LINEAR_INPUTS), last(columns, n - n % WIDTH, n % WIDTH);
    Encounters batch[PASS];
    for (int64_t start = 0; start < n; start += PASS * WIDTH) {
        int many = 0;
        for (int64_t i = start; i < n && many < PASS; i += WIDTH)
            prepare(n - i < WIDTH ? last : columns, i, slope, to.given, batch[many++]);
        find(batch, many, start, n, horizon, to);
        for (int k = 0; k < many && to.approach; k++) {
            const Encounters &q = batch[k];
            const Lanes approach = q.v - course<exponential>(q, q.time).y1;
            store(to.approach + start + k * WIDTH, where(q.found, approach, all(NOT_A_NUMBER)), n - start - k * WIDTH);
        }
        int64_t i = start;
        for (const Encounters *q = batch; q < batch + many; q++, i += WIDTH) {
            const Columns &own = n - i < WIDTH ? last : columns;
            if (to.states.at) write_states(*q, {to.states, i, n - i, q->found});
            if (to.gradients.at) write_gradients(*q, own.get(GAIN, i), slope, {to.gradients, i, n - i, q->found});
            if (to.peaks.at) {
                const Lanes coupling = slope * own.get(GAIN, i), drift = own.get(DRIFT, i), pull = own.get(PULL, i);
                write_peaks(*q, coupling, drift, pull, {to.peaks, i, n - i, q->found});
            }
        }
    }
}

// For tests: e^x and 1 - e^x of each function, phi_2 and phi_3 with their validity, and ln(1 - x).
void exponentials(const double *x, int64_t n, double *out) {
    for (int64_t i = 0; i < n; i += WIDTH) {
        const Lanes at = load(x + i, n - i);
        const auto [value, rest] = exponential(at);
        const ExponentialParts parts = exponential_parts(at);
        const auto [rough, rough_rest] = rough_exponential(at);
        const Lanes rows[] = {value, rest, parts.value, parts.rest, parts.second, parts.third,
                              where(parts.near, all(1.0), Lanes{}), rough, rough_rest, rough_logarithm(-at)};
        double *to = out + i;
        for (const Lanes row : rows) {
            store(to, row, n - i);
            to += n;
        }
    }
}

}  // namespace PRETOUCH_VARIANT
