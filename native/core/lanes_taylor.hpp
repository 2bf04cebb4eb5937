// Compute Taylor coefficients of products of series, and of ln xi along a motion, order by order.
//
// With l = c_0 + c_1 t + ... and v_k = (k + 1) c_{k+1}, coefficient k of d(ln xi)/dt is g v_k plus a remainder that
// contains only lower coefficients. The remainder is computed from the polynomial sum_j a_j z^j about the present l,
// with z = l(t) - l(0) = c_1 t + c_2 t^2 + ..., by the Paterson-Stockmeyer scheme: the series of z^2, z^3 and z^4 are
// computed once, and
//
//     degree 4:   a_1 z + a_2 z^2 + z^2 (a_3 z + a_4 z^2)
//     degree 12:  a_1 z + ... + a_3 z^3 + z^4 (a_4 + ... + a_7 z^3 + z^4 (a_8 + ... + a_12 z^4))
//
// So 1.5 and 4 convolutions are needed (a square counts as a half). All of them are short, since z starts at order one.
// For g = n / (l + l_0), which is called degree 0, one convolution suffices: with q (l + l_0) = l', d(ln xi)/dt = n q.
// A constant slope, degree 1, needs none, since the motion is linear.

#pragma once

#include "lanes.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int ORDER = 16;
constexpr int LARGEST_DEGREE = 12;

// The counter of a loop that is unrolled at compile time, so that the indexed values can be kept in registers.
template <int I> struct Place {
    static constexpr int value = I;
};

// Call body(Place<FROM>{}), ..., body(Place<TO - 1>{}).
template <int FROM, int TO, class Body> __attribute__((always_inline)) inline void unrolled(Body body) {
    if constexpr (FROM < TO) {
        body(Place<FROM>{});
        unrolled<FROM + 1, TO>(body);
    }
}

// A polynomial and its first two derivatives at a point.
template <class V> struct Point {
    V value, slope, bend;
};

// Evaluate the polynomial with coefficients c at s.
template <int DEGREE = ORDER, class V> __attribute__((always_inline)) inline Point<V> look_at(const V *c, V s) {
    V value = c[DEGREE], slope{}, bend{};
    unrolled<0, DEGREE>([&](auto place) __attribute__((always_inline)) {
        bend = slope + bend * s;
        slope = value + slope * s;
        value = c[DEGREE - 1 - decltype(place)::value] + value * s;
    });
    return {value, slope, bend + bend};
}

// A series whose first nonzero coefficient has the order FIRST; lower ones are not stored.
template <int FIRST> struct Series {
    Lanes at[ORDER + 1];
};

// products: the number of terms in coefficient n of the product of two series with the first orders `left` and `right`.
// left_factor: the order of the left factor in one of these terms. Terms with the newest coefficients come last, since
// these are available last.
constexpr int products(int n, int left, int right) { return n - left - right + 1; }
constexpr int left_factor(int n, int left, int right, int which) {
    for (int newest = (n + 1) / 2; newest <= n; newest++) {
        const int older = n - newest;
        if (newest >= left && older >= right && which-- == 0) return newest;
        if (older >= left && newest >= right && older != newest && which-- == 0) return older;
    }
    return -1;
}

// Coefficient N of the product of two series.
template <int N, int A, int B>
__attribute__((always_inline)) inline Lanes convolve(const Series<A> &left, const Series<B> &right) {
    constexpr int first = left_factor(N, A, B, 0);
    Lanes total = left.at[first] * right.at[N - first];
    unrolled<1, products(N, A, B)>([&](auto which) __attribute__((always_inline)) {
        constexpr int i = left_factor(N, A, B, decltype(which)::value);
        total = total + left.at[i] * right.at[N - i];
    });
    return total;
}

