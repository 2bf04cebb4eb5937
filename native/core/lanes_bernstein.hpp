// Bounds and peaks of vectors of polynomials on [0, 1].
//
// In Bernstein form, for s in [0, 1],
//
//     sum_{k <= 6} a_k s^k = sum_j beta_j B_j(s),  beta_j = sum_{k <= j} a_k C(j, k) / C(6, k),  B_j >= 0, sum B_j = 1,
//
// lies between the smallest and the largest beta. Terms of higher order than a_6 s^6 change beta_6 by at most the sum
// of their magnitudes, since s^7 <= s^6 = B_6(s). In the Bernstein form of its full degree, a polynomial has at most as
// many zeros in [0, 1] as its coefficients have sign changes (Descartes). The peaks of q are at the zeros of q'. The
// signs of q' at nine places bracket some of these zeros. If these are as many as the Bernstein coefficients of q' have
// sign changes, no zero is missed.

#pragma once

#include "lanes_taylor.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int PARTS = 8;  // equal parts of [0, 1] in which sign changes of q' are searched
constexpr int LOW_DEGREE = 6;
constexpr double SMALL = 1e-11;  // accepted underestimate of a peak, relative to the largest value

template <int N> struct Polynomial {
    Lanes at[N];  // coefficients
};

struct Range {
    Lanes least, most;
};

constexpr double binomial(int n, int k) { return k == 0 ? 1.0 : binomial(n, k - 1) * (n - k + 1) / k; }

// the first N terms of a polynomial in Bernstein form
template <int N, int M> __attribute__((always_inline)) inline Polynomial<N> bernstein(const Polynomial<M> &a) {
    Polynomial<N> result;
    unrolled<0, N>([&](auto k) __attribute__((always_inline)) {
        constexpr double factor = 1.0 / binomial(N - 1, decltype(k)::value);
        result.at[decltype(k)::value] = a.at[decltype(k)::value] * factor;
    });
    unrolled<1, N>([&](auto start) __attribute__((always_inline)) {
        unrolled<0, N - decltype(start)::value>([&](auto down) __attribute__((always_inline)) {
            constexpr int j = N - 1 - decltype(down)::value;
            result.at[j] = result.at[j] + result.at[j - 1];
        });
    });
    return result;
}

// Extend a range so that it contains the first `count` coefficients.
template <int N> __attribute__((always_inline)) inline Range ends(const Polynomial<N> &beta, Range range, int count) {
    for (int j = 0; j < count; j++) range = {least(range.least, beta.at[j]), most(beta.at[j], range.most)};
    return range;
}

// the value at s = 1
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

// Bounds of a polynomial on [0, 1], from its Bernstein form of low degree.
template <int N> __attribute__((always_inline)) inline Range range_of(const Polynomial<N> &a) {
    const Polynomial<LOW_DEGREE + 1> beta = bernstein<LOW_DEGREE + 1>(a);
    Lanes rest = absolute(a.at[N - 1]);
    unrolled<LOW_DEGREE + 2, N>([&](auto k) __attribute__((always_inline)) {
        rest = rest + absolute(a.at[N + LOW_DEGREE - decltype(k)::value]);
    });
    return ends(beta, {beta.at[LOW_DEGREE] - rest, beta.at[LOW_DEGREE] + rest}, LOW_DEGREE);
}

// A sign change of a slope: the left end of the part of [0, 1] that contains it, and the zero of the secant there.
struct Turn {
    Lanes left, start;
};

// Find the zero of a slope in one part of [0, 1] by Newton's method; return the length of the last Newton step.
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

// Return the largest magnitude of each polynomial at the zeros of its slope inside [0, 1]; 0 if there are no zeros. The
// result is NaN if more than two zeros are bracketed, if others may be missed, or if Newton's method did not converge.
template <int N> __attribute__((noinline)) Lanes find_peaks(const Polynomial<N> &q) {
    const Polynomial<N - 1> slope = slope_of(q);
    const Lanes zero = all(0.0);
    Turn first = {zero, zero}, last = {zero, zero};
    Lanes brackets = zero;
    Lanes here = where(zero < absolute(slope.at[0]), slope.at[0], q.at[2]);  // q'(0) = 0: the sign of q''(0)
    for (int j = 0; j < PARTS; j++) {
        const Lanes next = j + 1 < PARTS ? look_at<N - 2>(slope.at, all((j + 1.0) / PARTS)).value : total(slope);
        const Masks changed = here * next < 0.0, is_first = changed & (brackets < 0.5);
        const Turn now = {all(double(j) / PARTS), (here / (here - next) + double(j)) * (1.0 / PARTS)};
        first = {where(is_first, now.left, first.left), where(is_first, now.start, first.start)};
        last = {where(changed, now.left, last.left), where(changed, now.start, last.start)};
        brackets = brackets + where(changed, all(1.0), zero);
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
    largest = where(zero < brackets, largest, zero);
    doubt = where(zero < brackets, doubt, zero);
    const Lanes extra = where(flat, zero, changes - brackets);
    return where((doubt < 1e-6) & (brackets < 2.5) & (extra < 0.5), largest, all(NOT_A_NUMBER));
}

// Return the largest magnitude of each polynomial on [0, 1], and at least `so_far`. If find_peaks is uncertain on the
// whole interval, its halves are searched instead. Once no halvings remain, an uncertain peak inside is ignored.
template <int N> Lanes largest(const Polynomial<N> &q, Lanes so_far, int halvings) {
    const Lanes best = most(most(absolute(q.at[0]), absolute(total(q))), so_far);
    const Range range = range_of(slope_of(q));
    const Masks inside = (range.least < 0.0) & (0.0 < range.most) & (best < best + least(range.most, -range.least));
    if (!bits(inside)) return best;
    const Lanes turning = find_peaks(q);
    if (!bits(inside & (turning != turning)) || halvings == 0) return where(inside, most(turning, best), best);
    Polynomial<N> half = q;
    for (int k = 0; k < N; k++) half.at[k] = q.at[k] * (1.0 / double(1 << k));
    const Lanes first = largest(half, best, halvings - 1);
    for (int i = 0; i < N - 1; i++) {
        for (int j = N - 2; j >= i; j--) half.at[j] = half.at[j] + half.at[j + 1];
    }
    return largest(half, first, halvings - 1);
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
