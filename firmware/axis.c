/*
 * Controller(PID, 50 Hz, 0 to 75 V)
 * Written by piezotrack 0.1.0, piezotrack export --to c99; do not edit.
 * Numbers: double. State: 168 bytes. A step that does not saturate:
 * 10 additions, 4 multiplications.
 *
 * The equations and their sources: docs/export.md and the Rust crate piezotrack-control, which this
 * follows operation by operation. Compiled without fused multiply-add it gives the same bits.
 */
#include <stdbool.h>

#include "axis.h"

#ifdef __FAST_MATH__
#error "compile without -ffast-math: a reading that is NaN would pass for a measurement"
#endif

typedef axis_real real;

/* ---- limits, and tests of numbers without a library ---- */

/* lowest command, V */
static const real LIMITS_LOW = 0x0p+0; /* 0.0 */
/* highest command, V */
static const real LIMITS_HIGH = 0x1.2cp+6; /* 75.0 */
/* numbers from here on enter no state */
static const real USABLE = 0x1.249ad2594c37dp+332; /* 1e+100 */

static real magnitude(real value)
{
    return (value < (real)0) ? -value : value;
}

/* False for NaN and infinity. */
static bool is_finite(real value)
{
    const real nothing = value - value;
    return (nothing >= (real)0) && (nothing <= (real)0);
}

/* False for NaN. */
static bool is_a_number(real value)
{
    return (value < (real)0) || (value >= (real)0);
}

/* False for NaN and for numbers that soon overflow. */
static bool is_usable(real value)
{
    return magnitude(value) < USABLE;
}

/* The command within the limits; that nearest to 0 for NaN. */
static real clip(real volts)
{
    const real value = is_a_number(volts) ? volts : (real)0;
    return (value < LIMITS_LOW) ? LIMITS_LOW : ((value > LIMITS_HIGH) ? LIMITS_HIGH : value);
}

/* Copies numbers. Through volatile, so that no compiler makes a call of memcpy of it. */
static void numbers_copy(real *numbers, const real *from, uint32_t count)
{
    volatile real *place = numbers;
    uint32_t i;
    for (i = 0u; i < count; i++) {
        place[i] = from[i];
    }
}

/* ---- which readings are measurements ---- */

/* lowest displacement that the sensor can show, m */
static const real SPAN_LOW = -0x1.47ae147ae147bp-7; /* -0.01 */
/* highest one, m */
static const real SPAN_HIGH = 0x1.47ae147ae147bp-7; /* 0.01 */
/* a reference below this is none, m */
static const real REFERENCE_LOW = -0x1.eb851eb851eb8p-6; /* -0.03 */
/* a reference above this is none, m */
static const real REFERENCE_HIGH = 0x1.eb851eb851eb8p-6; /* 0.03 */

static uint32_t one_more(uint32_t count)
{
    return (count < UINT32_MAX) ? (count + 1u) : count;
}

/* Whether a reading is a measurement: not NaN, nor overload such as 9.91e37. */
static bool readings_accept(axis_state *s, real reading)
{
    if ((reading >= SPAN_LOW) && (reading <= SPAN_HIGH)) {
        return true;
    }
    if (!is_finite(reading)) {
        s->refused_not_finite = one_more(s->refused_not_finite);
    } else {
        s->refused_outside = one_more(s->refused_outside);
    }
    return false;
}

static void readings_rest(axis_state *s)
{
    s->refused_not_finite = 0u;
    s->refused_outside = 0u;
    s->refused_jumps = 0u;
}

/* ---- the feedback law ---- */

/* What the feedback law is told of a sample. */
struct sample {
    real error; /* reference less filtered measurement, m */
    real excess; /* command applied in the sample before less its unclipped command */
};

/* ---- incremental PID with back-calculation antiwindup ---- */

#define PID_PROPORTIONAL (s->settings.value[0]) /* Kp, V/m */
#define PID_INTEGRAL (s->settings.value[1]) /* Kp Ts/Ti, V/m */
#define PID_DERIVATIVE (s->settings.value[2]) /* Kp Td/Ts, V/m */
#define PID_TRACKING (s->settings.value[3]) /* Ts/Tt, of the antiwindup */

static void pid_start(axis_state *s, real volts)
{
    s->pid_volts = volts;
    s->pid_e1 = (real)0;
    s->pid_e2 = (real)0;
    s->pid_begun = 0u;
}

static void pid_rest(axis_state *s)
{
    pid_start(s, (real)0);
}

