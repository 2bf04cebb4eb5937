// The search for one optimal gain per encounter: a scan, a proof of what it leaves out, and a polish.
//
// Gains are scanned from the weakest to the strongest, equally spaced in u = asinh(D_p / s). The spacing is halved until
// interpolation between the other gains predicts every second objective. If there is then one minimum inside the scan, the
// objective is interpolated at eight nodes close to it.
//
// When a scan may end: if g < 0, D^2 >= 4 M K, v < 0, a <= 0 and -D v - K x_0 >= sigma (u_0 - v) > 0, with sigma the
// smaller root of sigma^2 - D sigma + M K, then l falls until contact for every mitigating gain, and of two gains the
// stronger touches later (proved in docs/developers/fast-designs.md). A term of the objective that grows with the time of
// contact is therefore a lower bound for all stronger gains. Such terms are the time itself, and the displacement at
// contact, p + v t + a t^2 / 2, once it is negative. If this bound exceeds the best objective so far, no stronger gain
// can be the optimum, and none is solved.


#include <math.h>

#include "lanes_kernels.hpp"
#include "sampling.hpp"

namespace PRETOUCH_VARIANT {

namespace {

enum { MASS, DAMPING, STIFFNESS, X0, U0, P, V, A, OWN_V, OWN_A, INPUTS };
enum { TIME, DISPLACEMENT, VELOCITY, ACCELERATION, RELATIVE_VELOCITY, FORCE };  // quantities of the terms
constexpr int STATES = 6;

constexpr int FIRST = 17;  // gains of the first scan
constexpr int LARGEST = 129;
constexpr double WIDEST = 0.5;  // largest spacing in u
constexpr int PART = 2;  // gains per call if the next ones may not be needed
constexpr double HALF = 0.05;  // initial half width in u around the minimum
constexpr int MOVES = 8;

// factor * |quantity|^exponent, divided by the obstacle's squared speed if the term is relative to it
struct Term {
    double quantity, factor, exponent, follows;
};

// The allowed gains, as fractions of the range from the weakest to the strongest.
struct Axis {
    double scale, strong, weak, low, high;

    double gain_at(double part) const {
        return fmin(fmax(scale * sinh(weak + (strong - weak) * part), low), high);
    }
};

// One encounter and its objective.
struct Encounter {
    double inputs[INPUTS];
    double slope;  // g at l = 0, or everywhere if there are no curves
    const pretouch_curves *curves;
    double horizon;
    const Term *terms;
    int64_t count;
    double states[STATES * LARGEST];  // of the gains that were solved last, LARGEST per row
    int64_t solved;

    // Solve it for some gains; return the number of proved contacts before the first open one.
    int64_t solve(const double *gains, int64_t n) {
        pretouch_column columns[9];
        for (int i = 0; i < 8; i++) columns[i] = {inputs + i, 0};
        columns[8] = {gains, 1};
        int8_t status[LARGEST];
        const pretouch_linear wanted = {states, status, false, nullptr, {states + n, n}, {}, {}};
        solved = n;
        if (curves)
            series_contacts(columns, nullptr, n, curves, horizon, states, nullptr, nullptr, status);
        else
            linear_contacts(columns, n, slope, horizon, &wanted);
        for (int64_t i = 0; i < n; i++)
            if (status[i] != 0) return i;
        return n;
    }

    // The objective of the i-th gain that was solved last, or its part that grows with the time of contact.
    double weigh(int64_t i, double gain, bool growing) const {
        const double time = states[i], displacement = states[solved + i];
        double total = 0.0;
        for (const Term *term = terms; term < terms + count; term++) {
            const int kind = (int)term->quantity;
            if (growing && !(kind == TIME || (kind == DISPLACEMENT && displacement <= 0.0))) continue;
            double value = states[(kind == FORCE ? RELATIVE_VELOCITY : kind) * solved + i];
            if (kind == FORCE) value *= gain * slope;
            if (kind == VELOCITY) value += inputs[OWN_V] + inputs[OWN_A] * time;
            if (kind == ACCELERATION) value += inputs[OWN_A];
            double power = term->exponent == 2.0 ? value * value : pow(fabs(value), term->exponent);
            if (term->follows != 0.0) power /= (inputs[V] + inputs[OWN_V]) * (inputs[V] + inputs[OWN_V]);
            total += term->factor * power;
        }
        return total;
    }

    // Fill f with the objective of some gains; return the number of proved contacts before the first open one.
    int64_t appraise(const double *gains, int64_t n, double *f) {
        const int64_t proved = solve(gains, n);
        // solve filled what is weighed: NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage)
        for (int64_t i = 0; i < proved; i++) f[i] = weigh(i, gains[i], false);
        return proved;
    }

