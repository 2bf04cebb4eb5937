// C interface of the vectorized kernels. When the library is loaded, it detects the kind of processor and selects the
// matching variant of the kernels.

#include "approach.hpp"

#define PRETOUCH_VARIANT pretouch_base
#include "lanes_kernels.hpp"
#undef PRETOUCH_VARIANT

#if defined(__x86_64__) || defined(_M_X64)
#define PRETOUCH_X86 1
#include <cpuid.h>

#define PRETOUCH_VARIANT pretouch_avx2
#include "lanes_kernels.hpp"
#undef PRETOUCH_VARIANT
#define PRETOUCH_VARIANT pretouch_avx512
#include "lanes_kernels.hpp"
#undef PRETOUCH_VARIANT

#define CHOSEN(kernel) \
    (chosen == 2 ? pretouch_avx512::kernel : chosen == 1 ? pretouch_avx2::kernel : pretouch_base::kernel)
#else
#define CHOSEN(kernel) (pretouch_base::kernel)
#endif

namespace {

#ifdef PRETOUCH_X86
constexpr uint32_t bit(int place) { return 1u << place; }
constexpr uint32_t AVX2 = bit(5) | bit(3) | bit(8);  // leaf 7, ebx: AVX2, BMI, BMI2
constexpr uint32_t AVX512 = bit(16) | bit(17) | bit(28) | bit(30) | bit(31);  // F, DQ, CD, BW, VL
constexpr uint32_t FMA = bit(12), SAVES = bit(27);  // leaf 1, ecx: FMA, OSXSAVE

int best() {
    uint32_t a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & (FMA | SAVES)) != (FMA | SAVES)) return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));  // reads which registers the OS saves
    if ((low & 0x6) != 0x6 || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || (b & AVX2) != AVX2) return 0;
    return (low & 0xe6) == 0xe6 && (b & AVX512) == AVX512 ? 2 : 1;
}
#else
int best() { return 0; }
#endif

int chosen = best();

}  // namespace

int pretouch_best_variant(void) { return best(); }

int pretouch_choose_variant(int wanted) {
    const int most = best();
    return chosen = wanted < 0 || wanted > most ? most : wanted;
}

// ---- encounters with a constant slope ----

void pretouch_linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                              const pretouch_linear *wanted) {
    CHOSEN(linear_contacts)(inputs, n, slope, horizon, wanted);
}

void pretouch_exponentials(const double *x, int64_t n, double *out) { CHOSEN(exponentials)(x, n, out); }

// ---- encounters with any sensor curve ----

void pretouch_series_contacts(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                              const pretouch_curves *curves, double horizon, double *out, double *gradients,
                              double *const *peaks, int8_t *status) {
    CHOSEN(series_contacts)(inputs, reference, n, curves, horizon, out, gradients, peaks, status);
}

void pretouch_solve_series(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve,
                           double horizon, double *rows, int64_t *status, const double *times, int64_t m,
                           double *trace, const double *sections, int64_t section_count) {
    CHOSEN(solve_series)
    (values, n, gains, curve, horizon, rows, status, times, m, trace, sections, section_count);
}

void pretouch_follow_gradients(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve,
                               const double *shape, double horizon, double *gradients, int8_t *status) {
    CHOSEN(follow_gradients)(values, n, gains, curve, shape, horizon, gradients, status);
}

// ---- approaches under the virtual drag ----

void pretouch_drag_approaches(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves, double horizon,
                              const pretouch_approaches *wanted) {
    CHOSEN(drag_approaches)(inputs, n, curves, horizon, wanted);
}

void pretouch_solve_drag_courses(const double *values, int64_t n, const double *drags, const pretouch_pieces *curve,
                                 double horizon, const pretouch_drag_courses *wanted) {
    CHOSEN(solve_drag_courses)(values, n, drags, curve, horizon, wanted);
}

// ---- the sampled loop ----

void pretouch::run_side_by_side(const pretouch_loop *loop, const int64_t *which, int64_t n, void *states,
                                pretouch_reading *waiting, int64_t room) {
    CHOSEN(run_side_by_side)(loop, which, n, states, waiting, room);
}

// ---- designs ----

void pretouch_find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves,
                         const pretouch_pieces *pieces, double nearest, double farthest, int falling, double horizon, const double *terms, int64_t k, const double *limits, int64_t limit_count,
                         double scale, double strong, double weak, double low, double high, double *out) {
    CHOSEN(find_gains)(inputs, n, slope, curves, pieces, nearest, farthest, falling, horizon, terms, k, limits, limit_count,
                       scale, strong, weak, low, high, out);
}

void pretouch_interpolate(const double *place, int64_t n, double low, double high, const double *coefficients,
                          int64_t m, int64_t rows, double *out) {
    CHOSEN(interpolate)(place, n, low, high, coefficients, m, rows, out);
}
