// One encounter of the sampled loop: contact forces and steps of plant and obstacle (loop_mechanics.cpp), the sensor
// chain from a distance to the reading of the controller (loop_sensing.cpp), and the run (loop.cpp).
//
// Random numbers depend only on their index: the k-th draw of a run is the same on any thread and for any earlier draws.
// Two runs with one seed therefore have the same noise, reading by reading, even if one ends earlier (common random
// numbers). The mixing is that of SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014).

#pragma once

#include <math.h>
#include <stddef.h>

#include "approach.hpp"

namespace pretouch {

inline double larger(double a, double b) { return b > a ? b : a; }
inline double smaller(double a, double b) { return b < a ? b : a; }

// Plant, servo and obstacle; impulse: of the contact force so far [N s].
struct Body {
    double x, v, servo, xo, vo, impulse;
};

// The cubic through both ends of a step, by its slopes over the whole step.
struct Cubic {
    double start, start_slope, end, end_slope;

    double second() const { return 3.0 * (end - start) - 2.0 * start_slope - end_slope; }
    double third() const { return start_slope + end_slope - 2.0 * (end - start); }
    double at(double s) const { return start + s * (start_slope + s * (second() + s * third())); }
    double slope(double s) const { return start_slope + s * (2.0 * second() + s * 3.0 * third()); }
};

// The virtual object over a period of the controller: a cubic through both ends, and its mean acceleration.
struct Target {
    double period, acceleration;
    Cubic course;

