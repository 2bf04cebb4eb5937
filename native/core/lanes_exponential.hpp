// Vectorized exponential and logarithm.
//
// The exponential uses the common reduction x = n ln 2 + r with |r| <= ln 2 / 2, a polynomial in r, and 2^n assembled
// from its bits. The polynomial is p(r) in e^r = 1 + r + r^2 p(r). Near x = 0, closed forms of e^x - 1 and of the
// quotients below lose digits. There n = 0 and r = x, so the quotients follow from p directly:
//
//     phi_1(x) = (e^x - 1) / x = 1 + x phi_2(x),   phi_2(x) = p(x),   phi_3(x) = (p(x) - 1/2) / x.

#pragma once

#include "lanes.hpp"

namespace PRETOUCH_VARIANT {

struct Exponential {
    Lanes value, rest;  // e^x and 1 - e^x
};

struct ExponentialParts {
    Lanes value, rest;     // e^x and 1 - e^x
    Lanes second, third;   // phi_2(x) and phi_3(x)
    Masks near;            // whether second and third are valid: x > -0.34
};

namespace exponents {

typedef uint64_t Words __attribute__((vector_size(WIDTH * sizeof(uint64_t))));

constexpr double LOG2E = 1.4426950408889634, LN2 = 0.6931471805599453, ROOT2 = 1.4142135623730951;
constexpr double LN2_HIGH = 0.6931471803691238, LN2_LOW = 1.9082149292705877e-10;
constexpr double SHIFT = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds x to an integer, in the lowest bits
constexpr double LOWEST = -708.0;  // smaller arguments are raised to this one
constexpr double P0 = 0.5, P1 = 0.16666666666666666, P2 = 0.041666666666651246, P3 = 0.008333333333332147;
constexpr double P4 = 0.0013888888905973543, P5 = 0.00019841269854409363, P6 = 2.480153620505534e-05;
constexpr double P7 = 2.755727992579576e-06, P8 = 2.761390867578486e-07, P9 = 2.509563297507093e-08;

// x = n ln 2 + r
struct Reduced {
    Lanes n, r, power;  // power: 2^n
};

static inline Lanes not_below_lowest(Lanes x) { return where(x < LOWEST, all(LOWEST), x); }  // NaN stays NaN

static inline Reduced reduced(Lanes x) {
    const Lanes shifted = x * LOG2E + SHIFT, n = shifted - SHIFT;
    return {n, (x - n * LN2_HIGH) - n * LN2_LOW, (Lanes)(((Words)shifted + 1023) << 52)};
}

// e^x and 1 - e^x from power = 2^n and q = e^r - 1
static inline Exponential put_together(Lanes power, Lanes q) {
    return {power + power * q, (1.0 - power) - power * q};
}

}  // namespace exponents

// e^x and 1 - e^x for x <= 0, each accurate to a few units in the last place. For x < -708, e^x stays at 3e-308.
static inline Exponential exponential(Lanes x) {
    using namespace exponents;
    const auto [n, r, power] = reduced(not_below_lowest(x));
    const Lanes s = r * r, f = s * s;
    const Lanes high = (P8 + P9 * r) * f + ((P4 + P5 * r) + (P6 + P7 * r) * s);
    const Lanes p = (P0 + P1 * r) + (P2 + P3 * r) * s + high * f;
    return put_together(power, r + s * p);
}

// e^x and 1 - e^x for x <= 0, and the quotients phi_2(x) and phi_3(x) where x is near zero.
static inline ExponentialParts exponential_parts(Lanes x) {
    using namespace exponents;
    const auto [n, r, power] = reduced(not_below_lowest(x));
    const Lanes s = r * r;
    const Lanes high = (P5 + P6 * r) + (P7 + P8 * r) * s + P9 * (s * s);
    const Lanes third = (P1 + P2 * r) + (P3 + P4 * r) * s + high * (s * s);
    const Lanes second = P0 + r * third;
    const auto [value, rest] = put_together(power, r + s * second);
    return {value, rest, second, third, n == 0.0};
}

// e^x and 1 - e^x for x <= 0 with relative errors of about 1e-6: accurate enough for the first step of an iteration.
static inline Exponential rough_exponential(Lanes x) {
    using namespace exponents;
    x = not_below_lowest(x);
    const Lanes shifted = x * LOG2E + SHIFT, n = shifted - SHIFT;
    const Lanes r = x - n * LN2, s = r * r;
    return put_together((Lanes)(((Words)shifted + 1023) << 52), r + s * ((P0 + P1 * r) + (P2 + P3 * r) * s));
}

// ln(1 + x) for x >= 0 with a relative error of 1e-9, also for small x: accurate enough for the time of a peak.
static inline Lanes rough_logarithm(Lanes x) {
    using namespace exponents;
    constexpr uint64_t of_2_to_52 = 0x433ull << 52;
    const Words exponent = (Words)((1.0 + x) * ROOT2) >> 52;
    const Lanes power = (Lanes)(exponent << 52), n = (Lanes)(exponent | of_2_to_52) - (0x1p52 + 1023.0);
    const Lanes s = (x - (power - 1.0)) / (x + 1.0 + power);  // |s| <= 0.1716
    const Lanes f = s * s;
    return n * LN2 + 2.0 * s * (((1.0 + f * (1.0 / 3)) + f * f * ((1.0 / 5) + f * (1.0 / 7))) +
                                (f * f) * (f * f) * ((1.0 / 9) + f * (1.0 / 11)));
}

}  // namespace PRETOUCH_VARIANT
