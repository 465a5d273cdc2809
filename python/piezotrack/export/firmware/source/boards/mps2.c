/*
 * Arm's MPS2 board as QEMU emulates it: mps2-an386 (Cortex-M4F) and mps2-an500 (Cortex-M7). UART 0
 * is the link; UART 1 stands for the converters: a code and a status come for each sample, and a
 * code goes back. SysTick counts the time, the watchdog resets.
 *
 * With TIMER_CLOCK the interrupt of a timer runs the loop, in each interval, and a step that is not
 * done when the next one comes is an overrun. A reading waits for it; where the simulation behind it
 * is slower, the timer waits. Each sample begins its interval anew: the time of the emulator jumps
 * where the computer is busy, and two intervals would end at once. Without, the reading itself runs
 * the loop: the converters are the clock, in real time or as fast as they are answered.
 */
#include "board.h"

#include "firmware.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))

struct uart {
    volatile uint32_t data;
    volatile uint32_t state; /* bit 0: transmitter full; bit 1: there is a byte */
    volatile uint32_t control; /* bits 0, 1: transmitter, receiver; bit 3: its interrupt */
    volatile uint32_t interrupts; /* bit 1: of the receiver; written: it is cleared */
    volatile uint32_t divider;
};

#define LINK ((struct uart *)0x40004000u)
#define CONVERTERS ((struct uart *)0x40005000u)
#define CONVERTERS_INTERRUPT 2u

struct timer {
    volatile uint32_t control; /* bit 0: it runs; bit 3: its interrupt */
    volatile uint32_t value;
    volatile uint32_t reload;
    volatile uint32_t interrupts; /* bit 0; written: it is cleared */
};

#define TIMER ((struct timer *)0x40000000u)
#define TIMER_INTERRUPT 8u
#ifndef TIMER_CLOCK
#define TIMER_CLOCK 0
#endif
/* Interrupts that call firmware_sample. */
#define SAMPLING ((1u << CONVERTERS_INTERRUPT) | (1u << TIMER_INTERRUPT))

#define SYSTICK_CONTROL REGISTER(0xE000E010u)
#define SYSTICK_RELOAD REGISTER(0xE000E014u)
#define SYSTICK_VALUE REGISTER(0xE000E018u)
#define INTERRUPT_ENABLE REGISTER(0xE000E100u)
#define INTERRUPT_DISABLE REGISTER(0xE000E180u)
#define INTERRUPT_PRIORITY(interrupt) (*(volatile uint8_t *)(0xE000E400u + (interrupt)))
#define SYSTICK_PRIORITY REGISTER(0xE000ED20u)
#define WATCHDOG_LOAD REGISTER(0x40008000u)
#define WATCHDOG_CONTROL REGISTER(0x40008008u)
#define WATCHDOG_CLEAR REGISTER(0x4000800Cu)
#define WATCHDOG_LOCK REGISTER(0x40008C00u)

#define CLOCK_HZ 25000000u
#define WATCHDOG_MS 1000u
/* How long an answer may take to leave before the rest of it is dropped. */
#define LEAVING_MS 50u
/* Bytes of a sample from the converters, and of the answer. */
#define FRAME 5u
#define ANSWER 4u

static volatile uint32_t millis;
static uint8_t frame[FRAME];
static uint32_t frame_bytes;
static bool answers;
static bool cut; /* an answer that nobody read: what follows is dropped, up to an end of a line */
static bool due = true; /* the interval is over, and its reading has not come */
static unsigned late; /* BOARD_OVERRUN for the sample after one that took too long */

void systick_handler(void);
void converters_handler(void);
void timer_handler(void);

void systick_handler(void)
{
    millis++;
}

static bool has_room(const struct uart *uart)
{
    return (uart->state & 1u) == 0u;
}

/* To the converters. Where they take nothing, the watchdog resets. */
static void send(struct uart *uart, uint32_t byte)
{
    while (!has_room(uart)) {
        /* until there is */
    }
    uart->data = byte & 255u;
}

static void begin_interval(void)
{
    if (TIMER_CLOCK != 0) {
        TIMER->value = TIMER->reload;
        TIMER->control = 9u;
        TIMER->interrupts = 1u;
        due = false;
    }
}

