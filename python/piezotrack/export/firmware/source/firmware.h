/*
 * The state machine between converters and controller: off, ramp to the safe voltage, constant
 * voltage, voltages from a table, closed loop, fault.
 */
#ifndef FIRMWARE_H
#define FIRMWARE_H

#include <stdbool.h>
#include <stdint.h>

#include "configuration.h"

enum firmware_mode {
    MODE_OFF,  /* at the safe voltage */
    MODE_RAMP, /* on the way there, then off */
    MODE_HOLD, /* constant voltage */
    MODE_PLAY, /* voltages of the table, once; then constant at the last one */
    MODE_RUN,  /* closed loop */
    MODE_FAULT /* on the way to the safe voltage or there, until it is cleared */
};

enum firmware_fault {
    FAULT_NONE,
    FAULT_OVERRUN,  /* OVERRUNS_MOST samples in a row took longer than their interval */
    FAULT_READING,  /* INVALID_MOST readings in a row were none, in closed loop */
    FAULT_LINK,     /* nothing came over the link for LINK_TIMEOUT_MS, or it was closed */
    FAULT_SAMPLING, /* no sample came for SAMPLING_TIMEOUT_MS */
    FAULT_COUNT
};

/* What the client sees. */
struct firmware_status {
    enum firmware_mode mode;
    enum firmware_fault fault;
    uint32_t tick;     /* samples since the start */
    uint32_t overruns; /* samples that took longer than their interval */
    uint32_t invalid;  /* samples without a reading */
    uint32_t left;     /* samples until the table ends; 0 for none */
    real volts;        /* output */
    real reading;      /* last reading, m; NaN for none */
    real reference;    /* last reference, m; NaN without a loop */
};

/* Goes to the safe voltage, and takes settings that were saved. */
void firmware_init(void);

/* Answers a sample of the ADC: called by the board in each sampling interval. */
void firmware_sample(uint32_t code, unsigned status);

/* Answers the link and watches over it: called by main again and again. */
void firmware_poll(void);

/* What the protocol asks for: each returns false, and changes nothing, where it cannot be. */
void firmware_status(struct firmware_status *status);
bool firmware_hold(real volts);
bool firmware_load(unsigned table, uint32_t first, const real *numbers, uint32_t count);
bool firmware_play(uint32_t count, uint32_t divider, uint32_t lead);
bool firmware_run(uint32_t count, uint32_t periods, bool played);
bool firmware_follow(real reference);
bool firmware_stop(void);
bool firmware_clear(void);
uint32_t firmware_layout(void);
bool firmware_settings(real *numbers);
bool firmware_retune(const real *numbers);
bool firmware_save(void);

/* Tables of firmware_load. */
#define TABLE_VOLTS 0u
#define TABLE_REFERENCE 1u

#endif
