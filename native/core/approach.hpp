// What the lanes of lanes_loop.cpp and the sampled loop of one encounter (loop*.cpp) tell each other. It has no inline
// functions: those of two variants would be merged by the linker.

#pragma once

#include "pretouch.h"

namespace pretouch {

// The obstacle, as it moves by itself, from a time on until another, with one acceleration; way: no less than it has gone.
struct Leg {
    double since, until, xo, vo, ao, way;
};

// An encounter before its first contact: at a time within a period of the controller, t its start.
struct Approach {
    int64_t period;                          // its number
    double t, at, end_time;                  // end_time: of the period before
    double x, v, servo, xo, vo;              // of plant and obstacle
    double last_x, last_v, last_xo, last_vo; // the same at the start of the period
    double xv, vv;                           // of the virtual object at the start of the period
    double rate, acting;                     // acceleration over the last step, force of the law in the last period
    double detection_time, closest_distance, largest_excursion, largest_travel, largest_speed;
    double largest_virtual_force, largest_acceleration;
    pretouch_output output;                  // of the law, for this period
    int32_t flags;
    int32_t asked;                           // whether the law has been asked in this period
    Leg leg;                                 // of the obstacle
    int64_t stretch;                         // the number of stretches of the obstacle's course that have begun
};

constexpr int64_t SENSOR_SIZE = 512;  // octets with room for a sensor

// Makes the sensor of an encounter; returns when it first samples the distance [s].
double start_sensor(void *sensor, const pretouch_loop &loop, int64_t index, pretouch_reading *waiting, int64_t room);

// Returns when a sensor samples the next distance [s].
double next_sample(const void *sensor);

// Lets a sensor sample a distance; returns when it samples the next one [s].
double sample_distance(void *sensor, double distance);

// Delivers the reading that is available at a time; returns whether there is one.
int32_t deliver_reading(void *sensor, double t, double *reading, double *measured);

// Continues an encounter, alone, until its end. state: of its law.
void continue_encounter(const pretouch_loop &loop, int64_t index, void *state, const void *sensor,
                        const Approach &approach);

// Continues an encounter for one period at whose start the law has not been asked. Returns whether it goes on without a
// contact; else it is continued until its end.
bool continue_period(const pretouch_loop &loop, int64_t index, void *state, void *sensor, Approach &approach);

// The leg of an obstacle that starts with a stretch of its course, or with the acceleration after the last one.
Leg leg_after(const pretouch_loop &loop, int64_t index, const Leg &leg, int64_t stretch);

// Runs encounters of a damper side by side; loop.cpp says which. states and waiting:
// with room for MOST_LANES of what one encounter needs.
constexpr int64_t MOST_LANES = 8;
void run_side_by_side(const pretouch_loop *loop, const int64_t *which, int64_t n, void *states,
                      pretouch_reading *waiting, int64_t room);

}  // namespace pretouch