static void take_sample(void)
{
    const unsigned status = frame[4] | late;
    const uint32_t code = (uint32_t)frame[0] | ((uint32_t)frame[1] << 8)
        | ((uint32_t)frame[2] << 16) | ((uint32_t)frame[3] << 24);
    begin_interval();
    frame_bytes = 0;
    late = 0u;
    answers = true;
    firmware_sample(code, status);
    answers = false;
    if ((TIMER->interrupts & 1u) != 0u) {
        late = BOARD_OVERRUN; /* the next interval has begun within the step */
    }
}

void converters_handler(void)
{
    CONVERTERS->interrupts = 2u;
    while ((frame_bytes < FRAME) && ((CONVERTERS->state & 2u) != 0u)) {
        frame[frame_bytes] = (uint8_t)CONVERTERS->data;
        frame_bytes++;
        if ((frame_bytes == FRAME) && due) {
            take_sample();
        }
    }
}

void timer_handler(void)
{
    if ((TIMER->interrupts & 1u) == 0u) {
        return; /* an interval that was begun anew meanwhile */
    }
    TIMER->interrupts = 1u;
    if (frame_bytes == FRAME) {
        take_sample();
    } else {
        due = true;
    }
}

/* Says how codes are meant. */
static void tell_converters(void)
{
    static const real scale[CONVERTERS_NUMBERS] = CONVERTERS_SCALE;
    const uint8_t *bytes = (const uint8_t *)scale;
    uint32_t i;
    send(CONVERTERS, REAL_BYTES);
    for (i = 0; i < (uint32_t)sizeof scale; i++) {
        send(CONVERTERS, bytes[i]);
    }
}

void board_init(void)
{
    LINK->divider = 217u; /* 115200 baud */
    LINK->control = 3u;
    CONVERTERS->divider = 16u;
    CONVERTERS->control = 3u | 8u;
    tell_converters();
    SYSTICK_RELOAD = CLOCK_HZ / 1000u - 1u;
    SYSTICK_VALUE = 0;
    INTERRUPT_PRIORITY(CONVERTERS_INTERRUPT) = 0x40u;
    INTERRUPT_PRIORITY(TIMER_INTERRUPT) = 0x40u;
    TIMER->reload = (uint32_t)(SAMPLING_INTERVAL * (real)CLOCK_HZ + (real)0.5) - 1u;
    TIMER->value = TIMER->reload;
    SYSTICK_PRIORITY = 0x20000000u; /* above the loop: time goes on within a step */
    SYSTICK_CONTROL = 7u;
    WATCHDOG_LOCK = 0x1ACCE551u;
    WATCHDOG_LOAD = CLOCK_HZ / 1000u * WATCHDOG_MS;
    WATCHDOG_CONTROL = 3u;
}

void board_write(uint32_t code)
{
    uint32_t i;
    for (i = 0; i < ANSWER && answers; i++) {
        send(CONVERTERS, code >> (8u * i));
    }
}

uint32_t board_millis(void)
{
    return millis;
}

int board_get(void)
{
    return (LINK->state & 2u) != 0u ? (int)(LINK->data & 255u) : -1;
}

void board_put(char byte)
{
    const uint32_t begun = millis;
    if (cut && (byte != '\n')) {
        return;
    }
    while (!has_room(LINK)) {
        if (cut || ((millis - begun) > LEAVING_MS)) {
            cut = true;
            return;
        }
    }
    cut = false;
    LINK->data = (uint32_t)(unsigned char)byte;
}

bool board_linked(void)
{
    return true;
}

void board_feed(void)
{
    WATCHDOG_CLEAR = 1u;
}

void board_mask(bool held)
{
    if (held) {
        INTERRUPT_DISABLE = SAMPLING;
        __asm volatile("dsb\n isb" ::: "memory");
    } else {
        __asm volatile("" ::: "memory");
        INTERRUPT_ENABLE = SAMPLING;
    }
}

bool board_store(const void *image, uint32_t bytes)
{
    (void)image;
    (void)bytes;
    return false; /* it has no memory that outlives a reset */
}

bool board_recall(void *image, uint32_t bytes)
{
    (void)image;
    (void)bytes;
    return false;
}
