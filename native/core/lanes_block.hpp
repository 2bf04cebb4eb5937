// Simulate many encounters from the start to the contact by vectorized Taylor steps. An encounter whose contact is not
// proved keeps the status OPEN; the guaranteed path (lanes_guaranteed.cpp) can solve it.
//
// Each vector lane holds one encounter with a separate time, step and window of its curve. One table holds the windows
// of all curves, and each encounter stores which rows belong to its curve. When an encounter ends, the next one takes
// its lane at once. So no lane waits for another, and no result depends on the other lanes. Encounters that reach the
// contact are queued in a second set of lanes. When this queue is full, their contacts are computed together.
//
// What is proved: on each step, t = length * s with s in [0, 1], the sum b_1 + sum_k max(0, k b_k) is an upper bound of
// dl/ds. A step is accepted only if this bound is negative. Then l falls during the whole step, so it has at most one
// zero, and its value at the end decides whether there is one. Otherwise the step is passed only if l is proved to stay
// between two levels (pass_turn), or it is shortened. If neither helps, the encounter stays open.
//
// What is estimated: the last Taylor coefficient of each step is taken as the truncation error of l and of l'. This
// error is propagated to the contact; it may stay, grow, or be amplified if the damping decreases. Divided by |l'|, it
// is an error of the contact time. If that exceeds 1e-10 of the time, the encounter stays open.

#pragma once

#include "lanes_demands.hpp"
#include "lanes_responses.hpp"
#include "lanes_windows.hpp"
#include "pretouch.h"

