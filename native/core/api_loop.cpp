// The sampled loop, behind the plain interface of pretouch.h.

#include <string.h>

#include "loop.hpp"

using namespace pretouch;

void pretouch_run_encounters(const pretouch_loop *loop, const int64_t *which, int64_t n, void *state,
                             pretouch_reading *waiting, int64_t room) {
    const pretouch_laws &laws = loop->laws;
    for (int64_t i = 0; i < n; i++) {
        const int64_t index = which[i];
        memcpy(state, laws.states + laws.start_of[index] * laws.state_size, static_cast<size_t>(laws.state_size));
        const Law law = {laws.step, laws.parameters + laws.law_of[index] * laws.parameters_size, state};
        Encounter(*loop, index, law, waiting, room).run();
    }
}

void pretouch_run_law(pretouch_law_step *step, const void *parameters, void *state, const pretouch_sample *samples,
                      int64_t n, pretouch_output *out) {
    for (int64_t i = 0; i < n; i++) step(parameters, state, samples + i, out + i);
}

double pretouch_contact_step(const pretouch_contact *contact, double inverse_mass, double speed) {
    return contact_step(*contact, inverse_mass, speed);
}

double pretouch_elastic_duration(const pretouch_contact *contact, double inverse_mass, double speed) {
    return elastic_duration(*contact, inverse_mass, speed);
}

double pretouch_cubic(double start, double start_slope, double end, double end_slope, double s, double *slope) {
    const Cubic cubic = {start, start_slope, end, end_slope};
    *slope = cubic.slope(s);
    return cubic.at(s);
}

double pretouch_first_touch(double start, double start_slope, double end, double end_slope, double doubt,
                            double *least) {
    const Touch touch = first_touch({start, start_slope, end, end_slope}, doubt);
    *least = touch.least;
    return touch.part;
}
