// Simulate approaches under the virtual drag by adaptive quadrature over the distance. The 16 quadrature points of an
// interval are distributed to vector lanes.
//
// With w = l'^2 and k = phi / M, the equation M l'' = M a_o + phi g^2 l'^2 is linear in w,
//
//     dw/dl = 2 (a_o + k g^2 w),   so   w = e^-q W,   W = w_0 - 2 a_o int_l^{l_0} e^q dl,   q = 2 k int_l^{l_0} g^2 dl,
//
// for any l_0, and t = int dl / sqrt(w). A cell is an interval of the distance without a corner of the curve. On each
// cell, the polynomials through the values at 16 Gauss points are integrated. Cells are halved until the last Legendre
// coefficients of both integrands are negligible. If w is zero at one end of a cell, 1 / sqrt(w) is not smooth, but
// sqrt(w) is a smooth function of the square root of the distance from that end. Therefore the traversed share s of a
// cell is written as a function of a variable r from 0 to 1, s(r) = r - b r (1 - r). This is r for b = 0, r^2 for a
// start at rest (b = 1), and 1 - (1 - r)^2 for an end at rest (b = -1).
//
// Gradients: the derivative u of w with respect to an input obeys du/dl = 2 (k g^2 u + h), where h is the derivative of
// a_o + k g^2 w at fixed w. Hence u e^q = u_0 - 2 int_l^{l_0} e^q h dl. The derivative of the time is
// -1/2 int u w^{-3/2} dl. The derivative of the time by l_0 has the additional term 1/|l'|.

#include <math.h>

#include "gauss_tables.hpp"
#include "lanes.hpp"
#include "lanes_exponential.hpp"
#include "lanes_kernels.hpp"
#include "lanes_windows.hpp"

namespace PRETOUCH_VARIANT {

namespace {

using pretouch::FINE;
using pretouch::fine_place;
using pretouch::GAUSS;
using pretouch::legendre;
using pretouch::Legendre;
using pretouch::legendre_integral;

constexpr const pretouch::GaussTables &AT = pretouch::GAUSS_TABLES;
constexpr int VECTORS = GAUSS / WIDTH;

constexpr double TOLERANCE = 1e-12;   // largest accepted last Legendre coefficients, relative to the largest value
// At constant acceleration a_o, l'^2 would be zero at a distance l'^2 / |2 a_o| behind or ahead of the start of a cell
// (a virtual rest), where 1 / |l'| is singular. The width of a cell is limited to these fractions of that distance.
constexpr double PAST_REST = 0.7;     // the virtual rest is behind the start: the approach accelerates
constexpr double BEFORE_REST = 0.4;  // the virtual rest is ahead: the approach decelerates
constexpr double GROWTH = 3.0;  // largest q on a cell; a polynomial of degree 15 then equals e^q within rounding
constexpr double MAX_GROWTH = 100.0;  // larger values of q are reduced to this one to avoid overflow
constexpr int MAX_CELLS = 4000;
constexpr double HOPELESS = 4.0 * GROWTH * MAX_CELLS;  // if q is larger, even twice MAX_CELLS cells do not suffice
constexpr int DRAG_ROWS = 6, DRAG_PEAKS = 7, DRAG_GRADIENTS = 5;

// How an approach ended: ON if it continues, else a value of ContactStatus.
enum Ending : int64_t { ON = -1, CONTACT = 0, NEVER_IN_CONTACT = 1, LATE = 2, UNRESOLVED = 4 };

// The values of a function at the quadrature points of a cell.
struct Nodes {
    Lanes at[VECTORS];

