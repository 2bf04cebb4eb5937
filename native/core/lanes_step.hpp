// Take one vectorized Taylor step of encounters, and find the contact inside a step.
//
// Let the obstacle be at p + v t + a t^2 / 2 relative to the reference. The equation of motion,
//
//     M l'' = M a + D (v - l') + K (x_o - l) - D_p d(ln xi)/dt
//
// is expanded about the present time. It gives the coefficient c_{k+2} of l from c_0 ... c_{k+1} and from coefficient k
// of d(ln xi)/dt (see lanes_taylor.hpp).

#pragma once

#include "lanes_taylor.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr double LOG_TOLERANCE = -43.5;  // log2 of the largest last term relative to the initial l, 8e-14
constexpr double ROUNDING = 2e-16;
// Motions with more steps are stiff: l' and l'' are differences of much larger numbers.
constexpr double MOST_STEPS = 200.0;
constexpr double NEVER = 1e300;
constexpr double SMALLEST = 1e-300;
constexpr double MOST_NEGATIVE = -1e-9;  // l' < 0 is proved if its bound is below this times |b_1|

struct State {
    Lanes time, distance, speed, integral, error, strongest;
};

// Parameters and state of one encounter per lane. Empty lanes execute the same instructions, without an effect.
// weakest: (D + D_p g) / M at the start of the last step; scale: l at the start of the encounter, or less if
// derivatives must be accurate; cap: the largest length of the next step; bound: an upper bound of dl/ds on the last
// step.
struct Motion {
    Lanes b[ORDER + 1];                      // coefficients of l on the last step, s in [0, 1]
    Lanes length, end, weakest, scale;       // length of that step; l at its end
    Lanes position, velocity, acceleration;  // of the obstacle relative to the reference
    State state;
    Lanes damping, stiffness, gain;  // over M
    Lanes cap, bound, steps;
    Lanes edge, leave, middle, terms[LARGEST_DEGREE + 1];  // the window; at l <= leave the next lower one is used
};
constexpr int COPIED = __builtin_offsetof(Motion, damping) / sizeof(Lanes);  // rows that find_in_step reads

// Contacts. speed, bend: l' and l''; integral: of x~; doubt: the relative uncertainty of the time.
struct Contacts {
    Lanes time, speed, bend, integral, doubt;
};

// Lanes whose step was accepted, and those of them that must switch to a lower window.
struct Taken {
    uint64_t moved, late;
};

// rough_log2(x) is log2 |x| in units of LOG_UNIT = 2^-20 plus a constant, with an error of at most 0.09 in log2. The
// upper 32 bits of a double without the sign are such an integer, since they hold the exponent and 20 bits of the
// mantissa. The integer is put into the lowest bits of the double 2^52, so that no conversion is needed. The constant
// is therefore 2^52 + 1023 * 2^20. Differences of two results do not contain it.
constexpr double LOG_UNIT = 0x1p-20;
inline Lanes rough_log2(Lanes x) {
    typedef uint64_t Words __attribute__((vector_size(WIDTH * sizeof(uint64_t))));  // unsigned: >> shifts in zeros
    constexpr uint64_t shifted = 0x433ULL << 52;  // the bits of 2^52
    return (Lanes)((((Words)x << 1) >> 33) | shifted);
}

// 2 to the power of x for |x| < 1000, at most 6 % too large: puts x into the exponent and mantissa of a double.
inline Lanes rough_exp2(Lanes x) { return from_bits(as_bits(x + (0x1.8p32 + 1023.0)) << 32); }

// Position and velocity of the obstacle relative to the reference, at some time.
struct Obstacle {
    Lanes position, velocity;
};
inline Obstacle obstacle_at(const Motion &m, Lanes time) {
    return {m.position + (m.velocity + (m.acceleration * 0.5) * time) * time, m.velocity + m.acceleration * time};
}

// The mean position of the obstacle during a step. o: the obstacle at the start of the step.
inline Lanes mean_path(const Motion &m, const Obstacle &o, Lanes step) {
    return o.position + (o.velocity * 0.5 + (m.acceleration * (1.0 / 6.0)) * step) * step;
}

