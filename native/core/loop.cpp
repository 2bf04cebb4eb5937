// Run of one encounter of the sampled loop.

#include "loop.hpp"

#include <string.h>

namespace pretouch {

namespace {

// How a run can end: values of ContactStatus.
constexpr double CONTACT = 0.0, HORIZON = 2.0, UNRESOLVED = 4.0;
constexpr double FINEST = 1e-8;  // shortest step in a contact, relative to the controller's period

Cubic distance_along(const Body &from, const Body &to, double h) {
    return {from.xo - from.x, (from.vo - from.v) * h, to.xo - to.x, (to.vo - to.v) * h};
}

}  // namespace

Encounter::Encounter(const pretouch_loop &loop_, int64_t index_, const Law &law_, const Sensor &sensor_)
    : loop(loop_), scene(loop_.scenes[index_]), law(law_), sensor(sensor_),
      end(loop_.ends[index_]), touches(loop_.touches + index_ * loop_.most_touches), ideal(loop_.plant.mass == 0.0),
      inverse_mass(ideal ? 0.0 : 1.0 / loop_.plant.mass + loop_.contact.inverse_mass),
      body{scene.x, scene.v, 0.0, scene.xo, scene.vo, 0.0},
      index(index_), leg{0.0, 0.0, scene.xo, scene.vo, 0.0, 0.0}, xv(scene.x), vv(scene.v), resolved(loop_.plant_step) {
    begin_leg();
    for (int64_t k = 0; k < loop.linear.hidden; k++)
        hidden[k] = loop.linear.starts[2 * k] * scene.x + loop.linear.starts[2 * k + 1] * scene.v;
    end = {};
    end.status = HORIZON;
    end.rebound_velocity = end.detection_time = NAN;
    end.closest_distance = scene.xo - scene.x;
    end.largest_excursion = fabs(scene.x - scene.xd);
    end.largest_speed = fabs(scene.v);
    end.largest_advance = scene.v - scene.vd;
}

void Encounter::run(int64_t period) {
    const int64_t periods = static_cast<int64_t>(ceil(loop.horizon / loop.period - 1e-9));
    for (bool lasts = true; lasts && period < periods; period++) {
        t = static_cast<double>(period) * loop.period;
        at = 0.0;
        ask_law();
        lasts = end_period(body);
    }
    finish();
}

// Simulates the rest of a period; returns whether the encounter goes on. before: the bodies at the start of the period,
// which are restored if the motion does not stay finite.
bool Encounter::end_period(const Body &before) {
    const Body last_finite = before;  // a copy, because `before` may refer to `body`
    follow_period();
    end.end_time = now();
    xv = output.position;
    vv = output.velocity;
    if (isfinite(body.x) && isfinite(body.v)) return !(count && (ideal || end.end_time - first >= loop.follow_time));
    end.status = UNRESOLVED;
    body = last_finite;
    return false;
}

void Encounter::restore(const Approach &a) {
    leg = a.leg;
    stretch = a.stretch;
    t = a.t;
    at = a.at;
    body = {a.x, a.v, a.servo, a.xo, a.vo, 0.0};
    xv = a.xv;
    vv = a.vv;
    output = a.output;
    rate = a.rate;
    acting = a.acting;
    flags = a.flags;
    end.end_time = a.end_time;
    end.detection_time = a.detection_time;
    end.closest_distance = a.closest_distance;
    end.largest_excursion = a.largest_excursion;
    end.largest_travel = a.largest_travel;
    end.largest_speed = a.largest_speed;
    end.largest_virtual_force = a.largest_virtual_force;
    end.largest_acceleration = a.largest_acceleration;
    end.largest_advance = a.largest_advance;
}

void Encounter::resume(const Approach &a) {
    restore(a);
    if (!a.law_called) return run(a.period);
    set_target();
    if (end_period({a.last_x, a.last_v, 0.0, a.last_xo, a.last_vo, 0.0}))
        run(a.period + 1);
    else
        finish();
}

bool Encounter::visit(Approach &a, Sensor &sensor_after) {
    restore(a);
    ask_law();
    if (!end_period(body)) {
        finish();
        return false;
    }
    if (count) {
        run(a.period + 1);
        return false;
    }
    a = {a.period + 1, t, 0.0, end.end_time, body.x, body.v, body.servo, body.xo, body.vo,
         0.0, 0.0, 0.0, 0.0, xv, vv, rate, acting, end.detection_time, end.closest_distance, end.largest_excursion,
         end.largest_travel, end.largest_speed, end.largest_virtual_force, end.largest_acceleration, end.largest_advance, output,
         flags, false, leg, stretch};
    sensor_after = sensor;
    return true;
}

// Passes the newest reading to the law, which returns the motion of the virtual object over the period.
void Encounter::ask_law() {
    const int32_t fresh = deliver(sensor, t);
    const double force = force_now();
    const pretouch_sample sample = {sensor.reading,  larger(t - sensor.measured, 0.0), -force,
                                    reference_at(t), scene.vd + scene.ad * t,          scene.ad,
                                    fresh};
    law.step(law.parameters, law.state, &sample, &output);
    flags |= output.status;
    if (output.status & PRETOUCH_DETECTING && isnan(end.detection_time)) end.detection_time = t;
    if (count == 0) end.largest_virtual_force = larger(end.largest_virtual_force, fabs(output.virtual_force));
    if (trace_rows < loop.trace_rows) record_instant(force);
    acting = output.virtual_force;
    set_target();
}

// Sets the motion of the virtual object over the period from the law's output.
void Encounter::set_target() {
    target = {loop.period, output.acceleration, {xv, vv * loop.period, output.position, output.velocity * loop.period}};
}

void Encounter::record_instant(double force) {
    loop.trace[trace_rows++] = {t,      distance(),           body.x, body.v,         body.xo,          xv,
                                vv,     output.virtual_force, force,  sensor.reading, output.log_level,
                                static_cast<double>(output.status)};
}

void Encounter::follow_period() {
    while (at < loop.period - INSTANT) {
        while (now() >= leg.until - INSTANT) begin_leg();
        Step step = next_step();
        if (count == 0) {  // mean over a step, from the change of velocity instead of the law's output
            rate = ideal ? (output.velocity - vv) / loop.period : (step.moved.v - body.v) / step.h;
            end.largest_acceleration = larger(end.largest_acceleration, fabs(rate));
        }
        if (step.hit) shorten(step);
        if (!(step.hit && ideal)) {
            sense(step);
            take(step);
            at += step.h;
            end.closest_distance = smaller(end.closest_distance, step.touch.least);
        }
        if (count == 0) note_largest();
        if (step.hit) {
            begin_contact();
            if (ideal || !strike()) break;
        } else if (touching) {
            follow_contact();
        }
    }
}

// Sets the bodies to their state at the end of a step.
void Encounter::take(const Step &step) {
    body = step.moved;
    for (int64_t k = 0; k < loop.linear.hidden; k++) hidden[k] = step.hidden[k];
}

Encounter::Step Encounter::next_step() const {
    Step step;  // all used fields are set below; initializing it with 0 would take 5 % of a run's time
    const double remaining = loop.period - at;
    step.h = smaller(remaining, leg.until - now());
    if (ideal) {
        const double later = now() + step.h;
        const bool whole = step.h == remaining;  // then the law's output is used without rounding errors
        step.moved = {whole ? output.position : target.position(at + step.h),
                      whole ? output.velocity : target.velocity(at + step.h), 0.0,
                      pretouch::position(leg, later), pretouch::velocity(leg, later), 0.0};
    } else {
        step.h = smaller(step.h, touching ? resolved : loop.plant_step);
        move_along(step);
    }
    step.gap = distance_along(body, step.moved, step.h);
    step.touch = touching ? Touch{2.0, step.gap.end}
                          : first_touch(step.gap, resolution(scene, step.moved.x, way_until(leg, t + at + step.h)));
    step.hit = step.touch.part <= 1.0;
    return step;
}

// Computes the end of a step of length h. Before a touch is detected, no contact force acts, because a stiff contact
// could reverse the motion within the step, so that the touch would be missed.
void Encounter::move_along(Step &step) const {
    const pretouch_contact *contact = touching ? &loop.contact : nullptr;
    step.moved = loop.linear.rows
                     ? advance_linear(body, hidden, at, step.h, target, loop.linear, contact, leg.ao, step.hidden)
                     : advance(body, at, step.h, target, loop.plant, contact, leg.ao);
}

// Shortens a step so that it ends at the touch. For an ideal plant, sets the bodies to their state at the touch
// instead.
void Encounter::shorten(Step &step) {
    const double part = step.touch.part, h = step.h;
    const Body &to = step.moved;
    if (ideal) {
        const Cubic x = {body.x, body.v * h, to.x, to.v * h}, xo = {body.xo, body.vo * h, to.xo, to.vo * h};
        body = {x.at(part), x.slope(part) / h, 0.0, xo.at(part), xo.slope(part) / h, 0.0};
        at += part * h;
        end.closest_distance = 0.0;
        return;
    }
    step.h *= part;
    if (step.h > 0.0) {
        move_along(step);
    } else {
        step.moved = body;
        for (int64_t k = 0; k < loop.linear.hidden; k++) step.hidden[k] = hidden[k];
    }
    step.gap = distance_along(body, step.moved, step.h);
    step.touch.least = step.gap.end;
}

// Passes the distance to the sensor at each of its sampling instants within a step.
void Encounter::sense(const Step &step) {
    while (sensor.instant <= t + at + step.h + INSTANT) {
        const double part =
            step.h > 0.0 ? smaller(larger((sensor.instant - t - at) / step.h, 0.0), 1.0) : 1.0;
        look(sensor, step.gap.at(part));
    }
}

// Updates the largest values until the first contact.
void Encounter::note_largest() {
    end.largest_excursion = larger(end.largest_excursion, fabs(body.x - reference_at(now())));
    end.largest_travel = larger(end.largest_travel, fabs(body.x - scene.x));
    end.largest_speed = larger(end.largest_speed, fabs(body.v));
    end.largest_advance = larger(end.largest_advance, body.v - (scene.vd + scene.ad * now()));
}

void Encounter::begin_contact() {
    count++;
    touching = true;
    touch_time = now();
    touch_impulse = body.impulse;
    touch_peak = 0.0;
    if (count == 1) {
        first = now();
        end.status = CONTACT;
        end.time = now();
        end.position = body.x;
        end.velocity = body.v;
        end.displacement = body.x - reference_at(now());
        end.relative_velocity = closing();
        end.acceleration = rate;
        end.virtual_force = acting;
    }
    if (count <= loop.most_touches) {
        touches[count - 1].time = now();
        touches[count - 1].relative_velocity = closing();
    }
}

// Processes the first instant of a contact. The plant is set onto the surface, since the distance can be about 1e-11 m.
// The contact's damper acts there already, and its force may be the largest of the contact. Returns whether the contact
// can be resolved; if not, x becomes NaN. An unstable loop may strike so fast that the steps would be too short.
bool Encounter::strike() {
    body.x = body.xo;
    touch_peak = contact_force(loop.contact, 0.0, body.v - body.vo);
    const double speed = fabs(closing());
    end.peak_force = larger(end.peak_force, touch_peak);
    if (count == 1) impact_end = now() + elastic_duration(loop.contact, inverse_mass, speed);
    if (now() <= impact_end) end.impact_force = larger(end.impact_force, touch_peak);
    resolved = smaller(loop.plant_step, contact_step(loop.contact, inverse_mass, speed));
    record_moment(0.0, touch_peak);
    if (resolved > FINEST * loop.period) return true;
    body.x = NAN;
    return false;
}

void Encounter::follow_contact() {
    const double force = force_now();
    const bool parted = distance() > 0.0 && body.vo > body.v;
    touch_peak = larger(touch_peak, force);
    end.peak_force = larger(end.peak_force, force);
    if (now() <= impact_end) end.impact_force = larger(end.impact_force, force);  // later forces belong to a push
    record_moment(distance(), force);
    if (count <= loop.most_touches) {
        pretouch_touch &touch = touches[count - 1];
        touch.peak_force = touch_peak;
        touch.impulse = body.impulse - touch_impulse;
        touch.duration = now() - touch_time;
        touch.rebound_velocity = parted ? closing() : NAN;
    }
    if (!parted) return;
    touching = false;
    if (count == 1) end.rebound_velocity = closing();
}

void Encounter::record_moment(double gap, double force) {
    if (course_rows < loop.course_rows) loop.course[course_rows++] = {now(), gap, closing(), force};
}

void Encounter::finish() {
    end.impulse = body.impulse;
    end.contacts = static_cast<double>(count);
    end.flags = static_cast<double>(flags);
    if (count) return;
    // The state at the end. If the motion did not stay finite, it is the state at the start of the last period.
    const double ended = end.status == HORIZON ? end.end_time : larger(end.end_time - loop.period, 0.0);
    end.time = ended;
    end.position = body.x;
    end.velocity = body.v;
    end.distance = distance();
    end.displacement = body.x - scene.xd - ended * (scene.vd + 0.5 * scene.ad * ended);
    end.relative_velocity = closing();
    end.acceleration = rate;
    end.virtual_force = acting;
}

}  // namespace pretouch

