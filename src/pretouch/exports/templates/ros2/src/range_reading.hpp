// What a message of type sensor_msgs/Range says. `pretouch replay` reads recorded messages by the same rules.
#pragma once

#include <cmath>
#include <limits>

namespace pretouch_controller {

enum class Seen {
    reading,    // a distance, or an output of the sensor
    no_object,  // there is no object within the range
    too_near,   // the object is nearer than the sensor can measure
};

// Return what a range means. REP 117 defines infinity as no object, minus infinity as too near, and NaN as no valid
// reading, which the law refuses. By the definition of the message, distances outside of [least, most] do not count: those
// from `most` on are no object, as many drivers report it, and so are negative ones, such as -1; those below `least` are too
// near. The limits count if there is a range between them.
inline Seen seen_at(double range, double least, double most) {
    const double rounding = 1e-6;  // relative, of numbers in single precision
    const double infinite = std::numeric_limits<double>::infinity();
    const bool has_limits = least < most;
    if (range == -infinite) return Seen::too_near;
    if (range == infinite || range < 0) return Seen::no_object;
    if (has_limits && range >= most * (1 - rounding)) return Seen::no_object;
    if (has_limits && range < least * (1 - rounding)) return Seen::too_near;
    return Seen::reading;
}

}  // namespace pretouch_controller
