/*
 * Runs vectors.csv through NAME_step and prints the largest difference to what the controller of
 * piezotrack gives. Returns 0 where all are within the bound and at most @flags flags differ.
 *
 *     cc -std=c99 -O2 -ffp-contract=off -o check check.c NAME.c@link && ./check vectors.csv
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "NAME.h"

#include "bounds.h"

#define COLUMNS 15

static NAME_state state;
#if CLOSED

/* The loop is closed around the stage of the vectors, a lag: an observer around an integral would
   add up twice what floats leave out, where no reading answers. */

/* How far the stage is from where it is in the vectors, m. */
static double away;

/* The lag of the vectors, after a command (or what was reported of it) that is another. */
static void move(double more)
{
    away += STAGE_FRESH * (STAGE_GAIN * more - away);
}
#endif

static double difference(double found, double expected)
{
    return found > expected ? found - expected : expected - found;
}

static int read_line(FILE *file, double *columns)
{
    char line[1024];
    char *place = line;
    int i;
    if (fgets(line, sizeof line, file) == NULL) {
        return 0;
    }
    for (i = 0; i < COLUMNS; i++) {
        char *end;
        columns[i] = strtod(place, &end);
        if (end == place) {
            return 0;
        }
        place = *end == ',' ? end + 1 : end;
    }
    return 1;
}

int main(int count, char **arguments)
{
    const char *name = count > 1 ? arguments[1] : "vectors.csv";
    FILE *file = fopen(name, "r");
    char title[1024];
    double in[COLUMNS];
    double largest = 0;
    long steps = 0;
    long flags = 0;
    long worst = 0;
    if (file == NULL || fgets(title, sizeof title, file) == NULL) {
        fprintf(stderr, "%s: cannot be read\n", name);
        return 2;
    }
    NAME_init(&state);
    while (read_line(file, in)) {
        double d;
        int i;
        if (in[5] > 0) {
            NAME_reset(&state);
        }
#if CLOSED
        in[3] += away;
#endif
#if FORWARD_ONLINE
        NAME_step(&state, (NAME_real)in[1], (NAME_real)in[2], (NAME_real)in[3]);
#elif FORWARD_TABLE
        NAME_step(&state, (NAME_real)in[1], (NAME_real)in[3]);
#else
        NAME_step(&state, (NAME_real)in[1], (NAME_real)in[3], (NAME_real)in[4]);
#endif
        for (i = 0; i < 4; i++) {
            const double found[] = {state.last.volts, state.last.unclipped, state.last.feedback,
                                    state.last.repetitive};
            d = difference(found[i], in[7 + i]);
            if (!(d <= largest)) {
                largest = d;
                worst = steps;
            }
        }
        flags += state.last.saturated != (in[12] > 0);
        flags += state.last.measurement_ok != (in[13] > 0);
        flags += state.last.reference_ok != (in[14] > 0);
        if (in[6] == in[6]) {
            NAME_applied(&state, (NAME_real)in[6]);
        }
#if CLOSED
        if (!(in[6] == in[6])) {
            move((double)state.last.volts - in[7]);
        } else if (in[6] >= STAGE_LOW && in[6] <= STAGE_HIGH) {
            move(0);
        }
#endif
        steps++;
    }
    fclose(file);
    printf("steps %ld, largest difference %.3g at step %ld, flags that differ %ld, ",
           steps, largest, worst, flags);
    printf("state %lu bytes\n", (unsigned long)sizeof state);
    return steps > 0 && largest <= BOUND && flags <= FLAGS ? 0 : 1;
}
