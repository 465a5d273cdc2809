/*
 * What the firmware is made with. Edit converters, sizes and times for your board.
 */
#ifndef CONFIGURATION_H
#define CONFIGURATION_H

#include <stdbool.h>

#include "NAME.h"

typedef NAME_real real;

/* Converters: code 0 and the highest code. The DAC reaches at least from limit to limit. */
#ifndef DAC_BITS
#define DAC_BITS 20u
#define DAC_LOW_VOLTS LIMITS_LOW
#define DAC_HIGH_VOLTS LIMITS_HIGH
#endif
#ifndef ADC_BITS
#define ADC_BITS 20u
#define ADC_LOW_METRES SENSOR_LOW_METRES
#define ADC_HIGH_METRES SENSOR_HIGH_METRES
#endif

/* Samples of the tables, and samples that are kept for the client. */
#ifndef TABLE_SAMPLES
#define TABLE_SAMPLES 4096u
#endif
#ifndef RING_SAMPLES
#define RING_SAMPLES 4096u
#endif
/* Sampling intervals of one sample of a table, at most. */
#define DIVIDER_MOST 65535u

/* Faults: samples in a row that took too long or had no reading, and times without a line over the
   link or without a sample. */
#ifndef OVERRUNS_MOST
#define OVERRUNS_MOST 3u
#endif
#ifndef INVALID_MOST
#define INVALID_MOST 20u
#endif
#ifndef LINK_TIMEOUT_MS
#define LINK_TIMEOUT_MS 1000u
#endif
#ifndef SAMPLING_TIMEOUT_MS
#define SAMPLING_TIMEOUT_MS 500u
#endif

/* From here on: what belongs to the controller. Do not edit. */
#include "numbers.h"

#define CODE_MOST(bits) ((real)(0xFFFFFFFFu >> (32u - (bits))))
#define DAC_ZERO_VOLTS DAC_LOW_VOLTS
#define DAC_CODE_MOST CODE_MOST(DAC_BITS)
#define DAC_CODES_PER_VOLT (DAC_CODE_MOST / (DAC_HIGH_VOLTS - DAC_LOW_VOLTS))
#define ADC_ZERO_METRES ADC_LOW_METRES
#define ADC_CODE_MOST CODE_MOST(ADC_BITS)
#define ADC_METRES_PER_CODE ((ADC_HIGH_METRES - ADC_LOW_METRES) / ADC_CODE_MOST)

/* What the converters of a simulated stage are told at the start, REAL_BYTES before them. */
#define CONVERTERS_SCALE \
    {SAMPLING_INTERVAL, DAC_ZERO_VOLTS, DAC_CODES_PER_VOLT, ADC_ZERO_METRES, ADC_METRES_PER_CODE, \
     ADC_CODE_MOST, SAFE_VOLTS}
#define CONVERTERS_NUMBERS 7

/* Whether a step takes a feedforward of the client. */
#if FORWARD_ONLINE
#define INNER_TAKES_VOLTS 0
#else
#define INNER_TAKES_VOLTS 1
#endif

typedef NAME_state inner_state;

static inline void inner_init(inner_state *loop)
{
    NAME_init(loop);
}

static inline bool inner_start(inner_state *loop, real present)
{
    return NAME_start(loop, present) != 0;
}

static inline real inner_step(
    inner_state *loop, real reference, real next, real reading, real volts)
{
#if FORWARD_ONLINE
    (void)volts;
    return NAME_step(loop, reference, next, reading);
#else
    (void)next;
    return NAME_step(loop, reference, reading, volts);
#endif
}

static inline bool inner_applied(inner_state *loop, real volts)
{
    return NAME_applied(loop, volts) != 0;
}

static inline void inner_reset(inner_state *loop)
{
    NAME_reset(loop);
}

static inline bool inner_saturated(const inner_state *loop)
{
    return loop->last.saturated != 0u;
}

static inline bool inner_reading_ok(const inner_state *loop)
{
    return loop->last.measurement_ok != 0u;
}

#define INNER_SETTINGS NAME_SETTINGS
#if INNER_SETTINGS > 0
#define inner_setting_list NAME_setting_list

typedef NAME_settings inner_settings;

static inline void inner_settings_default(inner_settings *settings)
{
    NAME_settings_default(settings);
}

static inline void inner_settings_seal(inner_settings *settings)
{
    NAME_settings_seal(settings);
}

static inline bool inner_retune(inner_state *loop, const inner_settings *settings)
{
    return NAME_retune(loop, settings) != 0;
}
#endif

#endif
