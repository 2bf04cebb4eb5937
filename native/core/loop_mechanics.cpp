// Contact mechanics of the sampled loop: touches, time scales of contacts, and integration steps of plant and obstacle.

#include "loop.hpp"

namespace pretouch {

namespace {

// Returns the zero of a cubic that falls between low and high, by bisection.
double zero_between(const Cubic &gap, double low, double high) {
    for (int i = 0; i < 60; i++) {
        const double middle = 0.5 * (low + high);
        (gap.at(middle) > 0.0 ? low : high) = middle;
    }
    return high;
}

// Coulomb friction [N], smoothed by tanh. Most speeds are far above friction_speed; for x >= 20, tanh(x) rounds to 1
// and need not be computed.
inline double friction(const pretouch_plant &p, double v) {
    if (fabs(v) > 20.0 * p.friction_speed) return copysign(p.coulomb_friction, v);
    return p.coulomb_friction * tanh(v / p.friction_speed);
}

// Equations of motion of robot and obstacle during one step. If the bodies are apart (touching is false), the compiler
// omits the contact force, which saves a third of the time.
template <bool touching>
struct Robot {
    const pretouch_plant &plant;
    const pretouch_contact *contact;
    double inverse_mass, push, feedforward;

    // Position of the virtual object, and the part of the command that depends only on the virtual object.
    struct Wanted {
        double position, command;
    };

    Wanted wanted(const Target &target, double at) const {
        return {target.position(at), plant.reference_damping * target.velocity(at) + feedforward};
    }

    Body slopes(const Body &b, const Wanted &w) const {
        const double command = plant.stiffness * (w.position - b.x) - plant.own_damping * b.v + w.command;
        const bool lags = plant.servo_rate > 0.0;
        double drive = lags ? b.servo : command;
        if (plant.coulomb_friction > 0.0) drive -= friction(plant, b.v);
        Body k = {b.v, drive * inverse_mass, lags ? plant.servo_rate * (command - b.servo) : 0.0, b.vo, push, 0.0};
        if constexpr (touching) {
            k.impulse = contact_force(*contact, b.x - b.xo, b.v - b.vo);
            k.v -= k.impulse * inverse_mass;
            k.vo += k.impulse * contact->inverse_mass;
        }
        return k;
    }
};

inline Body along(const Body &b, const Body &k, double h) {
    return {b.x + h * k.x,   b.v + h * k.v,   b.servo + h * k.servo,
            b.xo + h * k.xo, b.vo + h * k.vo, b.impulse + h * k.impulse};
}

template <bool touching>
inline Body stepped(const Robot<touching> &robot, const Body &b, double at, double h, const Target &target) {
    const double half = 0.5 * h, sixth = h / 6.0;
    const auto middle = robot.wanted(target, at + half);
    const Body k1 = robot.slopes(b, robot.wanted(target, at));
    const Body k2 = robot.slopes(along(b, k1, half), middle);
    const Body k3 = robot.slopes(along(b, k2, half), middle);
    const Body k4 = robot.slopes(along(b, k3, h), robot.wanted(target, at + h));
    const auto mean = [sixth](double start, double a, double m1, double m2, double z) {
        return start + sixth * (a + 2.0 * (m1 + m2) + z);
    };
    return {mean(b.x, k1.x, k2.x, k3.x, k4.x),
            mean(b.v, k1.v, k2.v, k3.v, k4.v),
            mean(b.servo, k1.servo, k2.servo, k3.servo, k4.servo),
            mean(b.xo, k1.xo, k2.xo, k3.xo, k4.xo),
            mean(b.vo, k1.vo, k2.vo, k3.vo, k4.vo),
            mean(b.impulse, k1.impulse, k2.impulse, k3.impulse, k4.impulse)};
}

}  // namespace

Touch find_touch(const Cubic &gap, double doubt) {
    const double slope = gap.start_slope, second = gap.second(), third = gap.third();
    const double root = second * second - 3.0 * third * slope;
    double near = 1.0, far = 1.0;
    if (root > 0.0) {
        const double q = -second - copysign(sqrt(root), second);
        const double one = fabs(slope) < fabs(q) ? slope / q : 1.0;
        const double other = fabs(q) < fabs(3.0 * third) ? q / (3.0 * third) : 1.0;
        const double a = one > 0.0 ? one : 1.0, b = other > 0.0 ? other : 1.0;
        near = smaller(a, b);
        far = larger(a, b);
    }
    const double ends[] = {near, far, 1.0};
    double left = 0.0, before = gap.start, lowest = smaller(gap.start, gap.end);
    for (const double right : ends) {
        const double value = gap.at(right);
        lowest = smaller(lowest, value);
        if (value < before && value <= doubt) {
            const bool grazes = right < 1.0 && value >= -doubt;
            return {grazes ? right : zero_between(gap, left, right), lowest};
        }
        left = right;
        before = value;
    }
    return {2.0, lowest};
}

double contact_step(const pretouch_contact &c, double inverse_mass, double speed) {
    const double reduced = 1.0 / inverse_mass, n = c.exponent;
    const double depth = pow((n + 1.0) * 0.5 * reduced * speed * speed / c.stiffness, 1.0 / (n + 1.0));
    if (depth <= 0.0) return 1e-3;
    const double omega = sqrt(n * c.stiffness * pow(depth, n - 1.0) * inverse_mass);
    const double loss = c.damping * (c.grows != 0.0 ? pow(depth, n) : 1.0) * inverse_mass;
    return 0.02 / larger(omega, loss);
}

double elastic_duration(const pretouch_contact &c, double inverse_mass, double speed) {
    const double n = c.exponent, part = 1.0 / (n + 1.0);
    const double scale = pow(0.5 * (n + 1.0) / (c.stiffness * inverse_mass), part);  // depth / speed for a speed of 1
    // Scaled time to the deepest point, half of the contact: the integral of (1 - s^(n + 1))^(-1/2) from 0 to 1, which
    // is pi / 2 for n = 1.
    const double course = sqrt(3.14159265358979323846) * tgamma(1.0 + part) / tgamma(0.5 + part);
    return 2.0 * course * scale * pow(larger(speed, 1e-9), (1.0 - n) * part);
}

Body advance(const Body &b, double at, double h, const Target &target, const pretouch_plant &plant,
             const pretouch_contact *contact, double push) {
    const double inverse_mass = 1.0 / plant.mass, feedforward = plant.feedforward_mass * target.acceleration;
    return contact ? stepped(Robot<true>{plant, contact, inverse_mass, push, feedforward}, b, at, h, target)
                   : stepped(Robot<false>{plant, contact, inverse_mass, push, feedforward}, b, at, h, target);
}

namespace {

// Equations of motion of a linear plant with its hidden states, and of the obstacle.
struct Linear {
    const pretouch_state_space &plant;
    const pretouch_contact *contact;
    double push;
    const Target &target;

