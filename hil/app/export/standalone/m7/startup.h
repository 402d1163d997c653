#ifndef STARTUP_H
#define STARTUP_H
#include <stdint.h>

uint32_t systick(void);
uint32_t instructions_since(uint32_t began); /* since systick() was `began`, at most 5 million */
void paint_stack(void);                      /* below the caller's frame */
uint32_t stack_below(const void *top);       /* bytes used below `top` since then */
#endif
