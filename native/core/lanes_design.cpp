// Search the optimal gain of each encounter: scan gains, prove that the unscanned ones are worse, refine the minimum.
//
// Gains are scanned from the weakest to the strongest, equally spaced in u = asinh(D_p / s). The spacing is halved
// until the objective at every second gain is predicted by interpolation between the other gains. If the scan then has
// one minimum, the objective is interpolated at eight nodes close to it.
//
// With limits, each gap between neighboring gains is feasible, infeasible, crossed once by a limit, or open (not
// decided). Inside a gap, a ratio |quantity| / limit may leave the range between its values at both ends. The second
// differences of the ratio estimate how far. That includes corners of the ratio, at which another peak of the motion
// becomes the largest. The edge between the feasible and the infeasible part of a crossed gap is computed as a root. If
// the objective falls toward an edge or toward an end of the axis, the optimum lies there.
//
// When a scan may end early: assume g < 0, D^2 >= 4 M K, v < 0, a <= 0 and -D v - K x_0 >= sigma (u_0 - v) > 0, with
// sigma the smaller root of sigma^2 - D sigma + M K. Then l falls until contact for every mitigating gain, and a
// stronger gain has a later contact (proved in docs/developers/fast-designs.md). Therefore a term of the objective that
// grows with the contact time is a lower bound of the objective for all stronger gains. Such terms are the time itself,
// and the displacement at contact, p + v t + a t^2 / 2, once it is negative. If this bound exceeds the best objective
// so far, no stronger gain can be the optimum, and none is solved. The same holds for limits of the time, and of the
// excursion, which the displacement at contact bounds from below. If one of these limits is exceeded, all stronger
// gains exceed it, too.


#include <math.h>

#include "lanes_kernels.hpp"
#include "sampling.hpp"

namespace PRETOUCH_VARIANT {

namespace {

enum { MASS, DAMPING, STIFFNESS, X0, U0, P, V, A, OWN_V, OWN_A, INPUTS };
// Quantities of terms and limits: at contact, then the largest of the whole motion.
enum { TIME, DISPLACEMENT, VELOCITY, ACCELERATION, RELATIVE_VELOCITY, FORCE, EXCURSION };
constexpr int STATES = 6, QUANTITIES = 11;

constexpr int FIRST = 17;  // number of gains of the first scan
constexpr int LARGEST = 129;  // largest number of gains of a scan
constexpr double WIDEST = 0.5;  // largest spacing in u
constexpr int PART = 2;  // number of gains per call of the solver if the scan may end early
constexpr double HALF = 0.05;  // initial half width in u around the minimum
constexpr int MOVES = 8;  // largest number of interpolations around a minimum
constexpr int MOST_LIMITS = 16;
constexpr double HELD = 1 - 1e-11;  // largest feasible ratio |quantity| / limit, as in design/search/scan.py
constexpr double CLOSE = 1e-12;  // the search for an edge ends this close to HELD; 1000 times this is accepted
constexpr double LARGEST_START = 8796093022208.0;  // [m]: 2^43, as in motion/curve.py
constexpr int PASSES = 8;  // largest number of calls with eight gains to find an edge
constexpr int ZOOMS = 4;  // nested scans of gaps that may contain feasible gains
constexpr int FEW = 4;  // gaps are scanned on their own if fewer than one in so many may contain feasible gains
constexpr int SAMPLES = 33;  // places between two edges at which the slope of the objective is evaluated

// A term of the objective: factor * |quantity|^exponent, divided by the obstacle's squared speed unless follows is 0.
struct Term {
    double quantity, factor, exponent, follows;
};

// A limit: factor * |quantity|^exponent <= 1.
struct Limit {
    double quantity, factor, exponent;
};

inline double power_of(double value, double exponent) {
    return exponent == 2.0 ? value * value : exponent == 1.0 ? fabs(value) : pow(fabs(value), exponent);
}

// The allowed gains, as fractions of the range from the weakest to the strongest.
struct Axis {
    double scale, strong, weak, low, high;

