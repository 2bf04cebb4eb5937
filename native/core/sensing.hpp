// The sensor chain of the sampled loop, from the distance to the reading that arrives at the controller.
//
// The code of single encounters (loop*.cpp) and the vectorized loop (lanes_loop.cpp) both use these functions. They are
// static, so that each source has its own copy, which is compiled for its kind of processor. Contraction to fused
// multiply-add instructions is off in both, so all copies compute the same bits.

#pragma once

#include <math.h>

#include "pretouch.h"

namespace pretouch {

static inline double larger(double a, double b) { return b > a ? b : a; }
static inline double smaller(double a, double b) { return b < a ? b : a; }

constexpr double INSTANT = 1e-12;  // s; instants that are closer count as simultaneous

// Returns 64 random bits for a key and an index.
static inline uint64_t mix(uint64_t key, uint64_t index) {
    uint64_t z = key + (index + 1) * 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

// One cosine of the misfit of the sensor curve in a run: amplitude, wave number [1/m] and phase.
struct Wave {
    double amplitude, number, phase;
};

// A reading before the delay, or a message of a sensor of distances that sees no object.
struct Message {
    double value;  // NaN if the reading is lost by a dropout
    bool no_object;
};

constexpr int WAVES = 8;

// The sensor in one run. It averages the distance over exposures, makes a reading of each, and stores the readings that
// are in transit to the controller.
struct Sensor {
    const pretouch_chain *chain;
    const pretouch_curve *curve;
    uint64_t key;               // of the run's random numbers
    pretouch_reading *waiting;  // memory for the readings in transit
    uint64_t mask;              // their number is a power of two; this is the number minus 1
    uint64_t head, tail;
    uint64_t k;  // number of the exposure, in which `nodes` samples are taken
    double phase;  // start of the first exposure without jitter [s]
    double total, start, instant;  // sum of the samples of an exposure, its start, and the next sample [s]
    double reading, measured;      // the last delivered reading, and when it was measured [s]
    int nodes, node, disturbances;
    Message last;                              // the last message before the delay
    double begun[PRETOUCH_MOST_DISTURBANCES];  // when each disturbance began [s]; infinite before
    Wave waves[WAVES];
};

// Functions that few sensors need are marked as cold, so that they are not inlined.
namespace sensing {

constexpr double PI = 3.14159265358979323846;
constexpr uint64_t MISFIT = 1ull << 63;       // index of the draw for a run's misfit, above those of all readings
constexpr double INNER = 0.1127016653792583;  // first node of the three-point Gauss rule on [0, 1]

// Indices of the random draws of a reading. A normally distributed number needs two of them. The phase of the run uses
// the index of the first reading.
enum Draw : uint64_t { NOISE = 0, JITTER = 2, DROPOUT = 4, DISTANCE = 5, PHASE = 7, DRAWS = 8 };

static inline double uniform_of(uint64_t key, uint64_t index) {  // in (0, 1)
    return (static_cast<double>(static_cast<int64_t>(mix(key, index) >> 11)) + 0.5) * 1.1102230246251565e-16;
}

static inline double normal_of(uint64_t key, uint64_t index) {  // from the draws index and index + 1 (Box, Muller)
    const double radius = sqrt(-2.0 * log(uniform_of(key, index)));
    return radius * cos(2.0 * PI * uniform_of(key, index + 1));
}

static inline double rounded(double value, double step) { return step > 0.0 ? step * floor(value / step + 0.5) : value; }

// ln xi by cubic interpolation between values and slopes at equally spaced distances, constant beyond both ends.
static inline double log_output_at(const pretouch_curve &curve, double distance) {
    const double place = (distance - curve.low) / curve.step;
    if (!(place > 0.0)) return curve.table[0];  // also for NaN
    if (place >= static_cast<double>(curve.rows - 1)) return curve.table[2 * (curve.rows - 1)];
    const int64_t whole = static_cast<int64_t>(place), i = whole < curve.rows - 2 ? whole : curve.rows - 2;
    const double *row = curve.table + 2 * i, s = place - static_cast<double>(i);
    const double second = 3.0 * (row[2] - row[0]) - 2.0 * row[1] - row[3];
    const double third = row[1] + row[3] - 2.0 * (row[2] - row[0]);
    return row[0] + s * (row[1] + s * (second + s * third));
}

// Draws a random function with the covariance misfit^2 exp(-d^2 / (2 misfit_length^2)): a sum of cosines with normally
// distributed wave numbers and uniformly distributed phases (A. Rahimi, B. Recht, NIPS 2007).
[[gnu::cold]] static inline void draw_misfit(Sensor &s) {
    const uint64_t own = mix(s.key, MISFIT);
    for (uint64_t j = 0; j < WAVES; j++)
        s.waves[j] = {s.chain->misfit * sqrt(2.0 / WAVES), normal_of(own, 3 * j) / s.chain->misfit_length,
                      2.0 * PI * uniform_of(own, 3 * j + 2)};
}

// The misfit of this run: by how much its ln xi exceeds that of the sensor curve at a distance.
[[gnu::cold]] static inline double misfit_at(const Sensor &s, double distance) {
    double sum = 0.0;
    for (const Wave &w : s.waves) sum += w.amplitude * cos(w.number * distance + w.phase);
    return sum;
}

// Time at which an exposure starts [s].
static inline double start_of(const Sensor &s, uint64_t exposure) {
    const double shift =
        s.chain->jitter > 0.0 ? s.chain->jitter * normal_of(s.key, DRAWS * exposure + JITTER) : 0.0;
    return larger(s.phase + static_cast<double>(static_cast<int64_t>(exposure)) / s.chain->rate + shift, 0.0);
}

static inline double output(const Sensor &s, double distance) {
    if (distance > s.curve->high) return 0.0;
    const double level = log_output_at(*s.curve, distance);
    return exp(s.chain->misfit > 0.0 ? level + misfit_at(s, larger(distance, s.curve->low)) : level);
}

// The quantity that an exposure averages: the output xi, or the distance if the sensor measures a distance.
static inline double exposed_to(const Sensor &s, double distance) {
    return s.chain->measures_distance != 0.0 ? distance : output(s, distance);
}

// Begins the disturbances whose time or distance has come.
[[gnu::cold]] static inline void begin_disturbances(Sensor &s, double distance) {
    for (int i = 0; i < s.disturbances; i++) {
        const pretouch_disturbance &d = s.chain->disturbances[i];
        if (s.begun[i] == INFINITY && (s.instant >= d.time - INSTANT || distance <= d.distance))
            s.begun[i] = smaller(d.time, s.instant);
    }
}

// The reading of an exposure of a sensor that works, from its mean xi.
static inline double clean_reading(const Sensor &s, double mean, double time) {
    const pretouch_chain &chain = *s.chain;
    double value = mean + chain.offset + chain.drift * time;
    if (chain.noise > 0.0 || chain.relative_noise > 0.0) {
        const double deviation =
            sqrt(chain.noise * chain.noise + chain.relative_noise * chain.relative_noise * mean * mean);
        value += deviation * normal_of(s.key, DRAWS * s.k + NOISE);
    }
    return rounded(smaller(larger(value, chain.lowest), chain.highest), chain.resolution);
}

// The message of an exposure, from its mean. A sensor that measures a distance knows whether there is an object on its
// curve; any other one has an output also without an object.
static inline Message message_of(Sensor &s, double mean, double time) {
    const pretouch_chain &chain = *s.chain;
    const uint64_t draw = DRAWS * s.k;
    if (chain.dropout > 0.0 && uniform_of(s.key, draw + DROPOUT) < chain.dropout) return {NAN, false};
    const bool measures_distance = chain.measures_distance != 0.0;
    bool no_object = false;
    if (measures_distance) {
        const double noisy = mean + chain.distance_noise * normal_of(s.key, draw + DISTANCE);
        const double distance = rounded(noisy, chain.distance_resolution);
        no_object = distance > s.curve->high;
        mean = output(s, distance);
    }
    Message replaced = {NAN, false};
    for (int i = 0; i < s.disturbances; i++) {
        const pretouch_disturbance &d = chain.disturbances[i];
        if (!(s.begun[i] <= time && time < s.begun[i] + d.duration)) continue;
        switch (static_cast<int>(d.kind)) {
        case PRETOUCH_CABLE: replaced = {0.0, false}; break;
        case PRETOUCH_REFLECTANCE: mean *= d.factor; break;
        case PRETOUCH_OBJECT_LEAVES:
            mean = 0.0;
            no_object = measures_distance;
            break;
        case PRETOUCH_FULL_SCALE: replaced = {chain.highest, false}; break;
        default: replaced = s.last;  // NaN, thus without effect, if it is the first reading
        }
    }
    s.last = isnan(replaced.value) ? Message{clean_reading(s, mean, time), no_object} : replaced;
    return s.last;
}

static inline void send(Sensor &s, const Message &message, double ready, double taken) {
    s.waiting[s.tail++ & s.mask] = {message.value, ready, taken, message.no_object ? 1.0 : 0.0};
}

// Makes the first reading at t = 0 from the initial distance.
[[gnu::cold]] static inline void look_at_start(Sensor &s, double distance) {
    begin_disturbances(s, distance);
    send(s, message_of(s, exposed_to(s, distance), 0.0), s.chain->delay, 0.0);
    s.k = 1;
    s.instant = s.start = start_of(s, 1);
}

}  // namespace sensing

// Starts the sensor of a run. key: key of the run's random numbers; waiting: memory for `room` readings; distance: at
// the start [m].
static inline void start_sensing(Sensor &s, const pretouch_chain &chain, const pretouch_curve &curve, uint64_t key,
                                 pretouch_reading *waiting, int64_t room, double distance) {
    using namespace sensing;
    s = Sensor{};
    s.chain = &chain;
    s.curve = &curve;
    s.key = key;
    s.waiting = waiting;
    s.mask = static_cast<uint64_t>(room) - 1;
    s.nodes = chain.exposure > 0.0 ? 3 : 1;
    s.last = {NAN, false};
    if (chain.misfit > 0.0) draw_misfit(s);
    while (s.disturbances < PRETOUCH_MOST_DISTURBANCES && chain.disturbances[s.disturbances].kind != 0.0)
        s.begun[s.disturbances++] = INFINITY;
    s.phase = chain.random_phase != 0.0 ? uniform_of(key, PHASE) / chain.rate : chain.phase;
    s.start = start_of(s, 0);
    s.instant = s.start + chain.exposure * INNER;
    if (s.instant <= INSTANT && chain.exposure <= 0.0) look_at_start(s, distance);
}

// Starts the sensor of the encounter of a loop with this index.
static inline void start_sensing(Sensor &s, const pretouch_loop &loop, int64_t index, pretouch_reading *waiting,
                                 int64_t room) {
    const pretouch_scene &scene = loop.scenes[index];
    start_sensing(s, loop.chain, loop.curves[loop.curve_of[index]],
                  mix(loop.seed, static_cast<uint64_t>(loop.draws[index])), waiting, room, scene.xo - scene.x);
}

// Samples the distance at the time `instant` of the sensor. If this completes an exposure, adds its reading to those in
// transit.
static inline void look(Sensor &s, double distance) {
    using namespace sensing;
    const double exposure = s.chain->exposure;
    const double weight = s.nodes == 1 ? 1.0 : s.node == 1 ? 8.0 / 18.0 : 5.0 / 18.0;
    s.total += weight * exposed_to(s, distance);
    if (s.disturbances) begin_disturbances(s, distance);
    if (++s.node == s.nodes) {
        send(s, message_of(s, s.total, s.instant), s.start + exposure + s.chain->delay, s.start + 0.5 * exposure);
        s.node = 0;
        s.total = 0.0;
        s.start = larger(start_of(s, ++s.k), s.start + exposure);
    }
    const double part = s.node == 0 ? INNER : s.node == 1 ? 0.5 : 1.0 - INNER;
    s.instant = larger(s.nodes == 3 ? s.start + exposure * part : s.start, s.instant);
}

// Returns when the next reading in transit arrives [s]; infinite if there is none.
static inline double next_arrival(const Sensor &s) {
    return s.head < s.tail ? s.waiting[s.head & s.mask].ready : INFINITY;
}

// Delivers the newest reading that is available at a time; returns what is new: PRETOUCH_NOTHING, PRETOUCH_READING, or
// PRETOUCH_NO_OBJECT if a sensor of distances saw none.
static inline int32_t deliver(Sensor &s, double t) {
    int32_t fresh = PRETOUCH_NOTHING;
    for (; s.head < s.tail && s.waiting[s.head & s.mask].ready <= t + INSTANT; s.head++) {
        const pretouch_reading &next = s.waiting[s.head & s.mask];
        if (isnan(next.value)) continue;
        s.reading = next.value;
        s.measured = next.taken;
        fresh = next.no_object != 0.0 ? PRETOUCH_NO_OBJECT : PRETOUCH_READING;
    }
    return fresh;
}

}  // namespace pretouch
