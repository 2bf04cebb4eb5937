// The largest demands on the robot until the contacts of lanes_linear.cpp: the closed form on vectors.
//
// Every derivative of x~ is a free response, with B = F - mu_1 u_0 and the functions of linear_motion.hpp
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

#pragma once

#include "linear_motion.hpp"

namespace PRETOUCH_VARIANT {

struct Free {
    Lanes e2, h, f;
};

static inline Free free_at(Lanes t, const Rates &rates) {
    const auto [rest, h, e2] = basis<exponential>(t, rates);
    const Early early = early_functions(t, rates);
    return {e2, h, where(early.holds, early.f, (rest * rates.by1 - h) * rates.by2)};
}

// When h / e_2 is a ratio; 0 where that is not between the start and the end.
static inline Lanes moment(Lanes ratio, const Rates &rates, Lanes end) {
    const Lanes t = rates.by_width * rough_logarithm(rates.width * ratio);
    return where((ratio > 0.0) & (t < end), t, Lanes{});
}

static inline Lanes largest(Lanes at_start, Lanes at_peak, Lanes at_end) {
    return most(absolute(at_start), most(absolute(at_peak), absolute(at_end)));
}

// Writes the largest demands; drift, pull: velocity and acceleration of the reference.
[[gnu::noinline]] static void write_peaks(const Encounters &q, Lanes coupling, Lanes drift, Lanes pull, const Rows &rows) {
    const auto [rates, gap, force, by_mass, x0, u0, v, end, found] = q;  // a copy: no store could change it
    const Lanes mu1 = rates.mu1, by1 = rates.by1, total = mu1 + rates.mu2, product = mu1 * rates.mu2;
    const Lanes b = force - mu1 * u0, start = force - total * u0;
    const Lanes jerk = -total * start - product * u0, by_b = 1.0 / b;
    const Free far = free_at(moment(-u0 * by_b, rates, end), rates);
    const Free fastest = free_at(moment(start * by1 * by_b, rates, end), rates);
    const Free bent = free_at(moment(-jerk * by1 * by1 * by_b, rates, end), rates);
    const Free last = free_at(end, rates);
    const Lanes way = u0 * far.h + force * far.f, way_end = u0 * last.h + force * last.f;
    const Lanes speed = u0 * fastest.e2 + b * fastest.h, speed_end = u0 * last.e2 + b * last.h;
    const Lanes bend = start * bent.e2 - mu1 * b * bent.h, bend_end = start * last.e2 - mu1 * b * last.h;
    const Lanes none = all(NOT_A_NUMBER);
    const Masks steady = pull == 0.0;
    rows.keep(0, largest(x0, x0 + way, x0 + way_end));
    rows.keep(1, where(steady & (drift == 0.0), most(absolute(way), absolute(way_end)), none));
    rows.keep(2, where(steady, largest(u0 + drift, speed + drift, speed_end + drift), none));
    rows.keep(3, largest(start + pull, bend + pull, bend_end + pull));
    rows.keep(4, absolute(coupling) * largest(v - u0, v - speed, v - speed_end));
}

}  // namespace PRETOUCH_VARIANT
