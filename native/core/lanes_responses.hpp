// How the state at contact depends on the nine inputs, side by side.
//
// A change of an input changes l by d(t), which obeys the linear equation of small changes,
//
//     M d'' + D d' + K d + D_p (g d)' = f,    d' = y - c d,   y' = -(K d - f) / M,   c = (D + D_p g) / M,
//
// along the motion that is known already, so its Taylor coefficients follow over the same steps by one convolution of c
// and d. Eight responses are followed: h_1 to l(0) and h_2 to l'(0), and from rest those to the forces x~' (for D), x~
// (for K), -d(ln xi)/dt (for D_p), and M times 1, t and t^2/2 (F_0, F_1, F_2). They give
//
//     d_x0 = -h_1,   d_p = h_1 + (K/M) F_0,   d_a = F_0 + (D F_1 + K F_2) / M,
//     d_u0 = -h_2,   d_v = h_2 + (D F_0 + K F_1) / M,
//
// and a symmetry of the equation of motion, the same factor on M, D, K and D_p, gives the last,
//
//     0 = M d_M + D d_D + K d_K + D_p d_Dp.
//
// (Other units and another origin of time would give h_2 and h_1 as well, but lose digits: the one divides by l'(0),
// which is small at a slow start, the other takes those of the damping rate where the motion is stiff.)

#pragma once

#include <string.h>

#include "lanes_windows.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr double RESPONSE_TOLERANCE = 1e-10;  // what the last term of a step may add to a response, of its size

enum { BY_DAMPING, BY_STIFFNESS, BY_GAIN, BY_CONSTANT, BY_TIME, BY_SQUARE, BY_DISTANCE, BY_SPEED, RESPONSES };

struct Response {
    Lanes d, y;  // the change of l, and d' + c d
};

// What is followed beside a motion.
struct Responses {
    Lanes mass, widest, excess;  // the largest response to D_p, and what last terms add beside it
    Response of[RESPONSES];

    // Begin in a lane; held: c at the start.
    void start(int lane, double m, double held) {
        mass[lane] = m;
        widest[lane] = 0.0;
        for (Response &r : of) r.d[lane] = r.y[lane] = 0.0;
        of[BY_DISTANCE].d[lane] = 1.0;
        of[BY_DISTANCE].y[lane] = held;
        of[BY_SPEED].y[lane] = 1.0;
    }
};

// The series of the slope g along a step.
template <int DEGREE> struct SlopeCurve {
    Lanes a[DEGREE + 1];  // from here on of the slope: a[j + 1] is the coefficient of z^j
    Series<1> twice, inner, outer;
    Series<2> z2, twice2;
    Series<3> z3;
    Series<4> z4;

    __attribute__((always_inline)) SlopeCurve(const Motion &m, Series<0> &g) {
        shift<DEGREE>(m.terms, m.b[0] - m.middle, a);
        unrolled<2, DEGREE + 1>([&](auto j) __attribute__((always_inline)) {
            a[decltype(j)::value] = a[decltype(j)::value] * double(decltype(j)::value);
        });
        g.at[0] = a[1];
    }

    template <int N> __attribute__((always_inline)) Lanes next(const Series<1> &z, const Series<0> &) {
        if constexpr (2 * N < ORDER) twice.at[N] = z.at[N] + z.at[N];
        if constexpr (N >= 2) set<N>(z2, twice2, square<N>(z, twice));
        if constexpr (N >= 3) z3.at[N] = convolve<N>(z, z2);
        Lanes total;
        if constexpr (DEGREE == 12 && N >= 5) {
            further<N>(z);
            total = convolve<N>(z4, outer) + a[2] * z.at[N];
        } else {
            if constexpr (DEGREE == 12) further<N>(z);
            total = a[2] * z.at[N];
        }
        if constexpr (N >= 2) total = total + a[3] * z2.at[N];
        if constexpr (N >= 3) total = total + a[4] * z3.at[N];
        if constexpr (DEGREE == 12 && N >= 4) total = total + a[5] * z4.at[N];
        return total;
    }

  private:
    template <int N> __attribute__((always_inline)) void further(const Series<1> &z) {
        if constexpr (N >= 4) z4.at[N] = square<N>(z2, twice2);
        Lanes value = a[10] * z.at[N], middle;
        if constexpr (N >= 5) middle = convolve<N>(z4, inner) + a[6] * z.at[N];
        else middle = a[6] * z.at[N];
        if constexpr (N >= 2) value = value + a[11] * z2.at[N], middle = middle + a[7] * z2.at[N];
        if constexpr (N >= 3) value = value + a[12] * z3.at[N], middle = middle + a[8] * z3.at[N];
        if constexpr (N >= 4) middle = middle + a[9] * z4.at[N];
        inner.at[N] = value;
        outer.at[N] = middle;
    }
};

template <> struct SlopeCurve<0> {
    Lanes minus;

    __attribute__((always_inline)) SlopeCurve(const Motion &m, Series<0> &g) {
        const Lanes first = 1.0 / (m.b[0] - m.middle);
        g.at[0] = m.terms[0] * first;
        minus = -first;
    }

    template <int N> __attribute__((always_inline)) Lanes next(const Series<1> &z, const Series<0> &g) {
        return minus * convolve<N>(z, g);
    }
};

template <> struct SlopeCurve<1> {
    __attribute__((always_inline)) SlopeCurve(const Motion &m, Series<0> &g) { g.at[0] = m.terms[1]; }

    template <int N> __attribute__((always_inline)) Lanes next(const Series<1> &, const Series<0> &) {
        return all(0.0);
    }
};

