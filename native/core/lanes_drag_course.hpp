// One encounter under the virtual drag whose obstacle has a course.
//
// The drag acts only in an approach, l' < 0, and switches off the pull of the admittance toward the object:
//
//     M x~'' = -phi s'^2 - max(P, 0)   for l' < 0,      M x~'' = -P   for l' > 0,      P = K x~ + D x~',
//
// with s' = d(ln xi)/dt. So a motion consists of parts with an analytic equation each:
//
//     HELD    l' < 0 and P <= 0: the admittance does not act
//     ACTING  l' < 0 and P >= 0: drag and admittance act
//     AWAY    l' > 0: only the admittance acts
//     ALONG   l' = 0: l'' would be positive after an approach and negative after a recession, so that x~'' = a
//
// A part ends when l' or P changes its sign. Each step is the Taylor series of one part, or a long step of its stiff
// motion. A step is accepted only if its coefficients prove that l' changes its sign at most once, and P as well. It
// ends at the first change.

#pragma once

#include "gauss_tables.hpp"
#include "lanes_encounter.hpp"

namespace PRETOUCH_VARIANT {

namespace {

// Outputs of one encounter. impulse: the time integral of the admittance's force [N s]; steps: the number of steps with
// a drag; nodes: if not null, for each of these steps and each of 16 Gauss points the weight [s], l [m] and l' [m/s].
struct DragOutputs {
    double *impulse;
    int64_t *steps;
    double (*nodes)[3];
};

struct DragEncounter : Encounter {
    enum Part { HELD, ACTING, AWAY, ALONG };

    static constexpr double NOISE = 1e-14;  // rounding error of P, relative to its terms
    static constexpr int STUCK = 8;         // changes of the part at one time; then P is zero within rounding

    const DragOutputs wanted;
    Part part = HELD;
    double impulse = 0;
    int64_t steps = 0, changes = 0;

    DragEncounter(const Values &values, double drag, const pretouch_pieces &along, double until, const Samples &at,
                  Course &course, const Sections &sections, const DragOutputs &outputs)
        : Encounter(values, -drag, along, until, at, nullptr, course, sections), wanted(outputs) {
        row.settling_distance = NOT_A_NUMBER;
        choose_part();
    }

    bool approaches() const { return part == HELD || part == ACTING; }

    // The force of the admittance away from the object [N], and its derivative by time if l is constant.
    double pull() const {
        return m.stiffness * (obstacle_at(m, time) - l) + m.damping * (obstacle_speed(m, time) - speed);
    }
    double pull_rate() const { return m.stiffness * obstacle_speed(m, time) + m.damping * m.a; }

    // Choose the part of the motion from the present state.
    void choose_part() {
        if (speed > 0) part = AWAY;
        else if (speed < 0) part = pull() > 0 ? ACTING : HELD;
        else part = part_at_rest();
        start_part();
    }

    // The part after l' = 0. The limits of l'' from both sides decide. If both are zero, their derivatives decide.
    Part part_at_rest() const {
        const double force = pull(), before = m.a + larger(force, 0) / m.mass, after = m.a + force / m.mass;
        if (before < 0) return force > 0 ? ACTING : HELD;
        if (after > 0) return AWAY;
        if (after < 0 || before > 0) return ALONG;
        const double rate = pull_rate(), change = rate != 0 ? rate : m.stiffness * m.a;
        if (change > 0) return AWAY;
        return change < 0 && force > 0 ? ACTING : ALONG;
    }

    // Start values of the step control, from the rates of the equation of this part.
    void start_part() {
        const double slope = fabs(slope_at(piece, l).value), used = part == HELD ? 0.0 : 1.0;
        const double rate = (used * m.damping + (approaches() ? 2 * -gain * slope * slope * fabs(speed) : 0)) / m.mass +
                            used * sqrt(m.stiffness / m.mass);
        const double slow = rate > 0 ? 1.0 / rate : 1.0, crossing = 2 * piece.half / larger(fabs(speed), 1e-12);
        taylor = larger(smaller(smaller(slow, crossing), horizon), SHORTEST_UNIT);
        pace = {0, PATIENCE, PATIENCE, 0};
    }

