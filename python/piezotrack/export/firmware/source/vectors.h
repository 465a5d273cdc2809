/*
 * Steps of the controller of piezotrack: reference, the next one, reading, feedforward, whether it
 * is reset before, what is reported after it, and the command.
 */
#include <stdint.h>

#define NOT_FINITE ((real)(0.0f / 0.0f))
#define INFINITE ((real)(1.0f / 0.0f))

#include "rows.h"
