// One encounter of the sampled loop: sensor chain, controller at its own rate, plant and contact.
#pragma once

#include "loop_sensing.hpp"

namespace pretouch {

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
    Encounter(const pretouch_loop &loop, int64_t index, const Law &law, pretouch_reading *waiting, int64_t room);

    void run();

private:
    // A step of the robot: how long, where it begins and where it would end, and the distance meanwhile.
    struct Step {
        double h;
        Body moved;
        Cubic gap;
        Touch touch;
        bool hit;
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
    void record_instant(double force);
    void follow_period();
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