// A step as the equation of small changes needs it: -c, and the forces x~', x~ and -d(ln xi)/dt on the response to
// each, all over the time that the step is long.
struct Around {
    Lanes minus_c[ORDER], force[3][ORDER], moments[3][3];  // moments: of 1, t and t^2/2
    Lanes pull, length;
};

template <int DEGREE> __attribute__((always_inline)) inline void look_along(const Motion &m, Around &s) {
    Series<0> g, rate;
    Series<1> z;
    unrolled<0, ORDER + 1>([&](auto k) __attribute__((always_inline)) {
        z.at[decltype(k)::value] = m.b[decltype(k)::value];
    });
    SlopeCurve<DEGREE> curve(m, g);
    unrolled<1, ORDER>([&](auto place) __attribute__((always_inline)) {
        constexpr int n = decltype(place)::value;
        g.at[n] = curve.template next<n>(z, g);
    });
    const Lanes weight = -m.gain * m.length;
    unrolled<0, ORDER>([&](auto place) __attribute__((always_inline)) {
        constexpr int k = decltype(place)::value;
        s.minus_c[k] = g.at[k] * weight;
        rate.at[k] = z.at[k + 1] * double(k + 1);
        s.force[BY_GAIN][k] = -convolve<k>(g, rate) * m.length;
    });
    s.minus_c[0] = s.minus_c[0] - m.damping * m.length;
}

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

// Changes of l over a step.
struct Changes {
    Lanes d[ORDER + 1][RESPONSES], y[RESPONSES], total[RESPONSES], momentum[RESPONSES];
};

// The next coefficient of all: side by side, for none of them waits for the last one of another.
inline void grow(const Around &s, Changes &changes, int k) {
    Lanes sum[RESPONSES];
    unrolled<0, RESPONSES>([&](auto r) __attribute__((always_inline)) {
        sum[decltype(r)::value] = s.minus_c[k] * changes.d[0][decltype(r)::value];
    });
    for (int j = 1; j <= k; j++) {
        const Lanes c = s.minus_c[k - j];
        unrolled<0, RESPONSES>([&](auto r) __attribute__((always_inline)) {
            sum[decltype(r)::value] = sum[decltype(r)::value] + c * changes.d[j][decltype(r)::value];
        });
    }
    const double part = 1.0 / (k + 1);
    unrolled<0, RESPONSES>([&](auto place) __attribute__((always_inline)) {
        constexpr int r = decltype(place)::value;
        const Lanes next = (changes.y[r] + sum[r]) * part;
        if (k < ORDER - 1) {
            Lanes grown = s.pull * changes.d[k][r];
            if constexpr (r <= BY_GAIN) grown = grown + s.force[r][k];
            else if constexpr (r <= BY_SQUARE) grown = k < 3 ? grown + s.moments[r - BY_CONSTANT][k] : grown;
            changes.y[r] = grown * part;
            changes.momentum[r] = changes.momentum[r] + changes.y[r];
        }
        changes.d[k + 1][r] = next;
        changes.total[r] = changes.total[r] + next;
    });
}

// What one step adds to the responses: what they become, and the last term of each.
__attribute__((noinline)) void carry_all(const Around &s, const Responses &r, Response *to, Lanes *tails) {
    Changes changes;
    for (int i = 0; i < RESPONSES; i++) {
        changes.d[0][i] = changes.total[i] = r.of[i].d;
        changes.y[i] = changes.momentum[i] = r.of[i].y * s.length;
    }
    for (int k = 0; k < ORDER; k++) grow(s, changes, k);
    for (int i = 0; i < RESPONSES; i++) {
        to[i] = {changes.total[i], changes.momentum[i] / s.length};
        tails[i] = absolute(changes.d[ORDER][i]);
    }
}

// Carry the responses over the step that was taken, in the lanes that moved; return in which it suits them.
template <int DEGREE>
__attribute__((noinline)) uint64_t carry_responses(const Motion &m, Responses &r, Lanes start, Masks moved) {
    Around s;
    look_around(m, start, s);
    look_along<DEGREE>(m, s);
    Response to[RESPONSES];
    Lanes tails[RESPONSES];
    carry_all(s, r, to, tails);
    const Lanes widest = most(absolute(to[BY_GAIN].d), r.widest);
    r.excess = most(tails[BY_DISTANCE], tails[BY_GAIN] / most(all(SMALLEST), widest));
    const Masks smooth = r.excess < RESPONSE_TOLERANCE, kept = moved & smooth;
    r.widest = where(kept, widest, r.widest);
    for (int i = 0; i < RESPONSES; i++) {
        r.of[i].d = where(kept, to[i].d, r.of[i].d);
        r.of[i].y = where(kept, to[i].y, r.of[i].y);
    }
    return bits(smooth);
}

// Write the derivatives of time, x~ and l' at contact by the nine inputs, rows of n numbers; slope: g at contact.
inline void write_gradient(const Motion &m, const Responses &all_of, const Contacts &contact, int lane, double slope,
                           double *to, int64_t n) {
    const double dm = m.damping[lane], km = m.stiffness[lane], gm = m.gain[lane], mass = all_of.mass[lane];
    const double v = m.velocity[lane], a = m.acceleration[lane], time = contact.time[lane];
    const double held = dm + gm * slope;
    double found[3][9];
    for (int part = 0; part < 2; part++) {  // the change of l, then that of l', at the time of contact
        double r[RESPONSES], *row = found[2 * part];
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
        found[0][j] = -found[0][j] / contact.speed[lane];
        found[2][j] += contact.bend[lane] * found[0][j];
        found[1][j] = (v + a * time) * found[0][j];
    }
    found[1][5] += 1.0;
    found[1][6] += time;
    found[1][7] += time * time / 2;
    for (int row = 0; row < 3; row++) {
        for (int j = 0; j < 9; j++) to[(row * 9 + j) * n] = found[row][j];
    }
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