    double operator[](int i) const { return at[i / WIDTH][i % WIDTH]; }
};

template <class F> inline Nodes at_nodes(F value) {
    Nodes nodes;
    for (int j = 0; j < VECTORS; j++) nodes.at[j] = value(j);
    return nodes;
}

inline double sum(const Nodes &nodes, const double *weights) {
    Lanes total = nodes.at[0] * load(weights);
    for (int j = 1; j < VECTORS; j++) total += nodes.at[j] * load(weights + j * WIDTH);
    double value = total[0];
    for (int i = 1; i < WIDTH; i++) value += total[i];
    return value;
}

// The integral over the cell, by z from -1 to 1.
inline double integral(const Nodes &nodes) { return sum(nodes, AT.weight); }

inline Nodes times(const Nodes &nodes, const double (&matrix)[GAUSS][GAUSS]) {
    Nodes product = at_nodes([](int) { return Lanes{}; });
    for (int i = 0; i < GAUSS; i++) {
        const Lanes value = all(nodes[i]);
        for (int j = 0; j < VECTORS; j++) product.at[j] += value * load(matrix[i] + j * WIDTH);
    }
    return product;
}

// The integral from the start of the cell to each point.
inline Nodes so_far(const Nodes &nodes) { return times(nodes, AT.so_far); }

// The sum of the magnitudes of the last two Legendre coefficients, relative to the largest value.
inline double last_terms(const Nodes &nodes) {
    Lanes largest = absolute(nodes.at[0]);
    for (int j = 1; j < VECTORS; j++) largest = most(absolute(nodes.at[j]), largest);
    double greatest = largest[0];
    for (int i = 1; i < WIDTH; i++) greatest = most(greatest, largest[i]);
    return (fabs(sum(nodes, AT.last[0])) + fabs(sum(nodes, AT.last[1]))) / greatest;
}

// The polynomial through the values at the points, as a Legendre series.
struct Polynomial {
    double terms[GAUSS];

    explicit Polynomial(const Nodes &nodes) {
        const Nodes coefficients = times(nodes, AT.coefficient);
        for (int j = 0; j < VECTORS; j++) store(terms + j * WIDTH, coefficients.at[j]);
    }

    double operator()(double z) const {
        const Legendre p = legendre(z);
        double value = 0.0;
        for (int n = 0; n < GAUSS; n++) value += terms[n] * p.value[n];
        return value;
    }
};

// The place z in [-1, 1] at which the integral of a positive function reaches a total. Newton's method, safeguarded by
// bisection.
double place_of(const Nodes &rates, double total) {
    const Polynomial rate(rates);
    double low = -1.0, high = 1.0, z = 2.0 * total / most(integral(rates), 2.3e-308) - 1.0;
    for (int k = 0; k < 60; k++) {
        if (!(z > low && z < high)) z = 0.5 * (low + high);
        const Legendre p = legendre(z);
        double excess = -total, slope = 0.0;
        for (int n = 0; n < GAUSS; n++) {
            excess += rate.terms[n] * legendre_integral(p, n, z);
            slope += rate.terms[n] * p.value[n];
        }
        if (excess <= 0.0) low = z;
        if (excess >= 0.0) high = z;
        const double step = excess / slope;
        z -= step;
        if (fabs(step) <= 1e-15 || high - low <= 1e-15) break;  // Newton's method has converged to rounding
    }
    return least(most(z, -1.0), 1.0);
}

struct Maximum {
    double value, place;
};

// Find a maximum of the polynomial through the values at the points, times a sign, by Newton's method. The search
// starts from the best of its values at equally spaced places, and stays between the neighbors of that place.
Maximum refined_maximum(const Nodes &nodes, int best, double value, double sign) {
    const Polynomial polynomial(nodes);
    const double start = fine_place(best), low = fine_place(best > 0 ? best - 1 : 0);
    const double high = fine_place(best < FINE - 1 ? best + 1 : best);
    double z = start;
    for (int k = 0; k < 4; k++) {
        const Legendre p = legendre(z);
        double second[GAUSS] = {}, slope = 0.0, curve = 0.0;
        for (int n = 1; n < GAUSS; n++) {
            if (n > 1) second[n] = second[n - 2] + (2 * n - 1) * p.slope[n - 1];
            slope += polynomial.terms[n] * p.slope[n];
            curve += polynomial.terms[n] * second[n];
        }
        if (!(sign * curve < 0.0)) break;
        const double next = least(most(z - slope / curve, low), high), moved = fabs(next - z);
        z = next;
        if (moved < 1e-8) break;  // the error of the value is of the order of the square of this
    }
    const double refined = sign * polynomial(z);
    return refined > value ? Maximum{refined, z} : Maximum{value, start};
}

// The maximum of the polynomial times a sign, and its place, if it exceeds a bound. Otherwise the bound and NaN.
Maximum maximum(const Nodes &nodes, const double *values, int best, double sign, double bound) {
    const int middle = best == 0 ? 1 : best == FINE - 1 ? FINE - 2 : best;
    const double before = values[middle - 1], at = values[middle], after = values[middle + 1];
    const double bend = fabs(before - 2.0 * at + after), value = sign * values[best];
    if (!(value + bend > bound)) return {bound, NOT_A_NUMBER};  // a parabola exceeds its samples by at most bend / 8
    const bool at_end = best != middle && fabs(at - values[best]) > 2.0 * bend;  // and the polynomial still rises
    const Maximum refined = at_end ? Maximum{value, fine_place(best)} : refined_maximum(nodes, best, value, sign);
    return refined.value > bound ? refined : Maximum{bound, NOT_A_NUMBER};
}

// The windows of one curve.
struct Windowed {
    Windows windows;
    int64_t first, last;
    double low;