    // Whether the object can never approach again. The encounter then ends.
    bool is_final() {
        if (later.count || approaches() || m.a < 0) return false;
        row.settling_distance = part == ALONG && m.v == 0 && m.a == 0 ? l : INFINITY;
        return true;
    }

    // Fill the series of l, and that of s'^2 if the drag acts, up to the unit of time.
    void expand_part() {
        const bool acts = part != HELD, drags = approaches();
        const double by_speed = acts ? m.damping / m.mass : 0, by_place = acts ? m.stiffness / m.mass : 0;
        const double x[3] = {obstacle_at(m, time), obstacle_speed(m, time), m.a / 2}, strength = -gain / m.mass;
        LogCurve<DEGREE> along(motion.terms, motion.middle, all(l), all(0.0));
        double c[ORDER + 1], rates[ORDER], squares[ORDER] = {};
        c[0] = l;
        c[1] = speed;
        unrolled<0, ORDER - 1>([&](auto place) __attribute__((always_inline)) {
            constexpr int k = decltype(place)::value;
            const double v = (k + 1) * c[k + 1];
            double total = -by_place * c[k] - by_speed * v;
            if constexpr (k < 3) total += by_place * x[k];
            if constexpr (k < 2) total += by_speed * (k + 1) * x[k + 1];
            if constexpr (k == 0) total += m.a;
            if (drags) {
                along.template pulled<k>(all(0.0), all(c[k + 1]), all(v));
                rates[k] = along.slope[0] * v + along.beyond[0] * (k + 1);
                double square = 0;
                for (int i = 0; i <= k; i++) square += rates[i] * rates[k - i];
                squares[k] = square;
                total += strength * square;
            }
            c[k + 2] = total / ((k + 1) * (k + 2));
        });
        double power = 1;
        for (int k = 0; k <= ORDER; k++) {
            b[k] = c[k] * power;
            if (k < ORDER - 1) force[k] = squares[k] * power;
            power *= unit;
        }
    }

    // Compute the series of the next step; see Encounter::expand_step.
    double expand_drag_step() {
        const Borders used = curve.borders(index, 0);
        const double way = speed < 0 ? l - used.low : used.high - l, remaining = smaller(horizon, section_end()) - time;
        const double useful = smaller(remaining, AHEAD * way / larger(fabs(speed), 1e-300));
        memset(b, 0, sizeof b);
        memset(force, 0, sizeof force);
        Values acting = m;
        if (part == HELD) acting.damping = acting.stiffness = 0;
        unit = long_step(acting, approaches() ? gain : 0.0, piece, {time, l, speed}, taylor, useful, pace, b, force, 2);
        if (unit != 0) {
            if (!approaches()) memset(force, 0, sizeof force);
            return smaller(1, remaining / unit);
        }
        unit = taylor;
        expand_part();
        const double tau = reach();
        taylor = larger(smaller(unit * tau, horizon), SHORTEST_UNIT);
        pace.doubt = LEFT_OUT * SLOW * scale() / taylor;
        return smaller(tau, remaining / unit);
    }

    // Shorten the step until P is proved to keep its sign, or to change it once. Return whether the step ends with that
    // change.
    bool end_with_pull(double &tau) const {
        if (part == AWAY || (m.damping == 0 && m.stiffness == 0) || changes > STUCK) return false;
        const double x[3] = {obstacle_at(m, time), obstacle_speed(m, time) * unit, m.a / 2 * unit * unit};
        const double sign = part == HELD ? -1 : 1;
        const double displacement = x[0] - l, own = obstacle_speed(m, time) - speed;
        if (part == HELD && displacement <= 0 && own <= 0) return false;  // x~'' <= 0, so P cannot become positive
        double q[ORDER + 1], p[ORDER + 1];
        for (int k = 0; k <= ORDER; k++) q[k] = k < 3 ? x[k] - b[k] : -b[k];
        for (int k = 0; k <= ORDER; k++) {
            p[k] = sign * (m.stiffness * q[k] + (k < ORDER ? m.damping * (k + 1) * q[k + 1] / unit : 0.0));
        }
        const double terms = m.stiffness * (fabs(x[0]) + l) + m.damping * (fabs(x[1]) / unit + fabs(speed));
        for (; tau > SHORTEST; tau *= 0.5) {
            double rest = 0, bend = 0, power = 1;
            for (int k = 1; k <= ORDER; k++) {
                if (k > 1) bend += k * fabs(p[k]) * power;
                power *= tau;
                rest += fabs(p[k]) * power;
            }
            if (fabs(p[0]) + rest <= NOISE * terms || p[0] >= rest) return false;
            const bool lost = -p[0] > rest, monotone = fabs(p[1]) > bend;
            if (!lost && !monotone) continue;
            if (!lost && look_at(p, tau).value >= 0) return false;
            tau = lost || p[0] <= 0 ? 0 : zero_time(p, LEVEL, 0, 0, tau);
            return true;
        }
        return false;
    }

