/* The kernels behind a plain C interface: numbers and addresses in, arrays filled. Python loads them by ctypes
 * (pretouch/_core/native.py); every argument is checked there, so nothing here can fail. All arrays are contiguous,
 * float64 unless said otherwise; an array that the kernel fills is no const. */

#ifndef PRETOUCH_H
#define PRETOUCH_H

#include <stdint.h>

#if defined(_WIN32)
#define PRETOUCH_API __declspec(dllexport)
#else
#define PRETOUCH_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Numbers of many encounters: stride 1, or one number for all of them: stride 0. */
typedef struct {
    const double *at;
    int64_t stride;
} pretouch_column;

/* Which kernels run: 0 base, 1 AVX2 and FMA, 2 AVX-512. Choosing tells what runs from then on, which is the wanted one or
 * the best that the processor and the library have. */
PRETOUCH_API int pretouch_best_variant(void);
PRETOUCH_API int pretouch_choose_variant(int wanted);

/* Two Chebyshev series at n places in [low, high]: coefficients of both, shape (2, m); out, shape (2, n). */
PRETOUCH_API void pretouch_interpolate(const double *place, int64_t n, double low, double high,
                                       const double *coefficients, int64_t m, double *out);

#ifdef __cplusplus
}
#endif

#endif
