// Simulate several encounters of the sampled loop at once, one in each vector lane, until their first contact.
//
// The law's limits and motion, the robot and the obstacle are computed for all lanes together, as is a period of the law
// without a new reading. New readings pass through the sensor and the filters by the code of a single encounter, one lane
// after the other, because they arrive in different periods. Rare events (a touch, a limit of the motion, the end) are
// also handled by the code of a single encounter. This file is compiled without fused multiply-add instructions, and
// follows the order of the operations in loop*.cpp and pretouch_law.c. Therefore each result has the same bits as that
// of an encounter that runs alone, on every processor.

#include "approach.hpp"
#include "lanes.hpp"
#include "lanes_kernels.hpp"

#include <math.h>
#include <string.h>

namespace PRETOUCH_VARIANT {

namespace {

constexpr double INSTANT = pretouch::INSTANT;
constexpr double ROUNDING = 1e-9;      // relative, of an impulse, as in pretouch_law.c
constexpr double SAME_INSTANT = 1e-6;  // of a period, as in pretouch_law.c
constexpr double ANY_REFERENCE = 1e6;  // largest valid reference motion, as in pretouch_law.c
constexpr double TOWARD = 0.3333334;   // slightly above 1/3

inline Lanes larger(Lanes a, Lanes b) { return where(b > a, b, a); }
inline Lanes smaller(Lanes a, Lanes b) { return where(b < a, b, a); }
inline Lanes within(Lanes value, Lanes limit) { return larger(smaller(value, limit), -limit); }
inline Masks is_finite(Lanes x) { return absolute(x) < INFINITE; }

inline Masks masks_of(const int64_t *from) {
    Masks value;
    memcpy(&value, from, sizeof value);
    return value;
}

inline void store_masks(int64_t *to, Masks value) { memcpy(to, &value, sizeof value); }

// The flag in the lanes in which a condition is true, and 0 in the others.
inline Masks flag_where(Masks condition, int64_t flag) { return condition & (flag - Masks{}); }
inline Masks has_flag(Masks flags, int64_t flag) { return (flags & (flag - Masks{})) != Masks{}; }

inline Lanes rounded_down(Lanes x) {
#if defined(__AVX512F__)
    return (Lanes)_mm512_maskz_roundscale_pd(0xff, (__m512d)x, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
#elif defined(__AVX2__)
    return (Lanes)_mm256_floor_pd((__m256d)x);
#else
    for (int i = 0; i < WIDTH; i++) x[i] = __builtin_floor(x[i]);
    return x;
#endif
}

// A cubic polynomial on a step or a period, with s from 0 to 1. A slope is a derivative by s.
struct Course {
    Lanes start, start_slope, second, third;

    Lanes at(double s) const { return start + s * (start_slope + s * (second + s * third)); }
    Lanes slope(double s) const { return start_slope + s * (2.0 * second + s * 3.0 * third); }
};

inline Course course_between(Lanes start, Lanes start_slope, Lanes end, Lanes end_slope) {
    return {start, start_slope, 3.0 * (end - start) - 2.0 * start_slope - end_slope,
            start_slope + end_slope - 2.0 * (end - start)};
}

// Robot, servo and obstacle, or their time derivatives.
struct Bodies {
    Lanes x, v, servo, xo, vo;
};

inline Bodies along(const Bodies &b, const Bodies &k, double h) {
    return {b.x + h * k.x, b.v + h * k.v, b.servo + h * k.servo, b.xo + h * k.xo, b.vo + h * k.vo};
}

// The parameters of the drive of a law in each lane; see pretouch_drive_numbers.
struct Drive {
    Lanes hold, fade_step, largest_force, contact_gain, threshold;
    Lanes xx, xv, vx, vv, xf, vf;
    Lanes speed, acceleration, excursion;
};

// The parameters of the sensing of a law in each lane, with the limits of pretouch_observe; and its `ramp_step`.
struct Sensing {
    Lanes period, overdue, lost, most_quiet, most_measured, ramp_step;
};

// The encounters that share the lanes. When one ends, the next one takes its lane.
class Group {
public:
    Group(const pretouch_loop &loop_, const int64_t *which_, int64_t count_, char *states_,
          pretouch_reading *waiting_, int64_t room_)
        : loop(loop_), which(which_), count(count_), states(states_), waiting(waiting_), room(room_),
          ideal(loop_.plant.mass == 0.0), inverse_mass(ideal ? 0.0 : 1.0 / loop_.plant.mass) {}

    void run();

private:
    const pretouch_loop &loop;
    const int64_t *const which;
    const int64_t count;
    char *const states;
    pretouch_reading *const waiting;
    const int64_t room;
    const bool ideal;
    const double inverse_mass;

    int64_t next = 0, index[WIDTH];
    uint64_t open = 0;  // bits of the lanes whose encounter has not ended
    pretouch::Sensor sensors[WIDTH];
    // Arrays, because setting single lanes of a vector would write and read memory each time: time of the next sample of
    // the distance, and of the arrival of the next reading [s].
    alignas(64) double instants[WIDTH] = {}, arrivals[WIDTH] = {};

    Lanes number{}, t{};  // number of the period, as a real number, and its start [s]
    Bodies body{};
    Lanes last_x{}, last_v{}, last_xo{}, last_vo{}, end_time{}, xv{}, vv{}, rate{}, acting{};
    Lanes detection_time{}, closest{}, excursion{}, travel{}, fastest{}, strongest{}, hardest{}, advancing{};
    Lanes x0{}, start_xo{}, xd{}, vd{}, ad{};               // scene
    Lanes since{}, until{}, xo0{}, vo0{}, ao{}, gone{};  // leg of the obstacle's path
    int64_t stretch[WIDTH];
    Lanes quiet{}, measured{}, log_level{}, ramp{};  // state of the law's sensing that changes without a reading
    Sensing sensing{};
    Lanes steady{}, rest{}, ahead{}, fading{}, motion{}, speed{}, reference{};  // state of the law's drive
    Drive drive{};
    Lanes position{}, velocity{}, acceleration{}, force{};  // output of the law
    Masks status{}, flags{};

    pretouch_state *state_of(int lane) { return reinterpret_cast<pretouch_state *>(states + lane * loop.laws.state_size); }
    const pretouch_parameters *parameters_of(int lane) const {
        const pretouch_laws &laws = loop.laws;
        return reinterpret_cast<const pretouch_parameters *>(laws.parameters +
                                                             laws.law_of[index[lane]] * laws.parameters_size);
    }
    Lanes reference_at(Lanes time) const { return xd + time * (vd + 0.5 * ad * time); }

    void begin(int lane);
    void load_drive(int lane, const pretouch_drive_state &driven);
    void load_sensing(int lane, const pretouch_state &state);
    void store_sensing(int lane, pretouch_state &state) const;
    void set_leg(int lane, const pretouch::Leg &leg);
    pretouch::Leg leg_of(int i) const { return {since[i], until[i], xo0[i], vo0[i], ao[i], gone[i]}; }
    pretouch::Approach approach_of(int lane, double at, bool law_called);
    bool is_at_end(int lane, double periods) const {
        return number[lane] >= periods || !(body.x[lane] - body.xo[lane] < 0.0);
    }
    void follow_course(int lane, double periods);
    void visit(int lane);
    void leave(int lane, double at, bool law_called);
    void refill(int lane);
    void ask_laws();
    void step_alone(int lane, const pretouch_observation &observed, const pretouch_push &push, pretouch_sample &sample,
                    int64_t *statuses);
    bool is_open(int lane) const { return open >> lane & 1; }
    template <bool is_ideal> void follow_period();
    template <bool is_ideal> void follow(double periods);
    // Position of the virtual object, and the part of the command that depends only on the virtual object.
    struct Wanted {
        Lanes position, command;
    };

    Wanted wanted_at(const Course &target, double at) const;
    Bodies advance(double h, const Wanted &first, const Wanted &middle, const Wanted &last) const;
    Bodies slopes(const Bodies &b, const Wanted &wanted) const;
    Lanes slow_friction(Lanes speed_of_robot, Lanes friction, uint64_t slow) const;
};

// Start the next encounter in a lane, with the same values as the constructor of Encounter.
void Group::begin(int i) {
    const int64_t k = index[i] = which[next++];
    const pretouch_scene &s = loop.scenes[k];
    memcpy(state_of(i), loop.laws.states + loop.laws.start_of[k] * loop.laws.state_size,
           static_cast<size_t>(loop.laws.state_size));
    const pretouch_drive_numbers &d = parameters_of(i)->drive;
    const pretouch_sensing_numbers &n = parameters_of(i)->sensing;
    open |= 1ull << i;
    number[i] = t[i] = 0.0;
    pretouch::start_sensing(sensors[i], loop, k, waiting + i * room, room);
    end_time[i] = rate[i] = acting[i] = body.servo[i] = travel[i] = strongest[i] = hardest[i] = 0.0;
    x0[i] = body.x[i] = xv[i] = s.x;
    body.v[i] = vv[i] = s.v;
    start_xo[i] = body.xo[i] = s.xo;
    body.vo[i] = s.vo;
    stretch[i] = 1;
    set_leg(i, pretouch::leg_after(loop, k, {0.0, 0.0, s.xo, s.vo, 0.0, 0.0}, 0));
    xd[i] = s.xd;
    vd[i] = s.vd;
    ad[i] = s.ad;
    detection_time[i] = NOT_A_NUMBER;
    closest[i] = s.xo - s.x;
    excursion[i] = fabs(s.x - s.xd);
    fastest[i] = fabs(s.v);
    advancing[i] = s.v - s.vd;
    flags[i] = 0;
    load_sensing(i, *state_of(i));
    sensing.period[i] = n.period;
    sensing.overdue[i] = n.sensor_period * (1 - SAME_INSTANT);
    sensing.lost[i] = n.timeout * (1 + SAME_INSTANT);
    sensing.most_quiet[i] = 2 * n.timeout;
    sensing.most_measured[i] = 3 * n.timeout;
    sensing.ramp_step[i] = parameters_of(i)->law.ramp_step;
    load_drive(i, state_of(i)->drive);
    drive.hold[i] = d.hold;
    drive.fade_step[i] = d.fade_step;
    drive.largest_force[i] = d.largest_force;
    drive.contact_gain[i] = d.contact_gain;
    drive.threshold[i] = d.contact_threshold;
    drive.xx[i] = d.admittance.position_from_position;
    drive.xv[i] = d.admittance.position_from_velocity;
    drive.vx[i] = d.admittance.velocity_from_position;
    drive.vv[i] = d.admittance.velocity_from_velocity;
    drive.xf[i] = d.admittance.position_from_force;
    drive.vf[i] = d.admittance.velocity_from_force;
    drive.speed[i] = d.limits.speed;
    drive.acceleration[i] = d.limits.acceleration;
    drive.excursion[i] = d.limits.excursion;
}

// Copy the state of a law's drive to a lane.
void Group::load_drive(int i, const pretouch_drive_state &driven) {
    steady[i] = driven.delivery.steady;
    rest[i] = driven.delivery.rest;
    ahead[i] = driven.delivery.ahead;
    fading[i] = driven.delivery.fading;
    motion[i] = driven.motion.position;
    speed[i] = driven.motion.velocity;
    reference[i] = driven.reference;
}

// Copy the state of a law's sensing, and when its sensor acts next, to a lane.
void Group::load_sensing(int i, const pretouch_state &state) {
    quiet[i] = state.sensing.quiet;
    measured[i] = state.sensing.measured;
    log_level[i] = state.sensing.log_level;
    ramp[i] = state.law.ramp;
    instants[i] = sensors[i].instant;
    arrivals[i] = pretouch::next_arrival(sensors[i]);
}

// Copy the state of a lane's sensing back to the law.
void Group::store_sensing(int i, pretouch_state &state) const {
    state.sensing.quiet = quiet[i];
    state.sensing.measured = measured[i];
    state.sensing.log_level = log_level[i];
    state.law.ramp = ramp[i];
}

void Group::set_leg(int i, const pretouch::Leg &leg) {
    since[i] = leg.since;
    until[i] = leg.until;
    xo0[i] = leg.xo;
    vo0[i] = leg.vo;
    ao[i] = leg.ao;
    gone[i] = leg.way;
}

// Advance a lane until a period in which no leg of the obstacle's path ends. The code of a single encounter simulates
// the periods in which a leg ends.
void Group::follow_course(int i, double periods) {
    while (is_open(i)) {
        if (is_at_end(i, periods)) {
            leave(i, 0.0, false);
            refill(i);
            continue;
        }
        while (t[i] >= until[i] - INSTANT) set_leg(i, pretouch::leg_after(loop, index[i], leg_of(i), stretch[i]++));
        if (until[i] > t[i] + loop.period + INSTANT) return;
        visit(i);
        if (!is_open(i)) refill(i);
    }
}

// Start the next encounter in a lane, if one remains.
void Group::refill(int lane) {
    if (next < count) begin(lane);
}

// Pack the state of a lane for the code of a single encounter, and copy the state of its law back.
// law_called: whether the law has been called in this period.
pretouch::Approach Group::approach_of(int i, double at, bool law_called) {
    pretouch_drive_state &driven = state_of(i)->drive;
    store_sensing(i, *state_of(i));
    driven.delivery = {steady[i], rest[i], ahead[i], fading[i]};
    driven.motion = {motion[i], speed[i]};
    driven.reference = reference[i];
    return {
        static_cast<int64_t>(number[i]), t[i], at, end_time[i], body.x[i], body.v[i], body.servo[i], body.xo[i], body.vo[i],
        last_x[i], last_v[i], last_xo[i], last_vo[i], xv[i], vv[i], rate[i], acting[i], detection_time[i], closest[i], excursion[i], travel[i], fastest[i], strongest[i],
        hardest[i], advancing[i], {position[i], velocity[i], acceleration[i], force[i], log_level[i],
        static_cast<int32_t>(status[i])}, static_cast<int32_t>(flags[i]),
        law_called, leg_of(i), stretch[i]};
}

// Let the code of a single encounter continue the encounter of a lane until its end.
void Group::leave(int i, double at, bool law_called) {
    pretouch::continue_encounter(loop, index[i], state_of(i), sensors[i], approach_of(i, at, law_called));
    open &= ~(1ull << i);
}

// Let the code of a single encounter simulate one period of a lane, and load the state at its end.
void Group::visit(int i) {
    pretouch::Approach a = approach_of(i, 0.0, false);
    if (!pretouch::continue_period(loop, index[i], state_of(i), sensors[i], a)) {
        open &= ~(1ull << i);
        return;
    }
    load_sensing(i, *state_of(i));
    load_drive(i, state_of(i)->drive);
    number[i] = static_cast<double>(a.period);
    t[i] = number[i] * loop.period;
    end_time[i] = a.end_time;
    body.x[i] = a.x;
    body.v[i] = a.v;
    body.servo[i] = a.servo;
    body.xo[i] = a.xo;
    body.vo[i] = a.vo;
    xv[i] = a.xv;
    vv[i] = a.vv;
    rate[i] = a.rate;
    acting[i] = a.acting;
    detection_time[i] = a.detection_time;
    closest[i] = a.closest_distance;
    excursion[i] = a.largest_excursion;
    travel[i] = a.largest_travel;
    fastest[i] = a.largest_speed;
    strongest[i] = a.largest_virtual_force;
    hardest[i] = a.largest_acceleration;
    advancing[i] = a.largest_advance;
    position[i] = a.output.position;
    velocity[i] = a.output.velocity;
    acceleration[i] = a.output.acceleration;
    force[i] = a.output.virtual_force;
    status[i] = a.output.status;
    flags[i] = a.flags;
    set_leg(i, a.leg);
    stretch[i] = a.stretch;
}

// Compute the drive of one lane by the code of the law, since a limit or a fault may act.
void Group::step_alone(int i, const pretouch_observation &observed, const pretouch_push &push,
                       pretouch_sample &sample, int64_t *statuses) {
    pretouch_drive_state driven = {{steady[i], rest[i], ahead[i], fading[i]}, {motion[i], speed[i]}, reference[i]};
    pretouch_output out;
    sample.contact_force = -0.0;
    sample.reference_position = reference_at(t)[i];
    sample.reference_velocity = vd[i] + ad[i] * t[i];
    sample.reference_acceleration = ad[i];
    pretouch_drive(&parameters_of(i)->drive, &driven, &observed, &push, &sample, &out);
    load_drive(i, driven);
    position[i] = out.position;
    velocity[i] = out.velocity;
    acceleration[i] = out.acceleration;
    force[i] = out.virtual_force;
    statuses[i] = out.status;
}

// Pass the available readings to the laws. They move the virtual objects over the period.
void Group::ask_laws() {
    const Lanes none = all(0.0), one = all(1.0);
    // as pretouch_observe and pretouch_damp in pretouch_law.c without a new reading
    const Lanes quiet_now = quiet + sensing.period, measured_now = measured + sensing.period;
    Masks lost = quiet_now > sensing.lost, stale = quiet_now > sensing.overdue, usable{}, gone{};
    Lanes level = where(lost, none, log_level), impulse{};
    const Masks detecting = level > none;
    Lanes next_quiet = smaller(quiet_now, sensing.most_quiet);
    Lanes next_measured = smaller(measured_now, sensing.most_measured);
    Lanes next_ramp = where(detecting, smaller(ramp + sensing.ramp_step, one), larger(ramp - sensing.ramp_step, none));
    Masks seen = flag_where(detecting, PRETOUCH_DETECTING) + flag_where(stale, PRETOUCH_STALE) +
                 flag_where(lost, PRETOUCH_LOST);
    const uint64_t arriving = open & bits(load(arrivals) <= t + INSTANT), silent = open & bits(lost) & ~arriving;
    if (silent)
        for (int i = 0; i < WIDTH; i++)
            if (silent >> i & 1) state_of(i)->sensing.latest = PRETOUCH_NOTHING;
    if (arriving) {
        alignas(64) double quiets[WIDTH], ages[WIDTH], levels[WIDTH], ramps[WIDTH], impulses[WIDTH] = {};
        alignas(64) int64_t usables[WIDTH] = {}, stales[WIDTH], losses[WIDTH], vanished[WIDTH] = {}, seens[WIDTH];
        store(quiets, next_quiet);
        store(ages, next_measured);
        store(levels, level);
        store(ramps, next_ramp);
        store_masks(stales, stale);
        store_masks(losses, lost);
        store_masks(seens, seen);
        for (int i = 0; i < WIDTH; i++) {
            if (!(arriving >> i & 1)) continue;
            const pretouch_parameters *p = parameters_of(i);
            pretouch_state *state = state_of(i);
            pretouch::Sensor &sensor = sensors[i];
            pretouch_sample sample;
            pretouch_observation observed;
            pretouch_push push;
            sample.fresh = pretouch::deliver(sensor, t[i]);
            arrivals[i] = pretouch::next_arrival(sensor);
            sample.reading = sensor.reading;
            sample.age = pretouch::larger(t[i] - sensor.measured, 0.0);
            store_sensing(i, *state);
            pretouch_observe(&p->sensing, &state->sensing, &sample, &observed);
            pretouch_damp(&p->law, &state->law, &observed, &push);
            quiets[i] = state->sensing.quiet;
            ages[i] = state->sensing.measured;
            levels[i] = state->sensing.log_level;
            ramps[i] = state->law.ramp;
            impulses[i] = push.impulse;
            usables[i] = -observed.usable;
            stales[i] = -observed.stale;
            losses[i] = -observed.lost;
            vanished[i] = -observed.no_object;
            seens[i] = observed.status;
        }
        next_quiet = load(quiets);
        next_measured = load(ages);
        level = load(levels);
        next_ramp = load(ramps);
        impulse = load(impulses);
        usable = masks_of(usables);
        stale = masks_of(stales);
        lost = masks_of(losses);
        gone = masks_of(vanished);
        seen = masks_of(seens);
    }
    quiet = next_quiet;
    measured = next_measured;
    log_level = level;
    ramp = next_ramp;
    const double period = loop.period;
    // as deliver in pretouch_law.c
    const Lanes owed = impulse + rest, due = owed - ahead;
    const Masks covers = ((owed > 0.0) & (0.0 < due)) | ((owed < 0.0) & (0.0 > due));
    const Lanes new_steady = where(covers, within(due / drive.hold, drive.largest_force), none);
    const Lanes now_steady = where(usable, new_steady, steady);
    const Lanes remaining = where(usable, new_steady * drive.hold, rest);
    const Lanes now_ahead = where(gone, none, where(usable, where(covers, none, -due), ahead));
    const Lanes now_fading = where(gone, none, where(usable, one, fading));
    const Lanes portion = now_steady * period;
    const Masks lasts = remaining != 0.0, last = absolute(remaining) <= absolute(portion) * (1 + ROUNDING);
    const Masks fades = ~lasts & stale;
    const Lanes faded = larger(now_fading - drive.fade_step, none), fading_force = now_steady * faded;
    const Lanes delivered =
        where(lasts, where(last, remaining / period, now_steady), where(stale, fading_force, none));
    // as pretouch_drive in pretouch_law.c
    const Lanes virtual_force = within(delivered + 0.0, drive.largest_force);
    const Lanes total = virtual_force + drive.contact_gain * -0.0;
    const Lanes next_x = drive.xx * motion + drive.xv * speed + drive.xf * total;
    const Lanes next_v = drive.vx * motion + drive.vv * speed + drive.vf * total;
    // as limit_motion in pretouch_law.c: lanes in which no limit acts are `plain`
    const Lanes step = drive.acceleration * period, drifted = speed * period, moved = next_x - motion;
    const Lanes low = larger(-drive.speed, speed - step), high = smaller(drive.speed, speed + step);
    const Lanes size = absolute(next_v), whole = rounded_down(size / step), part = size - whole * step;
    const Lanes way = period * (step / 2 * whole * whole + part * (whole + 0.5));
    const Lanes toward = where(next_v >= 0.0, next_x, -next_x);
    Masks plain = (absolute(moved) <= drive.speed * period) & (absolute(moved - drifted) <= step * period / 2) &
                  (low <= next_v) & (next_v <= high) & (absolute(next_x) <= drive.excursion) &
                  (toward + way <= drive.excursion);
    const Lanes x = reference_at(t), v = vd + ad * t;
    plain &= (absolute(x) <= ANY_REFERENCE) & (absolute(v) <= ANY_REFERENCE) & (absolute(ad) <= ANY_REFERENCE);
    position = where(plain, x + period * (v + period / 2 * ad) + next_x, position);
    velocity = where(plain, v + period * ad + next_v, velocity);
    acceleration = where(plain, ad + (next_v - speed) / period, acceleration);
    force = where(plain, virtual_force, force);
    steady = where(plain, now_steady, steady);
    rest = where(plain, where(lasts & ~last, remaining - portion, none), rest);
    ahead = where(plain, where(fades, where(lost, none, now_ahead + fading_force * period), now_ahead), ahead);
    fading = where(plain, where(fades, faded, now_fading), fading);
    motion = where(plain, next_x, motion);
    speed = where(plain, next_v, speed);
    reference = where(plain, x, reference);
    status = seen + flag_where(absolute(virtual_force) >= drive.largest_force, PRETOUCH_FORCE_LIMITED) +
             flag_where(none >= drive.threshold, PRETOUCH_IN_CONTACT);
    const uint64_t alone = open & ~bits(plain);
    if (alone) {
        alignas(64) int64_t statuses[WIDTH];
        store_masks(statuses, status);
        for (int i = 0; i < WIDTH; i++) {
            if (!(alone >> i & 1)) continue;
            pretouch_observation observed{};
            observed.usable = usable[i] != 0;
            observed.no_object = gone[i] != 0;
            observed.stale = stale[i] != 0;
            observed.lost = lost[i] != 0;
            observed.log_level = log_level[i];
            observed.status = static_cast<int32_t>(seen[i]);
            pretouch_sample sample{};
            step_alone(i, observed, {impulse[i], 0.0}, sample, statuses);
        }
        status = masks_of(statuses);
    }
    flags |= status;
    const Masks first = has_flag(status, PRETOUCH_DETECTING) & ~(detection_time == detection_time);
    detection_time = where(first, t, detection_time);
    strongest = larger(strongest, absolute(force));
    acting = force;
}

// The time derivatives of robot, servo and obstacle.
[[gnu::always_inline]] inline Bodies Group::slopes(const Bodies &b, const Wanted &w) const {
    const pretouch_plant &p = loop.plant;
    const Lanes command = p.stiffness * (w.position - b.x) - p.own_damping * b.v + w.command;
    const bool lags = p.servo_rate > 0.0;
    Lanes driven = lags ? b.servo : command;
    if (p.coulomb_friction > 0.0) {
        Lanes friction = from_bits((as_bits(b.v) & INT64_MIN) | as_bits(all(p.coulomb_friction)));
        const uint64_t slow = open & ~bits(absolute(b.v) > 20.0 * p.friction_speed);
        if (slow) friction = slow_friction(b.v, friction, slow);
        driven -= friction;
    }
    return {b.v, driven * inverse_mass, lags ? p.servo_rate * (command - b.servo) : all(0.0), b.vo, ao};
}

// Coulomb friction [N]: in slow lanes by tanh, in the others as it is.
Lanes Group::slow_friction(Lanes speed_of_robot, Lanes friction, uint64_t slow) const {
    const pretouch_plant &p = loop.plant;
    alignas(64) double frictions[WIDTH], speeds[WIDTH];
    store(frictions, friction);
    store(speeds, speed_of_robot);
    for (int i = 0; slow >> i; i++)
        if (slow >> i & 1) frictions[i] = p.coulomb_friction * tanh(speeds[i] / p.friction_speed);
    return load(frictions);
}

// The virtual object at a time within the period.
inline Group::Wanted Group::wanted_at(const Course &target, double at) const {
    const double place = at / loop.period;
    return {target.at(place), loop.plant.reference_damping * (target.slope(place) / loop.period) +
                                  loop.plant.feedforward_mass * acceleration};
}

// Robot, servo and obstacle h [s] later, by the same Runge-Kutta method as in loop_mechanics.cpp.
[[gnu::always_inline]] inline Bodies Group::advance(double h, const Wanted &first, const Wanted &middle,
                                                    const Wanted &last) const {
    const double half = 0.5 * h, sixth = h / 6.0;
    const Bodies k1 = slopes(body, first);
    const Bodies k2 = slopes(along(body, k1, half), middle);
    const Bodies k3 = slopes(along(body, k2, half), middle);
    const Bodies k4 = slopes(along(body, k3, h), last);
    const auto mean = [sixth](Lanes start, Lanes a, Lanes m1, Lanes m2, Lanes z) {
        return start + sixth * (a + 2.0 * (m1 + m2) + z);
    };
    return {mean(body.x, k1.x, k2.x, k3.x, k4.x), mean(body.v, k1.v, k2.v, k3.v, k4.v),
            mean(body.servo, k1.servo, k2.servo, k3.servo, k4.servo),
            mean(body.xo, k1.xo, k2.xo, k3.xo, k4.xo), mean(body.vo, k1.vo, k2.vo, k3.vo, k4.vo)};
}

// Simulate the bodies and the sampling of the sensor over one period of the controller.
template <bool is_ideal> void Group::follow_period() {
    const double period = loop.period;
    const Course target = course_between(xv, vv * period, position, velocity * period);
    const auto way_at = [this](Lanes along_leg) {
        return gone + (absolute(vo0) + 0.5 * absolute(ao) * along_leg) * along_leg;
    };
    const auto doubt_of = [this](Lanes x, Lanes way) {
        return 1e-12 * (absolute(x0) + absolute(x) + absolute(start_xo) + way);
    };
    const Lanes longest_way = way_at(t + 2.0 * period - since);  // at least the way at the end of any step
    Wanted here{}, middle{}, last{};
    if constexpr (!is_ideal) here = wanted_at(target, 0.0);
    for (double at = 0.0; at < period - INSTANT;) {
        const double whole = period - at;
        const double h = !is_ideal && loop.plant_step < whole ? loop.plant_step : whole;
        const Lanes later = (t + at) + h;
        Bodies moved;
        if constexpr (is_ideal) {
            const Lanes along_leg = later - since;
            moved = {position, velocity, all(0.0), xo0 + along_leg * (vo0 + 0.5 * ao * along_leg), vo0 + ao * along_leg};
        } else {
            middle = wanted_at(target, at + 0.5 * h);
            last = wanted_at(target, at + h);
            moved = advance(h, here, middle, last);
            here = last;
        }
        const Lanes start = body.xo - body.x, start_slope = (body.vo - body.v) * h;
        const Lanes end = moved.xo - moved.x, end_slope = (moved.vo - moved.v) * h;
        const Lanes lowest = smaller(start, end);
        // If this is true, the exact test of first_touch is true as well: TOWARD is above 1/3 by more than its rounding
        // error, and the longest way is no shorter than the way at the end of the step.
        const Masks apart = (end > doubt_of(moved.x, longest_way)) &
                            (smaller(start + TOWARD * smaller(start_slope, all(0.0)),
                                     end - TOWARD * larger(end_slope, all(0.0))) >= lowest);
        const uint64_t doubtful = open & ~bits(apart), due = open & bits(load(instants) <= later + INSTANT);
        Lanes nearest = lowest;
        if (doubtful) {
            const Lanes doubt = doubt_of(moved.x, way_at(later - since));
            alignas(64) double least[WIDTH];
            store(least, lowest);
            for (int i = 0; i < WIDTH; i++)
                if (doubtful >> i & 1 && pretouch_first_touch(start[i], start_slope[i], end[i], end_slope[i], doubt[i],
                                                              least + i) <= 1.0)
                    leave(i, at, true);
            nearest = load(least);
        }
        rate = is_ideal ? (velocity - vv) / period : (moved.v - body.v) / h;
        hardest = larger(hardest, absolute(rate));
        if (open & due) {
            const Course distance = course_between(start, start_slope, end, end_slope);
            alignas(64) double gap[4][WIDTH];
            store(gap[0], distance.start);
            store(gap[1], distance.start_slope);
            store(gap[2], distance.second);
            store(gap[3], distance.third);
            for (int i = 0; i < WIDTH; i++) {
                if (!(open & due & 1ull << i)) continue;
                const double begun = t[i];
                pretouch::Sensor &sensor = sensors[i];
                while (sensor.instant <= begun + at + h + INSTANT) {
                    double s = (sensor.instant - begun - at) / h;
                    s = 0.0 > s ? 0.0 : s;
                    s = 1.0 < s ? 1.0 : s;
                    pretouch::look(sensor, gap[0][i] + s * (gap[1][i] + s * (gap[2][i] + s * gap[3][i])));
                }
                instants[i] = sensor.instant;
                arrivals[i] = pretouch::next_arrival(sensor);
            }
        }
        body = moved;
        at += h;
        closest = smaller(closest, nearest);
        const Lanes now = t + at;
        excursion = larger(excursion, absolute(body.x - reference_at(now)));
        travel = larger(travel, absolute(body.x - x0));
        fastest = larger(fastest, absolute(body.v));
        advancing = larger(advancing, body.v - (vd + ad * now));
        if (!(at < period - INSTANT)) {
            const uint64_t lost = open & ~bits(is_finite(body.x) & is_finite(body.v));
            for (int i = 0; lost >> i; i++)
                if (lost >> i & 1) leave(i, at, true);
        }
        if (!(at < period - INSTANT)) end_time = now;
    }
    xv = position;
    vv = velocity;
}

// Simulate all encounters. periods: number of periods until the horizon.
template <bool is_ideal> void Group::follow(double periods) {
    while (open) {
        t = number * loop.period;
        // overlapping bodies exert a contact force, which only the code of a single encounter computes
        const uint64_t ended = open & (bits(number >= periods) | ~bits(body.x - body.xo < 0.0));
        for (int i = 0; ended >> i; i++) {
            bool ends = ended >> i & 1;
            while (ends) {
                leave(i, 0.0, false);
                refill(i);
                ends = is_open(i) && is_at_end(i, periods);
            }
        }
        if (loop.stretches_each)
            for (int i = 0; i < WIDTH; i++) follow_course(i, periods);
        last_x = body.x;
        last_v = body.v;
        last_xo = body.xo;
        last_vo = body.vo;
        ask_laws();
        follow_period<is_ideal>();
        number += 1.0;
        if (open != (1ull << WIDTH) - 1)
            for (int i = 0; i < WIDTH; i++)
                if (!is_open(i)) refill(i);
    }
}

void Group::run() {
    const double periods = ceil(loop.horizon / loop.period - 1e-9);
    for (int i = 0; i < WIDTH; i++) refill(i);
    if (ideal)
        follow<true>(periods);
    else
        follow<false>(periods);
}

}  // namespace

static_assert(WIDTH <= pretouch::MOST_LANES);

void run_side_by_side(const pretouch_loop *loop, const int64_t *which, int64_t n, void *states,
                      pretouch_reading *waiting, int64_t room) {
    Group(*loop, which, n, static_cast<char *>(states), waiting, room).run();
}

}  // namespace PRETOUCH_VARIANT
