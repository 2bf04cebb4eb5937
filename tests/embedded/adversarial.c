/* Drives an exported law with samples that no sensor delivers.
 *     adversarial replay          samples of 7 doubles from stdin, outputs of 6 doubles to stdout
 *     adversarial COUNT SEED      random samples; each output must be finite and within the limits */
#include "pretouch_design.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t random_state;

static uint64_t random_bits(void) { /* xorshift64* */
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return random_state * UINT64_C(2685821657736338717);
}

static double unit(void) { return (double)(random_bits() >> 11) / 9007199254740992.0; }

/* A number of any size, a special one, or one near a size that matters. */
static double any_number(double size) {
    static const double special[] = {0, -0.0, 1e-300, -1e-300, 1e300, -1e300, NAN, INFINITY, -INFINITY, 1e9, -1e9, 1e6};
    const uint64_t kind = random_bits() % 16;
    if (kind < 2) return special[random_bits() % (sizeof special / sizeof *special)];
    if (kind < 4) return (unit() - 0.5) * exp(1400 * (unit() - 0.5));
    if (kind < 12) return size * (kind < 8 ? 2 * unit() - 1 : unit());
    return size * (0.9 + 0.2 * unit()); /* a plausible change of a reading */
}

static pretouch_sample any_sample(double level) {
    const double largest_age = 1.2 * (double)pretouch_design.sensing.timeout;
    const pretouch_sample sample = {
        (pretouch_real)any_number(level),
        (pretouch_real)(random_bits() % 4 ? unit() * 2e-3 : any_number(largest_age)),
        (pretouch_real)(random_bits() % 4 ? 0 : any_number(1e3)),
        (pretouch_real)(random_bits() % 4 ? 0 : any_number(1)),
        (pretouch_real)(random_bits() % 4 ? 0 : any_number(1)),
        (pretouch_real)(random_bits() % 4 ? 0 : any_number(100)),
        random_bits() % 32 == 0 ? PRETOUCH_NO_OBJECT : random_bits() % 3 != 0,
    };
    return sample;
}

static int is_good(double before, const pretouch_sample *sample, const pretouch_design_state *state,
                   const pretouch_output *out) {
    const pretouch_motion_limits *const limits = &pretouch_design.drive.limits;
    const double x = (double)state->drive.motion.position, v = (double)state->drive.motion.velocity;
    const double largest = (double)limits->acceleration;
    const int steady = sample->reference_acceleration == 0;
    return fabs(v - before) <= largest * (double)limits->period &&
           (!steady || fabs((double)out->acceleration) <= largest) && isfinite(out->position) && isfinite(out->velocity) && isfinite(out->acceleration) && isfinite(out->log_level) &&
           fabs((double)out->virtual_force) <= (double)pretouch_design.drive.largest_force &&
           fabs(x) <= (double)limits->excursion && fabs(v) <= (double)limits->speed;
}

static int replay(void) {
    double in[7];
    pretouch_design_state state;
    pretouch_design_start(&state);
    while (fread(in, sizeof in, 1, stdin) == 1) {
        const pretouch_sample sample = {(pretouch_real)in[0], (pretouch_real)in[1], (pretouch_real)in[2],
                                        (pretouch_real)in[3], (pretouch_real)in[4], (pretouch_real)in[5], (int32_t)in[6]};
        pretouch_output o;
        pretouch_design_step(&state, &sample, &o);
        const double out[6] = {(double)o.position, (double)o.velocity, (double)o.acceleration, (double)o.virtual_force,
                               (double)o.log_level, (double)o.status};
        fwrite(out, sizeof out, 1, stdout);
    }
    return 0;
}

int main(int argc, char **argv) {
    if (argc == 2 && strcmp(argv[1], "replay") == 0) return replay();
    if (argc != 3) return 2;
    const uint64_t count = strtoull(argv[1], NULL, 10);
    random_state = strtoull(argv[2], NULL, 10) * 2 + 1;
    uint64_t moved = 0, left = 0;
    double level = 1;
    pretouch_design_state state;
    pretouch_design_start(&state);
    for (uint64_t i = 0; i < count; i++) {
        if (left-- == 0) { /* readings of another size for a while, so that the law detects, loses and follows */
            left = random_bits() % 200;
            level = (double)pretouch_design.sensing.floor * exp(8 * unit());
        }
        const pretouch_sample sample = any_sample(level);
        const double before = (double)state.drive.motion.velocity;
        pretouch_output out;
        pretouch_design_step(&state, &sample, &out);
        if (!is_good(before, &sample, &state, &out)) return printf("step %" PRIu64 " of seed %s fails\n", i, argv[2]), 1;
        moved += fabs((double)out.virtual_force) > 0;
    }
    printf("%" PRIu64 " steps, %" PRIu64 " with a force\n", count, moved);
    return 0;
}