    Windowed(const pretouch_curves &curves, int64_t i)
        : windows{curves.windows, curves.width}, first(curves.starts[curves.curve_of[i * curves.stride]]),
          last(curves.starts[curves.curve_of[i * curves.stride] + 1]), low(windows[first][LOW]) {}

    // The lowest window whose top is not below l; the highest window if l is above all of them.
    int64_t find(double l, int64_t hint) const {
        const int64_t row = find_window(windows, first, last, l, hint);
        return row < 0 ? last - 1 : row;
    }

    // The distance of the next corner below a window, or the lowest distance if there is none. Neighboring windows
    // overlap, unless there is a corner between them.
    double border(int64_t row) const {
        while (row > first && windows[row - 1][TOP] != windows[row][LOW]) row--;
        return windows[row][LOW];
    }

    double slope(double l, int64_t hint) const { return window_slope(windows[find(l, hint)], windows.width, l); }

    // g at decreasing distances that start in a window. Distances below the window are evaluated in lower windows.
    Nodes slopes(const Nodes &distance, int64_t row) const {
        const double *window = windows[row];
        const int64_t degree = windows.width - TERMS - 1;
        if (degree == 0)
            return at_nodes([&](int j) { return window[TERMS] / (distance.at[j] - window[MIDDLE]); });
        if (distance[GAUSS - 1] >= window[LOW] || row == first)
            return at_nodes([&](int j) {
                const Lanes z = distance.at[j] - window[MIDDLE];
                Lanes value = all(0.0);
                for (int64_t i = degree; i > 0; i--) value = value * z + double(i) * window[TERMS + i];
                return value;
            });
        Nodes slopes;
        for (int i = 0; i < GAUSS; i++) {
            while (row > first && distance[i] < windows[row][LOW]) row--;
            slopes.at[i / WIDTH][i % WIDTH] = window_slope(windows[row], windows.width, distance[i]);
        }
        return slopes;
    }
};

// A cell, the state at its start, and its window. bend: b in the share s(r); square: l'^2.
struct Cell {
    double start, width, bend, square, time;
    int64_t row;

    // The traversed share of the cell at a place z in [-1, 1].
    double share(double z) const {
        const double r = 0.5 * (1.0 + z);
        return r - bend * r * (1.0 - r);
    }
};

// The motion on a cell. At its points: l, g, |dl/dz|, e^-q, e^q |dl/dz|, l'^2 and dt/dz. At its end: q, l'^2 (negative
// if l' becomes zero before), the duration, and the integral of e^q over the distance.
struct Course {
    Nodes distance, slope, length, decay, grown, square, pace;
    double growth, last_square, duration, rest_integral;
};

// Compute the motion on a cell.
Course course_of(const Windowed &curve, double strength, double acceleration, const Cell &cell) {
    Course c;
    const double half = 0.5 * cell.width, bend = cell.bend, twice = 2.0 * acceleration;
    for (int j = 0; j < VECTORS; j++) {
        const Lanes r = load(AT.share + j * WIDTH), passed = cell.width * (r - bend * r * (1.0 - r));
        c.distance.at[j] = most(cell.start - passed, all(curve.low));
        c.length.at[j] = half * (1.0 - bend * (1.0 - 2.0 * r));
    }
    c.slope = curve.slopes(c.distance, cell.row);
    const Nodes rate =
        at_nodes([&](int j) { return 2.0 * strength * (c.slope.at[j] * c.slope.at[j]) * c.length.at[j]; });
    const Nodes growth = so_far(rate);
    c.growth = least(integral(rate), MAX_GROWTH);
    for (int j = 0; j < VECTORS; j++) {
        c.decay.at[j] = exponential(-least(growth.at[j], all(MAX_GROWTH))).value;
        c.grown.at[j] = c.length.at[j] / c.decay.at[j];
    }
    c.rest_integral = integral(c.grown);
    if (bend < 0.0) {
        const Nodes to_come = times(c.grown, AT.to_come);
        c.square = at_nodes([&](int j) { return c.decay.at[j] * (twice * to_come.at[j]); });
        c.last_square = 0.0;
    } else if (acceleration == 0.0) {
        c.square = at_nodes([&](int j) { return c.decay.at[j] * cell.square; });
        c.last_square = cell.square * exp(-c.growth);
    } else {
        const Nodes passed = so_far(c.grown);
        c.square = at_nodes([&](int j) { return c.decay.at[j] * (cell.square - twice * passed.at[j]); });
        c.last_square = (cell.square - twice * c.rest_integral) * exp(-c.growth);
    }
    c.pace = at_nodes([&](int j) { return c.length.at[j] / root(c.square.at[j]); });
    c.duration = integral(c.pace);
    return c;
}

// The smaller number; if one of them is NaN, the other one.
inline double smaller_number(double x, double y) { return x < y || y != y ? x : y; }

// One approach, from its start to contact, rest, horizon or failure.
class Approach {
  public:
    Approach(const pretouch_column *inputs, const pretouch_curves &curves, double latest, const pretouch_approaches &to,
             int64_t which)
        : curve(curves, which), wanted(to), i(which), horizon(latest) {
        const auto input = [&](int k) { return inputs[k].at[which * inputs[k].stride]; };
        strength = input(0), acceleration = input(1), distance = start = input(2), square = input(3);
        begin = time = input(4);
        if (to.peaks) place = input(5), velocity = input(6), push = input(7);
        row = curve.find(distance, -1);
        slope = window_slope(curve.windows[row], curve.windows.width, distance);
        // initial values of the derivatives by the initial l: -2 (a_o + k g^2 l'^2) for l'^2, and 1 / |l'| for t
        by_square[2] = -2.0 * (acceleration + strength * slope * slope * square), by_square[3] = 1.0;
        by_time[2] = 1.0 / sqrt(square);
    }

