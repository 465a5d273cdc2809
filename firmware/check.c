/*
 * Runs vectors.csv through axis_step and prints the largest difference to what the controller of
 * piezotrack gives. Returns 0 where all are within the bound and at most 0 flags differ.
 *
 *     cc -std=c99 -O2 -ffp-contract=off -o check check.c axis.c && ./check vectors.csv
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "axis.h"

#define BOUND 0.0 /* largest difference allowed; 0: all bits are the same */
#define FLAGS 0 /* flags that may differ */

#define COLUMNS 15

static axis_state state;

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
    axis_init(&state);
    while (read_line(file, in)) {
        double d;
        int i;
        if (in[5] > 0) {
            axis_reset(&state);
        }
        axis_step(&state, (axis_real)in[1], (axis_real)in[3], (axis_real)in[4]);
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
            axis_applied(&state, (axis_real)in[6]);
        }
        steps++;
    }
    fclose(file);
    printf("steps %ld, largest difference %.3g at step %ld, flags that differ %ld, ",
           steps, largest, worst, flags);
    printf("state %lu bytes\n", (unsigned long)sizeof state);
    return steps > 0 && largest <= BOUND && flags <= FLAGS ? 0 : 1;
}
