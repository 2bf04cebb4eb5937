// Robots in MuJoCo. robot_sight.cpp computes what a sensor sees, and robot_loop.cpp runs an encounter of a robot.

#pragma once

#include "loop.hpp"

namespace pretouch {

// Looks along the axis of a sensor.
void see_axis(const pretouch_sight &sight, void *data, const double *point, const double *frame,
              pretouch_glance &glance);

// Returns the distance at which a facing plane causes the same output as the scene. axis: what see_axis has seen in the
// same state; null if it has not been called.
double see_beam(const pretouch_sight &sight, void *data, const double *point, const double *frame,
                const pretouch_glance *axis);

}  // namespace pretouch
