// Fits of sensor curves to readings: many small nonlinear least-squares problems by the Levenberg-Marquardt method.
//
// A calibration needs thousands of fits of two to four parameters: for each possible offset and ceiling, each excluded
// distance, and each end of an interval. The curves have the parameters of the families in pretouch/sensors, which suit
// a fit: ln xi in the middle of the window, and two more. Their derivatives are exact, except that of ln -g of a
// Mittag-Leffler curve. Residuals that are computed elsewhere are differentiated by finite differences.

#include <math.h>
#include <string.h>

#include "mittag_leffler.hpp"
#include "pretouch.h"

namespace {

using Fit = pretouch_fit;

enum Family : int64_t { FIRST_ORDER, SECOND_ORDER, INVERSE_POWER, MITTAG_LEFFLER };

constexpr double SMALLEST_DAMPING = 1e-9;
constexpr double LARGEST_DAMPING = 1e12;  // damping of the normal equations; with more, no step improves the cost
constexpr double SMALLEST_SQUARE = 1e-30;
constexpr double HUGE_RESIDUAL = 1e150;   // replaces residuals that are not finite
constexpr double STEP = 1e-6;             // step of a parameter for finite differences
constexpr double LARGEST_LOG = 300;       // largest ln(xi / width) of a tried curve
constexpr double ACCURACY = 1e-9;         // of the Mittag-Leffler function, relative; sufficient for a fit
constexpr double SMALLEST_VALUE = 1e-300; // of the Mittag-Leffler function, which may underflow at tried parameters
constexpr double SMALLEST_SLOPE = 1e-9;   // of -g [1/m], in ln -g
constexpr int SHAPE = 3;                  // most parameters of a curve
constexpr int COORDINATES = 4;

int curve_size(int64_t family) { return family == FIRST_ORDER ? 2 : 3; }

// Rows of the workspace. All derivatives of a row have the shape (n, parameters).
struct Room {
    double *row, *slope, *next, *next_slope;  // residuals and derivatives, here and at the next parameters
    double *level, *change;                   // ln xi, and its derivatives by the parameters of the curve, shape (n, 3)
    double *scratch;                          // 4 (n + 1) numbers
    double *log_width, *measured;             // of one problem: ln of the widths, asinh((y - o) / width) for a given o
    double *rows, *moved;                     // residuals at moved parameters, and these parameters
    double *x, *gradient, *step, *scale, *square;
    int64_t *problem;
};

int64_t width_of(const Fit &fit) { return fit.points + (fit.pulls != nullptr); }

// Divides the workspace of a fit, and returns its size. Without memory, only the size is computed.
int64_t lay_out(const Fit &fit, double *memory, Room &room) {
    const int64_t n = width_of(fit), p = fit.parameters;
    int64_t used = 0;
    const auto take = [&used, memory](int64_t size) {
        double *start = memory == nullptr ? nullptr : memory + used;
        used += size;
        return start;
    };
    room.row = take(n), room.next = take(n);
    room.slope = take(n * p), room.next_slope = take(n * p);
    room.log_width = take(n), room.measured = take(n);
    room.level = take(n), room.change = take(n * SHAPE), room.scratch = take(4 * (n + 1));
    room.rows = take((p + 1) * n), room.moved = take((p + 1) * p);
    room.x = take(p), room.gradient = take(p), room.step = take(p), room.scale = take(p), room.square = take(p * p);
    room.problem = reinterpret_cast<int64_t *>(take(p + 1));
    return used;
}

// Computes ln xi, and its derivatives by the parameters u of the curve, at all distances.
void curve(const Fit &fit, const double *u, Room &room) {
    const int64_t n = fit.points;
    const double middle = (fit.first + fit.last) / 2, span = fit.last - fit.first;
    double *level = room.level, *change = room.change;
    const double *distance = fit.distances;
    if (fit.family == FIRST_ORDER) {
        const double rate = -exp(u[1]);
        for (int64_t i = 0; i < n; i++, change += SHAPE) {
            level[i] = u[0] + rate * (distance[i] - middle);
            change[0] = 1, change[1] = rate * (distance[i] - middle);
        }
    } else if (fit.family == SECOND_ORDER) {
        const double first = -exp(u[1]), b = first * expm1(u[2]) / (2 * span), c = first - 2 * b * fit.first;
        const double bent = first * exp(u[2]) / (2 * span), raised = -2 * bent * fit.first;  // derivatives of b and c
        const double start = (b * middle + c) * middle, shift = (bent * middle + raised) * middle;
        for (int64_t i = 0; i < n; i++, change += SHAPE) {
            const double l = distance[i], fall = (b * l + c) * l;
            level[i] = u[0] - start + fall;
            change[0] = 1, change[1] = fall - start, change[2] = (bent * l + raised) * l - shift;
        }
    } else if (fit.family == INVERSE_POWER) {
        const double first = exp(u[1]), kappa = u[2], radius = first + kappa * (middle - fit.first);
        for (int64_t i = 0; i < n; i++, change += SHAPE) {
            const double away = distance[i] - middle, grown = radius + kappa * away;
            const double log_share = log1p(kappa * away / radius), part = away * first / (radius * grown);
            level[i] = u[0] - log_share / kappa;
            change[0] = 1, change[1] = part, change[2] = (log_share / kappa - part) / kappa;
        }
    } else {
        double *z = room.scratch, *value = z + n + 1, *slope = value + n + 1, *by_order = slope + n + 1;
        const double rate = exp(u[1]);
        for (int64_t i = 0; i < n; i++) z[i] = -rate * distance[i];
        z[n] = -rate * middle;
        pretouch::mittag_leffler(fmin(u[2], 1.0), z, n + 1, ACCURACY, value, slope, by_order);
        for (int64_t i = n; i >= 0; i--) {  // the middle first
            const bool lost = !(value[i] >= SMALLEST_VALUE);
            const double size = lost ? SMALLEST_VALUE : fmin(value[i], 1.0);
            value[i] = log(size);
            slope[i] = lost ? 0 : z[i] * slope[i] / size;
            by_order[i] = lost ? 0 : by_order[i] / size;
            if (i == n) continue;
            double *here = change + i * SHAPE;
            level[i] = u[0] + value[i] - value[n];
            here[0] = 1, here[1] = slope[i] - slope[n], here[2] = by_order[i] - by_order[n];
        }
    }
}

// ln -g of a Mittag-Leffler curve at a distance.
double log_fall(double log_rate, double order, double distance) {
    double value, slope;
    const double z = -exp(log_rate) * distance;
    pretouch::mittag_leffler(fmin(order, 1.0), &z, 1, ACCURACY, &value, &slope, nullptr);
    return log(fmax(exp(log_rate) * slope / fmin(fmax(value, SMALLEST_VALUE), 1.0), SMALLEST_SLOPE));
}

// Returns a coordinate of a curve, and its derivatives by the parameters u of the curve. The last coordinate of each
// family is ln -g in the middle of the window.
double coordinate(const Fit &fit, const double *u, int64_t number, double *change) {
    const double middle = (fit.first + fit.last) / 2, span = fit.last - fit.first;
    double q[COORDINATES] = {}, d[COORDINATES][SHAPE] = {};
    d[0][0] = 1;
    if (fit.family == FIRST_ORDER) {
        const double rate = exp(u[1]);
        q[0] = u[0] + rate * middle, d[0][1] = rate * middle;
        q[1] = d[1][1] = -rate;
        q[2] = u[1], d[2][1] = 1;
    } else if (fit.family == SECOND_ORDER) {
        const double first = -exp(u[1]), b = first * expm1(u[2]) / (2 * span), c = first - 2 * b * fit.first;
        const double bent = first * exp(u[2]) / (2 * span), raised = -2 * bent * fit.first;
        const double fall = -(2 * b * middle + c);
        q[0] = u[0] - (b * middle + c) * middle;
        d[0][1] = -(b * middle + c) * middle, d[0][2] = -(bent * middle + raised) * middle;
        q[1] = d[1][1] = c, d[1][2] = raised;
        q[2] = d[2][1] = b, d[2][2] = bent;
        q[3] = log(fall), d[3][1] = 1, d[3][2] = -(2 * bent * middle + raised) / fall;
    } else if (fit.family == INVERSE_POWER) {
        const double half = middle - fit.first, radius = exp(u[1]) + u[2] * half, inverse = log(u[2] / radius);
        const double by_first = -exp(u[1]) / radius, by_kappa = 1 / u[2] - half / radius;  // of `inverse`
        q[0] = u[0] - inverse / u[2], d[0][1] = -by_first / u[2], d[0][2] = (inverse / u[2] - by_kappa) / u[2];
        q[1] = inverse, d[1][1] = by_first, d[1][2] = by_kappa;
        q[2] = log(u[2]), d[2][2] = 1 / u[2];
        q[3] = -log(radius), d[3][1] = by_first, d[3][2] = -half / radius;
    } else if (number == 0) {
        double value, slope, by_order;
        const double z = -exp(u[1]) * middle;
        pretouch::mittag_leffler(fmin(u[2], 1.0), &z, 1, ACCURACY, &value, &slope, &by_order);
        const double size = fmin(fmax(value, SMALLEST_VALUE), 1.0);
        q[0] = u[0] - log(size), d[0][1] = -z * slope / size, d[0][2] = -by_order / size;
    } else if (number == 3) {
        const double shift = u[2] + STEP > 1 ? -STEP : STEP;
        q[3] = log_fall(u[1], u[2], middle);
        d[3][1] = (log_fall(u[1] + STEP, u[2], middle) - q[3]) / STEP;
        d[3][2] = (log_fall(u[1], u[2] + shift, middle) - q[3]) / shift;
    } else {
        q[number] = u[number], d[number][number] = 1;
    }
    if (number > 0) d[number][0] = 0;
    if (number == curve_size(fit.family) && q[number] < log(SMALLEST_SLOPE)) {
        q[number] = log(SMALLEST_SLOPE);
        memset(d[number], 0, sizeof d[number]);
    }
    memcpy(change, d[number], sizeof d[number]);
    return q[number];
}

double clipped(double value) {
    return isfinite(value) ? fmin(fmax(value, -HUGE_RESIDUAL), HUGE_RESIDUAL) : HUGE_RESIDUAL;
}

// Computes what does not depend on the parameters of a problem.
void prepare(const Fit &fit, int64_t problem, Room &room) {
    for (int64_t i = 0; i < fit.points; i++) {
        room.log_width[i] = log(fit.widths[i]);
        if (fit.offsets == nullptr) continue;
        room.measured[i] = asinh((fit.outputs[i] - fit.offsets[problem * fit.offset_step]) / fit.widths[i]);
    }
}

// Computes the residuals of a curve, and their derivatives if `slope` is not null.
void curve_residuals(const Fit &fit, const double *x, int64_t problem, Room &room, double *row, double *slope) {
    const int64_t n = fit.points, p = fit.parameters;
    const int size = curve_size(fit.family);
    const bool is_fitted = fit.offsets == nullptr;
    const double offset = is_fitted ? x[p - 1] : fit.offsets[problem * fit.offset_step];
    curve(fit, x, room);
    double ceiling = INFINITY, lowered = 0, power = 1;  // `lowered`: derivative of ln C by the offset
    if (fit.above != nullptr && isfinite(fit.above[problem])) {
        double top = fit.outputs[0];
        for (int64_t i = 1; i < n; i++) top = fmax(top, fit.outputs[i]);
        ceiling = log(fmax(top - offset, SMALLEST_VALUE)) + fit.above[problem];
        lowered = top - offset > SMALLEST_VALUE ? -1 / (top - offset) : 0;
        power = fit.sharpness[problem];
    }
    for (int64_t i = 0; i < n; i++) {
        const double ratio = (fit.outputs[i] - offset) / fit.widths[i];
        double level = room.level[i], share = 1;  // `share`: derivative of ln xi by ln u
        if (isfinite(ceiling)) {
            const double above = power * (level - ceiling), smaller = exp(-fabs(above));
            level -= (fmax(above, 0) + log1p(smaller)) / power;
            share = (above > 0 ? smaller : 1) / (1 + smaller);
        }
        const double measured = is_fitted ? asinh(ratio) : room.measured[i];
        const double log_ratio = level - room.log_width[i], modelled = exp(fmin(log_ratio, LARGEST_LOG));
        double factor = 1 / fit.errors[i];
        if (fit.weights != nullptr) factor *= fit.weights[problem * fit.weight_step + i];
        row[i] = factor == 0 ? 0 : clipped((measured - asinh(modelled)) * factor);
        if (slope == nullptr) continue;
        const bool is_flat = factor == 0 || log_ratio > LARGEST_LOG || fabs(row[i]) >= HUGE_RESIDUAL;
        const double by_level = is_flat ? 0 : -factor * modelled / sqrt(1 + modelled * modelled);
        double *here = slope + i * p;
        for (int k = 0; k < size; k++) {
            const double change = by_level * share * room.change[i * SHAPE + k];
            here[k] = isfinite(change) ? change : 0;
        }
        if (!is_fitted) continue;
        const double by_offset = is_flat ? 0 : -factor / (fit.widths[i] * sqrt(1 + ratio * ratio));
        here[p - 1] = by_offset + by_level * (1 - share) * lowered;
    }
    if (fit.pulls == nullptr) return;
    const double *pull = fit.pulls + 3 * problem;
    double change[SHAPE];
    const double value = coordinate(fit, x, static_cast<int64_t>(pull[0]), change);
    row[n] = clipped(pull[1] * (value - pull[2]));
    if (slope == nullptr) return;
    memset(slope + n * p, 0, static_cast<size_t>(p) * sizeof(double));
    for (int k = 0; k < size; k++) slope[n * p + k] = isfinite(change[k]) ? pull[1] * change[k] : 0;
}

// Computes residuals of another function and their derivatives by finite differences. Steps respect the upper bounds.
void other_residuals(const Fit &fit, const double *x, int64_t problem, const double *high, Room &room, double *row,
                     double *slope) {
    const int64_t n = fit.points, p = fit.parameters;
    for (int64_t k = 0; k <= p; k++) {
        memcpy(room.moved + k * p, x, static_cast<size_t>(p) * sizeof(double));
        room.problem[k] = problem;
    }
    for (int64_t k = 0; k < p; k++) {
        const double size = STEP * fmax(1.0, fabs(x[k]));
        room.moved[(k + 1) * p + k] += x[k] + size > high[k] ? -size : size;
    }
    fit.function(room.moved, room.problem, p + 1, room.rows);
    for (int64_t i = 0; i < n; i++) {
        row[i] = clipped(room.rows[i]);
        for (int64_t k = 0; k < p; k++) {
            const double size = STEP * fmax(1.0, fabs(x[k])), shift = x[k] + size > high[k] ? -size : size;
            slope[i * p + k] = (clipped(room.rows[(k + 1) * n + i]) - row[i]) / shift;
        }
    }
}

double sum_of_squares(const double *row, int64_t n) {
    double sum = 0;
    for (int64_t i = 0; i < n; i++) sum += row[i] * row[i];
    return sum;
}

// Returns whether a parameter stays at a bound, because the cost would decrease only beyond it.
bool stays(double x, double gradient, double low, double high) {
    return (x <= low && gradient > 0) || (x >= high && gradient < 0);
}

void add_gradient(const double *row, const double *slope, int64_t n, int64_t p, double *gradient) {
    memset(gradient, 0, static_cast<size_t>(p) * sizeof(double));
    for (int64_t i = 0; i < n; i++) {
        for (int64_t k = 0; k < p; k++) gradient[k] += slope[i * p + k] * row[i];
    }
}

// Solves a symmetric positive definite system in place, by elimination without pivots.
void solve(double *matrix, double *right, int64_t p) {
    for (int64_t k = 0; k < p; k++) {
        for (int64_t i = k + 1; i < p; i++) {
            const double factor = matrix[i * p + k] / matrix[k * p + k];
            for (int64_t j = k; j < p; j++) matrix[i * p + j] -= factor * matrix[k * p + j];
            right[i] -= factor * right[k];
        }
    }
    for (int64_t k = p - 1; k >= 0; k--) {
        for (int64_t j = k + 1; j < p; j++) right[k] -= matrix[k * p + j] * right[j];
        right[k] /= matrix[k * p + k];
    }
}

// Computes the Levenberg-Marquardt step. Parameters that stay at a bound do not change. A step that is not finite is 0.
void find_step(const double *x, const double *low, const double *high, double damping, int64_t n, int64_t p,
               Room &room) {
    double *square = room.square, *step = room.step;
    add_gradient(room.row, room.slope, n, p, room.gradient);
    memset(square, 0, static_cast<size_t>(p * p) * sizeof(double));
    for (int64_t i = 0; i < n; i++) {
        const double *slope = room.slope + i * p;
        for (int64_t k = 0; k < p; k++) {
            for (int64_t j = 0; j <= k; j++) square[k * p + j] += slope[k] * slope[j];
        }
    }
    for (int64_t k = 0; k < p; k++) {
        const double corner = square[k * p + k];
        if (!stays(x[k], room.gradient[k], low[k], high[k])) {
            square[k * p + k] += damping * fmax(corner, SMALLEST_SQUARE);
            step[k] = -room.gradient[k];
            continue;
        }
        for (int64_t j = 0; j < p; j++) square[k * p + j] = square[j * p + k] = 0;
        square[k * p + k] = 1;
        step[k] = 0;
    }
    for (int64_t k = 0; k < p; k++) room.scale[k] = 1 / sqrt(square[k * p + k]);
    for (int64_t k = 0; k < p; k++) {
        for (int64_t j = 0; j <= k; j++) {
            square[k * p + j] *= room.scale[k] * room.scale[j];
            square[j * p + k] = square[k * p + j];
        }
        step[k] *= room.scale[k];
    }
    solve(square, step, p);
    for (int64_t k = 0; k < p; k++) {
        step[k] *= room.scale[k];
        if (!isfinite(step[k])) step[k] = 0;
    }
}

// Minimizes one sum of squares from its start x, and returns it.
double minimize(const Fit &fit, int64_t problem, const double *low, const double *high, double tolerance, int64_t most,
                double *x, Room &room) {
    const int64_t n = width_of(fit), p = fit.parameters;
    const auto evaluate = [&](const double *at, double *row, double *slope) {
        if (fit.function == nullptr) {
            curve_residuals(fit, at, problem, room, row, slope);
        } else {
            other_residuals(fit, at, problem, high, room, row, slope);
        }
        return sum_of_squares(row, n);
    };
    if (fit.function == nullptr) prepare(fit, problem, room);
    for (int64_t k = 0; k < p; k++) x[k] = fmin(fmax(x[k], low[k]), high[k]);
    double cost = evaluate(x, room.row, room.slope), damping = 1e-3;
    for (int64_t count = 0; count < most; count++) {
        find_step(x, low, high, damping, n, p, room);
        double moved = 0;
        for (int64_t k = 0; k < p; k++) {
            room.x[k] = fmin(fmax(x[k] + room.step[k], low[k]), high[k]);
            moved = fmax(moved, fabs(room.x[k] - x[k]));
        }
        const double next = evaluate(room.x, room.next, room.next_slope);
        const bool is_better = next < cost;
        const bool converged = (fabs(cost - next) <= tolerance * cost && moved < 1e-3) || moved <= tolerance;
        damping = is_better ? fmax(0.2 * damping, SMALLEST_DAMPING) : 8 * damping;
        if (is_better) {
            memcpy(x, room.x, static_cast<size_t>(p) * sizeof(double));
            cost = next;
            double *row = room.row, *slope = room.slope;
            room.row = room.next, room.next = row;
            room.slope = room.next_slope, room.next_slope = slope;
        }
        if (converged || !(damping < LARGEST_DAMPING)) break;
    }
    return cost;
}

}  // namespace

