/*
 * The hardware: ten functions that a board implements. host.c is a process with TCP, mps2.c an
 * emulated Cortex-M.
 */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

/* What the converters say of a sample. */
#define BOARD_OVERRUN 1u /* the sample before was not answered in its interval */
#define BOARD_INVALID 2u /* there is no reading */

/* Starts clocks, converters, link and watchdog, with samples held back as by board_mask(true). Once
   they are let come, the board calls firmware_sample in each sampling interval, by interrupt or
   within board_get. */
void board_init(void);

/* Puts a code out at the DAC: within each firmware_sample, and by the main loop with samples held
   back. */
void board_write(uint32_t code);

/* Time since the start, ms; wraps around. */
uint32_t board_millis(void);

/* The next byte of the link, or -1 where there is none. */
int board_get(void);

/* Sends a byte over the link. It waits for room, for far less than the watchdog's time: then the rest
   of the line is dropped, or the client hung up on. */
void board_put(char byte);

/* False where the link is known to be lost. A serial line does not know, and returns true. */
bool board_linked(void);

/* Keeps the watchdog from a reset. */
void board_feed(void);

/* Holds firmware_sample back, or lets it come again. */
void board_mask(bool held);

/* Keeps a block of bytes over a reset, or reads it back; false where that cannot be done. */
bool board_store(const void *image, uint32_t bytes);
bool board_recall(void *image, uint32_t bytes);

#endif
