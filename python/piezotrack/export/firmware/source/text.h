/*
 * Numbers as text, without a library. A number is written as its bits, "x" and hexadecimal digits,
 * and read as those or as a decimal.
 */
#ifndef TEXT_H
#define TEXT_H

#include <stdbool.h>
#include <stdint.h>

#include "configuration.h"

/* Sends a text, a whole number, a number as its bits, a number as a decimal of six digits. */
void text_put(const char *text);
void text_put_count(uint32_t count);
void text_put_bits(real number);
void text_put_decimal(real number);

/* The next word of a line, ended by a 0 in its place; empty at the end. */
char *text_word(char **line);

bool text_same(const char *one, const char *other);

/* Reads a whole number or a number; false where the word is none. */
bool text_count(const char *word, uint32_t *count);
bool text_number(const char *word, real *number);

#endif
