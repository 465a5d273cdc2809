/*
 * Samples that are kept for the client: the newest RING_SAMPLES of a recording.
 */
#ifndef RING_H
#define RING_H

#include <stdbool.h>
#include <stdint.h>

#include "configuration.h"

#define SAMPLE_SATURATED 1u
#define SAMPLE_INVALID 2u
#define SAMPLE_OVERRUN 4u
#define SAMPLE_LOOP 8u

struct ring_sample {
    uint32_t tick;
    uint32_t flags;
    real reference; /* m; NaN without a loop */
    real volts;     /* output from this sample on */
    real reading;   /* at this sample, m; NaN for none */
};

/* Begins a recording of so many samples, or one without an end for 0. */
void ring_begin(uint32_t samples);

/* Ends the recording. */
void ring_end(void);

/* Adds a sample while one is recorded. */
void ring_add(const struct ring_sample *sample);

/* Samples recorded so far, of which the last RING_SAMPLES are there. */
uint32_t ring_count(void);

/* The sample of this number, from 0; false where it is not there, or not any more. */
bool ring_get(uint32_t number, struct ring_sample *sample);

#endif