// ---- the C interface ----

using namespace pretouch;

void pretouch::continue_encounter(const pretouch_loop &loop, int64_t index, void *state, const Sensor &sensor,
                                  const Approach &approach) {
    const pretouch_laws &laws = loop.laws;
    const Law law = {laws.step, laws.parameters + laws.law_of[index] * laws.parameters_size, state};
    Encounter(loop, index, law, sensor).resume(approach);
}

bool pretouch::continue_period(const pretouch_loop &loop, int64_t index, void *state, Sensor &sensor,
                               Approach &approach) {
    const pretouch_laws &laws = loop.laws;
    const Law law = {laws.step, laws.parameters + laws.law_of[index] * laws.parameters_size, state};
    return Encounter(loop, index, law, sensor).visit(approach, sensor);
}

Leg pretouch::leg_after(const pretouch_loop &loop, int64_t index, const Leg &leg, int64_t stretch) {
    const double since = leg.until;
    const bool more = stretch < loop.stretches_each;
    const pretouch_stretch *next = loop.stretches + index * loop.stretches_each + stretch;
    return {since, more ? next->until : INFINITY, position(leg, since), velocity(leg, since),
            more ? next->acceleration : loop.scenes[index].ao, way_until(leg, since)};
}

void pretouch_run_encounters(const pretouch_loop *loop, const int64_t *which, int64_t n, void *state,
                             pretouch_reading *waiting, int64_t room) {
    const pretouch_laws &laws = loop->laws;
    const bool traced = loop->trace_rows || loop->course_rows;
    if (n > 1 && laws.step == pretouch_step_damper && !loop->linear.rows && !traced) {
        run_side_by_side(loop, which, n, state, waiting, room);
        return;
    }
    for (int64_t i = 0; i < n; i++) {
        const int64_t index = which[i];
        memcpy(state, laws.states + laws.start_of[index] * laws.state_size, static_cast<size_t>(laws.state_size));
        const Law law = {laws.step, laws.parameters + laws.law_of[index] * laws.parameters_size, state};
        Sensor sensor;
        start_sensing(sensor, *loop, index, waiting, room);
        Encounter(*loop, index, law, sensor).run(0);
    }
}

void pretouch_run_law(pretouch_law_step *step, const void *parameters, void *state, const pretouch_sample *samples,
                      int64_t n, pretouch_output *out) {
    for (int64_t i = 0; i < n; i++) step(parameters, state, samples + i, out + i);
}

double pretouch_contact_step(const pretouch_contact *contact, double inverse_mass, double speed) {
    return contact_step(*contact, inverse_mass, speed);
}

double pretouch_elastic_duration(const pretouch_contact *contact, double inverse_mass, double speed) {
    return elastic_duration(*contact, inverse_mass, speed);
}

double pretouch_cubic(double start, double start_slope, double end, double end_slope, double s, double *slope) {
    const Cubic cubic = {start, start_slope, end, end_slope};
    *slope = cubic.slope(s);
    return cubic.at(s);
}

double pretouch_first_touch(double start, double start_slope, double end, double end_slope, double doubt,
                            double *least) {
    const Touch touch = first_touch({start, start_slope, end, end_slope}, doubt);
    *least = touch.least;
    return touch.part;
}
