// Compute the derivatives of the state at contact by the nine inputs, vectorized.
//
// A small change of an input changes l by d(t), which obeys the linearized equation of motion,
//
//     M d'' + D d' + K d + D_p (g d)' = f,    d' = y - c d,   y' = -(K d - f) / M,   c = (D + D_p g) / M,
//
// along the computed motion. So the Taylor coefficients of d follow on the same steps, by one convolution of c and d.
// Eight responses are integrated: h_1 to a change of l(0), h_2 to a change of l'(0), and six responses from rest to
// forces f. The forces are x~' (for D), x~ (for K), -d(ln xi)/dt (for D_p), and M times 1, t and t^2/2 (F_0, F_1, F_2).
// The responses give the derivatives of l by x_0, p, a, u_0 and v,
//
//     d_x0 = -h_1,   d_p = h_1 + (K/M) F_0,   d_a = F_0 + (D F_1 + K F_2) / M,
//     d_u0 = -h_2,   d_v = h_2 + (D F_0 + K F_1) / M,
//
// The derivative by M follows, since a common factor of M, D, K and D_p does not change the motion:
//
//     0 = M d_M + D d_D + K d_K + D_p d_Dp.
//
// (h_2 and h_1 would also follow from scaling all lengths and from shifting the time, but with a loss of digits.
// Scaling divides by l'(0), which may be small. The shift loses the digits of the damping rate in stiff motions.)

#pragma once

#include <string.h>

#include "lanes_windows.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr double RESPONSE_TOLERANCE = 1e-10;  // largest accepted last Taylor term of a step, relative to the response

enum { BY_DAMPING, BY_STIFFNESS, BY_GAIN, BY_CONSTANT, BY_TIME, BY_SQUARE, BY_DISTANCE, BY_SPEED, BY_SHAPE, SHAPED };
constexpr int RESPONSES = BY_SHAPE;

struct Response {
    Lanes d, y;  // d: the change of l; y = d' + c d
};

// The responses that are integrated with a motion: the eight ones, and optionally that to a parameter of the curve.
// Those to the forces for D, K and D_p are stored times M. widest: the largest response to D_p so far; excess: the last
// Taylor terms of the latest step, of the response to l(0), or of that to D_p relative to `widest`, whichever is
// larger.
struct Responses {
    Lanes mass, widest, excess;
    Response of[SHAPED];
    Lanes shape[LARGEST_DEGREE + 1];  // the derivative of ln xi by the parameter, as terms of the window

    // Start the responses of a new encounter in a lane. held: c at the start.
    void start(int lane, double m, double held) {
        mass[lane] = m;
        widest[lane] = 0.0;
        for (Response &r : of) r.d[lane] = r.y[lane] = 0.0;
        of[BY_DISTANCE].d[lane] = 1.0;
        of[BY_DISTANCE].y[lane] = held;
        of[BY_SPEED].y[lane] = 1.0;
    }
};

// The Taylor coefficients of the linearized equation of motion on one step: -c, the forces x~', x~ and -d(ln xi)/dt,
// that of the parameter of the curve, those of 1, t and t^2/2, and -K / M (pull). The unit of time is the length of the
// step.
struct Around {
    Lanes minus_c[ORDER], force[3][ORDER], shape[ORDER], moments[3][3];
    Lanes pull, length;
};

// Fill the coefficients that depend on the slope of the curve.
template <int DEGREE, int N>
__attribute__((always_inline)) inline void look_along(const Motion &m, const Responses &r, Around &s) {
    Series<0> g, rate, shape;
    find_slope<DEGREE>(m.terms, m.b[0] - m.middle, m.b, g);
    if constexpr (N == SHAPED) find_slope<DEGREE>(r.shape, m.b[0] - m.middle, m.b, shape);
    const Lanes weight = -m.gain * m.length;
    unrolled<0, ORDER>([&](auto place) __attribute__((always_inline)) {
        constexpr int k = decltype(place)::value;
        s.minus_c[k] = g.at[k] * weight;
        rate.at[k] = m.b[k + 1] * double(k + 1);
        s.force[BY_GAIN][k] = -convolve<k>(g, rate) * m.length;
        if constexpr (N == SHAPED) s.shape[k] = convolve<k>(shape, rate) * weight;
    });
    s.minus_c[0] = s.minus_c[0] - m.damping * m.length;
}

// Fill the coefficients that do not depend on the curve. start: the time at the start of the step.
inline void look_around(const Motion &m, Lanes start, Around &s) {
    const Lanes length = m.length, square = length * length;
    const Obstacle o = obstacle_at(m, start);
    Lanes displacement[ORDER + 1];
    for (int k = 0; k <= ORDER; k++) displacement[k] = -m.b[k];
    displacement[0] = displacement[0] + o.position;
    displacement[1] = displacement[1] + o.velocity * length;
    displacement[2] = displacement[2] + m.acceleration * 0.5 * square;
    for (int k = 0; k < ORDER; k++) {
        s.force[BY_DAMPING][k] = displacement[k + 1] * double(k + 1) * length;
        s.force[BY_STIFFNESS][k] = displacement[k] * square;
    }
    const Lanes zero = all(0.0);
    const Lanes moments[3][3] = {
        {square, zero, zero},
        {square * start, square * length, zero},
        {square * start * start * 0.5, square * length * start, square * square * 0.5},
    };
    memcpy(s.moments, moments, sizeof moments);
    s.pull = -m.stiffness * square;
    s.length = length;
}

// Taylor series of N responses on a step: the coefficients of d, the latest one of y, and the sums of both.
template <int N> struct Changes {
    Lanes d[ORDER + 1][N], y[N], total[N], momentum[N];
};

