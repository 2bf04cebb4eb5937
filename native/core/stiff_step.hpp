// Long steps of a stiff motion: see stiff_step.cpp.

#pragma once

#include "pieces.hpp"

namespace pretouch {

constexpr double PATIENCE = 64;  // Taylor steps before the first long step is tried; fewer if the next border is far
constexpr int LONG_TERMS = 12;
constexpr double AHEAD = 1.5;    // longest useful step, relative to the time to the next border at the present speed

// State at the start of a step.
struct Start {
    double time, l, speed;
};

// When and how the next long step is tried: its length [s], how many Taylor steps to wait until then, how many to wait
// after a failure, and the error of l' [m/s].
struct Pace {
    double next, wait, patience, doubt;
};

// Tries a step that is longer than the Taylor step of length `taylor`, and at most `longest`, the longest useful step
// [s]. Returns its length [s], or 0 if no long step was tried or none was accepted. For an accepted step, it fills `l`
// with LONG_TERMS power coefficients of l, and `force` with the first POINTS ones of F / gain, in time / length of the
// step. The virtual force is F = gain (d ln xi / dt)^exponent; the exponent is 1 or 2.
double long_step(const Values &m, double gain, const Piece &piece, const Start &state, double taylor, double longest,
                 Pace &pace, double *l, double *force, int exponent = 1);

}  // namespace pretouch
