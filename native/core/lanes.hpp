// Vectors of doubles ("lanes"), as wide as a vector register of the processor for which this file is compiled.
//
// A kernel is written once for a type V that is `double` or `Lanes`. It needs only operators and the functions below.
// The core is compiled once for each kind of processor. Everything here is in the namespace of that variant
// (PRETOUCH_VARIANT), and no std:: template is used. Otherwise the linker could merge instances of different variants,
// and the program could execute instructions that its processor does not have.

#pragma once

#include <stdint.h>

#if defined(__x86_64__) || defined(_M_X64)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

namespace PRETOUCH_VARIANT {

#if defined(__AVX512F__)
constexpr int WIDTH = 8;
#elif defined(__AVX2__)
constexpr int WIDTH = 4;
#else
constexpr int WIDTH = 2;
#endif

typedef double Lanes __attribute__((vector_size(WIDTH * sizeof(double))));
typedef int64_t Masks __attribute__((vector_size(WIDTH * sizeof(int64_t))));  // all bits of a lane are set, or none

constexpr double INFINITE = __builtin_inf();
const double NOT_A_NUMBER = __builtin_nan("");

static inline Lanes all(double value) { return value - Lanes{}; }
static inline Lanes load(const double *from) {
    Lanes value;
    __builtin_memcpy(&value, from, sizeof value);
    return value;
}
static inline void store(double *to, Lanes value) { __builtin_memcpy(to, &value, sizeof value); }

// Load or store the vector at the end of an array whose length need not be a multiple of WIDTH. If fewer than WIDTH
// numbers remain, the unused lanes are filled with the first number. The last numbers thus pass through the same
// instructions as all others, so a result does not depend on its position in the array.
static inline Lanes load(const double *from, int64_t count) {
    if (count >= WIDTH) return load(from);
    Lanes value = all(from[0]);
    for (int i = 0; i < count; i++) value[i] = from[i];
    return value;
}
static inline void store(double *to, Lanes value, int64_t count) {
    if (count >= WIDTH) return store(to, value);
    for (int i = 0; i < count; i++) to[i] = value[i];
}

static inline double where(bool condition, double yes, double no) { return condition ? yes : no; }
static inline Lanes where(Masks condition, Lanes yes, Lanes no) { return condition ? yes : no; }

static inline double absolute(double x) { return __builtin_fabs(x); }
static inline Lanes absolute(Lanes x) { return (Lanes)((Masks)x & INT64_MAX); }

// the smaller and the larger of two numbers; y if x or y is NaN
static inline double least(double x, double y) { return x < y ? x : y; }
static inline double most(double x, double y) { return x > y ? x : y; }
#if defined(__AVX512F__)
static inline Lanes least(Lanes x, Lanes y) { return (Lanes)_mm512_maskz_min_pd(0xff, (__m512d)x, (__m512d)y); }
static inline Lanes most(Lanes x, Lanes y) { return (Lanes)_mm512_maskz_max_pd(0xff, (__m512d)x, (__m512d)y); }
#elif defined(__AVX2__)
static inline Lanes least(Lanes x, Lanes y) { return (Lanes)_mm256_min_pd((__m256d)x, (__m256d)y); }
static inline Lanes most(Lanes x, Lanes y) { return (Lanes)_mm256_max_pd((__m256d)x, (__m256d)y); }
#elif defined(__x86_64__)
static inline Lanes least(Lanes x, Lanes y) { return (Lanes)_mm_min_pd((__m128d)x, (__m128d)y); }
static inline Lanes most(Lanes x, Lanes y) { return (Lanes)_mm_max_pd((__m128d)x, (__m128d)y); }
#else
static inline Lanes least(Lanes x, Lanes y) { return x < y ? x : y; }
static inline Lanes most(Lanes x, Lanes y) { return x > y ? x : y; }
#endif

static inline double root(double x) { return __builtin_sqrt(x); }
static inline Lanes root(Lanes x) {
#if defined(__AVX512F__)
    return (Lanes)_mm512_maskz_sqrt_pd(0xff, (__m512d)x);  // masked, since gcc 12 warns about the unmasked function
#elif defined(__AVX2__)
    return (Lanes)_mm256_sqrt_pd((__m256d)x);
#elif defined(__x86_64__)
    return (Lanes)_mm_sqrt_pd((__m128d)x);
#elif defined(__aarch64__)
    return (Lanes)vsqrtq_f64((float64x2_t)x);
#else
    for (int i = 0; i < WIDTH; i++) x[i] = __builtin_sqrt(x[i]);
    return x;
#endif
}

static inline bool any(bool condition) { return condition; }
static inline bool any(Masks condition) {
    int64_t result = 0;
    for (int i = 0; i < WIDTH; i++) result |= condition[i];
    return result != 0;
}

// one bit for each lane in which the condition is true
static inline uint64_t bits(Masks condition) {
#if defined(__AVX512DQ__)
    return _mm512_movepi64_mask((__m512i)condition);
#elif defined(__AVX2__)
    return (uint64_t)_mm256_movemask_pd((__m256d)condition);
#elif defined(__x86_64__)
    return (uint64_t)_mm_movemask_pd((__m128d)condition);
#else
    uint64_t result = 0;
    for (int i = 0; i < WIDTH; i++) result |= (uint64_t)(condition[i] != 0) << i;
    return result;
#endif
}

static inline int64_t as_bits(double x) {
    int64_t result;
    __builtin_memcpy(&result, &x, sizeof result);
    return result;
}
static inline Masks as_bits(Lanes x) { return (Masks)x; }
static inline double from_bits(int64_t x) {
    double result;
    __builtin_memcpy(&result, &x, sizeof result);
    return result;
}
static inline Lanes from_bits(Masks x) { return (Lanes)x; }

// Mask: the result type of a comparison of two V; all: a V whose lanes all have the same value
template <class V> struct Of;
template <> struct Of<double> {
    typedef bool Mask;
    static double all(double value) { return value; }
};
template <> struct Of<Lanes> {
    typedef Masks Mask;
    static Lanes all(double value) { return PRETOUCH_VARIANT::all(value); }
};

}  // namespace PRETOUCH_VARIANT
