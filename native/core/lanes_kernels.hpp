// Declarations of the vectorized kernels that the C interface of pretouch.h calls. dispatch.cpp includes this file once
// for each kind of processor, each time with another namespace PRETOUCH_VARIANT. So it has no include guard.

#include "pretouch.h"

namespace PRETOUCH_VARIANT {

void linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                     const pretouch_linear *wanted);
void exponentials(const double *x, int64_t n, double *out);

void series_contacts(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                     const pretouch_curves *curves, double horizon, double *out, double *gradients,
                     double *const *peaks, int8_t *status);
void solve_series(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve, double horizon,
                  double *rows, int64_t *status, const double *times, int64_t m, double *trace, const double *sections,
                  int64_t section_count);
void solve_drag_courses(const double *values, int64_t n, const double *drags, const pretouch_pieces *curve,
                        double horizon, const pretouch_drag_courses *wanted);
void follow_gradients(const double *values, int64_t n, const double *gains, const pretouch_pieces *curve,
                      const double *shape, double horizon, double *gradients, int8_t *status);

void drag_approaches(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves, double horizon,
                     const pretouch_approaches *wanted);

void find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves,
                const pretouch_pieces *pieces, double nearest, double farthest, int falling, double horizon, const double *terms, int64_t k, const double *limits, int64_t limit_count, double scale,
                double strong, double weak, double low, double high, double *out);
void interpolate(const double *place, int64_t n, double low, double high, const double *coefficients, int64_t m,
                 int64_t rows, double *out);

void run_side_by_side(const pretouch_loop *loop, const int64_t *which, int64_t n, void *states,
                      pretouch_reading *waiting, int64_t room);

}  // namespace PRETOUCH_VARIANT
