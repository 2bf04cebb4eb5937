// Long steps of a stiff motion: see stiff_step.cpp.

#pragma once

#include "pieces.hpp"

namespace pretouch {

constexpr double PATIENCE = 64;  // Taylor steps before long ones are tried; fewer if the next border is far
constexpr int LONG_TERMS = 12;
constexpr double AHEAD = 1.5;    // largest length of a long step relative to the way to a border

// State at the start of a step.
struct Start {
    double time, l, speed;
};

// Length of the next attempt [s], Taylor steps until then, Taylor steps after another failure, and the error of l' [m/s].
struct Pace {
    double next, wait, patience, doubt;
};

// Try a step that is longer than those of Taylor's series, of the length `taylor`, but not longer than `longest` [s],
// the longest of use. Returns its length, 0 where there is none; fills the first LONG_TERMS coefficients of l and of
// d ln xi / dt in parts of it.
double long_step(const Values &m, double gain, const Piece &piece, const Start &state, double taylor, double longest,
                 Pace &pace, double *l, double *force);

}  // namespace pretouch
