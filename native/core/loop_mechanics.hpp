// Contact forces, and one step of plant and obstacle, for the sampled loop.
#pragma once

#include <math.h>

#include "pretouch.h"

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

// The distance [m] at a time that is not told from zero: of the terms that l is the difference of, as in motion.
inline double resolution(const pretouch_scene &scene, double x, double t) {
    constexpr double rounding = 1e-12;
    const double way = (fabs(scene.vo) + 0.5 * fabs(scene.ao) * t) * t;
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

}  // namespace pretouch
