/* Replays vectors.csv through the law and prints the largest difference of each output, relative to its largest value.
 * The differences are 0 in double precision on the processor and with the C library that wrote the vectors. In single
 * precision, while a limit of the motion acts, the rounding of a position x changes the velocity by about 1e-7 x / T, and
 * the acceleration by 1e-7 x / T^2. */
#include "pretouch_design.h"

#include <math.h>
#include <stdio.h>

int main(int argc, char **argv) {
    static const char *const names[5] = {"position", "velocity", "acceleration", "virtual force", "log level"};
    static const double single_precision[5] = {1e-4, 1e-3, 1e-2, 1e-4, 1e-4};
    double in[6], want[5], largest[5] = {0}, difference[5] = {0};
    int run, last = -1, fresh, status, steps = 0, flags = 0, bad = 0;
    char line[1024];
    pretouch_design_state state;
    FILE *const file = fopen(argc > 1 ? argv[1] : "vectors.csv", "r");
    if (file == NULL) return printf("vectors.csv cannot be opened\n"), 2;
    while (fgets(line, sizeof line, file) != NULL) {
        if (sscanf(line, "%d,%lf,%lf,%lf,%lf,%lf,%lf,%d,%lf,%lf,%lf,%lf,%lf,%d", &run, in, in + 1, in + 2, in + 3, in + 4,
                   in + 5, &fresh, want, want + 1, want + 2, want + 3, want + 4, &status) != 14) continue;
        if (run != last) pretouch_design_start(&state);
        last = run;
        const pretouch_sample sample = {(pretouch_real)in[0], (pretouch_real)in[1], (pretouch_real)in[2],
                                        (pretouch_real)in[3], (pretouch_real)in[4], (pretouch_real)in[5], fresh};
        pretouch_output out;
        pretouch_design_step(&state, &sample, &out);
        const double got[5] = {(double)out.position, (double)out.velocity, (double)out.acceleration,
                               (double)out.virtual_force, (double)out.log_level};
        for (int i = 0; i < 5; i++) {
            largest[i] = fmax(largest[i], fabs(want[i]));
            difference[i] = isfinite(got[i]) ? fmax(difference[i], fabs(got[i] - want[i])) : (double)INFINITY;
        }
        flags += out.status != status;
        steps++;
    }
    fclose(file);
    for (int i = 0; i < 5; i++) {
        const double relative = difference[i] > 0 ? difference[i] / largest[i] : 0;
        printf("%-14s %.3g\n", names[i], relative);
        bad += !(relative <= (sizeof(pretouch_real) == sizeof(double) ? 1e-9 : single_precision[i]));
    }
    printf("%d steps, %d with other status flags; %s\n", steps, flags, bad || flags || !steps ? "FAILED" : "passed");
    return bad || flags || !steps;
}