// Compute the coefficients of order k + 1 of all responses together. They do not depend on one another, so the
// processor can overlap the operations.
template <int N> inline void grow(const Around &s, Changes<N> &changes, int k) {
    Lanes sum[N];
    unrolled<0, N>([&](auto r) __attribute__((always_inline)) {
        sum[decltype(r)::value] = s.minus_c[k] * changes.d[0][decltype(r)::value];
    });
    for (int j = 1; j <= k; j++) {
        const Lanes c = s.minus_c[k - j];
        unrolled<0, N>([&](auto r) __attribute__((always_inline)) {
            sum[decltype(r)::value] = sum[decltype(r)::value] + c * changes.d[j][decltype(r)::value];
        });
    }
    const double part = 1.0 / (k + 1);
    unrolled<0, N>([&](auto place) __attribute__((always_inline)) {
        constexpr int r = decltype(place)::value;
        const Lanes next = (changes.y[r] + sum[r]) * part;
        if (k < ORDER - 1) {
            Lanes grown = s.pull * changes.d[k][r];
            if constexpr (r <= BY_GAIN) grown = grown + s.force[r][k];
            else if constexpr (r <= BY_SQUARE) grown = k < 3 ? grown + s.moments[r - BY_CONSTANT][k] : grown;
            else if constexpr (r == BY_SHAPE) grown = grown + s.shape[k];
            changes.y[r] = grown * part;
            changes.momentum[r] = changes.momentum[r] + changes.y[r];
        }
        changes.d[k + 1][r] = next;
        changes.total[r] = changes.total[r] + next;
    });
}

// Compute the responses at the end of a step, and the magnitude of the last Taylor term of each.
template <int N>
__attribute__((noinline)) void carry_all(const Around &s, const Responses &r, Response *to, Lanes *tails) {
    Changes<N> changes;
    for (int i = 0; i < N; i++) {
        changes.d[0][i] = changes.total[i] = r.of[i].d;
        changes.y[i] = changes.momentum[i] = r.of[i].y * s.length;
    }
    for (int k = 0; k < ORDER; k++) grow(s, changes, k);
    for (int i = 0; i < N; i++) {
        to[i] = {changes.total[i], changes.momentum[i] / s.length};
        tails[i] = absolute(changes.d[ORDER][i]);
    }
}

// Propagate the responses over a step in the lanes that moved. Return the lanes in which they are accurate. In all
// other lanes they stay unchanged.
template <int DEGREE, int N = RESPONSES>
__attribute__((noinline)) uint64_t carry_responses(const Motion &m, Responses &r, Lanes start, Masks moved,
                                                   double tolerance = RESPONSE_TOLERANCE) {
    Around s;
    look_around(m, start, s);
    look_along<DEGREE, N>(m, r, s);
    Response to[N];
    Lanes tails[N];
    carry_all<N>(s, r, to, tails);
    const Lanes widest = most(absolute(to[BY_GAIN].d), r.widest);
    r.excess = most(tails[BY_DISTANCE], tails[BY_GAIN] / most(all(SMALLEST), widest));
    const Masks smooth = r.excess < tolerance, kept = moved & smooth;
    r.widest = where(kept, widest, r.widest);
    for (int i = 0; i < N; i++) {
        r.of[i].d = where(kept, to[i].d, r.of[i].d);
        r.of[i].y = where(kept, to[i].y, r.of[i].y);
    }
    return bits(smooth);
}

// Write the derivatives of time, x~ and l' at contact by the nine inputs, in rows of n numbers. slope: g at contact.
inline void write_gradient(const Motion &m, const Responses &all_of, const Contacts &contact, int lane, double slope,
                           double *to, int64_t n) {
    const double dm = m.damping[lane], km = m.stiffness[lane], gm = m.gain[lane], mass = all_of.mass[lane];
    const double v = m.velocity[lane], a = m.acceleration[lane], time = contact.time[lane];
    const double held = dm + gm * slope;
    double gradient[3][9];
    for (int part = 0; part < 2; part++) {  // first the changes of l, then those of l', at the unchanged contact time
        double r[RESPONSES], *row = gradient[2 * part];
        for (int j = 0; j < RESPONSES; j++) {
            const double d = all_of.of[j].d[lane], y = all_of.of[j].y[lane];
            r[j] = part == 0 ? d : y - held * d;
        }
        row[0] = -(dm * r[BY_DAMPING] + km * r[BY_STIFFNESS] + gm * r[BY_GAIN]) / mass;
        row[1] = r[BY_DAMPING] / mass;
        row[2] = r[BY_STIFFNESS] / mass;
        row[3] = -r[BY_DISTANCE];
        row[4] = -r[BY_SPEED];
        row[5] = r[BY_DISTANCE] + km * r[BY_CONSTANT];
        row[6] = r[BY_SPEED] + (dm * r[BY_CONSTANT] + km * r[BY_TIME]);
        row[7] = r[BY_CONSTANT] + dm * r[BY_TIME] + km * r[BY_SQUARE];
        row[8] = r[BY_GAIN] / mass;
    }
    for (int j = 0; j < 9; j++) {
        gradient[0][j] = -gradient[0][j] / contact.speed[lane];
        gradient[2][j] += contact.bend[lane] * gradient[0][j];
        gradient[1][j] = (v + a * time) * gradient[0][j];
    }
    gradient[1][5] += 1.0;
    gradient[1][6] += time;
    gradient[1][7] += time * time / 2;
    for (int row = 0; row < 3; row++) {
        for (int j = 0; j < 9; j++) to[(row * 9 + j) * n] = gradient[row][j];
    }
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
