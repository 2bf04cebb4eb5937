// Robots in MuJoCo. robot_dynamics.cpp reduces the dynamics of a posture, robot_sight.cpp computes what a sensor sees, and
// robot_loop.cpp runs an encounter of a robot.

#pragma once

#include "loop.hpp"

namespace pretouch {

constexpr double DEPENDENT = 1e-8;  // of constraint rows of length 1: rounding of loops that are closed up to it
constexpr double NOTHING = 1e-28;   // share of a matrix by squares, below which a column is rounding
constexpr int SWEEPS = 40;

inline int64_t larger_of(int64_t a, int64_t b) { return a > b ? a : b; }

// Replaces a symmetric matrix, of which the lower triangle is used, by its Cholesky factor. Returns false if it is not
// positive definite.
bool factor(double *matrix, int64_t n);

// Solves L x = b or L^T x = b in place with the factor L.
void solve_lower(const double *lower, double *x, int64_t n);
void solve_upper(const double *lower, double *x, int64_t n);

// Turns the columns of a matrix, shape (rows, columns), until they are orthogonal to each other, and applies the same
// rotations to the identity (one-sided Jacobi method; J. Demmel, K. Veselic, 1992). The columns are then the left
// singular vectors times the singular values, and those of `right` the right singular vectors.
void orthogonalize(double *matrix, int64_t rows, int64_t columns, double *right);

// Looks along the axis of a sensor.
void see_axis(const pretouch_sight &sight, void *data, const double *point, const double *frame,
              pretouch_glance &glance);

// Returns the distance at which a facing plane causes the same output as the scene. axis: what see_axis has seen in the
// same state; null if it has not been called.
double see_beam(const pretouch_sight &sight, void *data, const double *point, const double *frame,
                const pretouch_glance *axis);

}  // namespace pretouch
