/*
 * One axis: the inverse of a Prandtl-Ishlinskii stage as feedforward, a PI controller and repetitive
 * control, on a stage that the program makes up: a lag of 5 ms, 8 % less sensitive than the model, with
 * 20 nm of offset. Prints the tracking error of the second and of the last period; returns 0 where
 * learning has removed nine tenths of it.
 *
 *     make c-library
 *     cc -std=c99 -Irust/capi/include -o track rust/capi/examples/track.c \
 *         -Ltarget/release -Wl,-rpath,"$PWD/target/release" -lpiezotrack -lm
 *     ./track
 *
 * To link it statically: target/release/libpiezotrack.a -lpthread -ldl -lm in place of the line
 * before the last.
 */
#include <math.h>
#include <stdio.h>

#include "piezotrack.h"

#define DT 0.001      /* sampling interval, s */
#define SAMPLES 200   /* of a period */
#define PERIODS 30
#define PLAYS 2

static const double PI = 3.14159265358979323846;

/* Displacement to be followed, m. */
static double reference(int k)
{
    return 10e-6 + 20e-6 * (1.0 - cos(2.0 * PI * (k % SAMPLES) / SAMPLES));
}

/* The stage that is driven: plays of the voltage and a lag, m. */
static double stage(double volts)
{
    static const double thresholds[PLAYS] = {5.0, 15.0};
    static const double weights[PLAYS] = {0.20e-6, 0.10e-6};
    static double plays[PLAYS];
    static double x;
    double target = 20e-9 + 1.1e-6 * volts;
    int i;
    for (i = 0; i < PLAYS; i++) {
        plays[i] = fmax(volts - thresholds[i], fmin(volts + thresholds[i], plays[i]));
        target += weights[i] * plays[i];
    }
    x += (1.0 - exp(-DT / 0.005)) * (target - x);
    return x;
}

int main(void)
{
    static const double linear[] = {1.2e-6};          /* m/V */
    static const double thresholds[] = {5.0, 15.0};   /* V */
    static const double weights[] = {0.2e-6, 0.1e-6}; /* m/V */
    static const double time_constant[] = {0.005};    /* s */
    static const double pid[] = {0.05e6, 0.02, 0.0, NAN};
    static const double learner[] = {SAMPLES * DT, 0.3e6, 2.0, 0.99, 0.0, 1.0};
    const piezotrack_numbers parameters[] = {
        {"linear", linear, 1},
        {"thresholds", thresholds, PLAYS},
        {"weights", weights, PLAYS},
        {"time_constant", time_constant, 1},
    };
    const piezotrack_settings settings = {
        .dt = DT,
        .low = 0.0,
        .high = 75.0,
        .law = {"pid", pid, 4},
        .repetitive = {"zero-phase", learner, 6},
        .model = "prandtl-ishlinskii",
        .parameters = parameters,
        .parameter_count = sizeof parameters / sizeof parameters[0],
    };
    char message[256];
    double second = 0.0, last = 0.0, measured = 0.0;
    int k;
    piezotrack_controller *axis = piezotrack_new(&settings, message, sizeof message);
    if (axis == NULL) {
        fprintf(stderr, "%s\n", message);
        return 2;
    }
    for (k = 0; k < PERIODS * SAMPLES; k++) {
        const double volts = piezotrack_step(axis, reference(k), reference(k + 1), measured);
        const double error = piezotrack_last(axis).error;
        if (k >= SAMPLES && k < 2 * SAMPLES) {
            second += error * error;
        } else if (k >= (PERIODS - 1) * SAMPLES) {
            last += error * error;
        }
        measured = stage(volts);
    }
    second = sqrt(second / SAMPLES);
    last = sqrt(last / SAMPLES);
    printf("piezotrack %s: error %.1f nm rms in the second period, %.1f nm in the last\n",
           piezotrack_version(), 1e9 * second, 1e9 * last);
    piezotrack_free(axis);
    return last < 0.1 * second ? 0 : 1;
}
