// What lanes_design.cpp and lanes_interpolation.cpp define, once in the namespace of each processor (so there is no guard); see pretouch.h.

#include "pretouch.h"

namespace PRETOUCH_VARIANT {

void interpolate(const double *place, int64_t n, double low, double high, const double *coefficients, int64_t m,
                 double *out);

}  // namespace PRETOUCH_VARIANT
