/*
 * Commands over the link, a line each, answered by a line that begins with "ok" or "error".
 */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdint.h>

/* Answers the lines that have come; returns the time since the last one, ms. */
uint32_t protocol_poll(uint32_t now);

#endif
