// The Mittag-Leffler function E_alpha(z) for 0 < alpha <= 1 and z <= 0: see mittag_leffler.cpp.

#pragma once

#include <stdint.h>

namespace pretouch {

// Computes E_alpha, dE_alpha/dz and, if `by_order` is not null, dE_alpha/dalpha at n arguments z <= 0.
// accuracy: largest allowed relative error of E_alpha; a larger one avoids the slower of two methods more often.
void mittag_leffler(double order, const double *z, int64_t n, double accuracy, double *value, double *slope,
                    double *by_order);

}  // namespace pretouch
