/* Prints each step of an exported law, and lets it take STEP_US. Linked with --wrap=pretouch_step. */
#include "pretouch_law.h"

#include <stdio.h>
#include <stdlib.h>

extern unsigned long now_us;

void __real_pretouch_step(const pretouch_parameters *p, pretouch_state *s, const pretouch_sample *sample,
                          pretouch_output *out);

void __wrap_pretouch_step(const pretouch_parameters *p, pretouch_state *s, const pretouch_sample *sample,
                          pretouch_output *out) {
    const char *const duration = getenv("STEP_US");
    if (duration != NULL) now_us += (unsigned long)atol(duration);
    __real_pretouch_step(p, s, sample, out);
    printf("step %.9g %.9g %d %.9g %.9g %.9g %d\n", (double)sample->reading, (double)sample->age, (int)sample->fresh,
           (double)out->position, (double)out->velocity, (double)out->acceleration, (int)out->status);
}
