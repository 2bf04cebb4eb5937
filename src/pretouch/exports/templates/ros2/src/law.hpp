// The control law of this design, with those of its numbers that parameters may change.
#pragma once

#include "pretouch_design.h"

namespace pretouch_controller {

using LawParameters = pretouch_parameters$suffix;
using LawState = pretouch_state$suffix;

inline void start_law(const LawParameters &parameters, LawState &state) {
    pretouch_start$suffix(&parameters, 0, 0, &state);
}

inline void step_law(const LawParameters &parameters, LawState &state, const pretouch_sample &sample,
                     pretouch_output &output) {
    $step(&parameters, &state, &sample, &output);
}

// Return the numbers of the design with the values of the ROS parameters `law.*`.
template <class Chosen>
LawParameters with_chosen_values(const Chosen &chosen) {
    LawParameters numbers = pretouch_design;
    numbers.law.$number = chosen.$number;
    numbers.sensing.offset = chosen.offset;
    numbers.sensing.floor = chosen.floor;
    numbers.sensing.saturation = chosen.saturation;
    numbers.sensing.timeout = chosen.timeout;
    numbers.sensing.largest_rate = chosen.largest_rate;
    numbers.drive.largest_force = chosen.largest_force;
    numbers.drive.contact_gain = chosen.contact_gain;
    numbers.drive.contact_threshold = chosen.contact_threshold;
    numbers.drive.limits.speed = chosen.largest_speed;
    numbers.drive.limits.acceleration = chosen.largest_acceleration;
    numbers.drive.limits.excursion = chosen.largest_excursion;
    return numbers;
}

// Return whether all numbers are those that pretouch exported.
inline bool is_as_exported(const LawParameters &numbers) {
    const auto &design = pretouch_design;
    const auto &sensing = numbers.sensing;
    const auto &drive = numbers.drive;
    return numbers.law.$number == design.law.$number && sensing.offset == design.sensing.offset &&
           sensing.floor == design.sensing.floor && sensing.saturation == design.sensing.saturation &&
           sensing.timeout == design.sensing.timeout && sensing.largest_rate == design.sensing.largest_rate &&
           drive.largest_force == design.drive.largest_force && drive.contact_gain == design.drive.contact_gain &&
           drive.contact_threshold == design.drive.contact_threshold &&
           drive.limits.speed == design.drive.limits.speed &&
           drive.limits.acceleration == design.drive.limits.acceleration &&
           drive.limits.excursion == design.drive.limits.excursion;
}

}  // namespace pretouch_controller
