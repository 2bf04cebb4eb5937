// Contacts of any curve side by side, behind the plain interface of pretouch.h.

#include "dispatch.hpp"

#define PRETOUCH_LANES "lanes_series.hpp"
#include "each_variant.hpp"

void pretouch_series_contacts(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves, double horizon,
                              double *out, int8_t *status) {
    CHOSEN(series_contacts)(inputs, n, curves, horizon, out, status);
}

void pretouch_series_gradients(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves, double horizon,
                               double *out, double *gradients, int8_t *status) {
    CHOSEN(series_gradients)(inputs, n, curves, horizon, out, gradients, status);
}

void pretouch_series_peaks(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                           const pretouch_curves *curves, double horizon, double *out, double *peaks, int8_t *status) {
    CHOSEN(series_peaks)(inputs, reference, n, curves, horizon, out, peaks, status);
}

void pretouch_solve_series(const double *values, int64_t n, const double *gains, const double *pieces, int64_t p,
                           int64_t q, double horizon, int contact_border, int open_ended, double *rows,
                           int64_t *status) {
    CHOSEN(solve_series)(values, n, gains, pieces, p, q, horizon, contact_border, open_ended, rows, status);
}

void pretouch_trace_series(const double *values, int64_t n, const double *gains, const double *pieces, int64_t p,
                           int64_t q, double horizon, int contact_border, int open_ended, const double *times,
                           int64_t m, double *trace) {
    CHOSEN(trace_series)(values, n, gains, pieces, p, q, horizon, contact_border, open_ended, times, m, trace);
}

void pretouch_follow_gradients(const double *values, int64_t n, const double *gains, const double *pieces, int64_t p,
                               int64_t q, const double *shape, double horizon, double *found, int8_t *status) {
    CHOSEN(follow_gradients)(values, n, gains, pieces, p, q, shape, horizon, found, status);
}