    Body slopes(const Body &b, const double *z, double at, double *dz) const {
        const int64_t n = plant.hidden, width = n + 6;
        const double force = contact ? contact_force(*contact, b.x - b.xo, b.v - b.vo) : 0.0;
        const double inputs[] = {target.position(at), target.velocity(at), target.acceleration, -force};
        double acceleration = 0.0;
        for (int64_t i = 0; i <= n; i++) {
            const double *row = plant.rows + i * width;
            double sum = row[0] * b.x + row[1] * b.v;
            for (int64_t k = 0; k < n; k++) sum += row[2 + k] * z[k];
            for (int64_t k = 0; k < 4; k++) sum += row[2 + n + k] * inputs[k];
            (i == 0 ? acceleration : dz[i - 1]) = sum;
        }
        return {b.v, acceleration, 0.0, b.vo, push + (contact ? force * contact->inverse_mass : 0.0), force};
    }
};

}  // namespace

Body advance_linear(const Body &b, const double *hidden, double at, double h, const Target &target,
                    const pretouch_state_space &plant, const pretouch_contact *contact, double push, double *after) {
    const Linear robot = {plant, contact, push, target};
    const double parts[] = {0.5, 0.5, 1.0}, weights[] = {1.0, 2.0, 2.0, 1.0};
    Body from = b, sum = b;
    double place[PRETOUCH_MOST_HIDDEN], dz[PRETOUCH_MOST_HIDDEN];
    for (int64_t k = 0; k < plant.hidden; k++) after[k] = place[k] = hidden[k];
    for (int stage = 0; stage < 4; stage++) {
        const double instant = stage == 0 ? at : at + parts[stage - 1] * h;
        const Body slope = robot.slopes(from, place, instant, dz);
        sum = along(sum, slope, weights[stage] * h / 6.0);
        for (int64_t k = 0; k < plant.hidden; k++) after[k] += weights[stage] * h / 6.0 * dz[k];
        if (stage == 3) break;
        from = along(b, slope, parts[stage] * h);
        for (int64_t k = 0; k < plant.hidden; k++) place[k] = hidden[k] + parts[stage] * h * dz[k];
    }
    return sum;
}

}  // namespace pretouch
