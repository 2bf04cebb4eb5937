// What the guaranteed path has of an encounter and of its curve: the obstacle's path, and the slope g on pieces.

#pragma once

#include <math.h>
#include <stdint.h>

#include "endings.hpp"
#include "pretouch.h"

namespace pretouch {

constexpr int COEFFICIENTS = 10;  // of g on a piece, at most
constexpr double OVERLAP = 1e-9;  // of a piece's width: how far its polynomial is used beyond its border

// the larger and the smaller; the first one where either is not a number
static inline double larger(double x, double y) { return y > x ? y : x; }
static inline double smaller(double x, double y) { return y < x ? y : x; }

// What is written of an encounter: COLUMNS of motion/layout.py.
struct Course {
    double time, distance, displacement, displacement_velocity, displacement_acceleration, relative_velocity;
    double virtual_force;
    double largest_excursion, largest_travel, largest_speed, largest_acceleration, largest_virtual_force;
    double closest_distance, settling_distance, displacement_integral;
};

// Position of the obstacle relative to the reference, and its velocity [m, m/s].
static inline double obstacle_at(const Values &m, double t) { return m.p + (m.v + m.a * t / 2) * t; }
static inline double obstacle_speed(const Values &m, double t) { return m.v + m.a * t; }

// g = sum_j g_j z^j with z = (l - middle) / half on [middle - half, middle + half].
struct Piece {
    double middle, half, g[COEFFICIENTS];
};

// g and dg/dl at a distance.
struct Slope {
    double value, bend;
};

static inline Slope slope_at(const Piece &piece, double l) {
    const double z = (l - piece.middle) / piece.half;
    double value = 0, bend = 0;
    for (int j = COEFFICIENTS - 1; j >= 0; j--) {
        bend = bend * z + value;
        value = value * z + piece.g[j];
    }
    return {value, bend / piece.half};
}

// The lowest place from first to before last whose top is not below l, the last one where all are.
template <class Top> static inline int64_t lowest_above(int64_t first, int64_t last, double l, Top top) {
    int64_t low = first, high = last - 1;
    while (low < high) {
        const int64_t between = (low + high) / 2;
        if (l <= top(between)) high = between;
        else low = between + 1;
    }
    return low;
}

// Between which distances [m] a step must end, and where l comes into contact, at or below the lower one.
struct Borders {
    double low, high, contact;
};

namespace {  // as functions of it are compiled for each kind of processor

// A curve as an entry point is given it.
struct Curve : pretouch_pieces {
    double bottom(int64_t i) const { return pieces[i * width] - pieces[i * width + 1]; }
    double top(int64_t i) const { return pieces[i * width] + pieces[i * width + 1]; }

    Piece piece(int64_t i) const {
        const double *row = pieces + i * width;
        Piece found = {row[0], row[1], {}};
        for (int j = 0; j < COEFFICIENTS && j < width - 2; j++) found.g[j] = row[2 + j];
        return found;
    }

    // the lowest piece whose upper border is not below l, the last where all are
    int64_t find(double l) const { return lowest_above(0, count, l, [this](int64_t i) { return top(i); }); }

    // between which distances the polynomial of a piece is used: at the top as well, where an object may rest
    Borders borders(int64_t i, double contact) const {
        const double half = pieces[i * width + 1];
        return {bottom(i) - (i > 0 ? OVERLAP * half : 0.0), top(i) + OVERLAP * half, contact};
    }
};

}  // namespace

}  // namespace pretouch