    double gain_at(double part) const {
        if (part <= 0.0 || part >= 1.0) return part <= 0.0 ? high : low;  // exactly the bounds, without rounding
        return fmin(fmax(scale * sinh(weak + (strong - weak) * part), low), high);
    }
};

// Objective f and ratios r = |quantity| / limit at the gains of a scan, in their order.
struct Values {
    double f[LARGEST];
    double r[MOST_LIMITS][LARGEST];
};

// One encounter, its objective and its limits.
struct Encounter {
    double inputs[INPUTS];
    double slope;  // g at l = 0, or everywhere if there are no curves
    const pretouch_curves *curves;
    double horizon;
    const Term *terms;
    int64_t count;
    const Limit *limits;
    int64_t limit_count;
    bool peaks;  // whether a term or a limit needs the whole motion
    bool wanted[QUANTITIES];  // the peaks that a term or a limit needs
    const pretouch_pieces *pieces;  // the curve for the guaranteed path; may be null
    double nearest, farthest;  // valid distances of a constant slope
    double states[QUANTITIES * LARGEST];  // results for the gains that were solved last
    int64_t solved;

    // Solve the encounter for n gains. Return the number of proved contacts before the first unproved one.
    int64_t solve(const double *gains, int64_t n) {
        pretouch_column columns[11];
        for (int i = 0; i < 8; i++) columns[i] = {inputs + i, 0};
        columns[8] = {gains, 1};
        columns[9] = {inputs + OWN_V, 0};
        columns[10] = {inputs + OWN_A, 0};
        int8_t status[LARGEST];
        double *largest = peaks ? states + STATES * n : nullptr, *rows[QUANTITIES - EXCURSION];
        for (int k = EXCURSION; k < QUANTITIES; k++) rows[k - EXCURSION] = wanted[k] ? states + k * n : nullptr;
        const pretouch_linear outputs = {states, status, false, nullptr, {states + n, n}, {}, {largest, n}};
        solved = n;
        if (curves)
            series_contacts(columns, peaks ? columns + 9 : nullptr, n, curves, horizon, states, nullptr,
                            peaks ? rows : nullptr, status);
        else
            linear_contacts(columns, n, slope, horizon, &outputs);
        for (int64_t i = 0; i < n; i++)
            if ((status[i] != 0 || (peaks && !has_peaks(i))) && !solve_alone(gains[i], i)) return i;
        return n;
    }

    // Whether the lanes have determined all needed peaks of the motion with the i-th gain.
    bool has_peaks(int64_t i) const {
        double sum = 0.0;
        for (int row = EXCURSION; row < QUANTITIES; row++)
            if (wanted[row]) sum += states[row * solved + i];
        return sum < INFINITY;
    }

    // Solve the i-th gain by the guaranteed path, which finds or excludes every contact. Return whether it ends in
    // contact. Return false without a solution if there are curves, but no pieces, or if the initial distance is too
    // large.
    bool solve_alone(double gain, int64_t i) {
        constexpr int COLUMNS = 15, CONTACT = 0;  // as in motion/layout.py
        constexpr int COLUMN_OF[QUANTITIES] = {0, 2, 3, 4, 5, 14, 7, 8, 9, 10, 11};
        double row[COLUMNS] = {};
        int64_t status = -1;
        if (curves && !(pieces && inputs[P] - inputs[X0] <= LARGEST_START)) return false;
        if (curves)
            solve_series(inputs, 1, &gain, pieces, horizon, row, &status, nullptr, 0, nullptr, nullptr, 0);
        else
            pretouch_solve_linear(inputs, 1, slope, &gain, horizon, nearest, farthest, row, &status);
        for (int k = 0; k < (peaks ? QUANTITIES : STATES); k++) states[k * solved + i] = row[COLUMN_OF[k]];
        return status == CONTACT;
    }

    // A quantity of the i-th of the gains that were solved last.
    double quantity(int kind, int64_t i, double gain) const {
        double value = states[(kind == FORCE ? RELATIVE_VELOCITY : kind) * solved + i];
        if (kind == FORCE) value *= gain * slope;
        if (kind == VELOCITY) value += inputs[OWN_V] + inputs[OWN_A] * states[i];
        if (kind == ACCELERATION) value += inputs[OWN_A];
        return value;
    }

