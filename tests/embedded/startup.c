/* Start of a program on QEMU's MPS2 boards (Cortex-M4F and M7): vector table, FPU, and newlib with semihosting. */

extern void _start(void);
extern unsigned long stack_top;

static void stop(void) {
    for (;;) __asm volatile("bkpt #0");
}

void reset(void) {
    *(volatile unsigned long *)0xE000ED88 |= 0xFul << 20; /* CPACR: full access to the FPU */
    __asm volatile("dsb\n isb");
    _start();
    stop();
}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    &stack_top, (void *)reset, (void *)stop, (void *)stop, (void *)stop, (void *)stop, (void *)stop};