// Fill c with the coefficients of l and, unless it is null, `rates` with those of d ln xi / dt. Return (D + D_p g) / M
// at the start. `rates` is filled only for DEGREE > 1.
template <int DEGREE>
__attribute__((always_inline)) inline Lanes expand(const Motion &m, const Obstacle &o, Lanes *c,
                                                   Lanes *rates = nullptr) {
    LogCurve<DEGREE> curve(m.terms, m.middle, m.state.distance, m.gain);
    c[0] = m.state.distance;
    c[1] = m.state.speed;
    const Lanes held = m.damping + m.gain * curve.slope;
    Lanes v = m.state.speed;
    unrolled<0, ORDER - 1>([&](auto place) __attribute__((always_inline)) {
        constexpr int k = decltype(place)::value;
        Lanes total = -m.stiffness * c[k];
        if constexpr (k == 0) total = m.acceleration + m.damping * o.velocity + m.stiffness * (o.position - c[0]);
        if constexpr (k == 1) total = m.damping * m.acceleration + m.stiffness * o.velocity + total;
        if constexpr (k == 2) total = m.stiffness * m.acceleration * 0.5 + total;
        total = curve.template pulled<k>(total * (1.0 / (k + 1)), c[k + 1], v);
        if constexpr (DEGREE > 1) {
            if (rates) rates[k] = curve.slope * v + curve.beyond * double(k + 1);
        }
        v = total - (held * (1.0 / (k + 1))) * v;
        c[k + 2] = v * (1.0 / (k + 2));
    });
    return held;
}

// The length of a step for which its last two terms are below the tolerance, at most `most_of_all`. Low accuracy of the
// logarithms suffices, because the length depends only on the sixteenth root of the term.
inline Lanes longest(const Motion &m, const Lanes *c, Lanes most_of_all) {
    const Lanes size = rough_log2(m.scale) + LOG_TOLERANCE / LOG_UNIT;
    const Lanes reach = (size - rough_log2(c[ORDER])) * (LOG_UNIT / ORDER);
    const Lanes before = (size - rough_log2(c[ORDER - 1])) * (LOG_UNIT / (ORDER - 1));
    return least(rough_exp2(least(reach, before)), most_of_all);
}

// Propagate the estimated error of l over a step. The last term `tail` is added as an error of l. It also is an error
// of l', which changes l until the damping has removed it or the contact is reached, whichever is earlier. Rounding
// errors of l are added. The previous error grows if the damping `held` is negative.
inline Lanes carried_error(const Motion &m, Lanes tail, Lanes held, Lanes ahead, Lanes per_length) {
    const Lanes lever = least(1.0 / most(all(SMALLEST), held), ahead) * per_length;
    Lanes growth = most(all(0.0), -held * m.length);
    growth = 1.0 + growth * (1.0 + growth * (1.0 + growth * 0.5));
    return (tail + m.state.distance * ROUNDING) + (tail * double(ORDER)) * lever + m.state.error * growth;
}

// Sums over the coefficients b_k of a step: l at the end, dl/ds at the end, the mean of l, an upper bound of dl/ds.
struct Sums {
    Lanes end, turn, area, bound;
};

// Scale the coefficients to the length of the step, and sum them. The sums over even and over odd orders are
// independent, and the powers of the length form short chains, so that the processor can overlap these operations.
__attribute__((always_inline)) inline Sums scale(Motion &m, const Lanes *c, Lanes length) {
    Lanes power[ORDER + 1];
    power[1] = length;
    Sums sums[2];
    unrolled<0, ORDER + 1>([&](auto place) __attribute__((always_inline)) {
        constexpr int k = decltype(place)::value;
        if constexpr (k > 1) power[k] = power[k > 4 ? k - 4 : k / 2] * power[k > 4 ? 4 : k - k / 2];
        Lanes b = c[k];
        if constexpr (k > 0) b = b * power[k];
        m.b[k] = b;
        Sums &s = sums[k % 2];
        if constexpr (k == 0) {
            s.end = s.area = b;
        } else if constexpr (k == 1) {
            s = {b, b, b * 0.5, b};
        } else if constexpr (k == 2) {
            s = {s.end + b, b * 2.0, s.area + b * (1.0 / 3), most(all(0.0), b) * 2.0};
        } else {
            s.end = s.end + b;
            s.turn = s.turn + b * double(k);
            s.area = s.area + b * (1.0 / (k + 1));
            s.bound = s.bound + most(all(0.0), b) * double(k);
        }
    });
    const Sums &even = sums[0], &odd = sums[1];
    return {even.end + odd.end, even.turn + odd.turn, even.area + odd.area, even.bound + odd.bound};
}