    // The objective for the i-th gain, or only the terms of it that grow with the contact time.
    double weigh(int64_t i, double gain, bool growing) const {
        const double displacement = states[solved + i];
        double total = 0.0;
        for (const Term *term = terms; term < terms + count; term++) {
            const int kind = (int)term->quantity;
            if (growing && !(kind == TIME || (kind == DISPLACEMENT && displacement <= 0.0))) continue;
            double power = power_of(quantity(kind, i, gain), term->exponent);
            if (term->follows != 0.0) power /= (inputs[V] + inputs[OWN_V]) * (inputs[V] + inputs[OWN_V]);
            total += term->factor * power;
        }
        return total;
    }

    // Whether a limit is exceeded by this gain and, as proved at the top of this file, by all stronger ones.
    bool exceeds_for_good(int64_t i) const {
        const double displacement = states[solved + i];
        for (const Limit *limit = limits; limit < limits + limit_count; limit++) {
            const int kind = (int)limit->quantity;
            const double value = kind == TIME ? states[i] : kind == EXCURSION && displacement <= 0.0 ? displacement : 0.0;
            if (limit->factor * power_of(value, limit->exponent) > 1.0) return true;
        }
        return false;
    }

    // Solve n gains and fill their values from index `to` on. Return how many are certain before the first open one.
    int64_t appraise(const double *gains, int64_t n, Values &values, int to) {
        const int64_t proved = solve(gains, n);
        for (int64_t i = 0; i < proved; i++) {
            // solve() has filled the states. NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage)
            values.f[to + i] = weigh(i, gains[i], false);
            double sum = values.f[to + i];
            for (int64_t j = 0; j < limit_count; j++) {
                const Limit &limit = limits[j];
                const double value = quantity((int)limit.quantity, i, gains[i]);
                sum += values.r[j][to + i] = limit.factor * power_of(value, limit.exponent);
            }
            if (!(fabs(sum) < INFINITY)) return i;  // a peak is not determined
        }
        return proved;
    }

    // The largest ratio |quantity| / limit of a gain.
    double worst(const Values &values, int i) const {
        double most = 0.0;
        for (int64_t j = 0; j < limit_count; j++) most = fmax(most, values.r[j][i]);
        return most;
    }

    // Whether a stronger gain always has a later contact, by the conditions at the top of this file.
    bool ends_early(bool falling) const {
        const double m = inputs[MASS], d = inputs[DAMPING], s = inputs[STIFFNESS], v = inputs[V], u0 = inputs[U0];
        const double room = d * d - 4.0 * m * s;
        if (!(falling && d >= 0.0 && s >= 0.0 && room >= 0.0 && v < 0.0 && u0 > v && inputs[A] <= 0.0)) return false;
        const double sigma = d > 0.0 ? 2.0 * m * s / (d + sqrt(room)) : 0.0;
        return -d * v - s * inputs[X0] >= sigma * (u0 - v);
    }
};

// How a function of the gain may behave between two neighboring gains of a scan.
struct Gap {
    double least, most;  // estimated bounds of its values
    bool monotone;
};

// The gap from the i-th gain to the next one (stride 1), or to the one after that if only every second gain is used.
inline Gap gap_of(const double *r, int i, int used, int stride = 1) {
    const int next = i + stride;
    const double step = r[next] - r[i], low = fmin(r[i], r[next]), high = fmax(r[i], r[next]);
    const double before = i >= stride ? fabs(step - (r[i] - r[i - stride])) : 0.0;
    const double after = next + stride < used ? fabs(r[next + stride] - r[next] - step) : 0.0;
    const double bend = fmax(before, after);
    if (fabs(step) > bend) return {low, high, true};
    return {low - 0.5 * bend, high + 0.5 * bend, false};
}

enum class Kind { FEASIBLE, INFEASIBLE, CROSSED, OPEN };

// A scan of the axis of gains, and the values at its gains.
struct Scan {
    Encounter &encounter;
    const Axis &axis;
    int count = FIRST;  // number of gains on the whole axis
    int used = 0;  // number of gains, from the weakest, that can be optimal and are evaluated
    Values at;

    Scan(Encounter &of, const Axis &along) : encounter(of), axis(along) {}

    bool is_feasible(int i) const { return encounter.worst(at, i) <= HELD; }

