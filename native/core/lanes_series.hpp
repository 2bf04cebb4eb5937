// What lanes_series.cpp defines, once in the namespace of each processor (so there is no guard); see pretouch.h.

#include "pretouch.h"

namespace PRETOUCH_VARIANT {

void series_contacts(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves, double horizon,
                     double *out, int8_t *status);
void series_gradients(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves, double horizon,
                      double *out, double *gradients, int8_t *status);
void series_peaks(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                  const pretouch_curves *curves, double horizon, double *out, double *peaks, int8_t *status);

}  // namespace PRETOUCH_VARIANT
