/*
 * libFuzzer on the C library: settings from bytes, then steps, reports, starts and resets.
 *
 * A voltage outside of the limits, an error that is no sentence, a panic that was caught: each ends
 * the program, as does what the sanitizers find. Texts and numbers are copies of exactly their
 * length, so that a byte read beyond them is seen.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "piezotrack.h"

#define MOST 24
#define STEPS 48

static const char *const SMOOTHINGS[] = {"lag", "compensated-lag", "zero-phase", "none"};
static const char *const FILTERS[] = {"low-pass", "notch"};
static const char *const NETWORK[] = {
    "centre", "scales", "thresholds", "hidden", "biases", "outputs", "direct", "constant",
};

/* Names that the library knows: it lists them where it refuses another one. */
typedef struct {
    char text[1000];
    const char *all[32];
    size_t count;
} names;

static names LAWS, MODELS, PARAMETERS[32];

static const double SPECIAL[] = {
    0.0, 1.0, -1.0, 0.5, 2.0, 3.0, NAN, INFINITY, -INFINITY, 1.7976931348623157e308, 5e-324,
    2.2250738585072014e-308, 1e100, 1e-100, 4294967295.0, -0.0,
};
#define COUNT(array) (sizeof(array) / sizeof(array)[0])

typedef struct {
    const uint8_t *at;
    size_t left;
    void *kept[512];
    size_t count;
} bytes;

static unsigned byte(bytes *from)
{
    if (from->left == 0) {
        return 0;
    }
    from->left--;
    return *from->at++;
}

static double number(bytes *from)
{
    const unsigned kind = byte(from);
    if (kind < 32) {
        return SPECIAL[kind % COUNT(SPECIAL)];
    }
    if (kind < 240) {
        const double size = pow(10.0, (int)(kind - 32) / 8 - 12);
        return (kind % 8 == 7 ? -size : size) * (1.0 + byte(from) * (9.0 / 256.0));
    }
    uint64_t bits = 0;
    for (int i = 0; i < 8; i++) {
        bits = bits << 8 | byte(from);
    }
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static double near(bytes *from, double usual)
{
    const unsigned kind = byte(from);
    return kind < 192 ? usual * (0.25 + kind / 85.0) : number(from);
}

/* Memory that is freed at the end; a pointer to 0 bytes may not be read at all. */
static void *room(bytes *from, size_t size)
{
    void *kept = malloc(size ? size : 1);
    if (kept == NULL || from->count == COUNT(from->kept)) {
        abort();
    }
    from->kept[from->count++] = kept;
    return kept;
}

static const char *copied(bytes *from, const char *text, size_t length)
{
    char *copy = room(from, length + 1);
    memcpy(copy, text, length);
    copy[length] = 0;
    return copy;
}

/* One of the names, or the bytes that come next up to a 0. */
static const char *name(bytes *from, const char *const *all, size_t count)
{
    if (byte(from) < 240) {
        const char *known = all[byte(from) % count];
        return copied(from, known, strlen(known));
    }
    size_t length = 0;
    while (length < from->left && length < 40 && from->at[length] != 0) {
        length++;
    }
    const char *text = copied(from, (const char *)from->at, length);
    from->at += length;
    from->left -= length;
    return text;
}

static piezotrack_numbers part(bytes *from, const char *text)
{
    const unsigned kind = byte(from);
    piezotrack_numbers made = {text, NULL, kind % 4 == 0 ? 1 : byte(from) % (MOST + 1)};
    if (kind == 255) {
        return made; /* no numbers where there is a count */
    }
    if (kind == 254) {
        made.name = NULL;
    }
    double *values = room(from, made.count * sizeof *values);
    double sum = 0.0;
    for (size_t i = 0; i < made.count; i++) {
        values[i] = kind & 4 ? number(from) : near(from, 1.0);
        sum += fabs(values[i]);
        values[i] = kind & 8 ? sum : values[i]; /* as thresholds rise */
    }
    made.values = values;
    return made;
}

static void feedforward(bytes *from, piezotrack_settings *into)
{
    const size_t which = byte(from) % (MODELS.count + 1);
    const int known = which < MODELS.count;
    into->model = known ? copied(from, MODELS.all[which], strlen(MODELS.all[which]))
                        : name(from, MODELS.all, MODELS.count);
    const char *const *all = known ? PARAMETERS[which].all : NETWORK;
    const size_t count = known ? PARAMETERS[which].count : COUNT(NETWORK);
    piezotrack_numbers *parameters = room(from, (count + 1) * sizeof *parameters);
    for (size_t i = 0; i <= count; i++) {
        /* Each that the model has, but for a few, and sometimes one too many. */
        if ((byte(from) < 224) == (i < count)) {
            const char *text = i < count ? all[i] : name(from, all, count);
            parameters[into->parameter_count++] = part(from, text);
        }
    }
    into->parameters = parameters;
    into->initial_count = byte(from) % 8;
    piezotrack_numbers *initial = room(from, into->initial_count * sizeof *initial);
    for (size_t i = 0; i < into->initial_count; i++) {
        initial[i] = part(from, name(from, all, count));
    }
    into->initial = initial;
    into->offset = near(from, 0.0);
    into->delay = near(from, 0.0);
}

static piezotrack_settings settings(bytes *from)
{
    const unsigned which = byte(from);
    piezotrack_settings made = {
        .dt = near(from, 0.001), .low = near(from, -10.0), .high = near(from, 75.0)};
    if (which & 1) {
        made.law = part(from, name(from, LAWS.all, LAWS.count));
    }
    if (which & 2) {
        made.repetitive = part(from, name(from, SMOOTHINGS, COUNT(SMOOTHINGS)));
    }
    if (which & 4) {
        made.filter_count = byte(from) % 4;
        piezotrack_numbers *filters = room(from, made.filter_count * sizeof *filters);
        for (size_t i = 0; i < made.filter_count; i++) {
            filters[i] = part(from, name(from, FILTERS, COUNT(FILTERS)));
        }
        made.filters = filters;
    }
    if (which & 8) {
        made.span_low = near(from, -1e-5);
        made.span_high = near(from, 1e-4);
        made.max_jump = near(from, 1e-6);
    }
    if (which & 16) {
        feedforward(from, &made);
    }
    return made;
}

static void expect(int holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "broken: %s\n", what);
        abort();
    }
}

