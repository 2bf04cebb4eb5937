// Encounters of a constant slope, side by side, behind the plain interface of pretouch.h.

#include "dispatch.hpp"

#define PRETOUCH_LANES "lanes_linear.hpp"
#include "each_variant.hpp"

void pretouch_linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                              const pretouch_linear *wanted) {
    CHOSEN(linear_contacts)(inputs, n, slope, horizon, wanted);
}

void pretouch_exponentials(const double *x, int64_t n, double *out) { CHOSEN(exponentials)(x, n, out); }
