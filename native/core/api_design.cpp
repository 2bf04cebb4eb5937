// Designs, behind the plain interface of pretouch.h.

#include "dispatch.hpp"

#define PRETOUCH_LANES "lanes_design.hpp"
#include "each_variant.hpp"

void pretouch_find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves, int falling,
                         double horizon, const double *terms, int64_t k, double scale, double strong, double weak,
                         double low, double high, double *out) {
    CHOSEN(find_gains)(inputs, n, slope, curves, falling, horizon, terms, k, scale, strong, weak, low, high, out);
}

void pretouch_interpolate(const double *place, int64_t n, double low, double high, const double *coefficients,
                          int64_t m, double *out) {
    CHOSEN(interpolate)(place, n, low, high, coefficients, m, out);
}
