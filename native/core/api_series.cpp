// Contacts of any curve side by side, behind the plain interface of pretouch.h.

#include "dispatch.hpp"

#define PRETOUCH_LANES "lanes_series.hpp"
#include "each_variant.hpp"

void pretouch_series_contacts(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                              const pretouch_curves *curves, double horizon, double *out, double *gradients,
                              double *peaks, int8_t *status) {
    CHOSEN(series_contacts)(inputs, reference, n, curves, horizon, out, gradients, peaks, status);
}

void pretouch_solve_series(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve,
                           double horizon, double *rows, int64_t *status, const double *times, int64_t m,
                           double *trace) {
    CHOSEN(solve_series)(values, n, gains, curve, horizon, rows, status, times, m, trace);
}

void pretouch_follow_gradients(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve,
                               const double *shape, double horizon, double *found, int8_t *status) {
    CHOSEN(follow_gradients)(values, n, gains, curve, shape, horizon, found, status);
}