// Try one step in every lane. It is accepted if l is proved to fall during the step, stays above the lower edge of the
// window, and ends before the horizon. Only in these lanes time, l and l' advance.
template <int DEGREE> __attribute__((noinline)) Taken take_step(Motion &m, double horizon) {
    const Lanes time = m.state.time, distance = m.state.distance, speed = m.state.speed;
    const Obstacle o = obstacle_at(m, time);
    Lanes c[ORDER + 1];
    const Lanes held = expand<DEGREE>(m, o, c), ahead = distance / absolute(speed);
    const Lanes length = longest(m, c, least(ahead + ahead, m.cap)), per_length = 1.0 / length;
    m.length = length;
    const Sums sums = scale(m, c, length);
    m.end = sums.end;
    m.bound = sums.bound;
    m.weakest = held;
    m.steps = m.steps + 1.0;
    const Lanes moved = time + length;
    const Masks good = (m.edge < sums.end) & (sums.bound < absolute(m.b[1]) * MOST_NEGATIVE) & (moved < horizon) &
                       (m.steps < MOST_STEPS);
    const Lanes error = carried_error(m, absolute(m.b[ORDER]), held, ahead, per_length);
    const Lanes integral = m.state.integral + (mean_path(m, o, length) - sums.area) * length;
    m.state.error = where(good, error, m.state.error);
    m.state.strongest = most(held, m.state.strongest);
    m.state.integral = where(good, integral, m.state.integral);
    m.state.time = where(good, moved, time);
    m.state.distance = where(good, sums.end, distance);
    m.state.speed = where(good, sums.turn * per_length, speed);
    m.cap = where(good, all(NEVER), m.cap);
    return {bits(good), bits(good & (sums.end < m.leave))};
}

// Solve l = 0 by Newton's method, starting from the zero of the secant. change: the length of the last Newton step. A
// lane that has converged keeps its value, so that no result depends on the number of iterations of other lanes.
inline Lanes find_zero(const Motion &m, Lanes &change) {
    constexpr double arrived = 1e-12;  // converged: the next step would be of the order of its square
    Lanes s = m.b[0] / (m.b[0] - m.end);
    change = s;
    Masks open = s == s;
    for (int i = 0; i < 6 && bits(open); i++) {
        const Point<Lanes> l = look_at(m.b, s);
        const Lanes following = least(most(all(0.0), s - l.value / l.slope), all(1.0));
        change = where(open, absolute(following - s), change);
        s = where(open, following, s);
        open = open & (change > arrived);
    }
    return s;
}

// Find the contact inside the last step of each lane, on which l is proved monotone.
inline Contacts find_in_step(const Motion &m) {
    Lanes change;
    const Lanes s = find_zero(m, change);
    const Point<Lanes> l = look_at(m.b, s);
    const Lanes last = m.b[ORDER], slope = l.slope / m.length;
    Lanes area = last * (1.0 / (ORDER + 1));
    for (int k = ORDER - 1; k >= 0; k--) area = m.b[k] * (1.0 / (k + 1)) + area * s;
    const Lanes step = m.length * s, end = m.state.time + step;
    const Lanes path = mean_path(m, obstacle_at(m, m.state.time), step) - area;
    const Lanes ratio = most(all(1.0), m.state.strongest / most(all(SMALLEST), m.weakest));
    const Lanes error = m.state.error + absolute(last) * (1.0 + ORDER);
    const Lanes doubt = (error * ratio + m.scale * ROUNDING) / absolute(slope * end) + change * m.length / end * 1e-3;
    return {end, slope, l.bend / (m.length * m.length), m.state.integral + path * step, doubt};
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