static void run(bytes *from, piezotrack_controller *controller, const piezotrack_settings *of)
{
    for (int k = 0; k < STEPS; k++) {
        const double reference = near(from, 1e-6 * k);
        double volts = 0.0;
        switch (byte(from) % 16) {
        case 1:
            volts = piezotrack_step_given(controller, reference, near(from, 0.0), number(from));
            break;
        case 2:
            piezotrack_reset(controller);
            volts = piezotrack_last(controller).volts;
            break;
        case 3:
            (void)piezotrack_start(controller, near(from, 1.0));
            volts = piezotrack_last(controller).volts;
            break;
        case 4:
            (void)piezotrack_applied(controller, near(from, 1.0));
            /* fallthrough */
        default:
            volts = piezotrack_step(controller, reference, number(from), near(from, reference));
        }
        expect(volts >= of->low && volts <= of->high, "a voltage outside of the limits");
        (void)piezotrack_refused(controller);
    }
}

/* Takes the names from what the library says of the name "?". */
static void learn(names *into, const piezotrack_settings *of)
{
    piezotrack_controller *none = piezotrack_new(of, into->text, sizeof into->text);
    char *list = strstr(into->text, "expected ");
    expect(none == NULL && list != NULL, into->text);
    list += strlen("expected ");
    list += strncmp(list, "one of ", 7) == 0 ? 7 : 0;
    while (list != NULL && into->count < COUNT(into->all)) {
        char *end = strstr(list, ", ");
        char *other = strstr(list, " or ");
        end = end == NULL || (other != NULL && other < end) ? other : end;
        into->all[into->count++] = *list == '\'' ? list + 1 : list;
        list = end == NULL ? NULL : end + (*end == ',' ? 2 : 4);
        if (end != NULL) {
            *(end[-1] == '\'' ? end - 1 : end) = 0;
        } else if (into->all[into->count - 1] != NULL) {
            char *last = strchr(into->all[into->count - 1], '\'');
            if (last != NULL) {
                *last = 0;
            }
        }
    }
    expect(into->count > 1, into->text);
}

int LLVMFuzzerInitialize(int *count, char ***arguments)
{
    (void)count;
    (void)arguments;
    piezotrack_settings of = {.dt = 0.001, .high = 75.0, .law = {"?", NULL, 0}};
    learn(&LAWS, &of);
    of.law.name = NULL;
    of.model = "?";
    learn(&MODELS, &of);
    const double one = 1.0;
    const piezotrack_numbers unknown = {"?", &one, 1};
    of.parameters = &unknown;
    of.parameter_count = 1;
    /* The last one is the network. */
    MODELS.count--;
    for (size_t i = 0; i < MODELS.count; i++) {
        of.model = MODELS.all[i];
        learn(&PARAMETERS[i], &of);
    }
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes from = {data, size, {NULL}, 0};
    const size_t space = byte(&from);
    char *message = room(&from, space);
    const piezotrack_settings of = settings(&from);
    piezotrack_controller *controller = piezotrack_new(&of, message, space);
    if (space > 0) {
        expect(memchr(message, 0, space) != NULL, "a message without an end");
        expect((controller == NULL) == (message[0] != 0) || space == 1, "NULL without a message");
        /* At the beginning: libFuzzer has put these words into a name. */
        expect(strncmp(message, "the settings cannot be used", 27) != 0, message);
    }
    if (controller != NULL) {
        run(&from, controller, &of);
        piezotrack_free(controller);
    }
    for (size_t i = 0; i < from.count; i++) {
        free(from.kept[i]);
    }
    return 0;
}
