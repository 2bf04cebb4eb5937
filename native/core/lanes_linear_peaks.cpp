// The largest demands on the robot until the contacts that linear_contacts finds: the closed form on vectors.
//
// Every derivative of x~ is a free response, with B = F - mu_1 u_0 and the functions of lanes_linear.cpp
//
//     x~' = u_0 e_2 + B h,      x~'' = A e_2 - mu_1 B h,      x~''' = J e_2 + mu_1^2 B h,
//
// A and J being x~'' and x~''' at the start. As h / e_2 = (e^((mu_2 - mu_1) t) - 1) / (mu_2 - mu_1) only grows, a
// response y e_2 + b h has at most one zero, where h / e_2 = r = -y / b is positive, at
//
//     t = ln(1 + (mu_2 - mu_1) r) / (mu_2 - mu_1),
//
// which nothing makes singular. So x~, x~' and x~'' have at most one peak each inside the motion, and the largest
// magnitude is that at the start, at the peak or at the end. A peak is flat: 1e-9 in its time is 1e-18 in its
// height, and whatever the time that rounding leaves, no value that the motion does not reach is reported.
//
// A reference that moves adds a line to x~; its peaks are then two, and they are left to the Taylor lanes.

#include "lanes_linear.hpp"

#include "linear_states.hpp"

namespace PRETOUCH_VARIANT {

namespace {

enum { DRIFT, PULL, REFERENCE };  // velocity and acceleration of the reference

struct Responses {
    Lanes e2, h, f;
};

// At a time; f by its series where that is short.
inline Responses responses(Lanes t, const Rates &rates) {
    const auto &[mu1, mu2, by1, by2, width, by_width] = rates;
    const auto [e1, m1] = exponential(-mu1 * t);
    const Lanes decay = e1 * exponential(-width * t).rest, h = decay * by_width;
    const Lanes z = -(mu1 + mu2) * t, w = mu1 * mu2 * t * t;
    const Lanes s2 = z * z - w, s3 = z * s2 - w * z, s4 = z * s3 - w * s2;
    const Lanes early = (0.5 + (1.0 / 6) * z) + ((1.0 / 24) * s2 + (1.0 / 120) * s3) +
                        ((1.0 / 720) * s4 + (1.0 / 5040) * (z * s4 - w * s3));
    return {e1 - decay, h, where(mu2 * t < 0.02, t * t * early, (m1 * by1 - h) * by2)};
}

// When h / e_2 is a ratio; 0 where that is not between the start and the end.
inline Lanes moment(Lanes ratio, const Rates &rates, Lanes end) {
    const Lanes t = rates.by_width * rough_logarithm(rates.width * ratio);
    return where((ratio > 0.0) & (t < end), t, Lanes{});
}

inline Lanes largest(Lanes at_start, Lanes at_peak, Lanes at_end) {
    return most(absolute(at_start), most(absolute(at_peak), absolute(at_end)));
}

}  // namespace

void linear_peaks(const pretouch_column *inputs, const pretouch_column *reference, int64_t n, double slope,
                  const double *time, const int8_t *status, double *out, int64_t m, int64_t first) {
    Columns<LINEAR_INPUTS> columns(inputs);
    Columns<REFERENCE> own(reference);
    const Lanes none = all(NOT_A_NUMBER);
    for (int64_t i = 0; i < n; i += WIDTH) {
        columns.reach(i, n - i);
        own.reach(i, n - i);
        const Lanes stiffness = columns.get(STIFFNESS, i), x0 = columns.get(X0, i), u0 = columns.get(U0, i);
        const Lanes v = columns.get(V, i), coupling = slope * columns.get(GAIN, i), end = load(time + i, n - i);
        const Lanes drift = own.get(DRIFT, i), pull = own.get(PULL, i);
        const auto [rates, by_mass, by_extra, real] =
            decay_rates(columns.get(MASS, i), columns.get(DAMPING, i), stiffness, coupling, all(1.0));
        const Lanes mu1 = rates.mu1, by1 = rates.by1, total = mu1 + rates.mu2, product = mu1 * rates.mu2;
        const Lanes force = (coupling * v - stiffness * x0) * by_mass;
        const Lanes b = force - mu1 * u0, start = force - total * u0;
        const Lanes jerk = -total * start - product * u0, by_b = 1.0 / b;
        const Responses far = responses(moment(-u0 * by_b, rates, end), rates);
        const Responses fastest = responses(moment(start * by1 * by_b, rates, end), rates);
        const Responses bent = responses(moment(-jerk * by1 * by1 * by_b, rates, end), rates);
        const Responses last = responses(end, rates);
        const Lanes way = u0 * far.h + force * far.f, way_end = u0 * last.h + force * last.f;
        const Lanes speed = u0 * fastest.e2 + b * fastest.h, speed_end = u0 * last.e2 + b * last.h;
        const Lanes bend = start * bent.e2 - mu1 * b * bent.h, bend_end = start * last.e2 - mu1 * b * last.h;
        const Masks found = load_status(status + i, n - i), steady = found & (pull == 0.0);
        double *to = out + first + i;
        store(to, where(found, largest(x0, x0 + way, x0 + way_end), none), n - i);
        store(to + m, where(steady & (drift == 0.0), most(absolute(way), absolute(way_end)), none), n - i);
        store(to + 2 * m, where(steady, largest(u0 + drift, speed + drift, speed_end + drift), none), n - i);
        store(to + 3 * m, where(found, largest(start + pull, bend + pull, bend_end + pull), none), n - i);
        const Lanes force_peak = absolute(coupling) * largest(v - u0, v - speed, v - speed_end);
        store(to + 4 * m, where(found, force_peak, none), n - i);
    }
}

// What the tests look at: e^x and 1 - e^x of each kind, phi_2 and phi_3 with whether they hold, and ln(1 - x).
void exponentials(const double *x, int64_t n, double *out) {
    for (int64_t i = 0; i < n; i += WIDTH) {
        const Lanes at = load(x + i, n - i);
        const auto [value, rest] = exponential(at);
        const ExponentialParts parts = exponential_parts(at);
        const auto [rough, rough_rest] = rough_exponential(at);
        const Lanes rows[] = {value, rest, parts.value, parts.rest, parts.second, parts.third,
                              where(parts.near, all(1.0), Lanes{}), rough, rough_rest, rough_logarithm(-at)};
        double *to = out + i;
        for (const Lanes row : rows) {
            store(to, row, n - i);
            to += n;
        }
    }
}

}  // namespace PRETOUCH_VARIANT
