/* Vector table and reset of the emulated board: newlib's start-up code follows, whose output goes through semihosting. */
#include <stdint.h>

extern void _start(void);
extern uint32_t stack_top;

static void fault(void) {
    for (;;) {
    }
}

static void reset(void) {
#ifdef __ARM_FP
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* CPACR: the floating-point unit */
#endif
    _start();
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &stack_top, (const void *)reset, (const void *)fault, (const void *)fault};