    void run() {
        double scale = 1.0;
        status = ON;
        for (int k = 0; k < MAX_CELLS && status == ON; k++) {
            const double border = curve.border(row), room = distance - border;
            Cell cell = next_cell(room, scale);
            if (is_hopeless(room)) break;
            const double missed = shorten_to_end(cell), of_growth = last_terms(course.grown), of_pace = last_terms(course.pace);
            const double error = most(most(of_growth, of_pace), missed);
            const bool good = of_growth <= TOLERANCE && of_pace <= TOLERANCE && missed <= TOLERANCE && course.duration < INFINITE;
            scale = good ? least(2.0 * scale, 1.0) : 0.5 * scale;
            if (good) accept(cell, error, cell.width == cell.start - border ? border : cell.start - cell.width);
        }
        if (status == ON) status = UNRESOLVED;
        write();
    }

  private:
    const Windowed curve;
    const pretouch_approaches &wanted;
    const int64_t i;
    const double horizon;
    double strength, acceleration, start, begin, place = 0, velocity = 0, push = 0;
    double distance, square, time, slope, growth = 0, error_sum = 0, widest = 0;
    int64_t row, status = ON, cells = 0, ending = ON, sample = 0;
    double by_square[DRAG_GRADIENTS] = {}, by_time[DRAG_GRADIENTS] = {}, impulse = 0, moment = 0;
    double largest_rate = -INFINITE, rate_distance = 0, smallest_rate = -INFINITE, fastest = -INFINITE;
    double slowest = -INFINITE, farthest = -INFINITE, nearest = -INFINITE;  // the smallest values, with opposite sign
    Course course;

    // The next cell, short enough for an accurate quadrature. It ends at or before the next corner.
    Cell next_cell(double room, double scale) {
        const double twice = 2.0 * acceleration;
        double far = smaller_number(room, GROWTH / (2.0 * strength * slope * slope)), tried = far, ahead = 0.0;
        for (int k = 0; k < 4; k++, tried /= 3.0) {
            const double g = curve.slope(most(distance - tried, curve.low), row);
            ahead = 2.0 * strength * g * g;  // dq/dl
            if (ahead * tried <= 2.0 * GROWTH) break;
            if (k == 3) {
                tried = smaller_number(tried, GROWTH / ahead);
                break;
            }
        }
        widest = tried;
        far = scale * tried;
        if (square > 0.0) {
            const double near = scale * (twice < 0.0 ? PAST_REST : BEFORE_REST) * square / fabs(twice);
            const double rest = 1.01 * square / twice;  // l' becomes zero within this distance, since e^q >= 1
            far = smaller_number(far, twice * far > square ? rest : near);
        }
        return {distance, far, square == 0.0 ? 1.0 : 0.0, square, time, row};
    }