int64_t pretouch_fit_room(const pretouch_fit *fit) {
    Room room;
    return lay_out(*fit, nullptr, room);
}

void pretouch_fit_residuals(const pretouch_fit *fit, const double *x, const int64_t *problem, int64_t rows,
                            double *residuals, double *workspace) {
    Room room;
    lay_out(*fit, workspace, room);
    for (int64_t i = 0; i < rows; i++) {
        double *row = residuals + i * width_of(*fit);
        prepare(*fit, problem[i], room);
        curve_residuals(*fit, x + i * fit->parameters, problem[i], room, row, nullptr);
    }
}

void pretouch_minimize(const pretouch_fit *fit, const int64_t *problem, int64_t rows, const double *low,
                       const double *high, int64_t bound_step, double tolerance, int64_t most, double *x,
                       double *residuals, double *jacobian, double *costs, double *workspace) {
    const int64_t n = width_of(*fit), p = fit->parameters;
    Room room;
    lay_out(*fit, workspace, room);
    for (int64_t i = 0; i < rows; i++) {
        const double *least = low + i * bound_step, *largest = high + i * bound_step;
        double *at = x + i * p, *slope = jacobian + i * n * p;
        costs[i] = minimize(*fit, problem[i], least, largest, tolerance, most, at, room);
        memcpy(residuals + i * n, room.row, static_cast<size_t>(n) * sizeof(double));
        memcpy(slope, room.slope, static_cast<size_t>(n * p) * sizeof(double));
        add_gradient(room.row, room.slope, n, p, room.gradient);
        for (int64_t k = 0; k < p; k++) {
            if (!stays(at[k], room.gradient[k], least[k], largest[k])) continue;
            for (int64_t j = 0; j < n; j++) slope[j * p + k] = 0;
        }
    }
}