    // Whether l' and l'' are zero at the start of the step, within rounding, so that the third derivative of l decides
    // how l moves. This happens when the admittance begins to pull the robot away. l'' is then set to zero.
    bool is_released() {
        if (speed != 0) return false;
        const double place = m.stiffness * (fabs(obstacle_at(m, time)) + l);
        const double terms = fabs(m.a) + (place + m.damping * fabs(obstacle_speed(m, time))) / m.mass;
        if (2 * fabs(b[2]) > NOISE * terms * unit * unit || (b[3] > 0) != (part == AWAY)) return false;
        b[2] = 0;
        return true;
    }

    // Whether l' keeps its sign on the step [0, tau], if l' and l'' are zero at its start.
    bool moves_apart(double tau) const {
        double rest = 0, power = 1;
        for (int k = 4; k <= ORDER; k++) {
            power *= tau;
            rest += k * fabs(b[k]) * power;
        }
        return 3 * fabs(b[3]) > rest;
    }

    // Write l and l' at Gauss points of a step with a drag.
    void keep_nodes(double tau) {
        if (!approaches()) return;
        for (int i = 0; wanted.nodes && i < GAUSS; i++) {
            const Point<double> at = look_at(b, tau * GAUSS_TABLES.share[i]);
            double *node = wanted.nodes[steps * GAUSS + i];
            node[0] = GAUSS_TABLES.weight[i] / 2 * tau * unit;
            node[1] = at.value;
            node[2] = at.slope / unit;
        }
        steps++;
    }

    // Take the step [0, tau] to the distance `end`.
    void take(double tau, double end) {
        const double before = row.displacement_integral, start_x = obstacle_at(m, time) - l;
        const double duration = unit * tau;
        sample(tau);
        keep_extremes(tau);
        keep_nodes(tau);
        finish(tau, end);
        if (part == ACTING || part == AWAY) {
            impulse += m.damping * (row.displacement - start_x) +
                       m.stiffness * (row.displacement_integral - before);
        }
        if (part == ALONG) impulse -= m.mass * m.a * duration;
        if (tau > 0) changes = 0;
        set_force();
    }

    void set_force() {
        const double rate = slope_at(piece, l).value * speed;
        row.virtual_force = approaches() ? gain * rate * rate : 0.0;
    }

    // Write the present state as the end of the encounter, without a step.
    void stay() {
        memset(b, 0, sizeof b);
        memset(force, 0, sizeof force);
        unit = 1;
        const double drag = approaches() ? gain / m.mass * slope_at(piece, l).value * slope_at(piece, l).value : 0;
        b[0] = l;
        b[1] = speed;
        const double acts = part == AWAY || part == ACTING ? pull() / m.mass : 0.0;
        b[2] = part == ALONG ? 0 : (m.a + acts - drag * speed * speed) / 2;
        keep_extremes(0);
        finish(0, l);
        set_force();
    }