    // The number of gains, which is odd, after which the scan may end; 0 if it must continue. The gains from `start` on
    // are those that were solved last.
    int last_needed(const double *gains, int start, int reached) const {
        double lowest = INFINITY;
        for (int i = 0; i < reached; i++) {
            if (is_feasible(i)) lowest = fmin(lowest, at.f[i]);
            if (i < start || i < LEAST - 1 || i % 2 == 1 || gains[i] >= 0.0) continue;
            if (encounter.weigh(i - start, gains[i], true) > lowest || encounter.exceeds_for_good(i - start)) return i + 1;
        }
        return 0;
    }

    // Evaluate the gains from the weakest to the last needed one. Return whether all their contacts are proved.
    bool run(bool falling) {
        while (fabs(axis.strong - axis.weak) > WIDEST * (count - 1) && 2 * count - 1 <= LARGEST) count = 2 * count - 1;
        double gains[LARGEST];
        for (int i = 0; i < count; i++) gains[i] = axis.gain_at((double)i / (count - 1));
        const bool early = encounter.ends_early(falling);
        for (int reached = 0; reached < count;) {
            const int start = reached;
            int following = count;
            if (encounter.curves && early) {  // avoid strong gains, whose motions are stiff
                following = reached + (reached ? PART : LEAST);
                if (following > count) following = count;
            }
            reached += (int)encounter.appraise(gains + start, following - start, at, start);
            if (early && (used = last_needed(gains, start, reached)) > 0) return true;
            if (reached < following) return false;
        }
        used = count;
        return true;
    }

    // Insert a gain between each two neighbors. Return false if the scan gets too long, or if a contact is not proved.
    bool refine() {
        count = 2 * count - 1;
        const int gaps = used - 1;
        if (2 * used - 1 > LARGEST) return false;
        double gains[LARGEST];
        Values between;
        for (int i = 0; i < gaps; i++) gains[i] = axis.gain_at((double)(2 * i + 1) / (count - 1));
        const int64_t proved = encounter.appraise(gains, gaps, between, 0);
        spread(at.f, between.f, gaps);
        for (int64_t j = 0; j < encounter.limit_count; j++) spread(at.r[j], between.r[j], gaps);
        used = 2 * used - 1;
        return proved == gaps;
    }

    // Insert a value into each gap of a row.
    static void spread(double *row, const double *between, int gaps) {
        for (int i = gaps; i > 0; i--) row[2 * i] = row[i];
        for (int i = 0; i < gaps; i++) row[2 * i + 1] = between[i];
    }

    // The kind of the gap after the i-th gain.
    Kind kind_of(int i) const {
        bool all_met = true, simple = true;
        for (int64_t j = 0; j < encounter.limit_count; j++) {
            const Gap gap = gap_of(at.r[j], i, used);
            if (gap.least > HELD) return Kind::INFEASIBLE;
            all_met = all_met && gap.most <= HELD;
            simple = simple && (gap.most <= HELD || gap.monotone);
        }
        if (all_met) return Kind::FEASIBLE;
        return simple && is_feasible(i) != is_feasible(i + 1) ? Kind::CROSSED : Kind::OPEN;
    }

    // Test the bounds of gaps: whether each ratio at every second gain is within the bounds from the other gains.
    bool is_bounded() const {
        for (int64_t j = 0; j < encounter.limit_count; j++)
            for (int i = 0; i + 2 < used; i += 2) {
                const Gap gap = gap_of(at.r[j], i, used, 2);
                if (!(gap.least <= at.r[j][i + 1] && at.r[j][i + 1] <= gap.most)) return false;
            }
        return true;
    }

    // Whether interpolation predicts the objective at every second gain, except between two infeasible gaps.
    bool is_objective_resolved() const {
        for (int i = 1; i < used - 1; i += 2) {
            if (is_predicted(at.f, used, i)) continue;
            if (kind_of(i - 1) != Kind::INFEASIBLE || kind_of(i) != Kind::INFEASIBLE) return false;
        }
        return true;
    }

    // Whether a ratio exceeds its limit in the gap after the i-th gain with a wide margin. The margin is necessary
    // because a narrow range of feasible gains may be hidden where a ratio nearly meets its limit.
    bool is_far(int i) const {
        for (int64_t j = 0; j < encounter.limit_count; j++) {
            const double *r = at.r[j], low = fmin(r[i], r[i + 1]);
            if (fmin(gap_of(r, i, used).least, low - 0.5 * fabs(r[i + 1] - r[i])) > 1.0) return true;
        }
        return false;
    }