// Coefficient N of the square of a series. twice: the lower half of its coefficients, doubled.
template <int N, int A>
__attribute__((always_inline)) inline Lanes square(const Series<A> &z, const Series<A> &twice) {
    constexpr int last = (N - 1) / 2, odd = N % 2;
    Lanes total;
    if constexpr (odd) total = twice.at[last] * z.at[N - last];
    else total = z.at[N / 2] * z.at[N / 2];
    unrolled<odd, last - A + 1>([&](auto which) __attribute__((always_inline)) {
        constexpr int i = last - decltype(which)::value;
        total = total + twice.at[i] * z.at[N - i];
    });
    return total;
}
// Store coefficient N of a series, and its double if it belongs to the lower half.
template <int N, int A> __attribute__((always_inline)) inline void set(Series<A> &z, Series<A> &twice, Lanes value) {
    z.at[N] = value;
    if constexpr (2 * N < ORDER) twice.at[N] = value + value;
}

// Compute the coefficients a of ln xi about a distance, by repeated Horner schemes (one for each derivative). a[0] is
// not needed and not set.
template <int DEGREE>
__attribute__((always_inline)) inline void shift(const Lanes *terms, Lanes by, Lanes (&a)[DEGREE + 1]) {
    unrolled<1, DEGREE + 1>([&](auto j) __attribute__((always_inline)) {
        a[decltype(j)::value] = terms[decltype(j)::value];
    });
    unrolled<0, DEGREE>([&](auto place) __attribute__((always_inline)) {
        constexpr int i = decltype(place)::value, last = i > 1 ? i : 1;
        unrolled<0, DEGREE - last>([&](auto down) __attribute__((always_inline)) {
            constexpr int j = DEGREE - 1 - decltype(down)::value;
            a[j] = a[j] + by * a[j + 1];
        });
    });
}

// The Taylor series of a polynomial sum_{j >= 2} a_j z^j along the motion, with z = l(t) - l(0). Each coefficient
// depends on the one before, and this chain of operations determines the computing time of a step. Therefore the newest
// terms are added last.
template <int DEGREE> struct Composed {
    Lanes a[DEGREE + 1];
    Series<1> z, twice, inner, outer;
    Series<2> z2, twice2;
    Series<3> z3;
    Series<4> z4;

    // Coefficient N of the series. All lower ones must have been computed before. l: coefficient N of z.
    template <int N> __attribute__((always_inline)) Lanes next(Lanes l) {
        set<N>(z, twice, l);
        if constexpr (N >= 2) set<N>(z2, twice2, square<N>(z, twice));
        if constexpr (DEGREE == 4) {
            inner.at[N] = a[3] * l;
            if constexpr (N >= 2) inner.at[N] = inner.at[N] + a[4] * z2.at[N];
        } else {
            powers<N>(l);
        }
        if constexpr (N < 2) return all(0.0);
        else if constexpr (DEGREE == 4 && N >= 3) return convolve<N>(z2, inner) + a[2] * z2.at[N];
        else if constexpr (DEGREE == 4 || N < 3) return a[2] * z2.at[N];
        else if constexpr (N < 4) return a[3] * z3.at[N] + a[2] * z2.at[N];
        else if constexpr (N < 5) return a[4] * z4.at[N] + a[3] * z3.at[N] + a[2] * z2.at[N];
        else return convolve<N>(z4, outer) + a[4] * z4.at[N] + a[3] * z3.at[N] + a[2] * z2.at[N];
    }

  private:
    // Coefficients N of the powers of z, and of the inner polynomials of the scheme for degree 12.
    template <int N> __attribute__((always_inline)) void powers(Lanes l) {
        if constexpr (N >= 3) z3.at[N] = convolve<N>(z, z2);
        if constexpr (N >= 4) z4.at[N] = square<N>(z2, twice2);
        Lanes low = a[9] * l, high = a[5] * l;
        if constexpr (N >= 5) high = convolve<N>(z4, inner) + high;
        if constexpr (N >= 2) low = low + a[10] * z2.at[N], high = high + a[6] * z2.at[N];
        if constexpr (N >= 3) low = low + a[11] * z3.at[N], high = high + a[7] * z3.at[N];
        if constexpr (N >= 4) low = low + a[12] * z4.at[N], high = high + a[8] * z4.at[N];
        inner.at[N] = low;
        outer.at[N] = high;
    }
};

