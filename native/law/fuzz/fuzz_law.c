/* A target for libFuzzer: for any samples, the output of the law must be finite and within its limits.
 *
 *     clang -g -O1 -fsanitize=fuzzer,address,undefined -I native/law native/law/fuzz/fuzz_law.c native/law/pretouch_law.c -lm
 *     ./a.out -max_total_time=600
 *
 * The first byte chooses the controller, the second the numbers of its drag; every 49 bytes after them are one
 * sample for both laws. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pretouch_law.h"

static pretouch_parameters parameters_of(uint8_t choice) {
    pretouch_parameters p;
    memset(&p, 0, sizeof p);
    const double period = choice & 1 ? 1e-3 : 1e-4;
    p.sensing.period = period;
    p.sensing.sensor_period = choice & 2 ? 4 * period : period;
    p.sensing.offset = choice & 4 ? 50.0 : 0.0;
    p.sensing.floor = 1e-3;
    p.sensing.saturation = choice & 8 ? 4000.0 : 1e12;
    p.sensing.timeout = 10 * p.sensing.sensor_period;
    p.sensing.largest_rate = choice & 16 ? 100.0 : 1e15;
    p.sensing.median_length = choice & 32 ? 10 : 1;
    p.sensing.sections = choice & 64 ? 1 : 0;
    /* second order at a tenth of the rate: tan(pi / 10) = 0.3249, damping 1 / sqrt 2 */
    const double k = 0.32491969623290632, size = 1 + 1.4142135623730951 * k + k * k;
    p.sensing.low_pass[0] = (pretouch_section){k * k / size, 2 * k * k / size, k * k / size, 2 * (k * k - 1) / size,
                                               (1 - 1.4142135623730951 * k + k * k) / size};
    p.law = (pretouch_damper_numbers){-0.7, 0.01, choice & 2 ? 0.1 : 1.0, choice >> 7};
    p.drive.hold = p.sensing.sensor_period;
    p.drive.fade_step = 0.5;
    p.drive.largest_force = 20.0;
    p.drive.contact_gain = choice & 4 ? 1.0 : 0.0;
    p.drive.contact_threshold = 1.0;
    /* a mass of 1 kg alone */
    p.drive.admittance = (pretouch_admittance_numbers){1, period, 0, 1, period * period / 2, period};
    p.drive.limits = (pretouch_motion_limits){period, 0.5, 50.0, 0.1};
    return p;
}

static void hold(int promise) {
    if (!promise) abort();
}

/* The same controller with the virtual drag: for a sensor with noise or without, from gentle to as strong as can be. */
static pretouch_parameters_drag drag_of(const pretouch_parameters *p, uint8_t choice) {
    const double period = p->sensing.period, noise = choice & 1 ? 1e-3 : 0.0;
    const pretouch_drag_numbers law = {.drag = choice & 2 ? 1e6 : 0.0144,
                                       .variance = noise * noise,
                                       .relative_variance = choice & 4 ? 1e-5 : 0.0,
                                       .level_share = choice & 8 ? 1.0 : 0.68,
                                       .rate_share = choice & 8 ? 1.0 : 0.19,
                                       .width = 7.4,
                                       .still = 0.62 / p->sensing.sensor_period,
                                       .sensor_period = p->sensing.sensor_period,
                                       .hold = 0.02,
                                       .own_advance = choice & 16 ? -0.7 : 0.0,
                                       .known_acceleration = choice & 32 ? -9.8 : 0.0,
                                       .period = period,
                                       .mass = 1.0};
    return (pretouch_parameters_drag){p->sensing, p->drive, law};
}

/* One step; what it gives and the motion it leaves keep what is promised. */
static void check(pretouch_law_step *step, const void *parameters, void *state, const pretouch_drive_state *driven,
                  const pretouch_motion_limits *limits, double largest_force, const pretouch_sample *sample) {
    const double before = driven->motion.velocity;
    pretouch_output out;
    step(parameters, state, sample, &out);
    hold(isfinite(out.position) && isfinite(out.velocity) && isfinite(out.acceleration));
    hold(isfinite(out.log_level) && out.log_level >= 0);
    hold(fabs(out.virtual_force) <= largest_force);
    hold(fabs(driven->motion.position) <= limits->excursion * (1 + 1e-12));
    hold(fabs(driven->motion.velocity) <= limits->speed * (1 + 1e-12));
    hold(fabs(driven->motion.velocity - before) <= limits->acceleration * limits->period * (1 + 1e-9));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size < 2) return 0;
    const pretouch_parameters p = parameters_of(data[0]);
    const pretouch_parameters_drag q = drag_of(&p, data[1]);
    pretouch_state damper;
    pretouch_state_drag drag;
    pretouch_start(&p, 0, 0, &damper);
    pretouch_start_drag(&q, 0, 0, &drag);
    for (size_t at = 2; at + 49 <= size; at += 49) {
        double numbers[6];
        memcpy(numbers, data + at, sizeof numbers);
        const pretouch_sample sample = {numbers[0], numbers[1], numbers[2], numbers[3],
                                        numbers[4], numbers[5], data[at + 48] & 3};
        check(pretouch_step_damper, &p, &damper, &damper.drive, &p.drive.limits, p.drive.largest_force, &sample);
        check(pretouch_step_drag, &q, &drag, &drag.drive, &p.drive.limits, p.drive.largest_force, &sample);
        hold(isfinite(drag.law.level) && isfinite(drag.law.rate) && isfinite(drag.law.mark));
    }
    return 0;
}
