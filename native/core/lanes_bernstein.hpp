// Bounds and peaks of vectors of polynomials on [0, 1].
//
// In Bernstein form, for s in [0, 1],
//
//     sum_{k <= 6} a_k s^k = sum_j beta_j B_j(s),  beta_j = sum_{k <= j} a_k C(j, k) / C(6, k),  B_j >= 0, sum B_j = 1,
//
// lies between the smallest and the largest beta. Terms after a_6 s^6 change beta_6 by at most the sum of their
// magnitudes, since s^7 <= s^6 = B_6(s). In the form of full degree a polynomial has at most as many zeros as its
// coefficients have changes of sign (Descartes). If nine values bracket as many zeros of q', these are all.

#pragma once

#include "lanes_taylor.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int PARTS = 8;
constexpr int LOW_DEGREE = 6;
constexpr double SMALL = 1e-11;  // relative to the largest value: accepted underestimate of a peak

template <int N> struct Polynomial {
    Lanes at[N];  // coefficients
};

struct Range {
    Lanes least, most;
};

constexpr double binomial(int n, int k) { return k == 0 ? 1.0 : binomial(n, k - 1) * (n - k + 1) / k; }

// the first N coefficients in Bernstein form
template <int N, int M> __attribute__((always_inline)) inline Polynomial<N> bernstein(const Polynomial<M> &a) {
    Polynomial<N> found;
    unrolled<0, N>([&](auto k) __attribute__((always_inline)) {
        constexpr double factor = 1.0 / binomial(N - 1, decltype(k)::value);
        found.at[decltype(k)::value] = a.at[decltype(k)::value] * factor;
    });
    unrolled<1, N>([&](auto start) __attribute__((always_inline)) {
        unrolled<0, N - decltype(start)::value>([&](auto down) __attribute__((always_inline)) {
            constexpr int j = N - 1 - decltype(down)::value;
            found.at[j] = found.at[j] + found.at[j - 1];
        });
    });
    return found;
}

template <int N> __attribute__((always_inline)) inline Range ends(const Polynomial<N> &beta, Range range, int count) {
    for (int j = 0; j < count; j++) range = {least(range.least, beta.at[j]), most(beta.at[j], range.most)};
    return range;
}

// the value at 1
template <int N> __attribute__((always_inline)) inline Lanes total(const Polynomial<N> &a) {
    Lanes sum = a.at[N - 1];
    unrolled<1, N>([&](auto k) __attribute__((always_inline)) { sum = sum + a.at[N - 1 - decltype(k)::value]; });
    return sum;
}

template <int N> __attribute__((always_inline)) inline Polynomial<N - 1> slope_of(const Polynomial<N> &a) {
    Polynomial<N - 1> slope;
    unrolled<1, N>([&](auto k) __attribute__((always_inline)) {
        slope.at[decltype(k)::value - 1] = a.at[decltype(k)::value] * double(decltype(k)::value);
    });
    return slope;
}

// bounds on [0, 1]
template <int N> __attribute__((always_inline)) inline Range range_of(const Polynomial<N> &a) {
    const Polynomial<LOW_DEGREE + 1> beta = bernstein<LOW_DEGREE + 1>(a);
    Lanes rest = absolute(a.at[N - 1]);
    unrolled<LOW_DEGREE + 2, N>([&](auto k) __attribute__((always_inline)) {
        rest = rest + absolute(a.at[N + LOW_DEGREE - decltype(k)::value]);
    });
    return ends(beta, {beta.at[LOW_DEGREE] - rest, beta.at[LOW_DEGREE] + rest}, LOW_DEGREE);
}

// A change of sign of a slope: its part of [0, 1], and the zero of the secant.
struct Turn {
    Lanes left, start;
};

// Newton's method for a zero of a slope in a part; returns the length of the last step.
template <int N> inline Lanes find_turn(const Polynomial<N> &slope, const Turn &turn, Lanes &s) {
    Lanes change = all(0.0);
    s = turn.start;
    for (int i = 0; i < 5; i++) {
        const Point<Lanes> q = look_at<N - 1>(slope.at, s);
        const Lanes following = least(most(turn.left, s - q.value / q.slope), turn.left + 1.0 / PARTS);
        change = absolute(following - s);
        s = following;
    }
    return change;
}

// The largest magnitudes of polynomials at the zeros of their slopes inside [0, 1]; NaN if uncertain.
template <int N> __attribute__((noinline)) Lanes find_peaks(const Polynomial<N> &q) {
    const Polynomial<N - 1> slope = slope_of(q);
    const Lanes zero = all(0.0);
    Turn first = {zero, zero}, last = {zero, zero};
    Lanes found = zero;
    Lanes here = where(zero < absolute(slope.at[0]), slope.at[0], q.at[2]);  // from rest: by its curvature
    for (int j = 0; j < PARTS; j++) {
        const Lanes next = j + 1 < PARTS ? look_at<N - 2>(slope.at, all((j + 1.0) / PARTS)).value : total(slope);
        const Masks changed = here * next < 0.0, is_first = changed & (found < 0.5);
        const Turn now = {all(double(j) / PARTS), (here / (here - next) + double(j)) * (1.0 / PARTS)};
        first = {where(is_first, now.left, first.left), where(is_first, now.start, first.start)};
        last = {where(changed, now.left, last.left), where(changed, now.start, last.start)};
        found = found + where(changed, all(1.0), zero);
        here = next;
    }
    const Polynomial<N - 1> beta = bernstein<N - 1>(slope);
    const Range range = ends(beta, {beta.at[0], beta.at[0]}, N - 1);
    const Masks flat = least(range.most, -range.least) < most(absolute(total(q)), absolute(q.at[0])) * SMALL;
    Lanes changes = zero, largest = zero, doubt = zero;
    for (int j = 0; j + 1 < N - 1; j++) changes = changes + where(beta.at[j] * beta.at[j + 1] < 0.0, all(1.0), zero);
    const Turn turns[] = {first, last};
    for (const Turn &turn : turns) {
        Lanes s;
        doubt = most(find_turn(slope, turn, s), doubt);
        largest = most(absolute(look_at<N - 1>(q.at, s).value), largest);
    }
    largest = where(zero < found, largest, zero);
    doubt = where(zero < found, doubt, zero);
    const Lanes extra = where(flat, zero, changes - found);
    return where((doubt < 1e-6) & (found < 2.5) & (extra < 0.5), largest, all(NOT_A_NUMBER));
}

// The largest magnitudes on [0, 1]; halves are searched if the whole interval is uncertain.
template <int N> Lanes largest(const Polynomial<N> &q, Lanes so_far, int halvings) {
    const Lanes found = most(most(absolute(q.at[0]), absolute(total(q))), so_far);
    const Range range = range_of(slope_of(q));
    const Masks inside = (range.least < 0.0) & (0.0 < range.most) & (found < found + least(range.most, -range.least));
    if (!bits(inside)) return found;
    const Lanes turning = find_peaks(q);
    if (!bits(inside & (turning != turning)) || halvings == 0) return where(inside, most(turning, found), found);
    Polynomial<N> half = q;
    for (int k = 0; k < N; k++) half.at[k] = q.at[k] * (1.0 / double(1 << k));
    const Lanes first = largest(half, found, halvings - 1);
    for (int i = 0; i < N - 1; i++) {
        for (int j = N - 2; j >= i; j--) half.at[j] = half.at[j] + half.at[j + 1];
    }
    return largest(half, first, halvings - 1);
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
