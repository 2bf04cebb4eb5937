// What lanes_design.cpp and lanes_interpolation.cpp define, once in the namespace of each processor (so there is no guard); see pretouch.h.

#include "pretouch.h"

namespace PRETOUCH_VARIANT {

void find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves, int falling,
                double horizon, const double *terms, int64_t k, double scale, double strong, double weak, double low,
                double high, double *out);
void interpolate(const double *place, int64_t n, double low, double high, const double *coefficients, int64_t m,
                 double *out);

}  // namespace PRETOUCH_VARIANT
