// Encounters of a constant slope, side by side, behind the plain interface of pretouch.h.

#include "dispatch.hpp"

#define PRETOUCH_LANES "lanes_linear.hpp"
#include "each_variant.hpp"

void pretouch_linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon, double *time,
                              int8_t *status, double *states, int64_t m, int64_t first) {
    CHOSEN(linear_contacts)(inputs, n, slope, horizon, time, status, states, m, first);
}

void pretouch_linear_approaches(const pretouch_column *inputs, int64_t n, double slope, double horizon, double *time,
                                int8_t *status, double *approach) {
    CHOSEN(linear_approaches)(inputs, n, slope, horizon, time, status, approach);
}

void pretouch_linear_states(const pretouch_column *inputs, int64_t n, double slope, const double *time,
                            const int8_t *status, double *states, int64_t m, int64_t first) {
    CHOSEN(linear_states)(inputs, n, slope, time, status, states, m, first);
}

void pretouch_linear_gradients(const pretouch_column *inputs, int64_t n, double slope, const double *time,
                               const int8_t *status, double *out) {
    CHOSEN(linear_gradients)(inputs, n, slope, time, status, out);
}

void pretouch_linear_peaks(const pretouch_column *inputs, const pretouch_column *reference, int64_t n, double slope,
                           const double *time, const int8_t *status, double *out, int64_t m, int64_t first) {
    CHOSEN(linear_peaks)(inputs, reference, n, slope, time, status, out, m, first);
}

void pretouch_exponentials(const double *x, int64_t n, double *out) { CHOSEN(exponentials)(x, n, out); }
