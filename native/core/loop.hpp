// Simulation of one encounter of the sampled loop. loop_mechanics.cpp computes contact forces and integration steps of
// plant and obstacle. sensing.hpp simulates the sensor chain, from the distance to the controller's reading. loop.cpp
// runs the encounter.
//
// A random number depends only on the seed, the run and its index in the run, not on the thread or on earlier draws.
// Two runs with the same seed therefore have the same noise, reading by reading, even if one ends earlier (common
// random numbers). The mixing function is that of SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014).

#pragma once

#include <math.h>
#include <stddef.h>

#include "approach.hpp"

namespace pretouch {

// Position and velocity of the plant, force of its servo, position and velocity of the obstacle, and the impulse of the
// contact force so far [N s].
struct Body {
    double x, v, servo, xo, vo, impulse;
};

// The cubic Hermite polynomial over a step, as a function of the part s of the step, 0 to 1. The slopes at both ends
// are derivatives by s.
struct Cubic {
    double start, start_slope, end, end_slope;

    double second() const { return 3.0 * (end - start) - 2.0 * start_slope - end_slope; }
    double third() const { return start_slope + end_slope - 2.0 * (end - start); }
    double at(double s) const { return start + s * (start_slope + s * (second() + s * third())); }
    double slope(double s) const { return start_slope + s * (2.0 * second() + s * 3.0 * third()); }
};

// Motion of the virtual object over a period of the controller: a cubic between both ends, and the mean acceleration.
struct Target {
    double period, acceleration;
    Cubic course;

    double position(double at) const { return course.at(at / period); }
    double velocity(double at) const { return course.slope(at / period) / period; }
};

// The contact force between the bodies [N]. It is never negative, because they do not stick. Damping acts from the
// depth 0 on.
inline double contact_force(const pretouch_contact &c, double depth, double rate) {
    if (depth < 0.0) return 0.0;
    const double grown = c.exponent == 1.0   ? depth
                         : c.exponent == 1.5 ? depth * sqrt(depth)
                                             : pow(depth, c.exponent);
    return larger(c.stiffness * grown + c.damping * rate * (c.grows != 0.0 ? grown : 1.0), 0.0);
}

inline double position(const Leg &leg, double t) {
    return leg.xo + (t - leg.since) * (leg.vo + 0.5 * leg.ao * (t - leg.since));
}
inline double velocity(const Leg &leg, double t) { return leg.vo + leg.ao * (t - leg.since); }
inline double way_until(const Leg &leg, double t) {
    return leg.way + (fabs(leg.vo) + 0.5 * fabs(leg.ao) * (t - leg.since)) * (t - leg.since);
}

// Distances [m] up to this one count as zero. It is a rounding error relative to the terms whose difference is l, as in
// pieces.hpp. x: position of the plant; way: distance that the obstacle has travelled.
inline double resolution(const pretouch_scene &scene, double x, double way) {
    constexpr double rounding = 1e-12;
    return rounding * (fabs(scene.x) + fabs(x) + fabs(scene.xo) + way);
}

// The part of a step at which the distance first reaches zero, 2 if it does not, and the smallest distance in the step
// [m].
struct Touch {
    double part, least;
};

// Returns the first touch of a cubic distance. Between its turning points the cubic is monotone, so no zero is missed,
// even in a very short dip. A minimum that differs from zero by at most `doubt` [m], to either side, is a touch at the
// minimum. A distance that only rises from the start of the step, as after a contact, is no touch.
Touch find_touch(const Cubic &gap, double doubt);

inline Touch first_touch(const Cubic &gap, double doubt) {
    const double lowest = smaller(gap.start, gap.end);  // the Bernstein coefficients show that the ends are lowest
    if (gap.end > doubt && smaller(gap.start + gap.start_slope / 3.0, gap.end - gap.end_slope / 3.0) >= lowest)
        return {2.0, lowest};
    return find_touch(gap, doubt);
}

// Step size [s] that resolves a contact that starts with a relative speed [m/s]: 1/50 of the contact's time constant.
double contact_step(const pretouch_contact &contact, double inverse_mass, double speed);

// Duration of a contact [s] that starts with a relative speed [m/s], without damping and external forces: m d'' = -k
// d^n.
double elastic_duration(const pretouch_contact &contact, double inverse_mass, double speed);

// Returns plant and obstacle after a step of h [s] by the classical Runge-Kutta method of order 4. The step starts at
// the time `at` within a period of the controller. contact: null if the bodies are apart; push: acceleration of the
// obstacle without contact [m/s^2].
Body advance(const Body &body, double at, double h, const Target &target, const pretouch_plant &plant,
             const pretouch_contact *contact, double push);

// The same for a linear plant. hidden: its states other than x and x'; after: output, the hidden states after the step.
Body advance_linear(const Body &body, const double *hidden, double at, double h, const Target &target,
                    const pretouch_state_space &plant, const pretouch_contact *contact, double push, double *after);

// ln xi by cubic interpolation between values and slopes at equally spaced distances, constant beyond both ends; and its
// slope d ln xi / dl, at an end the one there.
double log_output(const pretouch_curve &curve, double distance);
double log_slope(const pretouch_curve &curve, double distance);

// The law in one run: its step function, parameters and state.
struct Law {
    pretouch_law_step *step;
    const void *parameters;
    void *state;
};

// Simulation of one encounter. Within a period of the controller, the robot is integrated in steps. A step ends where
// the distance reaches zero. During a contact, the steps are short enough to resolve it.
class Encounter {
public:
    Encounter(const pretouch_loop &loop, int64_t index, const Law &law, const Sensor &sensor);

