// What lanes_linear*.cpp define, once in the namespace of each processor (so there is no guard); see pretouch.h.

#include "pretouch.h"

namespace PRETOUCH_VARIANT {

void linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon, double *time,
                     int8_t *status, double *states, int64_t m, int64_t first);
void linear_approaches(const pretouch_column *inputs, int64_t n, double slope, double horizon, double *time,
                       int8_t *status, double *approach);
void linear_states(const pretouch_column *inputs, int64_t n, double slope, const double *time, const int8_t *status,
                   double *states, int64_t m, int64_t first);
void linear_gradients(const pretouch_column *inputs, int64_t n, double slope, const double *time, const int8_t *status,
                      double *out);
void linear_peaks(const pretouch_column *inputs, const pretouch_column *reference, int64_t n, double slope,
                  const double *time, const int8_t *status, double *out, int64_t m, int64_t first);
void exponentials(const double *x, int64_t n, double *out);

}  // namespace PRETOUCH_VARIANT
