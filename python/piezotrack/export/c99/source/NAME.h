/*
@facts
 *
 * Displacements in m, commands in @unit, times in s:
@ranges
 *
 * Call NAME_init once, and NAME_step in each sampling interval. Nothing is allocated, no library
 * function is called. Several states may run side by side, each of them in one context only: a step
 * that is interrupted by another function of the same state is not safe.
 */
#ifndef NAME_H
#define NAME_H

#include <stdint.h>

#include "choices.h"

#ifdef __cplusplus
extern "C" {
#endif

#if SINGLE
typedef float NAME_real;
#else
typedef double NAME_real;
#endif

/* The command of a step, with its parts. The last three are flags, 0 or 1; a 0 of the last two is
   an error of this sample, which moves neither the actuator nor any state. */
typedef struct {
    NAME_real volts; /* the command, within the limits, @unit */
    NAME_real unclipped; /* the same before it was clipped, @unit */
    NAME_real feedforward; /* its feedforward part, @unit */
    NAME_real feedback; /* its feedback part, @unit */
    NAME_real repetitive; /* its repetitive part, @unit */
    NAME_real error; /* reference less filtered measurement, m */
    uint8_t saturated; /* whether it was clipped */
    uint8_t measurement_ok; /* 0: not finite, outside of the span, or a jump; the last is held */
    uint8_t reference_ok; /* 0: reference or feedforward could not be used; the last is held */
} NAME_command;
#if FORWARD_ONLINE

/* State of the inverse of the stage. */
typedef struct {
    NAME_real x; /* the last displacement, m */
    NAME_real w; /* its velocity times the sampling interval, m */
    NAME_real force; /* hysteresis q1 */
    NAME_real slope; /* its slope q2 along the path */
    uint8_t begun; /* whether there was a sample */
} NAME_inverse;
#endif

#if TUNED
#include "counts.h"

/* Numbers that are changed while the controller runs. Change some of those of
   NAME_settings_default, or of a copy of `settings` in the state, seal them, and pass them to
   NAME_retune. An image that is sealed may be kept over a restart; another controller refuses it. */
typedef struct {
    uint32_t version; /* of this structure */
    uint32_t layout; /* which numbers: of their names, units, how many, and of the interval */
    NAME_real value[NAME_SETTINGS]; /* in the order of NAME_setting_list */
    uint32_t checksum; /* CRC-32 of what is above */
} NAME_settings;

/* A number that is set: what it is, and its range, both ends included. */
typedef struct {
    const char *name;
    const char *unit; /* "1" where it has none */
    NAME_real low;
    NAME_real high;
} NAME_setting;

extern const NAME_setting NAME_setting_list[NAME_SETTINGS];
#else
#define NAME_SETTINGS 0 /* all numbers are constants */
#endif

/* The state: plain numbers, which may be copied to keep it over a restart. */
typedef struct {
    NAME_command last; /* the last command */
#include "state.h"
} NAME_state;

/* Begins at 0 @unit (or the limit nearest to it). */
void NAME_init(NAME_state *s);

/* Begins without a bump at the command `present` that is there now; returns 0, and changes nothing,
   where that is outside of the limits. In place of NAME_init. */
int NAME_start(NAME_state *s, NAME_real present);

#if FORWARD_ONLINE
/* The command for this sample: the reference, that of the next sample (NaN where it is not known,
   then the feedforward comes half a sample late), and the measurement, in m. NaN is allowed for
   each of them: see NAME_command. After a feedforward beyond the limits, and in NAME_applied, the
   inverse is evaluated again, 42 times at most and some 8 times mostly. */
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real next, NAME_real measured);
#elif FORWARD_TABLE
/* The command for this sample: reference and measurement in m. NaN is allowed for each of them:
   see NAME_command. The feedforward is played from its table: the first step after NAME_init is
   the beginning of a period, and NAME_reset does not shift it. */
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real measured);
#else
/* The command for this sample: reference and measurement in m, and a feedforward of your own in
   @unit, 0 for none. NaN is allowed for each of them: see NAME_command. */
NAME_real NAME_step(
    NAME_state *s, NAME_real reference, NAME_real measured, NAME_real feedforward);
#endif

/* Reports what the amplifier gave for the last command, where it differs from it: for the
   antiwindup. Returns 0 for what is not finite; that, and a report further outside of the limits
   than their range, is ignored. */
int NAME_applied(NAME_state *s, NAME_real volts);

/* Forgets errors, readings and what was learnt, and goes on from the command that is there. */
void NAME_reset(NAME_state *s);
#if TUNED

/* The settings of the design, sealed: those that NAME_init and NAME_start put into use. */
void NAME_settings_default(NAME_settings *settings);

/* Sets version, layout and checksum, after numbers were changed. */
void NAME_settings_seal(NAME_settings *settings);

/* Puts other settings into use from the next step on, without a bump: with other gains of a PID
   alone its state is kept; otherwise the feedback starts anew from the command that is there, and
   changed filters from the next measurement. What was learnt is kept, and NAME_reset keeps the
   settings. Returns 0, and changes nothing, where version, layout or checksum is another, or a
   number is not finite or out of its range. In the context that calls NAME_step. */
int NAME_retune(NAME_state *s, const NAME_settings *settings);
#endif

#ifdef __cplusplus
}
#endif

#endif
