/*
@facts
 *
 * Displacements in m, commands in @unit, times in s. Call NAME_init once, NAME_step in each
 * sampling interval, NAME_free at the end. The controller is one of libpiezotrack, which is linked
 * with it; a step does not allocate. The functions are those of piezotrack export --to c99.
 */
#ifndef NAME_H
#define NAME_H

#include "piezotrack.h"

#include "choices.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef double NAME_real;
typedef piezotrack_command NAME_command;

typedef struct {
    piezotrack_controller *controller;
    NAME_command last; /* the last command */
    uint32_t place; /* next sample of the table, where there is one */
} NAME_state;

/* Begins at 0 @unit (or the limit nearest to it). Returns 0 where there is no memory, or a library
   of another version refuses the settings. */
int NAME_init(NAME_state *s);

/* Begins without a bump at the command `present` that is there now, in place of NAME_init; returns
   0 where that is outside of the limits. */
int NAME_start(NAME_state *s, NAME_real present);

#if FORWARD_ONLINE
/* The command for this sample: the reference, that of the next sample (NaN where it is not known),
   and the measurement, in m. NaN is allowed for each of them. */
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real next, NAME_real measured);
#elif FORWARD_TABLE
/* The command for this sample: reference and measurement in m. NaN is allowed for each of them. The
   feedforward is played from its table: the first step after NAME_init is the beginning of a
   period, and NAME_reset does not shift it. */
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real measured);
#else
/* The command for this sample: reference and measurement in m, and a feedforward of your own in
   @unit, 0 for none. NaN is allowed for each of them. */
NAME_real NAME_step(
    NAME_state *s, NAME_real reference, NAME_real measured, NAME_real feedforward);
#endif

/* Reports what the amplifier gave for the last command, where it differs from it: for the
   antiwindup. Returns 0 for what is not finite. */
int NAME_applied(NAME_state *s, NAME_real volts);

/* Forgets errors, readings and what was learnt, and goes on from the command that is there. */
void NAME_reset(NAME_state *s);

void NAME_free(NAME_state *s);

#ifdef __cplusplus
}
#endif

#endif
