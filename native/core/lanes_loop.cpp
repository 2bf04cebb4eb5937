// Encounters of the sampled loop side by side, one in each lane, until their first contact.
//
// The law's limits and motion, the robot and the obstacle advance in lanes. Sensor, filters and the rest of the law are
// those of a single encounter, called for each lane. Whatever is rare (a touch, a limit of the motion, the end) is left
// to the code of a single encounter, too. This file is compiled without fused multiplication and addition, and follows
// the order of the operations in loop*.cpp and pretouch_law.c: each result has the same bits as that of an encounter
// that runs alone, on every processor.

#include "approach.hpp"
#include "lanes.hpp"
#include "lanes_kernels.hpp"

#include <math.h>
#include <string.h>

namespace PRETOUCH_VARIANT {

namespace {

constexpr double INSTANT = 1e-12;      // s: as in loop.hpp
constexpr double ROUNDING = 1e-9;      // of an impulse: as in pretouch_law.c
constexpr double ANY_REFERENCE = 1e6;  // as in pretouch_law.c

inline Lanes larger(Lanes a, Lanes b) { return where(b > a, b, a); }
inline Lanes smaller(Lanes a, Lanes b) { return where(b < a, b, a); }
inline Lanes within(Lanes value, Lanes limit) { return larger(smaller(value, limit), -limit); }
inline Masks is_finite(Lanes x) { return absolute(x) < INFINITE; }

inline Masks masks_of(const int64_t *from) {
    Masks value;
    memcpy(&value, from, sizeof value);
    return value;
}

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

// A cubic over a step or a period, by its slopes over the whole of it.
struct Course {
    Lanes start, start_slope, second, third;

    Lanes at(double s) const { return start + s * (start_slope + s * (second + s * third)); }
    Lanes slope(double s) const { return start_slope + s * (2.0 * second + s * 3.0 * third); }
};

inline Course course_between(Lanes start, Lanes start_slope, Lanes end, Lanes end_slope) {
    return {start, start_slope, 3.0 * (end - start) - 2.0 * start_slope - end_slope,
            start_slope + end_slope - 2.0 * (end - start)};
}

struct Bodies {
    Lanes x, v, servo, xo, vo;
};

inline Bodies along(const Bodies &b, const Bodies &k, double h) {
    return {b.x + h * k.x, b.v + h * k.v, b.servo + h * k.servo, b.xo + h * k.xo, b.vo + h * k.vo};
}

// The numbers of the drive of a law, pretouch_drive_numbers.
struct Drive {
    Lanes hold, fade_step, largest_force, contact_gain, threshold;
    Lanes xx, xv, vx, vv, xf, vf;
    Lanes speed, acceleration, excursion;
};

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

    int64_t next = 0, index[WIDTH], period_number[WIDTH];
    uint64_t open = 0;  // a bit for each lane with an encounter that is not at its end
    alignas(64) char sensors[WIDTH][pretouch::SENSOR_SIZE];

    alignas(64) double times[WIDTH] = {}, instants[WIDTH] = {};  // t, and of the next sample
    Lanes t{}, instant{};
    Bodies body{};
    Lanes last_x{}, last_v{}, last_xo{}, last_vo{}, end_time{}, xv{}, vv{}, rate{}, acting{};
    Lanes detection_time{}, closest{}, excursion{}, travel{}, fastest{}, strongest{}, hardest{};
    Lanes x0{}, start_xo{}, xd{}, vd{}, ad{};               // of the scene
    Lanes since{}, until{}, xo0{}, vo0{}, ao{}, gone{};  // of the obstacle's leg
    int64_t stretch[WIDTH];
    Lanes steady{}, rest{}, ahead{}, fading{}, motion{}, speed{}, reference{};  // of the law's drive
    Drive drive{};
    Lanes position{}, velocity{}, acceleration{}, force{};  // of the law's output
    double log_level[WIDTH];
    int32_t status[WIDTH], flags[WIDTH];

    pretouch_state *state_of(int lane) { return reinterpret_cast<pretouch_state *>(states + lane * loop.laws.state_size); }
    const pretouch_parameters *parameters_of(int lane) const {
        const pretouch_laws &laws = loop.laws;
        return reinterpret_cast<const pretouch_parameters *>(laws.parameters +
                                                             laws.law_of[index[lane]] * laws.parameters_size);
    }
    Lanes reference_at(Lanes time) const { return xd + time * (vd + 0.5 * ad * time); }