    double position(double at) const { return course.at(at / period); }
    double velocity(double at) const { return course.slope(at / period) / period; }
};

// The force between the bodies [N], never below 0: they do not stick. At the touch itself damping acts.
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

// The distance [m] at a time that is not told from zero: of the terms that l is the difference of, as in motion.
inline double resolution(const pretouch_scene &scene, double x, double way) {
    constexpr double rounding = 1e-12;
    return rounding * (fabs(scene.x) + fabs(x) + fabs(scene.xo) + way);
}

// Where a distance first comes to zero within a step, 2 where it does not, and the least that it comes to.
struct Touch {
    double part, least;
};

// Between its turning points the cubic rises or falls, so that none of its zeros is missed, however short the dip. A
// smallest distance closer to zero than `doubt`, on either side, is a touch, there; one that the cubic only rises from,
// as after a contact, is none.
Touch find_touch(const Cubic &gap, double doubt);

inline Touch first_touch(const Cubic &gap, double doubt) {
    const double lowest = smaller(gap.start, gap.end);  // Bernstein: the cubic does not go below its ends
    if (gap.end > doubt && smaller(gap.start + gap.start_slope / 3.0, gap.end - gap.end_slope / 3.0) >= lowest)
        return {2.0, lowest};
    return find_touch(gap, doubt);
}

// A step [s] that resolves a contact that starts with a relative speed: 1/50 of its time scale.
double contact_step(const pretouch_contact &contact, double inverse_mass, double speed);

// How long the bodies would touch [s], from a relative speed on, without loss and drive: m d'' = -k d^n.
double elastic_duration(const pretouch_contact &contact, double inverse_mass, double speed);

// Plant and obstacle h [s] later within a period of the controller, from the time `at` in it, by the classical
// Runge-Kutta method of order 4; contact: null where the bodies are apart; push: acceleration of the obstacle.
Body advance(const Body &body, double at, double h, const Target &target, const pretouch_plant &plant,
             const pretouch_contact *contact, double push);

// The same for a linear plant; `hidden` are its other states, and `after` those h later.
Body advance_linear(const Body &body, const double *hidden, double at, double h, const Target &target,
                    const pretouch_state_space &plant, const pretouch_contact *contact, double push, double *after);

constexpr double INSTANT = 1e-12;  // s: instants that are closer are one

// 64 random bits for an index.
inline uint64_t mix(uint64_t key, uint64_t index) {
    uint64_t z = key + (index + 1) * 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

// One cosine of the error that a curve has in a run: amplitude, wave number [1/m], phase.
struct Wave {
    double amplitude, number, phase;
};

// The sensor in one run: exposures that become readings, and readings in transit to the controller.
class Sensor {
public:
    // A run with a key of random numbers, and with the distance at the start.
    Sensor(const pretouch_chain &chain, const pretouch_curve &curve, uint64_t key, pretouch_reading *waiting,
           int64_t room, double distance);

    // The run of a loop with an index.
    Sensor(const pretouch_loop &loop, int64_t index, pretouch_reading *waiting, int64_t room);

    static void *operator new(size_t, void *place) { return place; }

    // Time of the next sample of the distance [s].
    double next() const { return instant; }

    // Samples the distance, and makes a reading of a completed exposure.
    void look(double distance);

    // Delivers the reading available at a time; returns whether there was one.
    bool deliver(double t);

    double reading = 0.0, measured = 0.0;  // what was handed over last, and when it was measured [s]

private:
    const pretouch_chain &chain;
    const pretouch_curve &curve;
    const uint64_t key;
    pretouch_reading *const waiting;
    const uint64_t mask;
    uint64_t head = 0, tail = 0;
    uint64_t k = 0;  // the exposure, which is looked at `nodes` times
    const int nodes;
    int node = 0;
    double total = 0.0, start = 0.0, instant = 0.0;
    static constexpr int WAVES = 8;
    Wave waves[WAVES];

    double start_of(uint64_t exposure) const;
    double misfit_at(double distance) const;
    double output(double distance) const;
    double exposed_to(double distance) const;
    double raw_reading(double mean, double time) const;
    void draw_misfit();
    void look_at_start(double distance);
};

// The law in one run: its parameters, its state, and what it answered last.
struct Law {
    pretouch_law_step *step;
    const void *parameters;
    void *state;
};

// An encounter as it goes on. Within a period of the controller the robot is followed in steps; a distance that comes
// to zero ends the step there, and from the touch on, steps resolve the contact.
class Encounter {
public:
    Encounter(const pretouch_loop &loop, int64_t index, const Law &law, const Sensor &sensor);

    // Runs periods, from the one with a number on, and then notes how the encounter ended.
    void run(int64_t period);

    // Continues an encounter that another code has brought so far.
    void resume(const Approach &approach);

    // Continues it for one period, and then stores the approach and the sensor; returns whether it goes on.
    bool visit(Approach &approach, void *sensor_after);

private:
    // A step of the robot: how long, where it begins and where it would end, and the distance meanwhile.
    struct Step {
        double h;
        Body moved;
        Cubic gap;
        Touch touch;
        bool hit;
        double hidden[PRETOUCH_MOST_HIDDEN];  // of a linear plant, where it would end
    };

    const pretouch_loop &loop;
    const pretouch_scene &scene;
    const Law law;
    Sensor sensor;
    pretouch_end &end;
    pretouch_touch *const touches;

    const bool ideal;                // the plant is the virtual object
    const double inverse_mass;       // 1 / the reduced mass of both bodies
    double t = 0.0, at = 0.0;        // start of the period, and time since then
    Body body;
    double hidden[PRETOUCH_MOST_HIDDEN];  // states of a linear plant
    const int64_t index;
    int64_t stretch = 0;             // the number of stretches of the obstacle's course that have begun
    Leg leg;
    double xv, vv;                   // of the virtual object at the start of the period
    Target target{};
    pretouch_output output{};
    double rate = 0.0, acting = 0.0; // acceleration over the last step, force of the law in the last period
    int32_t flags = 0;

    int64_t count = 0;               // contacts so far
    bool touching = false;
    double resolved;                 // step in contact [s]
    double touch_time = 0.0, touch_impulse = 0.0, touch_peak = 0.0;
    double first = NAN, impact_end = NAN;  // the first contact, and until when its forces are an impact
    int64_t trace_rows = 0, course_rows = 0;

    double now() const { return t + at; }
    double distance() const { return body.xo - body.x; }
    double closing() const { return body.vo - body.v; }  // l': negative on approach
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
