// The sensor chain of the sampled loop.

#include "loop.hpp"

namespace pretouch {

namespace {

constexpr double PI = 3.14159265358979323846;
constexpr uint64_t MISFIT = 1ull << 63;   // index of the draw for a run's misfit, above those of all readings
constexpr double INNER = 0.1127016653792583;  // first node of the three-point Gauss rule on [0, 1]

// Indices of the random draws of a reading. A normally distributed number needs two of them. The phase of the run uses
// the index of the first reading.
enum Draw : uint64_t { NOISE = 0, JITTER = 2, DROPOUT = 4, DISTANCE = 5, PHASE = 7, DRAWS = 8 };

double uniform_of(uint64_t key, uint64_t index) {  // in (0, 1)
    return (static_cast<double>(mix(key, index) >> 11) + 0.5) * 1.1102230246251565e-16;
}

double normal_of(uint64_t key, uint64_t index) {  // from the draws index and index + 1 (Box, Muller)
    const double radius = sqrt(-2.0 * log(uniform_of(key, index)));
    return radius * cos(2.0 * PI * uniform_of(key, index + 1));
}

double rounded(double value, double step) { return step > 0.0 ? step * floor(value / step + 0.5) : value; }

}  // namespace

namespace {

// The row of a curve's table before a distance, and the place in units of rows.
struct Place {
    const double *row;
    double part;
};

Place find_row(const pretouch_curve &curve, double distance) {
    const double place = (distance - curve.low) / curve.step;
    const int64_t i = static_cast<int64_t>(place) < curve.rows - 2 ? static_cast<int64_t>(place) : curve.rows - 2;
    return {curve.table + 2 * i, place - static_cast<double>(i)};
}

}  // namespace

double log_output(const pretouch_curve &curve, double distance) {
    const double place = (distance - curve.low) / curve.step;
    if (!(place > 0.0)) return curve.table[0];  // also for NaN
    if (place >= static_cast<double>(curve.rows - 1)) return curve.table[2 * (curve.rows - 1)];
    const Place at = find_row(curve, distance);
    return Cubic{at.row[0], at.row[1], at.row[2], at.row[3]}.at(at.part);
}

double log_slope(const pretouch_curve &curve, double distance) {
    const double place = (distance - curve.low) / curve.step;
    if (!(place > 0.0)) return curve.table[1] / curve.step;
    if (place >= static_cast<double>(curve.rows - 1)) return curve.table[2 * curve.rows - 1] / curve.step;
    const Place at = find_row(curve, distance);
    return Cubic{at.row[0], at.row[1], at.row[2], at.row[3]}.slope(at.part) / curve.step;
}

Sensor::Sensor(const pretouch_chain &chain_, const pretouch_curve &curve_, uint64_t key_, pretouch_reading *waiting_,
               int64_t room, double distance)
    : chain(chain_), curve(curve_), key(key_), waiting(waiting_), mask(static_cast<uint64_t>(room) - 1),
      nodes(chain_.exposure > 0.0 ? 3 : 1) {
    if (chain.misfit > 0.0) draw_misfit();
    while (disturbances < PRETOUCH_MOST_DISTURBANCES && chain.disturbances[disturbances].kind != 0.0)
        begun[disturbances++] = INFINITY;
    start = start_of(0);
    instant = start + chain.exposure * INNER;
    if (instant <= INSTANT && chain.exposure <= 0.0) look_at_start(distance);
}

Sensor::Sensor(const pretouch_loop &loop, int64_t index, pretouch_reading *waiting_, int64_t room)
    : Sensor(loop.chain, loop.curves[loop.curve_of[index]],
             mix(loop.seed, static_cast<uint64_t>(loop.draws[index])), waiting_, room,
             loop.scenes[index].xo - loop.scenes[index].x) {}

// Draws a random function with the covariance misfit^2 exp(-d^2 / (2 misfit_length^2)): a sum of cosines with normally
// distributed wave numbers and uniformly distributed phases (A. Rahimi, B. Recht, NIPS 2007).
void Sensor::draw_misfit() {
    const uint64_t own = mix(key, MISFIT);
    for (uint64_t j = 0; j < WAVES; j++)
        waves[j] = {chain.misfit * sqrt(2.0 / WAVES), normal_of(own, 3 * j) / chain.misfit_length,
                    2.0 * PI * uniform_of(own, 3 * j + 2)};
}

// The misfit of this run: by how much its ln xi exceeds that of the sensor curve at a distance.
double Sensor::misfit_at(double distance) const {
    if (!(chain.misfit > 0.0)) return 0.0;
    double sum = 0.0;
    for (const Wave &w : waves) sum += w.amplitude * cos(w.number * distance + w.phase);
    return sum;
}

// Time at which an exposure starts [s].
double Sensor::start_of(uint64_t exposure) const {
    const double phase = chain.random_phase != 0.0 ? uniform_of(key, PHASE) / chain.rate : chain.phase;
    const double shift = chain.jitter > 0.0 ? chain.jitter * normal_of(key, DRAWS * exposure + JITTER) : 0.0;
    return larger(phase + static_cast<double>(exposure) / chain.rate + shift, 0.0);
}

double Sensor::output(double distance) const {
    if (distance > curve.high) return 0.0;
    return exp(log_output(curve, distance) + misfit_at(larger(distance, curve.low)));
}

// The quantity that an exposure averages: the output xi, or the distance if the sensor measures a distance.
double Sensor::exposed_to(double distance) const {
    return chain.measures_distance != 0.0 ? distance : output(distance);
}

// Begins the disturbances whose time or distance has come.
void Sensor::begin_disturbances(double distance) {
    for (int i = 0; i < disturbances; i++) {
        const pretouch_disturbance &d = chain.disturbances[i];
        if (begun[i] == INFINITY && (instant >= d.time - INSTANT || distance <= d.distance))
            begun[i] = smaller(d.time, instant);
    }
}

// The message of an exposure, from its mean. A sensor that measures a distance knows whether there is an object on its
// curve; any other one has an output also without an object.
Sensor::Message Sensor::message_of(double mean, double time) {
    const uint64_t draw = DRAWS * k;
    if (chain.dropout > 0.0 && uniform_of(key, draw + DROPOUT) < chain.dropout) return {NAN, false};
    const bool measures_distance = chain.measures_distance != 0.0;
    bool no_object = false;
    if (measures_distance) {
        const double noisy = mean + chain.distance_noise * normal_of(key, draw + DISTANCE);
        const double distance = rounded(noisy, chain.distance_resolution);
        no_object = distance > curve.high;
        mean = output(distance);
    }
    Message replaced = {NAN, false};
    for (int i = 0; i < disturbances; i++) {
        const pretouch_disturbance &d = chain.disturbances[i];
        if (!(begun[i] <= time && time < begun[i] + d.duration)) continue;
        switch (static_cast<int>(d.kind)) {
        case PRETOUCH_CABLE: replaced = {0.0, false}; break;
        case PRETOUCH_REFLECTANCE: mean *= d.factor; break;
        case PRETOUCH_OBJECT_LEAVES:
            mean = 0.0;
            no_object = measures_distance;
            break;
        case PRETOUCH_FULL_SCALE: replaced = {chain.highest, false}; break;
        default: replaced = last;  // NaN, thus without effect, if it is the first reading
        }
    }
    last = isnan(replaced.value) ? Message{clean_reading(mean, time), no_object} : replaced;
    return last;
}

// The reading of an exposure of a sensor that works, from its mean xi.
double Sensor::clean_reading(double mean, double time) const {
    const uint64_t draw = DRAWS * k;
    double value = mean + chain.offset + chain.drift * time;
    if (chain.noise > 0.0 || chain.relative_noise > 0.0) {
        const double deviation =
            sqrt(chain.noise * chain.noise + chain.relative_noise * chain.relative_noise * mean * mean);
        value += deviation * normal_of(key, draw + NOISE);
    }
    return rounded(smaller(larger(value, chain.lowest), chain.highest), chain.resolution);
}

void Sensor::send(const Message &message, double ready, double taken) {
    waiting[tail++ & mask] = {message.value, ready, taken, message.no_object ? 1.0 : 0.0};
}

// Makes the first reading at t = 0 from the initial distance.
void Sensor::look_at_start(double distance) {
    begin_disturbances(distance);
    send(message_of(exposed_to(distance), 0.0), chain.delay, 0.0);
    k = 1;
    instant = start = start_of(1);
}

void Sensor::look(double distance) {
    const double weight = nodes == 1 ? 1.0 : node == 1 ? 8.0 / 18.0 : 5.0 / 18.0;
    total += weight * exposed_to(distance);
    if (disturbances) begin_disturbances(distance);
    if (++node == nodes) {
        send(message_of(total, instant), start + chain.exposure + chain.delay, start + 0.5 * chain.exposure);
        node = 0;
        total = 0.0;
        start = larger(start_of(++k), start + chain.exposure);
    }
    const double part = node == 0 ? INNER : node == 1 ? 0.5 : 1.0 - INNER;
    instant = larger(nodes == 3 ? start + chain.exposure * part : start, instant);
}

int32_t Sensor::deliver(double t) {
    int32_t fresh = PRETOUCH_NOTHING;
    for (; head < tail && waiting[head & mask].ready <= t + INSTANT; head++) {
        const pretouch_reading &next = waiting[head & mask];
        if (isnan(next.value)) continue;
        reading = next.value;
        measured = next.taken;
        fresh = next.no_object != 0.0 ? PRETOUCH_NO_OBJECT : PRETOUCH_READING;
    }
    return fresh;
}

static_assert(sizeof(Sensor) <= SENSOR_SIZE);

double start_sensor(void *sensor, const pretouch_loop &loop, int64_t index, pretouch_reading *waiting, int64_t room) {
    return (new (sensor) Sensor(loop, index, waiting, room))->next();
}

double next_sample(const void *sensor) { return static_cast<const Sensor *>(sensor)->next(); }

double sample_distance(void *sensor, double distance) {
    Sensor *one = static_cast<Sensor *>(sensor);
    one->look(distance);
    return one->next();
}

int32_t deliver_reading(void *sensor, double t, double *reading, double *measured) {
    Sensor *one = static_cast<Sensor *>(sensor);
    const int32_t fresh = one->deliver(t);
    *reading = one->reading;
    *measured = one->measured;
    return fresh;
}

}  // namespace pretouch

// ---- the C interface ----

using namespace pretouch;

int64_t pretouch_sensor_size(void) { return sizeof(Sensor); }

void pretouch_sensor_start(void *sensor, const pretouch_chain *chain, const pretouch_curve *curve, uint64_t seed,
                           int64_t run, pretouch_reading *waiting, int64_t room, double distance) {
    new (sensor) Sensor(*chain, *curve, mix(seed, static_cast<uint64_t>(run)), waiting, room, distance);
}

double pretouch_sensor_next(const void *sensor) { return static_cast<const Sensor *>(sensor)->next(); }

void pretouch_sensor_look(void *sensor, double distance) { static_cast<Sensor *>(sensor)->look(distance); }

int64_t pretouch_sensor_deliver(void *sensor, double t, double *reading, double *measured) {
    Sensor *const own = static_cast<Sensor *>(sensor);
    const int32_t fresh = own->deliver(t);
    *reading = own->reading;
    *measured = own->measured;
    return fresh;
}
