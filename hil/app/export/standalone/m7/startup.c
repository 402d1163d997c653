/* Start of a Cortex-M7, its counter of instructions (SysTick under QEMU's -icount), and the stack that was used.
   The loader has filled .data and .bss. */
#include "startup.h"

#include <stdlib.h>

#define CPACR (*(volatile uint32_t *)0xE000ED88u)
#define SYSTICK_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define SYSTICK_RELOAD (*(volatile uint32_t *)0xE000E014u)
#define SYSTICK_VALUE (*(volatile uint32_t *)0xE000E018u)
#define PAINT 0xC0FFEE00u

extern uint32_t stack_top[], stack_bottom[];
extern void initialise_monitor_handles(void) __attribute__((weak));
int main(int argc, char **argv);

static void reset(void) {
    static char *arguments[] = {"m7", NULL};
    CPACR |= 0xFu << 20; /* the floating-point unit */
    __asm volatile("dsb\nisb");
    for (uint32_t *word = stack_bottom; word < stack_top - 64; word++) *word = PAINT;
    SYSTICK_RELOAD = 0xFFFFFFu;
    SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = 5u; /* on, the processor's clock */
    if (initialise_monitor_handles) initialise_monitor_handles();
    exit(main(1, arguments));
}

static void fault(void) {
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    (void (*)(void))stack_top, reset, fault, fault, fault, fault, fault};

uint32_t systick(void) { return SYSTICK_VALUE; }

uint32_t instructions_since(uint32_t began) {
    /* 25 MHz and 128 ns an instruction: 3.2 counts each, downwards, 24 bits */
    return (uint32_t)(((began - SYSTICK_VALUE) & 0xFFFFFFu) / 3.2);
}

void paint_stack(void) {
    uint32_t *here = (uint32_t *)__builtin_frame_address(0);
    for (uint32_t *word = stack_bottom; word < here - 64; word++) *word = PAINT;
}

uint32_t stack_below(const void *top) {
    const uint32_t *word = stack_bottom;
    while (word < stack_top && *word == PAINT) word++;
    return (uint32_t)((const char *)top - (const char *)word);
}