    void begin(int lane);
    void load_drive(int lane);
    void set_leg(int lane, const pretouch::Leg &leg);
    pretouch::Leg leg_of(int i) const { return {since[i], until[i], xo0[i], vo0[i], ao[i], gone[i]}; }
    pretouch::Approach approach_of(int lane, double at, bool asked);
    bool is_at_end(int lane, int64_t periods) const {
        return period_number[lane] >= periods || !(body.x[lane] - body.xo[lane] < 0.0);
    }
    void follow_course(int lane, int64_t periods);
    void visit(int lane);
    void leave(int lane, double at, bool asked);
    void refill(int lane);
    void ask_laws();
    void step_alone(int lane, const pretouch_observation &seen, const pretouch_push &push, pretouch_sample &sample);
    bool is_open(int lane) const { return open >> lane & 1; }
    void follow_period();
    Bodies advance(double at, double h, const Course &target) const;
    Bodies slopes(const Bodies &b, Lanes wanted, Lanes command) const;
};

// Begins the next encounter in a lane, as the constructor of Encounter does.
void Group::begin(int i) {
    const int64_t k = index[i] = which[next++];
    const pretouch_scene &s = loop.scenes[k];
    memcpy(state_of(i), loop.laws.states + loop.laws.start_of[k] * loop.laws.state_size,
           static_cast<size_t>(loop.laws.state_size));
    const pretouch_drive_numbers &d = parameters_of(i)->drive;
    open |= 1ull << i;
    period_number[i] = 0;
    times[i] = t[i] = 0.0;
    instants[i] = instant[i] = pretouch::start_sensor(sensors[i], loop, k, waiting + i * room, room);
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
    flags[i] = 0;
    load_drive(i);
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

// Takes the state of the law's drive from the law.
void Group::load_drive(int i) {
    const pretouch_drive_state &driven = state_of(i)->drive;
    steady[i] = driven.delivery.steady;
    rest[i] = driven.delivery.rest;
    ahead[i] = driven.delivery.ahead;
    fading[i] = driven.delivery.fading;
    motion[i] = driven.motion.position;
    speed[i] = driven.motion.velocity;
    reference[i] = driven.reference;
}

void Group::set_leg(int i, const pretouch::Leg &leg) {
    since[i] = leg.since;
    until[i] = leg.until;
    xo0[i] = leg.xo;
    vo0[i] = leg.vo;
    ao[i] = leg.ao;
    gone[i] = leg.way;
}

// Brings a lane to a period without an end of a leg. The code of a single encounter follows periods with one.
void Group::follow_course(int i, int64_t periods) {
    while (is_open(i)) {
        if (is_at_end(i, periods)) {
            leave(i, 0.0, false);
            refill(i);
            continue;
        }
        while (times[i] >= until[i] - INSTANT) set_leg(i, pretouch::leg_after(loop, index[i], leg_of(i), stretch[i]++));
        if (until[i] > times[i] + loop.period + INSTANT) return;
        visit(i);
        if (!is_open(i)) refill(i);
    }
}

void Group::refill(int lane) {
    if (next < count) begin(lane);
}

// An encounter for the code of a single one. The law gets the state of its drive.
pretouch::Approach Group::approach_of(int i, double at, bool asked) {
    pretouch_drive_state &driven = state_of(i)->drive;
    driven.delivery = {steady[i], rest[i], ahead[i], fading[i]};
    driven.motion = {motion[i], speed[i]};
    driven.reference = reference[i];
    return {
        period_number[i], t[i], at, end_time[i], body.x[i], body.v[i], body.servo[i], body.xo[i], body.vo[i],
        last_x[i], last_v[i], last_xo[i], last_vo[i], xv[i], vv[i], rate[i], acting[i], detection_time[i], closest[i], excursion[i], travel[i], fastest[i], strongest[i],
        hardest[i], {position[i], velocity[i], acceleration[i], force[i], log_level[i], status[i]}, flags[i], asked,
        leg_of(i), stretch[i]};
}

// Leaves the rest of an encounter to the code of a single one.
void Group::leave(int i, double at, bool asked) {
    pretouch::continue_encounter(loop, index[i], state_of(i), sensors[i], approach_of(i, at, asked));
    open &= ~(1ull << i);
}

// Leaves a period of an encounter to the code of a single one.
void Group::visit(int i) {
    pretouch::Approach a = approach_of(i, 0.0, false);
    if (!pretouch::continue_period(loop, index[i], state_of(i), sensors[i], a)) {
        open &= ~(1ull << i);
        return;
    }
    load_drive(i);
    period_number[i] = a.period;
    times[i] = t[i] = static_cast<double>(a.period) * loop.period;
    instants[i] = instant[i] = pretouch::next_sample(sensors[i]);
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
    position[i] = a.output.position;
    velocity[i] = a.output.velocity;
    acceleration[i] = a.output.acceleration;
    force[i] = a.output.virtual_force;
    log_level[i] = a.output.log_level;
    status[i] = a.output.status;
    flags[i] = a.flags;
    set_leg(i, a.leg);
    stretch[i] = a.stretch;
}

// The drive of one lane by the law itself, for limits and faults.
void Group::step_alone(int i, const pretouch_observation &seen, const pretouch_push &push, pretouch_sample &sample) {
    pretouch_drive_state driven = {{steady[i], rest[i], ahead[i], fading[i]}, {motion[i], speed[i]}, reference[i]};
    pretouch_output out;
    sample.contact_force = -0.0;
    sample.reference_position = reference_at(t)[i];
    sample.reference_velocity = vd[i] + ad[i] * t[i];
    sample.reference_acceleration = ad[i];
    pretouch_drive(&parameters_of(i)->drive, &driven, &seen, &push, &sample, &out);
    steady[i] = driven.delivery.steady;
    rest[i] = driven.delivery.rest;
    ahead[i] = driven.delivery.ahead;
    fading[i] = driven.delivery.fading;
    motion[i] = driven.motion.position;
    speed[i] = driven.motion.velocity;
    reference[i] = driven.reference;
    position[i] = out.position;
    velocity[i] = out.velocity;
    acceleration[i] = out.acceleration;
    force[i] = out.virtual_force;
    status[i] = out.status;
}

// Passes the available readings to the laws, which move the virtual objects over the period.
void Group::ask_laws() {
    pretouch_observation seen[WIDTH];
    pretouch_push push[WIDTH];
    pretouch_sample sample[WIDTH];
    // arrays: a vector whose lanes are set one by one would go through memory each time
    alignas(64) double impulses[WIDTH] = {};
    alignas(64) int64_t usables[WIDTH] = {}, stales[WIDTH] = {}, losses[WIDTH] = {};
    for (int i = 0; i < WIDTH; i++) {
        push[i] = {0.0, 0.0};
        status[i] = 0;
        if (!is_open(i)) continue;
        double measured;
        const pretouch_parameters *p = parameters_of(i);
        sample[i].fresh = pretouch::deliver_reading(sensors[i], times[i], &sample[i].reading, &measured);
        const double age = times[i] - measured;
        sample[i].age = 0.0 > age ? 0.0 : age;
        pretouch_observe(&p->sensing, &state_of(i)->sensing, &sample[i], &seen[i]);
        pretouch_damp(&p->law, &state_of(i)->law, &seen[i], &push[i]);
        impulses[i] = push[i].impulse;
        usables[i] = -seen[i].usable;
        stales[i] = -seen[i].stale;
        losses[i] = -seen[i].lost;
        log_level[i] = seen[i].log_level;
    }
    const double period = loop.period;
    const Lanes impulse = load(impulses);
    const Masks usable = masks_of(usables), stale = masks_of(stales), lost = masks_of(losses);
    // deliver of pretouch_law.c
    const Lanes owed = impulse + rest, due = owed - ahead, none = all(0.0);
    const Masks covers = ((owed > 0.0) & (0.0 < due)) | ((owed < 0.0) & (0.0 > due));
    const Lanes new_steady = where(covers, within(due / drive.hold, drive.largest_force), none);
    const Lanes now_steady = where(usable, new_steady, steady);
    const Lanes left = where(usable, new_steady * drive.hold, rest);
    const Lanes now_ahead = where(usable, where(covers, none, -due), ahead);
    const Lanes now_fading = where(usable, all(1.0), fading);
    const Lanes given = now_steady * period;
    const Masks lasts = left != 0.0, last = absolute(left) <= absolute(given) * (1 + ROUNDING);
    const Masks fades = ~lasts & stale;
    const Lanes faded = larger(now_fading - drive.fade_step, none), fading_force = now_steady * faded;
    const Lanes delivered =
        where(lasts, where(last, left / period, now_steady), where(stale, fading_force, none));
    // pretouch_drive
    const Lanes virtual_force = within(delivered + 0.0, drive.largest_force);
    const Lanes total = virtual_force + drive.contact_gain * -0.0;
    const Lanes next_x = drive.xx * motion + drive.xv * speed + drive.xf * total;
    const Lanes next_v = drive.vx * motion + drive.vv * speed + drive.vf * total;
    // limit_motion: whether no limit acts
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
    rest = where(plain, where(lasts & ~last, left - given, none), rest);
    ahead = where(plain, where(fades, where(lost, none, now_ahead + fading_force * period), now_ahead), ahead);
    fading = where(plain, where(fades, faded, now_fading), fading);
    motion = where(plain, next_x, motion);
    speed = where(plain, next_v, speed);
    reference = where(plain, x, reference);
    const uint64_t limited = bits(absolute(virtual_force) >= drive.largest_force);
    const uint64_t pressed = bits(0.0 >= drive.threshold), common = bits(plain);
    for (int i = 0; i < WIDTH; i++) {
        if (!is_open(i)) continue;
        if (common >> i & 1)
            status[i] = seen[i].status + (limited >> i & 1 ? PRETOUCH_FORCE_LIMITED : 0) +
                        (pressed >> i & 1 ? PRETOUCH_IN_CONTACT : 0);
        else
            step_alone(i, seen[i], push[i], sample[i]);
        flags[i] |= status[i];
        if (status[i] & PRETOUCH_DETECTING && isnan(detection_time[i])) detection_time[i] = t[i];
    }
    strongest = larger(strongest, absolute(force));
    acting = force;
}

Bodies Group::slopes(const Bodies &b, Lanes wanted, Lanes extra) const {
    const pretouch_plant &p = loop.plant;
    const Lanes command = p.stiffness * (wanted - b.x) - p.own_damping * b.v + extra;
    const bool lags = p.servo_rate > 0.0;
    Lanes driven = lags ? b.servo : command;
    if (p.coulomb_friction > 0.0) {
        alignas(64) double friction[WIDTH], speeds[WIDTH];
        store(friction, from_bits((as_bits(b.v) & INT64_MIN) | as_bits(all(p.coulomb_friction))));
        store(speeds, b.v);
        const uint64_t slow = open & ~bits(absolute(b.v) > 20.0 * p.friction_speed);
        for (int i = 0; slow >> i; i++)
            if (slow >> i & 1) friction[i] = p.coulomb_friction * tanh(speeds[i] / p.friction_speed);
        driven -= load(friction);
    }
    return {b.v, driven * inverse_mass, lags ? p.servo_rate * (command - b.servo) : all(0.0), b.vo, ao};
}

// Plant and obstacle h [s] later, by the Runge-Kutta method of loop_mechanics.cpp.
Bodies Group::advance(double at, double h, const Course &target) const {
    const double half = 0.5 * h, sixth = h / 6.0, period = loop.period;
    const Lanes feedforward = loop.plant.feedforward_mass * acceleration;
    const double places[] = {at / period, (at + half) / period, (at + h) / period};
    Lanes wanted[3], extra[3];
    for (int i = 0; i < 3; i++) {
        wanted[i] = target.at(places[i]);
        extra[i] = loop.plant.reference_damping * (target.slope(places[i]) / period) + feedforward;
    }
    const Bodies k1 = slopes(body, wanted[0], extra[0]);
    const Bodies k2 = slopes(along(body, k1, half), wanted[1], extra[1]);
    const Bodies k3 = slopes(along(body, k2, half), wanted[1], extra[1]);
    const Bodies k4 = slopes(along(body, k3, h), wanted[2], extra[2]);
    const auto mean = [sixth](Lanes start, Lanes a, Lanes m1, Lanes m2, Lanes z) {
        return start + sixth * (a + 2.0 * (m1 + m2) + z);
    };
    return {mean(body.x, k1.x, k2.x, k3.x, k4.x), mean(body.v, k1.v, k2.v, k3.v, k4.v),
            mean(body.servo, k1.servo, k2.servo, k3.servo, k4.servo),
            mean(body.xo, k1.xo, k2.xo, k3.xo, k4.xo), mean(body.vo, k1.vo, k2.vo, k3.vo, k4.vo)};
}

void Group::follow_period() {
    const double period = loop.period;
    const Course target = course_between(xv, vv * period, position, velocity * period);
    for (double at = 0.0; at < period - INSTANT;) {
        const double whole = period - at;
        const double h = !ideal && loop.plant_step < whole ? loop.plant_step : whole;
        const Lanes later = (t + at) + h, along_leg = later - since;
        Bodies moved;
        if (ideal)
            moved = {position, velocity, all(0.0), xo0 + along_leg * (vo0 + 0.5 * ao * along_leg), vo0 + ao * along_leg};
        else
            moved = advance(at, h, target);
        const Lanes start = body.xo - body.x, start_slope = (body.vo - body.v) * h;
        const Lanes end = moved.xo - moved.x, end_slope = (moved.vo - moved.v) * h;
        const Lanes way = gone + (absolute(vo0) + 0.5 * absolute(ao) * along_leg) * along_leg;
        const Lanes doubt = 1e-12 * (absolute(x0) + absolute(moved.x) + absolute(start_xo) + way);
        const Lanes lowest = smaller(start, end);
        const Masks apart = (end > doubt) & (smaller(start + start_slope / 3.0, end - end_slope / 3.0) >= lowest);
        alignas(64) double gap[4][WIDTH], least[WIDTH];
        store(least, lowest);
        const uint64_t doubtful = open & ~bits(apart), due = bits(instant <= later + INSTANT);
        if (doubtful) {
            for (int i = 0; i < WIDTH; i++)
                if (doubtful >> i & 1 && pretouch_first_touch(start[i], start_slope[i], end[i], end_slope[i], doubt[i],
                                                              least + i) <= 1.0)
                    leave(i, at, true);
        }
        rate = ideal ? (velocity - vv) / period : (moved.v - body.v) / h;
        hardest = larger(hardest, absolute(rate));
        if (open & due) {
            const Course distance = course_between(start, start_slope, end, end_slope);
            store(gap[0], distance.start);
            store(gap[1], distance.start_slope);
            store(gap[2], distance.second);
            store(gap[3], distance.third);
            for (int i = 0; i < WIDTH; i++) {
                if (!(open & due & 1ull << i)) continue;
                const double since = times[i];
                double moment = instants[i];
                while (moment <= since + at + h + INSTANT) {
                    double s = (moment - since - at) / h;
                    s = 0.0 > s ? 0.0 : s;
                    s = 1.0 < s ? 1.0 : s;
                    moment = pretouch::sample_distance(
                        sensors[i], gap[0][i] + s * (gap[1][i] + s * (gap[2][i] + s * gap[3][i])));
                }
                instants[i] = moment;
            }
            instant = load(instants);
        }
        body = moved;
        at += h;
        closest = smaller(closest, load(least));
        const Lanes now = t + at;
        excursion = larger(excursion, absolute(body.x - reference_at(now)));
        travel = larger(travel, absolute(body.x - x0));
        fastest = larger(fastest, absolute(body.v));
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

void Group::run() {
    const int64_t periods = static_cast<int64_t>(ceil(loop.horizon / loop.period - 1e-9));
    for (int i = 0; i < WIDTH; i++) {
        log_level[i] = 0.0;
        refill(i);
    }
    while (open) {
        for (int i = 0; i < WIDTH; i++) {
            if (is_open(i)) times[i] = static_cast<double>(period_number[i]) * loop.period;
        }
        t = load(times);
        // bodies that overlap have a force, which only the code of a single encounter knows
        const uint64_t apart = bits(body.x - body.xo < 0.0);
        for (int i = 0; i < WIDTH; i++) {
            bool ends = is_open(i) && (period_number[i] >= periods || !(apart >> i & 1));
            while (ends) {
                leave(i, 0.0, false);
                refill(i);
                ends = is_open(i) && is_at_end(i, periods);
            }
        }
        if (loop.stretches_each) {
            for (int i = 0; i < WIDTH; i++) follow_course(i, periods);
            t = load(times);
        }
        last_x = body.x;
        last_v = body.v;
        last_xo = body.xo;
        last_vo = body.vo;
        ask_laws();
        follow_period();
        for (int i = 0; i < WIDTH; i++) {
            if (is_open(i))
                period_number[i]++;
            else
                refill(i);
        }
    }
}

}  // namespace

static_assert(WIDTH <= pretouch::MOST_LANES);

void run_side_by_side(const pretouch_loop *loop, const int64_t *which, int64_t n, void *states,
                      pretouch_reading *waiting, int64_t room) {
    Group(*loop, which, n, static_cast<char *>(states), waiting, room).run();
}

}  // namespace PRETOUCH_VARIANT