    // Whether cells are so narrow that the distance no longer changes, or whether far too many would be needed. The
    // latter is tested only if a_o accelerates the approach. Otherwise l' soon becomes zero, or the horizon ends.
    bool is_hopeless(double room) const {
        if (distance - widest == distance) return true;
        if (cells > 0 || acceleration >= 0.0 || widest * MAX_CELLS >= room) return false;
        double total = 0.0;
        for (int j = 0; j < GAUSS; j++) {
            const double g = curve.slope(distance - AT.share[j] * room, row);
            total += AT.weight[j] * strength * g * g * room;
        }
        return total > HOPELESS;
    }

    // Shorten a cell in which l' becomes zero, or in which the horizon ends, to end there. Return the relative error of
    // that end. It is needed because the original cell may have been too long for an accurate end.
    double shorten_to_end(Cell &cell) {
        course = course_of(curve, strength, acceleration, cell);
        ending = ON;
        double missed = 0.0;
        if (course.last_square <= 0.0) {
            ending = NEVER_IN_CONTACT;
            cell.width *= cell.share(place_of(course.grown, cell.square / (2.0 * acceleration)));
            cell.bend = -1.0;
            course = course_of(curve, strength, acceleration, cell);
            missed = fabs(1.0 - 2.0 * acceleration * course.rest_integral / cell.square);
        }
        if (cell.time + course.duration > horizon) {
            ending = LATE;
            cell.width *= cell.share(place_of(course.pace, horizon - cell.time));
            cell.bend = most(cell.bend, 0.0);
            course = course_of(curve, strength, acceleration, cell);
            missed = fabs(1.0 - (cell.time + course.duration) / horizon);
        }
        return missed;
    }

    // Accept a cell: update all requested outputs, and advance the state to its end.
    void accept(const Cell &cell, double error, double end) {
        if (wanted.peaks) raise_peaks(cell);
        if (wanted.gradients) follow_gradients();
        if (wanted.balance) add_to_balance(cell);
        if (wanted.times) take_samples(cell);
        if (wanted.nodes)
            for (int j = 0; j < VECTORS; j++) store(node_values(wanted.nodes) + j * WIDTH, course.distance.at[j]);
        cells++;
        distance = end, square = course.last_square, time += course.duration, growth += course.growth;
        error_sum += error * course.duration;
        row = curve.find(distance, row);
        slope = window_slope(curve.windows[row], curve.windows.width, distance);
        status = ending != ON ? ending : distance <= curve.low ? int64_t(CONTACT) : int64_t(ON);
    }

    template <class Number> Number *node_values(Number *from) const { return from + (wanted.first[i] + cells) * GAUSS; }

    Nodes load_nodes(const double *from) const {
        return at_nodes([&](int j) { return load(node_values(from) + j * WIDTH); });
    }

    Nodes times_at(const Cell &cell) const {
        const Nodes passed = so_far(course.pace);
        return at_nodes([&](int j) { return cell.time + passed.at[j]; });
    }

    double distance_at(const Cell &cell, double z) const { return cell.start - cell.width * cell.share(z); }

    void raise_peaks(const Cell &cell) {
        const Nodes at = times_at(cell), rate = at_nodes([&](int j) {
            return strength * (course.slope.at[j] * course.slope.at[j]) * course.square.at[j];
        });
        const Nodes moving =
            at_nodes([&](int j) { return velocity + push * at.at[j] + root(course.square.at[j]); });
        const Nodes travel = at_nodes([&](int j) {
            return place + (velocity + 0.5 * push * at.at[j]) * at.at[j] - course.distance.at[j];
        });
        const double where = raise(rate, largest_rate, smallest_rate);
        if (where == where) rate_distance = distance_at(cell, where);
        raise(moving, fastest, slowest);
        raise(travel, farthest, nearest);
    }

    // Update the largest value, and the smallest value (stored with opposite sign). Return the place of the new largest
    // value; NaN if it is unchanged.
    static double raise(const Nodes &nodes, double &largest, double &smallest) {
        Lanes fine[FINE / WIDTH] = {};
        for (int i = 0; i < GAUSS; i++) {
            const Lanes value = all(nodes[i]);
            for (int k = 0; k < FINE / WIDTH; k++) fine[k] += value * load(AT.fine[i] + k * WIDTH);
        }
        double values[FINE];
        for (int k = 0; k < FINE / WIDTH; k++) store(values + k * WIDTH, fine[k]);
        Lanes high = fine[0], low = fine[0];
        for (int k = 1; k < FINE / WIDTH; k++) high = most(fine[k], high), low = least(fine[k], low);
        double top = high[0], bottom = low[0];
        for (int k = 1; k < WIDTH; k++) top = most(high[k], top), bottom = least(low[k], bottom);
        int best = 0, worst = 0;
        while (best < FINE - 1 && values[best] != top) best++;
        while (worst < FINE - 1 && values[worst] != bottom) worst++;
        const Maximum highest = maximum(nodes, values, best, 1.0, largest);
        largest = highest.value, smallest = maximum(nodes, values, worst, -1.0, smallest).value;
        return highest.place;
    }

