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
