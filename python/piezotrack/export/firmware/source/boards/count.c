/*
 * Counts the instructions and the stack of a step under QEMU, over the test vectors, and compares
 * commands: make count-m4. With -icount shift=8 an instruction takes 256 ns of the emulated time,
 * 6.4 ticks of SysTick.
 */
#include <stdint.h>

#include "configuration.h"
#include "vectors.h"

#define SYSTICK_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define SYSTICK_RELOAD (*(volatile uint32_t *)0xE000E014u)
#define SYSTICK_VALUE (*(volatile uint32_t *)0xE000E018u)
#define STACK_WORDS 512u
#define UNTOUCHED 0xA5A5A5A5u

void systick_handler(void);
void converters_handler(void);
void timer_handler(void);

static inner_state loop;

void systick_handler(void)
{
}

void converters_handler(void)
{
}

void timer_handler(void)
{
}

/* A call of the emulator. */
static void semihosting(uint32_t call, const void *argument)
{
    register uint32_t r0 __asm__("r0") = call;
    register const void *r1 __asm__("r1") = argument;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

static void say(const char *text)
{
    semihosting(4u, text);
}

static void say_count(const char *before, uint32_t count)
{
    char digits[11];
    int n = 10;
    digits[10] = '\0';
    do {
        n--;
        digits[n] = (char)('0' + (char)(count % 10u));
        count /= 10u;
    } while (count > 0u);
    say(before);
    say(&digits[n]);
}

static uint32_t ticks(uint32_t before, uint32_t after)
{
    return (before - after) & 0xFFFFFFu;
}

static uint32_t instructions(uint32_t of_ticks)
{
    return (uint32_t)(((uint64_t)of_ticks * 10u + 32u) / 64u);
}

/* The memory below the stack that is in use; no function is called while it is looked at. */
static inline volatile uint32_t *below_stack(void)
{
    uint32_t pointer;
    __asm volatile("mov %0, sp" : "=r"(pointer));
    return (volatile uint32_t *)(pointer - 4u * STACK_WORDS);
}

/* Kept out of the loop, so that its stack is that of a call. */
static __attribute__((noinline)) real step(const real *row)
{
    return inner_step(&loop, row[0], row[1], row[2], row[3]);
}

int main(void)
{
    volatile uint32_t *const stack = below_stack();
    uint32_t nothing, i, k;
    uint32_t worst = 0;
    uint32_t worst_at = 0;
    uint32_t deepest = 0;
    uint64_t sum = 0;
    uint32_t apart = 0;
    struct {
        uint32_t reason, code;
    } end = {0x20026u, 0};
    SYSTICK_RELOAD = 0xFFFFFFu;
    SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = 5u;
    inner_init(&loop);
    nothing = SYSTICK_VALUE;
    nothing = ticks(nothing, SYSTICK_VALUE);
    for (i = 0; i < VECTORS; i++) {
        const real *row = vectors[i];
        uint32_t begin, taken;
        real volts;
        if (row[4] > 0) {
            inner_reset(&loop);
        }
        if (i % 16u == 0u) {
            for (k = 0; k < STACK_WORDS; k++) {
                stack[k] = UNTOUCHED;
            }
        }
        begin = SYSTICK_VALUE;
        volts = step(row);
        taken = instructions(ticks(begin, SYSTICK_VALUE) - nothing);
        if (i % 16u == 0u) {
            for (k = 0; k < STACK_WORDS && stack[k] == UNTOUCHED; k++) {
            }
            deepest = STACK_WORDS - k > deepest ? STACK_WORDS - k : deepest;
        }
        sum += taken;
        if (taken > worst) {
            worst = taken;
            worst_at = i;
        }
        if (!(volts - row[6] <= VECTORS_BOUND && row[6] - volts <= VECTORS_BOUND)) {
            apart++;
        }
        if (row[5] - row[5] <= 0) {
            (void)inner_applied(&loop, row[5]);
        }
    }
    say_count("instructions mean ", (uint32_t)(sum / VECTORS));
    say_count(" worst ", worst);
    say_count(" at step ", worst_at);
    say_count(", stack bytes ", 4u * deepest);
    say_count(", state bytes ", (uint32_t)sizeof loop);
    say_count(", steps apart ", apart);
    say_count(" of ", VECTORS);
    say("\n");
    end.code = apart > VECTORS_APART ? 1u : 0u;
    semihosting(0x20u, &end);
    return 0;
}
