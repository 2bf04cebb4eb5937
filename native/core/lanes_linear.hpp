// What lanes_linear.cpp defines, once in the namespace of each processor (so there is no guard); see pretouch.h.

#include "pretouch.h"

namespace PRETOUCH_VARIANT {

void linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                     const pretouch_linear *wanted);
void exponentials(const double *x, int64_t n, double *out);

}  // namespace PRETOUCH_VARIANT