    // The number of gaps that may contain feasible gains.
    int count_open() const {
        int open = 0;
        for (int i = 0; i + 1 < used; i++) open += !is_far(i);
        return open;
    }

    // Whether no gain of the scan is feasible.
    bool has_none() const {
        for (int i = 0; i < used; i++)
            if (is_feasible(i)) return false;
        return true;
    }

    // Whether the objective is above a value in the whole gap after the i-th gain.
    bool is_above(int i, double value) const { return gap_of(at.f, i, used).least > value; }
};

struct Optimum {
    double gain, objective;
    double outcome;  // 1: optimal, 2: no gain is feasible, 0: not certain
};

constexpr Optimum UNCERTAIN = {NAN, NAN, 0.0}, INFEASIBLE = {NAN, NAN, 2.0};

// Find the minimum of the objective between the coordinates u = first and u = last by interpolation at eight nodes.
// They span `half` on both sides of `center`, the first guess; both are adapted until the interpolation is accurate.
Optimum polish(Encounter &encounter, const Axis &axis, double center, double first, double last, double half) {
    const double range = axis.strong - axis.weak;
    for (int move = 0; move < MOVES; move++) {
        double nodes[NODES];
        Values values;
        for (int i = 0; i < NODES; i++) nodes[i] = axis.gain_at((center + half * AT[i] - axis.weak) / range);
        if (encounter.appraise(nodes, NODES, values, 0) < NODES) break;
        const Bottom bottom = bottom_between(values.f);
        const double u = center + half * bottom.z;
        const bool inside = fabs(bottom.z) <= 0.9;
        if (inside && bottom.fits) {
            if (!(first <= u && u <= last)) break;
            return {axis.gain_at((u - axis.weak) / range), bottom.value, 1.0};
        }
        center = fmin(fmax(u, first), last);
        if (inside) half *= 0.5;
    }
    return UNCERTAIN;
}

// One end of the range of feasible gains around the best gain of a scan: its position on the axis, from 0 to 1, the
// objective there, and whether the end could be determined.
struct Edge {
    double part, objective;
    bool certain, proper;  // proper: an edge of a limit or an end of the axis, not only a neighboring gain
};

// Find the gain at which a limit is met exactly, between a feasible gain and an infeasible one.
Edge find_edge(const Scan &scan, int inside, int outside) {
    Encounter &encounter = scan.encounter;
    double a = (double)inside / (scan.count - 1), b = (double)outside / (scan.count - 1);
    double at_a = encounter.worst(scan.at, inside) - HELD, at_b = encounter.worst(scan.at, outside) - HELD;
    double objective = scan.at.f[inside];
    double guess = 0.5, spread = 1.0;  // fractions of [a, b]; in the first pass the gains are equally spaced
    for (int pass = 0; pass < PASSES && at_a < -CLOSE; pass++) {
        constexpr double OFFSETS[NODES] = {-1.0, -1e-2, -1e-4, -1e-6, 1e-6, 1e-4, 1e-2, 1.0};
        double parts[NODES], gains[NODES];
        Values values;
        for (int k = 0; k < NODES; k++) {
            const double share = pass ? guess + spread * OFFSETS[k] : (k + 1.0) / (NODES + 1);
            parts[k] = a + (b - a) * fmin(fmax(share, 0.0), 1.0);
            gains[k] = scan.axis.gain_at(parts[k]);
        }
        if (encounter.appraise(gains, NODES, values, 0) < NODES) return {a, objective, false, true};
        for (int k = 0; k < NODES; k++) {
            const double excess = encounter.worst(values, k) - HELD;
            const bool closer_a = fabs(parts[k] - b) < fabs(a - b), closer_b = fabs(parts[k] - a) < fabs(b - a);
            if (excess <= 0.0 && closer_a) a = parts[k], at_a = excess, objective = values.f[k];
            if (excess > 0.0 && closer_b) b = parts[k], at_b = excess;
            if (excess > 0.0) break;  // the gains are ordered from the feasible end to the infeasible one
        }
        guess = at_a / (at_a - at_b);
        spread = fmin(guess, 1.0 - guess);
        if (fabs(b - a) <= 1e-16) break;
    }
    return {a, objective, at_a >= -1e3 * CLOSE, true};
}

// The end of the feasible range on one side of the best gain: side -1 toward weaker gains, 1 toward stronger ones.
Edge end_on(const Scan &scan, int best, int side) {
    const int next = best + side;
    if (next < 0 || next >= scan.used) {
        const bool is_end = next < 0 || scan.used == scan.count;  // otherwise the scan ended early
        return {(double)best / (scan.count - 1), scan.at.f[best], is_end, true};
    }
    const Kind kind = scan.kind_of(best < next ? best : next);
    if (kind == Kind::CROSSED) return find_edge(scan, best, next);
    return {(double)next / (scan.count - 1), scan.at.f[next], kind == Kind::FEASIBLE, false};
}

// The optimum between the two ends of the feasible range, at least one of which is proper.
Optimum between_edges(const Scan &scan, const Edge &weak, const Edge &strong) {
    const Axis &axis = scan.axis;
    const double range = axis.strong - axis.weak, first = axis.weak + range * weak.part;
    const double last = axis.weak + range * strong.part, center = 0.5 * (first + last), half = 0.5 * (last - first);
    double nodes[NODES], c[NODES], slope[NODES];
    Values values;
    for (int i = 0; i < NODES; i++) nodes[i] = axis.gain_at((center + half * AT[i] - axis.weak) / range);
    if (scan.encounter.appraise(nodes, NODES, values, 0) < NODES) return UNCERTAIN;
    chebyshev_of(values.f, c);
    sampling::differentiate(c, slope);
    double largest = 0.0, smallest = INFINITY;
    int falls = 0;  // number of places at which the objective falls toward stronger gains
    for (int k = 0; k < SAMPLES; k++) {
        const double s = sampling::series(slope, -1.0 + 2.0 * k / (SAMPLES - 1));
        largest = fmax(largest, fabs(s));
        smallest = fmin(smallest, fabs(s));
        falls += s < 0.0;
    }
    const double doubt = fabs(c[NODES - 1]) + fabs(c[NODES - 2]);
    if (falls == 0 || falls == SAMPLES) {
        const Edge &lower = falls ? strong : weak;
        if (!lower.proper || !(smallest > 1e-6 * largest + NODES * NODES * doubt)) return UNCERTAIN;
        return {axis.gain_at(lower.part), lower.objective, 1.0};
    }
    const Bottom bottom = bottom_between(values.f);
    if (!(fabs(bottom.z) <= 0.999)) return UNCERTAIN;
    const Optimum result = polish(scan.encounter, axis, center + half * bottom.z, fmin(first, last), fmax(first, last),
                                 fmin(HALF, fabs(half)));
    return result.objective <= fmin(weak.objective, strong.objective) ? result : UNCERTAIN;
}

// The index of the only local minimum among the feasible gains of a scan; -1 if there are several, or none.
int only_feasible_minimum(const Scan &scan) {
    int minimum = -1;
    double before = INFINITY, here = scan.is_feasible(0) ? scan.at.f[0] : INFINITY;
    for (int i = 0; i < scan.used; i++) {
        const double after = i + 1 < scan.used && scan.is_feasible(i + 1) ? scan.at.f[i + 1] : INFINITY;
        if (here < INFINITY && here <= before && here < after) {
            if (minimum >= 0) return -1;
            minimum = i;
        }
        before = here;
        here = after;
    }
    return minimum;
}

// The optimum of a scan whose objective is resolved. It is uncertain if an undecided gap may contain a better gain.
Optimum decide(const Scan &scan) {
    const int best = only_feasible_minimum(scan);
    if (best < 0) return UNCERTAIN;
    const Axis &axis = scan.axis;
    const Edge weak = end_on(scan, best, -1), strong = end_on(scan, best, 1);
    if (!(weak.certain && strong.certain)) return UNCERTAIN;
    Optimum result;
    if (weak.proper || strong.proper) {
        result = between_edges(scan, weak, strong);
    } else {
        const double step = (axis.strong - axis.weak) / (scan.count - 1);
        const double u = axis.weak + step * guess_minimum(scan.at.f, best, scan.used);
        const double one = axis.weak + step * (best + 1), other = axis.weak + step * (best - 1);
        result = polish(scan.encounter, axis, u, fmin(one, other), fmax(one, other), HALF);
    }
    if (result.outcome != 1.0) return UNCERTAIN;
    if (scan.encounter.limit_count > 0) {  // test the limits again, since the bounds inside gaps are estimates
        Values there;
        if (scan.encounter.appraise(&result.gain, 1, there, 0) < 1) return UNCERTAIN;
        if (scan.encounter.worst(there, 0) > HELD + CLOSE) return UNCERTAIN;
    }
    for (int i = 0; i + 1 < scan.used; i++) {
        if (i == best || i == best - 1) continue;
        const Kind kind = scan.kind_of(i);
        const bool harmless = kind == Kind::FEASIBLE || kind == Kind::INFEASIBLE;
        if (!harmless && !scan.is_above(i, result.objective)) return UNCERTAIN;
    }
    return result;
}

Optimum optimum(Encounter &encounter, const Axis &axis, bool falling, int zooms);

// The optimum within the few gaps that may contain feasible gains, if no gain of a scan is feasible. Neighboring gaps
// are scanned together.
Optimum within_gaps(const Scan &scan, bool falling, int zooms) {
    const Axis &axis = scan.axis;
    const double all = scan.count - 1, step = (axis.strong - axis.weak) / all;
    Optimum best = INFEASIBLE;
    for (int i = 0; i + 1 < scan.used; i++) {
        if (scan.is_far(i)) continue;
        const int first = i;
        while (i + 2 < scan.used && !scan.is_far(i + 1)) i++;
        const int last = i + 1;
        const Axis part{axis.scale, axis.weak + step * last, axis.weak + step * first, axis.gain_at(last / all),
                        axis.gain_at(first / all)};
        const Optimum result = optimum(scan.encounter, part, falling, zooms);
        if (result.outcome == 0.0) return UNCERTAIN;
        if (result.outcome == 1.0 && !(best.outcome == 1.0 && best.objective <= result.objective)) best = result;
    }
    return best;
}

// The optimal gain of an encounter: scan the gains, and refine the scan until the optimum is certain.
Optimum optimum(Encounter &encounter, const Axis &axis, bool falling, int zooms) {
    Scan scan(encounter, axis);
    bool proved = scan.run(falling);
    while (proved) {
        if (scan.is_bounded()) {
            const int open = scan.count_open();
            if (open == 0) return INFEASIBLE;
            if (zooms > 0 && FEW * open < scan.used && scan.has_none()) return within_gaps(scan, falling, zooms - 1);
            const Optimum result = scan.is_objective_resolved() ? decide(scan) : UNCERTAIN;
            if (result.outcome != 0.0) return result;
        }
        proved = scan.refine();
    }
    return UNCERTAIN;
}

}  // namespace

void find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves,
                const pretouch_pieces *pieces, double nearest, double farthest, int falling, double horizon, const double *terms, int64_t k, const double *limits, int64_t limit_count, double scale,
                double strong, double weak, double low, double high, double *out) {
    const Axis axis{scale, strong, weak, low, high};
    Encounter encounter;
    encounter.slope = slope;
    encounter.curves = curves;
    encounter.pieces = pieces;
    encounter.nearest = nearest;
    encounter.farthest = farthest;
    encounter.horizon = horizon;
    encounter.terms = (const Term *)terms;
    encounter.count = k;
    encounter.limits = (const Limit *)limits;
    encounter.limit_count = limit_count;
    for (bool &row : encounter.wanted) row = false;
    for (int64_t j = 0; j < k; j++) encounter.wanted[(int)encounter.terms[j].quantity] = true;
    for (int64_t j = 0; j < limit_count; j++) encounter.wanted[(int)encounter.limits[j].quantity] = true;
    encounter.peaks = false;
    for (int row = EXCURSION; row < QUANTITIES; row++) encounter.peaks |= encounter.wanted[row];
    for (int64_t i = 0; i < n; i++) {
        for (int j = 0; j < INPUTS; j++) encounter.inputs[j] = inputs[j * n + i];
        const Optimum result = optimum(encounter, axis, falling, ZOOMS);
        out[i] = result.gain;
        out[n + i] = result.objective;
        out[2 * n + i] = result.outcome;
    }
}

}  // namespace PRETOUCH_VARIANT
