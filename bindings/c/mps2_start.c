/* Vector table and start of the example on QEMU's mps2-an386: switches the floating-point unit on and hands over to
 * newlib, which prints through semihosting. */
#include <stdint.h>

extern uint32_t __stack;
void _start(void);
void reset(void);

void reset(void) {
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20;
    __asm volatile("dsb\n isb");
    _start();
    for (;;) {
    }
}

static void stop(void) {
    for (;;) {
    }
}

typedef union {
    uint32_t *stack;
    void (*handler)(void);
} vector;

__attribute__((section(".vectors"), used)) static const vector vectors[16] = {
    {.stack = &__stack}, {.handler = reset}, {.handler = stop}, {.handler = stop},
    {.handler = stop},   {.handler = stop},  {.handler = stop},
};