static real pid_step(axis_state *s, const struct sample *in)
{
    const real error = in->error;
    const bool begun = s->pid_begun != 0u;
    /* the first error stands for the earlier ones too: no derivative kick */
    const real e1 = begun ? s->pid_e1 : error;
    const real e2 = begun ? s->pid_e2 : error;
    const real rise = error - e1;
    const real bend = rise - (e1 - e2);
    const real change = PID_PROPORTIONAL * rise + PID_INTEGRAL * error + PID_DERIVATIVE * bend
        + PID_TRACKING * in->excess;
    real volts;
    if (!begun && !(magnitude(PID_INTEGRAL) > (real)0) && !(magnitude(s->pid_volts) > (real)0)) {
        /* nothing would ever make up for what the first error asks for */
        s->pid_volts = PID_PROPORTIONAL * error;
    }
    volts = s->pid_volts + change;
    if (is_finite(volts)) {
        s->pid_volts = volts;
        s->pid_e1 = error;
        s->pid_e2 = e1;
        s->pid_begun = 1u;
    } else {
        /* overflow: hold the output, start again from the next error */
        s->pid_begun = 0u;
    }
    return s->pid_volts;
}

/* ---- the law that the loop calls ---- */

static void feedback_rest(axis_state *s)
{
    pid_rest(s);
}

static void feedback_start(axis_state *s, real volts)
{
    pid_start(s, volts);
}

static real feedback_step(axis_state *s, const struct sample *in)
{
    return pid_step(s, in);
}

/* ---- the controller ---- */

/* limits less their range: no feedforward below, V */
static const real FAR_LOW = -0x1.2cp+6; /* -75.0 */
/* limits and their range: none above, V */
static const real FAR_HIGH = 0x1.2cp+7; /* 150.0 */

/* The command at the actuator: the last one, or what was reported. */
static real voltage(const axis_state *s)
{
    return (s->stepped != 0u) ? (s->last.unclipped + s->excess) : s->last.volts;
}

axis_real axis_step(
    axis_state *s, axis_real reference, axis_real measured, axis_real feedforward)
{
    const bool measurement_ok = readings_accept(s, measured);
    const bool reference_fits = (reference >= REFERENCE_LOW) && (reference <= REFERENCE_HIGH);
    bool begins = false;
    real used = feedforward;
    real feedback = s->last.feedback;
    real error = s->last.error;
    real unclipped;
    real volts;
    bool feedforward_ok = true;
    if (!is_usable(used)) {
        feedforward_ok = false;
        used = s->last.feedforward;
    } else if (used < FAR_LOW) {
        used = FAR_LOW;
    } else if (used > FAR_HIGH) {
        used = FAR_HIGH;
    } else {
        /* it is used as it is */
    }
    if (s->apart != 0u) {
        /* the first sample after a start or a report */
        s->stepped = 1u;
        s->reported = 0u;
        s->apart = 0u;
        begins = s->has_present != 0u;
        s->has_present = 0u;
    }
    if (begins) {
        feedback = s->present - used;
        feedback_start(s, feedback);
        s->excess = (real)0;
    }
    if (measurement_ok && reference_fits) {
        const real filtered = measured;
        struct sample in;
        error = reference - filtered;
        in.error = error;
        in.excess = s->excess;
        volts = feedback_step(s, &in);
        feedback = is_finite(volts) ? volts : feedback;
    }
    unclipped = feedback + used;
    if (!is_finite(unclipped)) {
        unclipped = s->last.volts; /* the sum overflowed */
    }
    volts = clip(unclipped);
    s->excess = volts - unclipped;
    s->last.volts = volts;
    s->last.unclipped = unclipped;
    s->last.feedforward = used;
    s->last.feedback = feedback;
    s->last.repetitive = (real)0;
    s->last.error = error;
    s->last.saturated = ((s->excess < (real)0) || (s->excess > (real)0)) ? 1u : 0u;
    s->last.measurement_ok = measurement_ok ? 1u : 0u;
    s->last.reference_ok = (reference_fits && feedforward_ok) ? 1u : 0u;
    return volts;
}

int axis_applied(axis_state *s, axis_real volts)
{
    if (!is_finite(volts)) {
        return 0;
    }
    if ((s->stepped != 0u) && (volts >= FAR_LOW) && (volts <= FAR_HIGH)) {
        s->excess = volts - s->last.unclipped;
        s->reported = 1u;
        s->apart = 1u;
    }
    return 1;
}

static void rest(axis_state *s, real volts)
{
    s->last.volts = volts;
    s->last.unclipped = (real)0;
    s->last.feedforward = (real)0;
    s->last.feedback = (real)0;
    s->last.repetitive = (real)0;
    s->last.error = (real)0;
    s->last.saturated = 0u;
    s->last.measurement_ok = 0u;
    s->last.reference_ok = 0u;
    s->excess = (real)0;
    s->stepped = 0u;
    s->reported = 0u;
    s->apart = 1u;
    readings_rest(s);
    feedback_rest(s);
}

void axis_init(axis_state *s)
{
    axis_settings_default(&s->settings);
    rest(s, clip((real)0));
    s->present = (real)0;
    s->has_present = 0u;
}

int axis_start(axis_state *s, axis_real present)
{
    if (!((present >= LIMITS_LOW) && (present <= LIMITS_HIGH))) {
        return 0;
    }
    axis_init(s);
    s->last.volts = present;
    s->present = present;
    s->has_present = 1u;
    return 1;
}