    // Keep the distance until the admittance pulls the robot away, or to the end of the section.
    void go_along() {
        const double bend = m.stiffness * m.a / 2, rise = pull_rate(), now = pull() + m.mass * m.a;
        const double square = rise * rise - 4 * bend * now;
        double release = INFINITY;
        if (square >= 0) {
            const double root = sqrt(square), found = rise > 0 ? -2 * now / (rise + root) : (root - rise) / (2 * bend);
            if (found >= 0) release = found;  // false for NaN
        }
        const double remaining = smaller(horizon, section_end()) - time, lasts = smaller(release, remaining);
        memset(b, 0, sizeof b);
        memset(force, 0, sizeof force);
        b[0] = l;
        if (lasts > 0) {
            unit = lasts;
            take(1, l);
        }
        speed = 0;
        if (release < remaining) part = AWAY, start_part();
        else if (!(lasts > 0)) time = smaller(horizon, section_end());
    }

    // Simulate the encounter until it ends; return how.
    Status run_drag() {
        const Status status = simulate();
        *wanted.impulse = impulse;
        *wanted.steps = steps;
        return status;
    }

    Status simulate() {
        const int64_t last = curve.count - 1, most = 4000 + 16 * curve.count;
        const double bottom = curve.bottom(0), top = curve.top(last);
        if (is_final()) return stay(), NO_CONTACT;
        if (part == AWAY && l >= top && !curve.open_ended) return stay(), LEFT_RANGE;
        if (speed < 0 && l <= bottom) return stay(), curve.ends_in_contact ? CONTACT : LEFT_RANGE;
        for (int64_t i = 0; i < most; i++) {
            if (part == ALONG) {
                go_along();
            } else {
                const Status status = advance(bottom, top);
                if (status != LATE) return status;
            }
            if (time >= horizon) return LATE;
            if (time >= section_end()) {
                m.p = later.next->p, m.v = later.next->v, m.a = later.next->a;
                later = {later.next + 1, later.count - 1};
                if (speed == 0) choose_part();
            }
            if (is_final()) return NO_CONTACT;
            if (!isfinite(l + speed)) return UNRESOLVED;
        }
        return UNRESOLVED;
    }

    // Take one step of a part with a relative motion. Return LATE if the encounter goes on.
    Status advance(double bottom, double top) {
        const int64_t last = curve.count - 1;
        double tau = expand_drag_step();
        const Borders borders = curve.borders(index, bottom);
        const bool released = is_released();
        Proof proof = certify(b, borders, tau);
        while (!(proof.monotone || proof.bent || (released && moves_apart(tau))) && tau > SHORTEST) {
            tau *= 0.5;
            proof = certify(b, borders, tau);
        }
        bool turns = !proof.monotone && b[1] != 0 && (look_at(b, tau).slope < 0) != (b[1] < 0);
        if (turns) tau = zero_time(b, TURNING, 0, 0, tau);
        const double turn = tau;
        const bool switches = end_with_pull(tau);
        turns = turns && tau == turn;
        double end = look_at(b, tau).value;
        if (turns && speed < 0 && fabs(end - borders.contact) <= resolution(m, time + unit * tau)) {
            take(tau, bottom);
            row.distance = row.closest_distance = bottom;
            row.displacement_velocity += speed;
            row.relative_velocity = row.virtual_force = 0;
            return curve.ends_in_contact ? CONTACT : LEFT_RANGE;
        }
        if (end <= borders.low && speed <= 0) {
            take(zero_time(b, LEVEL, borders.low, 0, tau), borders.low);
            if (index == 0) {
                row.distance = row.closest_distance = bottom;
                return curve.ends_in_contact ? CONTACT : LEFT_RANGE;
            }
            enter(index - 1);
            return LATE;
        }
        const double high = index == last ? larger(l, top) : borders.high;
        if (end >= high && part == AWAY) {
            take(l < high ? zero_time(b, LEVEL, high, 0, tau) : 0.0, high);
            if (index == last) {
                row.distance = top;
                return curve.open_ended ? UNRESOLVED : LEFT_RANGE;
            }
            enter(index + 1);
            return LATE;
        }
        take(tau, end);
        if (turns) {
            row.displacement_velocity += speed;
            speed = row.relative_velocity = row.virtual_force = 0;
            choose_part();
        } else if (switches) {
            part = part == HELD ? ACTING : HELD;
            changes++;
            start_part();
        }
        return LATE;
    }
};

}  // namespace

}  // namespace PRETOUCH_VARIANT