// ln xi along the motion. slope: g at the start; beyond: the latest coefficient of ln xi - g z.
template <int DEGREE> struct LogCurve {
    Composed<DEGREE> curve;
    Lanes slope, weight, beyond;

    __attribute__((always_inline)) LogCurve(const Lanes *terms, Lanes middle, Lanes distance, Lanes gain) {
        shift<DEGREE>(terms, distance - middle, curve.a);
        slope = curve.a[1];
        weight = -gain;
    }

    // Return rest - gain * r / (K + 1), where r is coefficient K of d(ln xi)/dt without the part g v_K. l: coefficient
    // K + 1 of l.
    template <int K> __attribute__((always_inline)) Lanes pulled(Lanes rest, Lanes l, Lanes) {
        beyond = curve.template next<K + 1>(l);
        if constexpr (K == 0) return rest;
        else return rest + weight * beyond;
    }
};

// The same for g = n / (l + l_0), by the quotient q = l' / (l + l_0).
template <> struct LogCurve<0> {
    Lanes inverse, slope, weight;
    Series<1> c;
    Series<0> q;

    __attribute__((always_inline)) LogCurve(const Lanes *terms, Lanes middle, Lanes distance, Lanes gain) {
        inverse = 1.0 / (distance - middle);
        slope = terms[0] * inverse;
        weight = gain * slope;
    }

    template <int K> __attribute__((always_inline)) Lanes pulled(Lanes rest, Lanes l, Lanes v) {
        c.at[K + 1] = l;
        if constexpr (K == 0) {
            q.at[0] = inverse * v;
            return rest;
        } else {
            const Lanes product = convolve<K>(c, q);
            q.at[K] = inverse * v - inverse * product;
            return rest + (weight * (1.0 / (K + 1))) * product;
        }
    }
};

// The same for a constant slope: d(ln xi)/dt has no other part than g v_K.
template <> struct LogCurve<1> {
    Lanes slope;

    __attribute__((always_inline)) LogCurve(const Lanes *terms, Lanes, Lanes, Lanes) { slope = terms[1]; }

    template <int K> __attribute__((always_inline)) Lanes pulled(Lanes rest, Lanes, Lanes) { return rest; }
};

// Compute the series of the slope g along a computed motion l, from the coefficients of ln xi. from_middle: the initial
// l relative to the middle of the window.
template <int DEGREE>
__attribute__((always_inline)) inline void find_slope(const Lanes *terms, Lanes from_middle, const Lanes *l,
                                                      Series<0> &g) {
    if constexpr (DEGREE == 0) {
        Series<1> z;
        const Lanes first = 1.0 / from_middle, minus = -first;
        g.at[0] = terms[0] * first;
        unrolled<1, ORDER>([&](auto place) __attribute__((always_inline)) {
            constexpr int n = decltype(place)::value;
            z.at[n] = l[n];
            g.at[n] = minus * convolve<n>(z, g);
        });
    } else if constexpr (DEGREE == 1) {
        for (int n = 0; n < ORDER; n++) g.at[n] = n == 0 ? terms[1] : all(0.0);
    } else {
        Lanes a[DEGREE + 1];
        Composed<DEGREE> slope;
        shift<DEGREE>(terms, from_middle, a);
        unrolled<0, DEGREE>([&](auto place) __attribute__((always_inline)) {
            constexpr int j = decltype(place)::value;
            slope.a[j] = a[j + 1] * double(j + 1);
        });
        slope.a[DEGREE] = all(0.0);
        g.at[0] = slope.a[0];
        unrolled<1, ORDER>([&](auto place) __attribute__((always_inline)) {
            constexpr int n = decltype(place)::value;
            g.at[n] = slope.template next<n>(l[n]) + slope.a[1] * l[n];
        });
    }
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
