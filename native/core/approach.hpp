// Interface between the vectorized loop (lanes_loop.cpp) and the sampled loop of a single encounter (loop*.cpp).
//
// It must not define inline functions, other than static ones. lanes_loop.cpp is compiled once for each kind of
// processor, and the linker would keep only one of the compiled copies.

#pragma once

#include "sensing.hpp"

namespace pretouch {

// Part of the obstacle's path without contact forces, from the time `since` to `until`, with the constant acceleration
// ao. xo, vo and way hold at `since`: position, velocity, and an upper bound of the distance that it has travelled [m].
struct Leg {
    double since, until, xo, vo, ao, way;
};

// State of an encounter before its first contact, at the time t + at within a period of the controller.
struct Approach {
    int64_t period;                          // number of the controller's period, from 0
    double t, at, end_time;                  // start of the period, time since then, end of the previous period
    double x, v, servo, xo, vo;              // plant and its servo, obstacle
    double last_x, last_v, last_xo, last_vo; // plant and obstacle at the start of the period
    double xv, vv;                           // virtual object at the start of the period
    double rate, acting;                     // acceleration over the last step, virtual force at the last law call
    double detection_time, closest_distance, largest_excursion, largest_travel, largest_speed;
    double largest_virtual_force, largest_acceleration, largest_advance;
    pretouch_output output;                  // output of the law for this period
    int32_t flags;
    int32_t law_called;                      // whether the law has been called in this period
    Leg leg;                                 // present part of the obstacle's path
    int64_t stretch;                         // how many stretches of the obstacle's course have begun
};

// Continues an encounter to its end by the code for single encounters. state: state of its law.
void continue_encounter(const pretouch_loop &loop, int64_t index, void *state, const Sensor &sensor,
                        const Approach &approach);

// Continues an encounter for one period, including the call of the law at its start. Returns true if there was no
// contact and the encounter goes on; `approach` and `sensor` then have the new state. Otherwise it runs the encounter
// to its end.
bool continue_period(const pretouch_loop &loop, int64_t index, void *state, Sensor &sensor, Approach &approach);

// Returns the part of the obstacle's path that follows `leg`. It has the acceleration of the stretch with this number,
// or, after the last stretch, that of the scene.
Leg leg_after(const pretouch_loop &loop, int64_t index, const Leg &leg, int64_t stretch);

// Runs encounters of the virtual damper in vector lanes, one in each lane. pretouch_run_encounters (loop.cpp) decides
// for which loops this code is used. states and waiting have room for MOST_LANES encounters.
constexpr int64_t MOST_LANES = 8;
void run_side_by_side(const pretouch_loop *loop, const int64_t *which, int64_t n, void *states,
                      pretouch_reading *waiting, int64_t room);

}  // namespace pretouch