    // Whether stronger gains touch later, by the proof above.
    bool ends_early(bool falling) const {
        const double m = inputs[MASS], d = inputs[DAMPING], s = inputs[STIFFNESS], v = inputs[V], u0 = inputs[U0];
        const double room = d * d - 4.0 * m * s;
        if (!(falling && d >= 0.0 && s >= 0.0 && room >= 0.0 && v < 0.0 && u0 > v && inputs[A] <= 0.0)) return false;
        const double sigma = d > 0.0 ? 2.0 * m * s / (d + sqrt(room)) : 0.0;
        return -d * v - s * inputs[X0] >= sigma * (u0 - v);
    }
};

// A scan of the axis: the gains in order, and their objectives.
struct Scan {
    Encounter &encounter;
    const Axis &axis;
    int count = FIRST;  // number of gains on the whole axis
    int used = 0;  // number of needed gains
    double f[LARGEST];

    Scan(Encounter &of, const Axis &along) : encounter(of), axis(along) {}

    // After how many gains the scan may end, an odd number; 0 if it must continue. Gains from `start` on were solved last.
    int last_needed(const double *gains, int start, int reached) const {
        double lowest = INFINITY;
        for (int i = 0; i < reached; i++) {
            lowest = fmin(lowest, f[i]);
            if (i < start || i < LEAST - 1 || i % 2 == 1 || gains[i] >= 0.0) continue;
            if (encounter.weigh(i - start, gains[i], true) > lowest) return i + 1;
        }
        return 0;
    }

    // Evaluate gains from the weakest to the strongest that is needed; return whether all contacts are proved.
    bool run(bool falling) {
        while (fabs(axis.strong - axis.weak) > WIDEST * (count - 1) && 2 * count - 1 <= LARGEST) count = 2 * count - 1;
        double gains[LARGEST];
        for (int i = 0; i < count; i++) gains[i] = axis.gain_at((double)i / (count - 1));
        const bool early = encounter.ends_early(falling);
        for (int reached = 0; reached < count;) {
            const int start = reached;
            int following = count;
            if (encounter.curves && early) {  // strong gains cause stiff motions
                following = reached + (reached ? PART : LEAST);
                if (following > count) following = count;
            }
            reached += (int)encounter.appraise(gains + start, following - start, f + start);
            if (early && (used = last_needed(gains, start, reached)) > 0) return true;
            if (reached < following) return false;
        }
        used = count;
        return true;
    }

    // Insert a gain between each two; return whether that was possible.
    bool refine() {
        count = 2 * count - 1;
        const int gaps = used - 1;
        if (2 * used - 1 > LARGEST) return false;
        double gains[LARGEST], between[LARGEST];
        for (int i = 0; i < gaps; i++) gains[i] = axis.gain_at((double)(2 * i + 1) / (count - 1));
        for (int i = gaps; i > 0; i--) f[2 * i] = f[i];
        const int64_t proved = encounter.appraise(gains, gaps, between);
        for (int i = 0; i < proved; i++) f[2 * i + 1] = between[i];
        used = 2 * used - 1;
        return proved == gaps;
    }
};

struct Optimum {
    double gain, objective;
    bool certain;
};

// Interpolate the objective near the best node of a scan.
Optimum polish(Encounter &encounter, const Scan &scan, int best) {
    const Axis &axis = scan.axis;
    const double range = axis.strong - axis.weak, step = range / (scan.count - 1);
    const double first = axis.weak + step * (best + 1), last = axis.weak + step * (best - 1);
    double center = axis.weak + step * guess_minimum(scan.f, best, scan.used), half = HALF;
    for (int move = 0; move < MOVES; move++) {
        double nodes[NODES], values[NODES];
        for (int i = 0; i < NODES; i++) nodes[i] = axis.gain_at((center + half * AT[i] - axis.weak) / range);
        if (encounter.appraise(nodes, NODES, values) < NODES) break;
        const Bottom bottom = bottom_between(values);
        const double u = center + half * bottom.z;
        const bool inside = fabs(bottom.z) <= 0.9;
        if (inside && bottom.fits) {
            if (!(first <= u && u <= last)) break;
            return {axis.gain_at((u - axis.weak) / range), bottom.value, true};
        }
        center = fmin(fmax(u, first), last);
        if (inside) half *= 0.5;
    }
    return {NAN, NAN, false};
}

Optimum optimum(Encounter &encounter, const Axis &axis, bool falling) {
    Scan scan(encounter, axis);
    bool known = scan.run(falling);
    while (known && !is_resolved(scan.f, scan.used)) known = scan.refine();
    const int best = known ? only_minimum(scan.f, scan.used) : -1;
    return best < 0 ? Optimum{NAN, NAN, false} : polish(encounter, scan, best);
}

}  // namespace

void find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves, int falling,
                double horizon, const double *terms, int64_t k, double scale, double strong, double weak, double low,
                double high, double *out) {
    const Axis axis{scale, strong, weak, low, high};
    Encounter encounter;
    encounter.slope = slope;
    encounter.curves = curves;
    encounter.horizon = horizon;
    encounter.terms = (const Term *)terms;
    encounter.count = k;
    for (int64_t i = 0; i < n; i++) {
        for (int j = 0; j < INPUTS; j++) encounter.inputs[j] = inputs[j * n + i];
        const Optimum found = optimum(encounter, axis, falling);
        out[i] = found.gain;
        out[n + i] = found.objective;
        out[2 * n + i] = found.certain;
    }
}

}  // namespace PRETOUCH_VARIANT
