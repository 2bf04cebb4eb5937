// One Taylor step of encounters side by side, and the contact inside a step.
//
// With the obstacle at p + v t + a t^2 / 2 from the reference, expanded about the present time,
//
//     M l'' = M a + D (v - l') + K (x_o - l) - D_p d(ln xi)/dt
//
// gives the coefficient c_{k+2} of l from c_0 ... c_{k+1} and coefficient k of d(ln xi)/dt, see lanes_taylor.hpp.

#pragma once

#include "lanes_taylor.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr double LOG_TOLERANCE = -43.5;  // log2 of what the last coefficient may add to l, of l at the start: 8e-14
constexpr double ROUNDING = 2e-16;
constexpr double MOST_STEPS = 200.0;  // what takes more is stiff: l' and l'' are differences of much larger numbers there
constexpr double NEVER = 1e300;
constexpr double SMALLEST = 1e-300;
constexpr double MOST_NEGATIVE = -1e-9;  // of the first coefficient: l falls all along where its bound is below that

struct State {
    Lanes time, distance, speed, integral, error, strongest;
};

// What encounters side by side are, and where they are. Lanes that hold none go through the same steps.
struct Motion {
    Lanes b[ORDER + 1];                                // the coefficients of l over the last step, in [0, 1]
    Lanes damping, stiffness, gain;                    // over M
    Lanes position, velocity, acceleration;            // of the obstacle relative to the reference
    State state;
    Lanes cap, length, end, bound, scale, steps, weakest;
    Lanes edge, leave, middle, terms[LARGEST_DEGREE + 1];  // the window; at and below `leave` the next holds l
};
constexpr int COPIED = __builtin_offsetof(Motion, edge) / sizeof(Lanes);  // rows that a search for the contact reads

// Contacts that were found, with the doubt about their time, over it.
struct Contacts {
    Lanes time, speed, bend, integral, doubt;
};

// Which lanes moved, and which of them need another window.
struct Taken {
    uint64_t moved, late;
};

// about log2 |x|, to 0.09: its exponent and its mantissa, from the bits
inline Lanes rough_log2(Lanes x) {
    constexpr int64_t mantissa = (1LL << 52) - 1, one = 0x3ffLL << 52, shifted = 0x433LL << 52;  // the bits of 2^52
    const Masks bits = as_bits(absolute(x));
    const Lanes exponent = from_bits((bits >> 52) | shifted) - (0x1p52 + 1024.0);
    return exponent + from_bits((bits & mantissa) | one);
}

// about 2 to the power of x, at most 6 % too large, for |x| < 1000
inline Lanes rough_exp2(Lanes x) {
    constexpr double shift = 0x1.8p52;  // adding it rounds to an integer, which then are the lowest bits
    const Lanes shifted = x + shift;
    const Masks rest = as_bits(x - (shifted - shift) + 1.5);
    return from_bits(rest - (1LL << 51) + (as_bits(shifted) << 52));
}

// Where the obstacle is, and how fast, at some time.
struct Obstacle {
    Lanes position, velocity;
};
inline Obstacle obstacle_at(const Motion &m, Lanes time) {
    return {m.position + (m.velocity + (m.acceleration * 0.5) * time) * time, m.velocity + m.acceleration * time};
}

// the integral of the obstacle's path over a step, over the step
inline Lanes mean_path(const Motion &m, const Obstacle &o, Lanes step) {
    return o.position + (o.velocity * 0.5 + (m.acceleration * (1.0 / 6.0)) * step) * step;
}

// Fill c with the coefficients of l; return the damping that the motion feels.
template <int DEGREE> __attribute__((always_inline)) inline Lanes expand(const Motion &m, const Obstacle &o, Series<1> &c) {
    LogCurve<DEGREE> curve(m.terms, m.middle, m.state.distance);
    c.at[0] = m.state.distance;
    c.at[1] = m.state.speed;
    const Lanes held = m.damping + m.gain * curve.slope;
    const Lanes weight = -(m.gain * curve.factor), spring = -m.stiffness, drag = -held;
    Lanes v = m.state.speed;
    unrolled<0, ORDER - 1>([&](auto place) __attribute__((always_inline)) {
        constexpr int k = decltype(place)::value;
        const Lanes bent = curve.template bent<k>(c, v);
        Lanes total;
        if constexpr (k == 0) {
            total = m.acceleration + m.damping * o.velocity + m.stiffness * (o.position - c.at[0]);
        } else if constexpr (k == 1) {
            total = m.damping * m.acceleration + m.stiffness * o.velocity + spring * c.at[1];
        } else if constexpr (k == 2) {
            total = m.stiffness * m.acceleration * 0.5 + spring * c.at[2];
        } else {
            total = spring * c.at[k];
        }
        if constexpr (k > 0 && DEGREE != 1) total = total + weight * bent;
        v = (total + drag * v) * (1.0 / (k + 1));
        c.at[k + 2] = v * (1.0 / (k + 2));
    });
    return held;
}

