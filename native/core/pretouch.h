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

/* ---- one encounter at a time, every contact found or excluded (linear.cpp, series.cpp, follow.cpp) ----
 * values: M, D, K, x~(0), x~'(0), p, v, a, velocity and acceleration of the reference; SI, shape (n, 10).
 * rows: filled with COLUMNS of motion/layout.py, shape (n, 15); status: filled with the numbers of ContactStatus. */
PRETOUCH_API void pretouch_solve_linear(const double *values, int64_t n, double slope, const double *gains,
                                        double horizon, double low, double high, double *rows, int64_t *status);

/* The first `count` of y, y', y'', y''' and the integral of y, for M y'' + D y' + K y = f0 + f1 t, for each row (M, D,
 * K, y0, v0, f0, f1) at times, shape (n, m): out, whose encounters lie `stride` numbers apart and whose times `step`. */
PRETOUCH_API void pretouch_respond(const double *rows, int64_t n, const double *times, int64_t m, double *out,
                                   int64_t stride, int64_t step, int64_t count);

/* pieces: middle, half width and coefficients of g of each, shape (p, q). */
PRETOUCH_API void pretouch_solve_series(const double *values, int64_t n, const double *gains, const double *pieces,
                                        int64_t p, int64_t q, double horizon, int contact_border, int open_ended,
                                        double *rows, int64_t *status);
PRETOUCH_API void pretouch_trace_series(const double *values, int64_t n, const double *gains, const double *pieces,
                                        int64_t p, int64_t q, double horizon, int contact_border, int open_ended,
                                        const double *times, int64_t m, double *trace);

/* Derivatives of time and l' at contact by nine inputs and k parameters of the curve: found, shape (n, 2, 9 + k). */
PRETOUCH_API void pretouch_follow_gradients(const double *values, int64_t n, const double *gains, const double *pieces,
                                            int64_t p, int64_t q, const double *terms, int64_t k, double horizon,
                                            double *found, int8_t *status);

/* ---- many encounters of a constant slope, side by side (lanes_linear.cpp) ----
 * inputs: M, D, K, x~(0), x~'(0), p, v, a, D_p. states, where not null: five rows of m numbers, filled from column
 * `first` on with x~, x~', x~'', l' and the integral of x~; no numbers where open. status: 0 or -1, open. */
PRETOUCH_API void pretouch_linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                                           double *time, int8_t *status, double *states, int64_t m, int64_t first);
/* The same with nothing but l' of the state. */
PRETOUCH_API void pretouch_linear_approaches(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                                             double *time, int8_t *status, double *approach);
PRETOUCH_API void pretouch_linear_states(const pretouch_column *inputs, int64_t n, double slope, const double *time,
                                         const int8_t *status, double *states, int64_t m, int64_t first);
/* out: derivatives of time, x~ and l' by the nine inputs and the slope, shape (3, 10, n). */
PRETOUCH_API void pretouch_linear_gradients(const pretouch_column *inputs, int64_t n, double slope, const double *time,
                                            const int8_t *status, double *out);
/* reference: its velocity and acceleration. out: the largest demands, five rows of m numbers. */
PRETOUCH_API void pretouch_linear_peaks(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                                        double slope, const double *time, const int8_t *status, double *out, int64_t m,
                                        int64_t first);

/* For tests: of x <= 0 the rows e^x and 1 - e^x; the same two beside phi_2, phi_3 and whether these hold, 1 or 0; e^x
 * and 1 - e^x roughly; ln(1 - x) roughly. out, shape (10, n). */
PRETOUCH_API void pretouch_exponentials(const double *x, int64_t n, double *out);

/* ---- many encounters of any curve, side by side (lanes_series.cpp) ----
 * The curves: windows of all, shape (rows, width); where those of each begin, and the last end; which is whose. */
typedef struct {
    const double *windows;
    int64_t rows, width;
    const int64_t *starts;
    const int64_t *curve_of;
    int64_t stride; /* of curve_of: 0 where all encounters have one curve */
} pretouch_curves;

/* out: time, x~, x~', x~'', l' and the integral of x~, shape (6, n); gradients, where not null: of time, x~ and l' by
 * the inputs, shape (3, 9, n); peaks, where not null: the largest demands, shape (5, n). */
PRETOUCH_API void pretouch_series_contacts(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves,
                                           double horizon, double *out, int8_t *status);
PRETOUCH_API void pretouch_series_gradients(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves,
                                            double horizon, double *out, double *gradients, int8_t *status);
PRETOUCH_API void pretouch_series_peaks(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                                        const pretouch_curves *curves, double horizon, double *out, double *peaks,
                                        int8_t *status);

/* ---- designs (lanes_design.cpp) ---- */
/* inputs: as values above, shape (10, n). curves: null for the constant slope. terms: shape (k, 4). out, shape (3, n). */
PRETOUCH_API void pretouch_find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves,
                                      int falling, double horizon, const double *terms, int64_t k, double scale,
                                      double strong, double weak, double low, double high, double *out);
/* Two Chebyshev series at n places in [low, high]: coefficients of both, shape (2, m); out, shape (2, n). */
PRETOUCH_API void pretouch_interpolate(const double *place, int64_t n, double low, double high,
                                       const double *coefficients, int64_t m, double *out);

#ifdef __cplusplus
}
#endif

#endif