    // Runs the encounter from the period with this number to its end, and writes how it ended.
    void run(int64_t period);

    // Continues an encounter that the vectorized loop started, and runs it to its end.
    void resume(const Approach &approach);

    // Continues such an encounter for one period. If there was no contact and it goes on, stores its state in
    // `approach` and its sensor in `sensor_after` and returns true. Otherwise runs it to its end and returns false.
    bool visit(Approach &approach, Sensor &sensor_after);

private:
    // A step of the robot: its length h, the bodies at its end, the distance during the step, the first touch in it,
    // and whether there is one.
    struct Step {
        double h;
        Body moved;
        Cubic gap;
        Touch touch;
        bool hit;
        double hidden[PRETOUCH_MOST_HIDDEN];  // hidden states of a linear plant at the end
    };

    const pretouch_loop &loop;
    const pretouch_scene &scene;
    const Law law;
    Sensor sensor;
    pretouch_end &end;
    pretouch_touch *const touches;

    const bool ideal;                // whether the plant follows the virtual object exactly
    const double inverse_mass;       // 1 / the reduced mass of both bodies
    double t = 0.0, at = 0.0;        // start of the period, and time since then
    Body body;
    double hidden[PRETOUCH_MOST_HIDDEN];  // hidden states of a linear plant
    const int64_t index;
    int64_t stretch = 0;             // how many stretches of the obstacle's course have begun
    Leg leg;
    double xv, vv;                   // virtual object at the start of the period
    Target target{};
    pretouch_output output{};
    double rate = 0.0, acting = 0.0; // acceleration over the last step, virtual force at the last law call
    int32_t flags = 0;

    int64_t count = 0;               // number of contacts so far
    bool touching = false;
    double resolved;                 // step size during a contact [s]
    double touch_time = 0.0, touch_impulse = 0.0, touch_peak = 0.0;
    double first = NAN, impact_end = NAN;  // first contact; end of its impact [s]
    int64_t trace_rows = 0, course_rows = 0;

    double now() const { return t + at; }
    double distance() const { return body.xo - body.x; }
    double closing() const { return body.vo - body.v; }  // l', negative during an approach
    double force_now() const { return contact_force(loop.contact, body.x - body.xo, body.v - body.vo); }
    double reference_at(double time) const { return scene.xd + time * (scene.vd + 0.5 * scene.ad * time); }

    void ask_law();
    void set_target();
    bool end_period(const Body &before);
    void record_instant(double force);
    void follow_period();
    void begin_leg() { leg = leg_after(loop, index, leg, stretch++); }
    void restore(const Approach &approach);
    void take(const Step &step);
    Step next_step() const;
    void move_along(Step &step) const;
    void shorten(Step &step);
    void sense(const Step &step);
    void note_largest();
    void begin_contact();
    bool strike();
    void follow_contact();
    void record_moment(double gap, double force);
    void finish();
};

}  // namespace pretouch
