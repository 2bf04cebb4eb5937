// What lanes_series.cpp and lanes_guaranteed.cpp define, once in the namespace of each processor (so there is no guard);
// see pretouch.h.

#include "pretouch.h"

namespace PRETOUCH_VARIANT {

void series_contacts(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                     const pretouch_curves *curves, double horizon, double *out, double *gradients, double *peaks,
                     int8_t *status);
void solve_series(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve, double horizon,
                  double *rows, int64_t *status, const double *times, int64_t m, double *trace);
void follow_gradients(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve,
                      const double *shape, double horizon, double *found, int8_t *status);

}  // namespace PRETOUCH_VARIANT
