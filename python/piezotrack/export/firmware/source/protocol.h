/*
 * Commands over the link, a line each, answered by a line that begins with "ok" or "error".
 */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdint.h>

/* Answers a line that has come; returns the time since the last one, ms. */
uint32_t protocol_poll(void);

#endif
