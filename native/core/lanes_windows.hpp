// Operations on a single vector lane: find, enter and evaluate the windows of its curve, and take steps on which l may
// rise.

#pragma once

#include <math.h>

#include "lanes_proof.hpp"
#include "lanes_step.hpp"

namespace PRETOUCH_VARIANT {

namespace {

constexpr int EDGE = 0, LOW = 1, TOP = 2, LEAVE = 3, MIDDLE = 4, TERMS = 5;  // columns of a window
constexpr double TURN = 24;  // a step on which l may rise counts as this many; solve_series solves long oscillations

// Windows of all curves, from l = 0 upward.
struct Windows {
    const double *rows;
    int64_t width;

    const double *operator[](int64_t index) const { return rows + index * width; }
};

// g at a distance l inside a window.
inline double window_slope(const double *window, int64_t width, double l) {
    const double z = l - window[MIDDLE];
    const int64_t last = width - 1;
    if (last == TERMS) return window[TERMS] / z;
    double value = 0.0;
    for (int64_t j = last - TERMS; j > 0; j--) value = value * z + double(j) * window[TERMS + j];
    return value;
}

// The lowest window whose top is not below l, among the rows from `first` to last - 1; -1 if there is none. A correct
// hint makes the search faster; a wrong one does not change the result.
inline int64_t find_window(const Windows &windows, int64_t first, int64_t last, double l, int64_t hint) {
    if (!(l <= windows[last - 1][TOP])) return -1;
    const bool hinted = first <= hint && hint < last;
    if (hinted && l <= windows[hint][TOP] && (hint == first || l > windows[hint - 1][TOP])) return hint;
    return lowest_above(first, last, l, [&](int64_t i) { return windows[i][TOP]; });
}

// Load another window of its curve into a lane.
template <int DEGREE> void enter_window(const double *window, bool is_lowest, Motion &m, int lane) {
    m.edge[lane] = window[EDGE];
    m.leave[lane] = is_lowest ? -INFINITE : window[LEAVE];
    m.middle[lane] = window[MIDDLE];
    for (int j = 0; j <= DEGREE; j++) m.terms[j][lane] = window[TERMS + j];
}

// The coefficients of l in one lane.
struct LaneSeries {
    double b[ORDER + 1];

    LaneSeries(const Motion &m, int lane) {
        for (int k = 0; k <= ORDER; k++) b[k] = m.b[k][lane];
    }
};

// Accept a step of a lane on which l may rise, if its coefficients prove that l stays between two levels. Return false,
// without a change, if this is not proved, the step ends after the horizon or is too short, or too many steps were
// taken.
inline bool pass_turn(Motion &m, int lane, double low, double top, double horizon) {
    if (!(m.steps[lane] < MOST_STEPS)) return false;
    const LaneSeries series(m, lane);
    const double time = m.state.time[lane], length = m.length[lane], l = m.b[0][lane], moved = time + length;
    if (!(certify(series.b, {low, top, 0}, 1).inside && moved < horizon && length > 1e-12 * moved)) return false;
    const Point<double> end = look_at(series.b, 1.0);
    double area = 0.0;
    for (int k = 1; k <= ORDER; k++) area += series.b[k] / (k + 1);
    const double p = m.position[lane], v = m.velocity[lane], a = m.acceleration[lane];
    const double path = p + (v + a / 2 * time) * time + ((v + a * time) / 2 + a / 6 * length) * length;
    const double held = m.weakest[lane], tail = absolute(m.b[ORDER][lane]);
    const double lever = 1 / most(most(held, root(most(m.stiffness[lane], 0.0))), 0.3 / moved) / length;
    const double error = m.state.error[lane] * exp(least(most(-held * length, 0.0), 50.0));
    m.state.error[lane] = error + tail + ORDER * tail * lever + ROUNDING * l;
    m.state.integral[lane] += (path - l - area) * length;
    m.state.time[lane] = moved;
    m.state.distance[lane] = end.value;
    m.state.speed[lane] = end.slope / length;
    m.cap[lane] = NEVER;
    m.steps[lane] += TURN;
    return true;
}

// Shorten the last step of each lane so that it ends at a time inside it: rescale its coefficients and its length.
inline void cut_steps(Motion &m, Lanes end) {
    const Lanes s = (end - m.state.time) / m.length;
    Lanes power = all(1.0);
    for (int k = 1; k <= ORDER; k++) {
        power = power * s;
        m.b[k] = m.b[k] * power;
    }
    m.length = m.length * s;
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
