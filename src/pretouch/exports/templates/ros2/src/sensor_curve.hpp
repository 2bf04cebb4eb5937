// The sensor curve of this design, for sensors that report a distance instead of their output xi.
#pragma once

#include <cmath>
#include <limits>

namespace pretouch_controller {

// $curve: ln xi at equal steps of the distance. Between the steps, ln xi is interpolated with an error
// of at most $curve_error.
constexpr double curve_start = $curve_start;  // smallest distance of the curve [m]
constexpr double curve_step = $curve_step;    // [m]
constexpr int curve_steps = $curve_steps;
constexpr double curve_reach = $curve_reach;  // [m]; there is no curve beyond, thus no object
constexpr double curve[curve_steps + 1] = {
$curve_values
};

// Return xi at a distance [m]. It is 0 beyond the curve, where nothing is detected, and constant before its start.
inline double output_at(double distance) {
    if (std::isnan(distance)) return distance;
    const double place = (distance - curve_start) / curve_step;
    if (place > curve_steps) return 0;
    if (!(place > 0)) return std::exp(curve[0]);
    const int before = place < curve_steps ? static_cast<int>(place) : curve_steps - 1;
    return std::exp(curve[before] + (place - before) * (curve[before + 1] - curve[before]));
}

}  // namespace pretouch_controller