    // Propagate the derivatives of l'^2 and t over the cell. push: e^q h |dl/dz| for one input.
    void follow_gradients() {
        const auto follow = [&](int k, const Nodes &push) {
            const Nodes passed = so_far(push);
            const Nodes by_pace = at_nodes([&](int j) {
                const Lanes along = course.decay.at[j] * (by_square[k] - 2.0 * passed.at[j]);
                return course.pace.at[j] * along / course.square.at[j];
            });
            by_time[k] -= 0.5 * integral(by_pace);
            by_square[k] = exp(-course.growth) * (by_square[k] - 2.0 * integral(push));
        };
        const Nodes none = at_nodes([](int) { return Lanes{}; });
        follow(0, at_nodes([&](int j) {
                   return course.grown.at[j] * (course.slope.at[j] * course.slope.at[j]) * course.square.at[j];
               }));
        follow(1, course.grown);
        follow(2, none);
        follow(3, none);
        if (!wanted.changes) return;
        const Nodes change = load_nodes(wanted.changes);
        follow(4, at_nodes([&](int j) {
                   const Lanes by_slope = 2.0 * strength * course.slope.at[j] * change.at[j];
                   return course.grown.at[j] * by_slope * course.square.at[j];
               }));
    }

    // Add k int s' ds and its moment, with s = ln xi. As a check, ds is computed from ln xi, which the quadrature does
    // not use.
    void add_to_balance(const Cell &cell) {
        const Nodes level = load_nodes(wanted.log_outputs), at = times_at(cell);
        const double first = level[0];
        const Nodes rise = times(at_nodes([&](int j) { return level.at[j] - first; }), AT.change);
        const Nodes force = at_nodes(
            [&](int j) { return -strength * course.slope.at[j] * root(course.square.at[j]) * rise.at[j]; });
        impulse += integral(force);
        moment += integral(at_nodes([&](int j) { return force.at[j] * at.at[j]; }));
    }

    // Write l and |l'| at the requested times inside the cell.
    void take_samples(const Cell &cell) {
        const double *at = wanted.times + i * wanted.m;
        const Polynomial speed(at_nodes([&](int j) { return root(course.square.at[j]); }));
        for (; sample < wanted.m && at[sample] <= cell.time + course.duration; sample++) {
            if (!(at[sample] > begin)) continue;
            const double z = place_of(course.pace, least(most(at[sample] - cell.time, 0.0), course.duration));
            double *to = wanted.trace + 2 * (i * wanted.m + sample);
            to[0] = distance_at(cell, z), to[1] = speed(z);
        }
    }

    void write() const {
        const double duration = time - begin;
        const double row_values[DRAG_ROWS] = {time, distance, square, slope, growth,
                                              duration > 0.0 ? error_sum / duration : 0.0};
        __builtin_memcpy(wanted.rows + i * DRAG_ROWS, row_values, sizeof row_values);
        wanted.status[i] = status, wanted.cells[i] = cells;
        if (wanted.peaks) {
            const double peaks[DRAG_PEAKS] = {largest_rate, rate_distance, -smallest_rate, fastest,
                                              -slowest,     farthest,      -nearest};
            __builtin_memcpy(wanted.peaks + i * DRAG_PEAKS, peaks, sizeof peaks);
        }
        if (wanted.gradients) {
            double *to = wanted.gradients + i * 2 * DRAG_GRADIENTS;
            __builtin_memcpy(to, by_square, sizeof by_square);
            __builtin_memcpy(to + DRAG_GRADIENTS, by_time, sizeof by_time);
        }
        if (wanted.balance) wanted.balance[2 * i] = impulse, wanted.balance[2 * i + 1] = moment;
    }
};

}  // namespace

void drag_approaches(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves, double horizon,
                     const pretouch_approaches *wanted) {
    for (int64_t i = 0; i < n; i++) Approach(inputs, *curves, horizon, *wanted, i).run();
}

}  // namespace PRETOUCH_VARIANT
