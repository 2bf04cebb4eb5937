// The C interface of the sensor chain, and the curve of a sensor.

#include "loop.hpp"

namespace pretouch {

double log_output(const pretouch_curve &curve, double distance) { return sensing::log_output_at(curve, distance); }

double log_slope(const pretouch_curve &curve, double distance) {
    const double place = (distance - curve.low) / curve.step;
    if (!(place > 0.0)) return curve.table[1] / curve.step;
    if (place >= static_cast<double>(curve.rows - 1)) return curve.table[2 * curve.rows - 1] / curve.step;
    const int64_t whole = static_cast<int64_t>(place), i = whole < curve.rows - 2 ? whole : curve.rows - 2;
    const double *row = curve.table + 2 * i;
    return Cubic{row[0], row[1], row[2], row[3]}.slope(place - static_cast<double>(i)) / curve.step;
}

}  // namespace pretouch

// ---- the C interface ----

using namespace pretouch;

int64_t pretouch_sensor_size(void) { return sizeof(Sensor); }

void pretouch_sensor_start(void *sensor, const pretouch_chain *chain, const pretouch_curve *curve, uint64_t seed,
                           int64_t run, pretouch_reading *waiting, int64_t room, double distance) {
    start_sensing(*static_cast<Sensor *>(sensor), *chain, *curve, mix(seed, static_cast<uint64_t>(run)), waiting, room,
                  distance);
}

double pretouch_sensor_next(const void *sensor) { return static_cast<const Sensor *>(sensor)->instant; }

void pretouch_sensor_look(void *sensor, double distance) { look(*static_cast<Sensor *>(sensor), distance); }

int64_t pretouch_sensor_deliver(void *sensor, double t, double *reading, double *measured) {
    Sensor *const own = static_cast<Sensor *>(sensor);
    const int32_t fresh = deliver(*own, t);
    *reading = own->reading;
    *measured = own->measured;
    return fresh;
}
