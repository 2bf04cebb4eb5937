// Find the contacts of many encounters with any curve, vectorized (see lanes_block.hpp), and evaluate Chebyshev series.

#include <string.h>

#include "lanes.hpp"
#include "lanes_block.hpp"
#include "lanes_kernels.hpp"

namespace PRETOUCH_VARIANT {

namespace {

template <int DEGREE, class Extra> __attribute__((noinline)) void solve(const Request &request) {
    Block<DEGREE, Extra> block(request);
    block.run();
}

// Call the solver for the degree of the windows, which follows from their width.
template <class Extra> void solve(const Request &request) {
    switch (request.curves->width - TERMS - 1) {
        case 0: return solve<0, Extra>(request);
        case 1: return solve<1, Extra>(request);
        case 4: return solve<4, Extra>(request);
        default: return solve<12, Extra>(request);
    }
}

}  // namespace

void series_contacts(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                     const pretouch_curves *curves, double horizon, double *out, double *gradients,
                     double *const *peaks, int8_t *status) {
    Request request = {inputs, reference, n, curves, horizon, out, gradients, {{}, n}, status};
    for (int64_t i = 0; gradients && i < 27 * n; i++) gradients[i] = NOT_A_NUMBER;
    for (int row = 0; peaks && row < PEAKS; row++) {
        double *filled = request.peaks.rows[row] = peaks[row];
        for (int64_t i = 0; filled && i < n; i++) filled[i] = 0.0;
    }
    if (gradients) return solve<Responses>(request);
    if (peaks) return solve<Demands>(request);
    solve<Nothing>(request);
}

// ---- Chebyshev series at many places, vectorized, by Clenshaw's recurrence ----

namespace {

// The value of a series with m coefficients; z is twice the place in [-1, 1].
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
                 int64_t rows, double *out) {
    const double middle = 0.5 * (low + high), by_quarter = 4.0 / (high - low);
    for (int64_t i = 0; i < n; i += WIDTH) {
        const Lanes z = (load(place + i, n - i) - middle) * by_quarter;
        for (int64_t k = 0; k < rows; k++) store(out + k * n + i, series(z, coefficients + k * m, m), n - i);
    }
}

}  // namespace PRETOUCH_VARIANT