void axis_reset(axis_state *s)
{
    const real present = clip(voltage(s));
    if (s->stepped != 0u) {
        s->present = present;
        s->has_present = 1u;
    }
    rest(s, present);
}

/* ---- settings: the numbers above, changed while the controller runs ---- */

#define SETTINGS_VERSION 1u /* of the structure */
#define SETTINGS_LAYOUT 3827858851u /* of names, units, sizes and interval */
#define SETTINGS_KEPT 0u /* the first number that may change with the state kept */
#define SETTINGS_KEPT_END 4u /* the first number behind these */

/* the numbers of the design */
static const real SETTINGS_DEFAULT[] = {
    0x1.d4cp+16, /* 120000.0 */ /* pid_proportional */
    0x1.046aaaaaaaaabp+18, /* 266666.6666666667 */ /* pid_integral */
    0x1.01cffffffffffp+18, /* 263999.99999999994 */ /* pid_derivative */
    0x1.014a2883c8175p+0, /* 1.005037815259212 */ /* pid_tracking */
};

const axis_setting axis_setting_list[AXIS_SETTINGS] = {
    {"pid_proportional", "V/m", -0x1.176592ep+36 /* -75000000000.0 */, 0x1.176592ep+36 /* 75000000000.0 */},
    {"pid_integral", "V/m", -0x1.176592ep+36 /* -75000000000.0 */, 0x1.176592ep+36 /* 75000000000.0 */},
    {"pid_derivative", "V/m", -0x1.176592ep+36 /* -75000000000.0 */, 0x1.176592ep+36 /* 75000000000.0 */},
    {"pid_tracking", "1", 0x0p+0 /* 0.0 */, 0x1p+1 /* 2.0 */},
};

/* CRC-32 (IEEE 802.3, as of zlib) of some bytes, from that of the bytes before. */
static uint32_t settings_crc(uint32_t before, const unsigned char *bytes, uint32_t count)
{
    uint32_t crc = ~before;
    uint32_t i;
    uint32_t k;
    for (i = 0u; i < count; i++) {
        crc ^= bytes[i];
        for (k = 0u; k < 8u; k++) {
            crc = (crc >> 1u) ^ (((crc & 1u) != 0u) ? 0xEDB88320u : 0u);
        }
    }
    return ~crc;
}

/* That of version, layout and numbers, byte by byte as they are in memory. */
static uint32_t settings_checksum(const axis_settings *settings)
{
    const uint32_t word = (uint32_t)sizeof(uint32_t);
    uint32_t crc = settings_crc(0u, (const unsigned char *)&settings->version, word);
    crc = settings_crc(crc, (const unsigned char *)&settings->layout, word);
    return settings_crc(
        crc, (const unsigned char *)settings->value, (uint32_t)sizeof(settings->value));
}

void axis_settings_seal(axis_settings *settings)
{
    settings->version = SETTINGS_VERSION;
    settings->layout = SETTINGS_LAYOUT;
    settings->checksum = settings_checksum(settings);
}

void axis_settings_default(axis_settings *settings)
{
    numbers_copy(settings->value, SETTINGS_DEFAULT, (uint32_t)AXIS_SETTINGS);
    axis_settings_seal(settings);
}

/* Whether they are of this controller, whole, and every number is within its range. */
static bool settings_fit(const axis_settings *settings)
{
    uint32_t i;
    if ((settings->version != SETTINGS_VERSION) || (settings->layout != SETTINGS_LAYOUT)
        || (settings->checksum != settings_checksum(settings))) {
        return false;
    }
    for (i = 0u; i < (uint32_t)AXIS_SETTINGS; i++) {
        const real value = settings->value[i];
        /* false for NaN */
        if (!((value >= axis_setting_list[i].low) && (value <= axis_setting_list[i].high))) {
            return false;
        }
    }
    return true;
}

/* Whether some of the numbers are other ones. */
static bool settings_differ(const real *now, const real *next, uint32_t count)
{
    uint32_t i;
    for (i = 0u; i < count; i++) {
        if ((next[i] < now[i]) || (next[i] > now[i])) {
            return true;
        }
    }
    return false;
}

int axis_retune(axis_state *s, const axis_settings *settings)
{
    const real *now = s->settings.value;
    const real *next = settings->value;
    bool anew;
    if (!settings_fit(settings)) {
        return 0;
    }
    /* all but the gains of a PID, whose state is right for other gains too */
    anew = settings_differ(now, next, SETTINGS_KEPT)
        || settings_differ(&now[SETTINGS_KEPT_END], &next[SETTINGS_KEPT_END],
                           (uint32_t)AXIS_SETTINGS - SETTINGS_KEPT_END);
    if ((s->stepped != 0u) && anew) {
        /* the law starts anew from the command that is there */
        s->present = clip(voltage(s));
        s->has_present = 1u;
        s->apart = 1u;
    }
    numbers_copy(s->settings.value, next, (uint32_t)AXIS_SETTINGS);
    s->settings.checksum = settings->checksum;
    return 1;
}
