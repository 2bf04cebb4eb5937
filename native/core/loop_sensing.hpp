// The sensor chain of the sampled loop: from the distance at an instant to the number that the controller is handed.
//
// Random numbers come by their index: the k-th draw of a run is the same whatever was drawn before, on any thread. So
// two runs with one seed meet the same noise, reading by reading, even where one of them ends earlier: common random
// numbers. The mixing is that of SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014).
#pragma once

#include "loop_mechanics.hpp"

namespace pretouch {

constexpr double INSTANT = 1e-12;  // s: instants that are closer are one

// 64 random bits for an index.
inline uint64_t mix(uint64_t key, uint64_t index) {
    uint64_t z = key + (index + 1) * 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

// One cosine of the error that a curve has in a run: amplitude, wave number [1/m], phase.
struct Wave {
    double amplitude, number, phase;
};

// The sensor in one run: exposures that end up as readings, and readings on their way to the controller.
class Sensor {
public:
    Sensor(const pretouch_chain &chain, const pretouch_curve &curve, uint64_t key, pretouch_reading *waiting,
           int64_t room);

    // When it looks at the distance next [s].
    double next() const { return instant; }

    // Looks at the distance, and makes a reading of an exposure that is over.
    void look(double distance);

    // A reading at the start, before anything has moved.
    void look_at_start(double distance);

    // Hands over what is there by a time; says whether there was any.
    bool deliver(double t);

    double reading = 0.0, measured = 0.0;  // what was handed over last, and when it was measured [s]

private:
    const pretouch_chain &chain;
    const pretouch_curve &curve;
    const uint64_t key;
    pretouch_reading *const waiting;
    const uint64_t mask;
    uint64_t head = 0, tail = 0;
    uint64_t k = 0;  // the exposure, which is looked at `nodes` times
    const int nodes;
    int node = 0;
    double total = 0.0, start = 0.0, instant = 0.0;
    static constexpr int WAVES = 8;
    Wave waves[WAVES];

    double start_of(uint64_t exposure) const;
    double misfit_at(double distance) const;
    double output(double distance) const;
    double exposed_to(double distance) const;
    double raw_reading(double mean, double time) const;
    void draw_misfit();
};

}  // namespace pretouch