// The length of a step: where its last two terms are below the tolerance, at most twice as far as l lasts. A sixteenth
// root forgives much.
inline Lanes longest(const Motion &m, const Series<1> &c, Lanes ahead) {
    const Lanes size = rough_log2(m.scale) + LOG_TOLERANCE;
    const Lanes reach = (size - rough_log2(c.at[ORDER])) * (1.0 / ORDER);
    const Lanes before = (size - rough_log2(c.at[ORDER - 1])) * (1.0 / (ORDER - 1));
    return least(least(rough_exp2(least(reach, before)), ahead + ahead), m.cap);
}

// Carry the estimate of the error over a step: what it adds to l and, over the time that damping or the way to go leave
// it, to l'.
inline Lanes carried_error(const Motion &m, Lanes tail, Lanes held, Lanes ahead) {
    const Lanes lever = least(1.0 / most(all(SMALLEST), held), ahead) / m.length;
    Lanes growth = most(all(0.0), -held * m.length);
    growth = 1.0 + growth * (1.0 + growth * (1.0 + growth * 0.5));
    return (tail + m.state.distance * ROUNDING) + (tail * double(ORDER)) * lever + m.state.error * growth;
}

template <int DEGREE> __attribute__((noinline)) Taken take_step(Motion &m, double horizon) {
    const Lanes time = m.state.time, distance = m.state.distance, speed = m.state.speed;
    const Obstacle o = obstacle_at(m, time);
    Series<1> c;
    const Lanes held = expand<DEGREE>(m, o, c), ahead = distance / absolute(speed);
    const Lanes length = longest(m, c, ahead), first = speed * length;
    Lanes power = length * length, end = distance + first, turn = first, area = distance + first * 0.5, bound = first;
    m.b[0] = distance;
    m.b[1] = first;
    unrolled<2, ORDER + 1>([&](auto place) __attribute__((always_inline)) {
        constexpr int k = decltype(place)::value;
        const Lanes b = c.at[k] * power;
        m.b[k] = b;
        end = end + b;
        area = area + b * (1.0 / (k + 1));
        turn = turn + b * double(k);
        bound = bound + most(all(0.0), b) * double(k);
        power = power * length;
    });
    m.length = length;
    m.end = end;
    m.bound = bound;
    m.weakest = held;
    m.steps = m.steps + 1.0;
    const Lanes moved = time + length;
    const Masks good = (m.edge < end) & (bound < absolute(first) * MOST_NEGATIVE) & (moved < horizon) &
                       (m.steps < MOST_STEPS);
    m.state.error = where(good, carried_error(m, absolute(m.b[ORDER]), held, ahead), m.state.error);
    m.state.strongest = most(held, m.state.strongest);
    m.state.integral = where(good, m.state.integral + (mean_path(m, o, length) - area) * length, m.state.integral);
    m.state.time = where(good, moved, time);
    m.state.distance = where(good, end, distance);
    m.state.speed = where(good, turn / length, speed);
    m.cap = where(good, all(NEVER), m.cap);
    return {bits(good), bits(good & (end < m.leave))};
}

// Find l = 0 inside steps that are proved monotone: Newton's method from the secant.
inline Contacts find_in_step(const Motion &m) {
    Lanes s = m.b[0] / (m.b[0] - m.end), change = s;
    for (int i = 0; i < 6; i++) {
        Lanes value = m.b[ORDER], slope = all(0.0);
        unrolled<0, ORDER>([&](auto place) __attribute__((always_inline)) {
            slope = value + slope * s;
            value = m.b[ORDER - 1 - decltype(place)::value] + value * s;
        });
        const Lanes following = least(most(all(0.0), s - value / slope), all(1.0));
        change = absolute(following - s);
        s = following;
    }
    const Lanes last = m.b[ORDER];
    Lanes slope = last * double(ORDER), bend = last * double(ORDER * (ORDER - 1)), area = last * (1.0 / (ORDER + 1));
    unrolled<0, ORDER>([&](auto place) __attribute__((always_inline)) {
        constexpr int k = ORDER - 1 - decltype(place)::value;
        area = m.b[k] * (1.0 / (k + 1)) + area * s;
        if constexpr (k > 0) slope = m.b[k] * double(k) + slope * s;
        if constexpr (k > 1) bend = m.b[k] * double(k * (k - 1)) + bend * s;
    });
    const Lanes step = m.length * s, end = m.state.time + step;
    const Lanes path = mean_path(m, obstacle_at(m, m.state.time), step) - area;
    slope = slope / m.length;
    const Lanes ratio = most(all(1.0), m.state.strongest / most(all(SMALLEST), m.weakest));
    const Lanes error = m.state.error + absolute(last) * (1.0 + ORDER);
    const Lanes doubt = (error * ratio + m.scale * ROUNDING) / absolute(slope * end) + change * m.length / end * 1e-3;
    return {end, slope, bend / (m.length * m.length), m.state.integral + path * step, doubt};
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
