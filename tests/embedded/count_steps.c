/* Counts the instructions and the stack of each step of an exported law under QEMU with -icount shift=0, where an
 * instruction takes 1 ns and SysTick counts 25 MHz, so one count is 40 instructions. */
#include "pretouch_design.h"

#include <stdio.h>

#define SYSTICK ((volatile unsigned long *)0xE000E010)
enum { CONTROL, RELOAD, CURRENT, WRAP = 1 << 24, INSTRUCTIONS = 40, PAINTED = 1024, PAINT = 0xA5 };

static volatile unsigned char *deepest;

/* Paints the stack below the caller, or returns how much of the paint is gone. */
__attribute__((noinline)) static int paint(int again) {
    volatile unsigned char *const top = (volatile unsigned char *)__builtin_frame_address(0) - 64;
    if (again) {
        deepest = top - PAINTED;
        for (int i = 0; i < PAINTED; i++) deepest[i] = PAINT;
        return 0;
    }
    int clean = 0;
    while (clean < PAINTED && deepest[clean] == PAINT) clean++;
    return PAINTED - clean + 64;
}

int main(void) {
    FILE *const file = fopen("vectors.csv", "r");
    char line[1024];
    double in[6];
    int run, last = -1, fresh, stack = 0;
    long steps = 0;
    unsigned long most = 0;
    unsigned long long all = 0;
    static pretouch_design_state state;
    if (file == NULL) return 2;
    SYSTICK[RELOAD] = WRAP - 1;
    SYSTICK[CONTROL] = 5;
    while (fgets(line, sizeof line, file) != NULL) {
        if (sscanf(line, "%d,%lf,%lf,%lf,%lf,%lf,%lf,%d", &run, in, in + 1, in + 2, in + 3, in + 4, in + 5, &fresh) != 8)
            continue;
        if (run != last) pretouch_design_start(&state);
        last = run;
        const pretouch_sample sample = {(pretouch_real)in[0], (pretouch_real)in[1], (pretouch_real)in[2],
                                        (pretouch_real)in[3], (pretouch_real)in[4], (pretouch_real)in[5], fresh};
        pretouch_output out;
        paint(1);
        const unsigned long before = SYSTICK[CURRENT];
        pretouch_design_step(&state, &sample, &out);
        const unsigned long spent = (before - SYSTICK[CURRENT]) & (WRAP - 1);
        const int used = paint(0);
        stack = used > stack ? used : stack;
        most = spent > most ? spent : most;
        all += spent;
        steps++;
    }
    printf("steps %ld, mean %llu, most %lu, stack %d, state %u, parameters %u\n", steps,
           all * INSTRUCTIONS / (unsigned long long)steps, most * INSTRUCTIONS, stack, (unsigned)sizeof state,
           (unsigned)sizeof pretouch_design);
    return 0;
}