namespace PRETOUCH_VARIANT {

namespace {

constexpr double LARGEST_DOUBT = 1e-10;  // largest accepted error of the contact time, relative; documented: 1e-9
constexpr double ROUGHLY = 1e-5;         // Newton's tolerance at a border, in step lengths; the error is its square
constexpr int MOST_CUTS = 4;             // how often one step may be shortened; then the encounter stays open
constexpr int8_t CONTACT = 0, OPEN = -1;

// Inputs and output arrays of a call. Outputs have rows of n numbers; gradients and each row of peaks may be null.
struct Request {
    const pretouch_column *inputs, *reference;
    int64_t n;
    const pretouch_curves *curves;
    double horizon, *out, *gradients;
    DemandsOut peaks;
    int8_t *status;
};

struct Nothing {};
template <class A, class B> constexpr bool SAME = false;
template <class A> constexpr bool SAME<A, A> = true;

// The motion in each lane, and the quantities that are computed with it: Nothing, Responses or Demands.
template <class Extra> struct Work {
    Motion motion;
    Extra extra;
};
template <> struct Work<Nothing> {
    Motion motion;
};

inline double number(const pretouch_column &column, int64_t i) { return column.at[i * column.stride]; }

// The mask of the lanes whose bits are set.
inline Masks chosen(uint64_t which) {
    Masks bit;
    for (int i = 0; i < WIDTH; i++) bit[i] = (int64_t)1 << i;
    return ((Masks{} + int64_t(which)) & bit) != 0;
}

template <int DEGREE, class Extra> class Block {
  public:
    explicit Block(const Request &request)
        : ask(request), windows{request.curves->windows, request.curves->width} {
        memset(&work, 0, sizeof work);
        memset(&queue, 0, sizeof queue);
        room.count = 0;
    }

    void run() {
        for (int64_t i = 0; i < 6 * ask.n; i++) ask.out[i] = NOT_A_NUMBER;
        memset(ask.status, OPEN, size_t(ask.n));
        for (fill(); active; fill()) advance();
        if (waiting) finish();
        if constexpr (HAS_DEMANDS) {
            room.settle(ask.peaks);
            for (int64_t i = 0; i < ask.n; i++) {
                if (ask.status[i] == CONTACT) continue;
                for (double *row : ask.peaks.rows)
                    if (row) row[i] = NOT_A_NUMBER;
            }
        }
    }

  private:
    static constexpr bool HAS_GRADIENTS = SAME<Extra, Responses>, HAS_DEMANDS = SAME<Extra, Demands>;
    static constexpr bool IS_LINE = DEGREE == 1;
    static constexpr uint64_t EVERY = (1ULL << WIDTH) - 1;

    const Request &ask;
    const Windows windows;
    Work<Extra> work, queue;
    Room room;
    int64_t owner[WIDTH], owners[WIDTH];              // index of the encounter in each lane, and of each queued one
    int64_t place[WIDTH], first[WIDTH], last[WIDTH];  // row of its window; rows of its curve: first, beyond the last
    int cuts[WIDTH], waiting = 0;
    int64_t following = 0, hint = 0;
    uint64_t active = 0;

    // Assign the next encounters to the free lanes.
    void fill() {
        while (active != EVERY && following < ask.n) {
            if (begin(following, __builtin_ctzll(~active))) active |= active + 1;
            following++;
        }
    }

    // Assign an encounter to a lane. Return false if it must stay open: its inputs are not valid, l is not positive at
    // the start, or the curve does not reach from l = 0 to the initial l.
    bool begin(int64_t i, int lane) {
        const pretouch_column *in = ask.inputs;
        const double m = number(in[0], i), d = number(in[1], i), k = number(in[2], i), x0 = number(in[3], i);
        const double u0 = number(in[4], i), p = number(in[5], i), v = number(in[6], i), a = number(in[7], i);
        const double gain = number(in[8], i), l = p - x0, inverse = 1 / m;
        const double sizes = absolute(d) + absolute(k) + absolute(a) + absolute(gain) + absolute(p) + absolute(x0);
        if (!(m > 0 && m < INFINITE && sizes + absolute(v) + absolute(u0) < INFINITE && l > 0)) return false;
        const int64_t curve = ask.curves->curve_of[i * ask.curves->stride];
        const int64_t lowest = ask.curves->starts[curve], beyond = ask.curves->starts[curve + 1];
        if (lowest == beyond || windows[lowest][LOW] != 0.0) return false;
        const int64_t index = find_window(windows, lowest, beyond, l, hint);
        if (index < 0) return false;
        hint = index;
        Motion &to = work.motion;
        to.damping[lane] = d * inverse;
        to.stiffness[lane] = k * inverse;
        to.gain[lane] = gain * inverse;
        to.position[lane] = p;
        to.velocity[lane] = v;
        to.acceleration[lane] = a;
        to.state.time[lane] = to.state.integral[lane] = to.state.error[lane] = to.state.strongest[lane] = 0.0;
        to.state.distance[lane] = l;
        to.state.speed[lane] = v - u0;
        to.cap[lane] = NEVER;
        to.steps[lane] = 0.0;
        to.scale[lane] = HAS_GRADIENTS || HAS_DEMANDS ? l / SPARE : l;
        enter_window<DEGREE>(windows[index], index == lowest, to, lane);
        if constexpr (HAS_GRADIENTS) {
            const double slope = window_slope(windows[index], windows.width, l);
            work.extra.start(lane, m, (d + gain * slope) * inverse);
        }
        if constexpr (HAS_DEMANDS) {
            work.extra.start(lane, m, v - u0, x0, number(ask.reference[0], i), number(ask.reference[1], i));
        }
        owner[lane] = i;
        place[lane] = index;
        first[lane] = lowest;
        last[lane] = beyond;
        cuts[lane] = 0;
        return true;
    }

    // Try one step in every lane. Lanes without another step are released.
    void advance() {
        Motion &m = work.motion;
        const State before = m.state;
        Taken taken = take_step<DEGREE>(m, ask.horizon);
        for (uint64_t stuck = ~taken.moved & active; stuck; stuck &= stuck - 1) {
            const int lane = __builtin_ctzll(stuck);
            if (!(m.bound[lane] < 0)) turn(lane, taken);
        }
        uint64_t rough = 0;
        if constexpr (HAS_GRADIENTS) rough = carry(before, taken);
        if constexpr (HAS_DEMANDS) {
            follow_demands<IS_LINE>(m, work.extra, before.time, chosen(taken.moved), owner, room, ask.peaks);
        }
        for (uint64_t late = taken.late & active; late; late &= late - 1) descend(__builtin_ctzll(late));
        for (uint64_t stuck = ~taken.moved & active & ~rough; stuck; stuck &= stuck - 1) {
            const int lane = __builtin_ctzll(stuck);
            if (!goes_on(lane)) active &= ~(1ULL << lane);
        }
    }

    // Accept the step of a lane on which l may rise, if l is proved to stay in the window and above 0.
    void turn(int lane, Taken &taken) {
        Motion &m = work.motion;
        if (!pass_turn(m, lane, most(m.edge[lane], 0.0), windows[place[lane]][TOP], ask.horizon)) return;
        taken.moved |= 1ULL << lane;
        if (m.state.distance[lane] < m.leave[lane]) taken.late |= 1ULL << lane;
    }

    // Propagate the responses over the step. Return the lanes in which the step was too long for accurate responses.
    // Their step is undone and will be repeated with a smaller length.
    uint64_t carry(const State &before, Taken &taken) {
        Motion &m = work.motion;
        uint64_t rough = ~carry_responses<DEGREE>(m, work.extra, before.time, chosen(taken.moved)) & active;
        for (uint64_t remaining = rough; remaining; remaining &= remaining - 1) {
            const int lane = __builtin_ctzll(remaining);
            if (m.steps[lane] >= MOST_STEPS) {
                rough &= ~(1ULL << lane);
                continue;
            }
            if (taken.moved >> lane & 1) {  // the step was accepted for the motion: undo it
                copy_lane(&m.state, lane, &before, lane, sizeof before);
                cuts[lane] = 0;
            }
            const double part = 0.9 * root(root(root(root(RESPONSE_TOLERANCE / work.extra.excess[lane]))));
            m.cap[lane] = m.length[lane] * most(part, 0.1);
        }
        taken.moved &= ~rough;
        taken.late &= ~rough;
        return rough;
    }

    // Switch a lane to a lower window.
    void descend(int lane) {
        int64_t index = place[lane];
        while (index > first[lane] && work.motion.state.distance[lane] <= windows[index][LEAVE]) index--;
        enter(lane, index);
    }

    void enter(int lane, int64_t index) {
        place[lane] = index;
        enter_window<DEGREE>(windows[index], index == first[lane], work.motion, lane);
    }

    // Decide what follows in a lane whose step was rejected. Return true if the lane tries another step. Return false
    // if its encounter was queued for its contact, or stays open.
    bool goes_on(int lane) {
        Motion &m = work.motion;
        const double end = m.end[lane], bound = m.bound[lane], length = m.length[lane], change = m.b[1][lane];
        if (m.cap[lane] == NEVER) cuts[lane] = 0;  // the previous step was accepted
        if (!(m.steps[lane] < MOST_STEPS)) return false;
        if (bound < MOST_NEGATIVE * absolute(change)) {
            if (end <= 0.0 && place[lane] == first[lane]) {
                let_wait(lane);
                return false;
            }
            if (!(end <= m.edge[lane])) return false;
            const LaneSeries series(m, lane);
            m.cap[lane] = length * zero_time(series.b, LEVEL, windows[place[lane]][LOW], 0, 1, ROUGHLY);
            return true;
        }
        if (!(bound < INFINITE && cuts[lane] < MOST_CUTS)) return false;
        cuts[lane]++;
        if (place[lane] + 1 < last[lane] && m.state.distance[lane] > windows[place[lane] + 1][LEAVE]) {
            enter(lane, place[lane] + 1);  // l may rise: use the window above
        } else {
            const double spare = change / (change - bound);
            m.cap[lane] = length * (0.8 < spare && spare < 1 ? 0.95 * spare : 0.7);
        }
        return true;
    }

    static void copy_lane(void *to, int to_lane, const void *from, int from_lane, size_t size) {
        double *target = static_cast<double *>(to) + to_lane;
        const double *source = static_cast<const double *>(from) + from_lane;
        for (size_t k = 0; k < size / sizeof(double); k += WIDTH) target[k] = source[k];
    }

    // Queue an encounter whose contact is inside the present step. A full queue is finished.
    void let_wait(int lane) {
        const bool whole = HAS_GRADIENTS || HAS_DEMANDS;
        copy_lane(&queue, waiting, &work, lane, whole ? sizeof work : COPIED * sizeof(Lanes));
        owners[waiting] = owner[lane];
        if (++waiting == WIDTH) finish();
    }

    // Compute and write the contacts of the queued encounters.
    __attribute__((noinline)) void finish() {
        Motion &m = queue.motion;
        const Contacts contact = find_in_step(m);
        const uint64_t there = (1ULL << waiting) - 1;
        uint64_t smooth = 0;
        if constexpr (HAS_GRADIENTS || HAS_DEMANDS) cut_steps(m, contact.time);
        if constexpr (HAS_GRADIENTS) {
            smooth = carry_responses<DEGREE>(m, queue.extra, m.state.time, chosen(there));
        }
        if constexpr (HAS_DEMANDS) {
            follow_demands<IS_LINE>(m, queue.extra, m.state.time, chosen(there), owners, room, ask.peaks);
        }
        const uint64_t certain = there & bits((contact.doubt <= LARGEST_DOUBT) & (contact.time <= ask.horizon) &
                                              (contact.speed < 0.0));
        for (uint64_t remaining = certain; remaining; remaining &= remaining - 1) {
            const int lane = __builtin_ctzll(remaining);
            write(contact, lane);
            if constexpr (HAS_GRADIENTS) {
                if (smooth >> lane & 1) differentiate(contact, lane);
            }
            if constexpr (HAS_DEMANDS) {
                write_demands<IS_LINE>(m, queue.extra, lane, contact.time[lane], owners[lane], ask.peaks);
            }
        }
        waiting = 0;
    }

    void write(const Contacts &contact, int lane) {
        const Motion &m = queue.motion;
        const double p = m.position[lane], v = m.velocity[lane], a = m.acceleration[lane], time = contact.time[lane];
        double *to = ask.out + owners[lane];
        to[0] = time;
        to[ask.n] = p + (v + a / 2 * time) * time;
        to[2 * ask.n] = v + a * time - contact.speed[lane];
        to[3 * ask.n] = a - contact.bend[lane];
        to[4 * ask.n] = contact.speed[lane];
        to[5 * ask.n] = contact.integral[lane];
        ask.status[owners[lane]] = CONTACT;
    }

    void differentiate(const Contacts &contact, int lane) {
        const int64_t i = owners[lane], curve = ask.curves->curve_of[i * ask.curves->stride];
        const double slope = window_slope(windows[ask.curves->starts[curve]], windows.width, 0.0);
        write_gradient(queue.motion, queue.extra, contact, lane, slope, ask.gradients + i, ask.n);
    }
};

}  // namespace

}  // namespace PRETOUCH_VARIANT
