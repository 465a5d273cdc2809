/*
 * Controller(PID, 50 Hz, 0 to 75 V)
 * Written by piezotrack 0.1.0, piezotrack export --to c99; do not edit.
 * Numbers: double. State: 168 bytes. A step that does not saturate:
 * 10 additions, 4 multiplications.
 *
 * Displacements in m, commands in V, times in s:
 *     a step every 0.02 s
 *     commands from 0.0 to 75.0 V
 *     measurements from -0.01 to 0.01 m, others are refused
 *
 * Call axis_init once, and axis_step in each sampling interval. Nothing is allocated, no library
 * function is called. Several states may run side by side, each of them in one context only: a step
 * that is interrupted by another function of the same state is not safe.
 */
#ifndef AXIS_H
#define AXIS_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef double axis_real;

/* The command of a step, with its parts. The last three are flags, 0 or 1; a 0 of the last two is
   an error of this sample, which moves neither the actuator nor any state. */
typedef struct {
    axis_real volts; /* the command, within the limits, V */
    axis_real unclipped; /* the same before it was clipped, V */
    axis_real feedforward; /* its feedforward part, V */
    axis_real feedback; /* its feedback part, V */
    axis_real repetitive; /* its repetitive part, V */
    axis_real error; /* reference less filtered measurement, m */
    uint8_t saturated; /* whether it was clipped */
    uint8_t measurement_ok; /* 0: not finite, outside of the span, or a jump; the last is held */
    uint8_t reference_ok; /* 0: reference or feedforward could not be used; the last is held */
} axis_command;

#define AXIS_SETTINGS 4 /* how many numbers there are to set */

/* Numbers that are changed while the controller runs. Change some of those of
   axis_settings_default, or of a copy of `settings` in the state, seal them, and pass them to
   axis_retune. An image that is sealed may be kept over a restart; another controller refuses it. */
typedef struct {
    uint32_t version; /* of this structure */
    uint32_t layout; /* which numbers: of their names, units, how many, and of the interval */
    axis_real value[AXIS_SETTINGS]; /* in the order of axis_setting_list */
    uint32_t checksum; /* CRC-32 of what is above */
} axis_settings;

/* A number that is set: what it is, and its range, both ends included. */
typedef struct {
    const char *name;
    const char *unit; /* "1" where it has none */
    axis_real low;
    axis_real high;
} axis_setting;

extern const axis_setting axis_setting_list[AXIS_SETTINGS];

/* The state: plain numbers, which may be copied to keep it over a restart. */
typedef struct {
    axis_command last; /* the last command */
    axis_settings settings; /* those in use, sealed */
    axis_real pid_volts; /* output, V */
    axis_real pid_e1; /* the last error, m */
    axis_real pid_e2; /* the error before it, m */
    axis_real present; /* command to go on from, V */
    axis_real excess; /* command applied less the unclipped one, V */
    uint32_t refused_not_finite; /* readings that were NaN or infinite */
    uint32_t refused_outside; /* readings outside of the span */
    uint32_t refused_jumps; /* readings too far from the last valid one */
    uint8_t pid_begun; /* whether there was an error */
    uint8_t has_present; /* whether there is a command to go on from */
    uint8_t stepped; /* whether there was a step */
    uint8_t reported; /* whether the excess is of a reported voltage */
    uint8_t apart; /* whether the next sample is the first after a start or a report */
} axis_state;

/* Begins at 0 V (or the limit nearest to it). */
void axis_init(axis_state *s);

/* Begins without a bump at the command `present` that is there now; returns 0, and changes nothing,
   where that is outside of the limits. In place of axis_init. */
int axis_start(axis_state *s, axis_real present);

/* The command for this sample: reference and measurement in m, and a feedforward of your own in
   V, 0 for none. NaN is allowed for each of them: see axis_command. */
axis_real axis_step(
    axis_state *s, axis_real reference, axis_real measured, axis_real feedforward);

/* Reports what the amplifier gave for the last command, where it differs from it: for the
   antiwindup. Returns 0 for what is not finite; that, and a report further outside of the limits
   than their range, is ignored. */
int axis_applied(axis_state *s, axis_real volts);

/* Forgets errors, readings and what was learnt, and goes on from the command that is there. */
void axis_reset(axis_state *s);

/* The settings of the design, sealed: those that axis_init and axis_start put into use. */
void axis_settings_default(axis_settings *settings);

/* Sets version, layout and checksum, after numbers were changed. */
void axis_settings_seal(axis_settings *settings);

/* Puts other settings into use from the next step on, without a bump: with other gains of a PID
   alone its state is kept; otherwise the feedback starts anew from the command that is there, and
   changed filters from the next measurement. What was learnt is kept, and axis_reset keeps the
   settings. Returns 0, and changes nothing, where version, layout or checksum is another, or a
   number is not finite or out of its range. In the context that calls axis_step. */
int axis_retune(axis_state *s, const axis_settings *settings);

#ifdef __cplusplus
}
#endif

#endif
