/*
 * From reset to main on a Cortex-M: vectors, floating-point unit, memory, and the two functions that
 * compilers call of their own.
 */
#include <stddef.h>
#include <stdint.h>

extern uint32_t data_image[];
extern uint32_t data_begin[];
extern uint32_t data_end[];
extern uint32_t bss_begin[];
extern uint32_t bss_end[];
extern uint32_t stack_top[];

int main(void);
void reset_handler(void);
void systick_handler(void);
void converters_handler(void);
void timer_handler(void);
void *memcpy(void *to, const void *from, size_t bytes);
void *memset(void *to, int byte, size_t bytes);

void *memcpy(void *to, const void *from, size_t bytes)
{
    volatile uint8_t *there = to;
    const uint8_t *here = from;
    for (; bytes > 0u; bytes--) {
        *there++ = *here++;
    }
    return to;
}

void *memset(void *to, int byte, size_t bytes)
{
    volatile uint8_t *there = to;
    for (; bytes > 0u; bytes--) {
        *there++ = (uint8_t)byte;
    }
    return to;
}

/* A fault: stands still, until the watchdog resets. */
static void stuck(void)
{
    for (;;) {
    }
}

void reset_handler(void)
{
    uint32_t *from = data_image;
    uint32_t *to;
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* the floating-point unit */
    __asm volatile("dsb\n isb" ::: "memory");
    for (to = data_begin; to < data_end; to++) {
        *to = *from;
        from++;
    }
    for (to = bss_begin; to < bss_end; to++) {
        *to = 0;
    }
    (void)main();
    stuck();
}

typedef void (*handler)(void);

union vector {
    handler handler;
    const uint32_t *address;
};

extern const union vector vectors[25];

__attribute__((section(".vectors"), used)) const union vector vectors[25] = {
    [0] = {.address = stack_top}, [1] = {.handler = reset_handler},
    [2] = {.handler = stuck}, [3] = {.handler = stuck}, [4] = {.handler = stuck},
    [5] = {.handler = stuck}, [6] = {.handler = stuck}, [15] = {.handler = systick_handler},
    [18] = {.handler = converters_handler}, /* receiver of UART 1 */
    [24] = {.handler = timer_handler}, /* timer 0 */
};
