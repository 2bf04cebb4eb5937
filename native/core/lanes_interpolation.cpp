// Chebyshev series of two functions at many places, side by side: Clenshaw's recurrence.

#include "lanes.hpp"
#include "lanes_design.hpp"

namespace PRETOUCH_VARIANT {

namespace {

Lanes series(Lanes z, const double *c, int64_t m) {
    Lanes first = all(0.0), before = first;
    for (int64_t k = m - 1; k > 0; k--) {
        const Lanes next = (c[k] - before) + z * first;
        before = first;
        first = next;
    }
    return c[0] + 0.5 * z * first - before;
}

}  // namespace

void interpolate(const double *place, int64_t n, double low, double high, const double *coefficients, int64_t m,
                 double *out) {
    const double middle = 0.5 * (low + high), by_quarter = 4.0 / (high - low);
    for (int64_t i = 0; i < n; i += WIDTH) {
        const Lanes z = (load(place + i, n - i) - middle) * by_quarter;
        store(out + i, series(z, coefficients, m), n - i);
        store(out + n + i, series(z, coefficients + m, m), n - i);
    }
}

}  // namespace PRETOUCH_VARIANT
