#include "protocol.h"

#include "board.h"
#include "firmware.h"
#include "ring.h"
#include "text.h"

/* Longest line, and numbers in a line of "load" at most. */
#define LINE_BYTES 1024u
#define NUMBERS 48u
/* Samples in an answer of "read" at most. */
#define READ_MOST 256u

static char line[LINE_BYTES];
static uint32_t length;
static uint32_t last_line; /* ms */
static uint8_t too_long;

#if INNER_SETTINGS > 0
static real staged[INNER_SETTINGS];
static bool has_staged; /* since the last "tune" */
#endif

static const char *const modes[] = {"off", "ramp", "hold", "play", "run", "fault"};
static const char *const faults[FAULT_COUNT] = {"none", "overrun", "reading", "link", "sampling"};

static void say(bool done, const char *problem)
{
    if (done) {
        text_put("ok");
    } else {
        text_put("error ");
        text_put(problem);
    }
}

static void named_count(const char *name, uint32_t count)
{
    text_put(name);
    text_put_count(count);
}

static void named_bits(const char *name, real number)
{
    text_put(name);
    text_put_bits(number);
}

static void identify(void)
{
    text_put("ok piezotrack-firmware 1 name=" INNER_NAME " unit=" DRIVE_UNIT);
    named_count(" real=", REAL_BYTES);
    named_bits(" dt=", SAMPLING_INTERVAL);
    named_bits(" low=", LIMITS_LOW);
    named_bits(" high=", LIMITS_HIGH);
    named_bits(" safe=", SAFE_VOLTS);
    named_count(" table=", TABLE_SAMPLES);
    named_count(" ring=", RING_SAMPLES);
    named_count(" divider=", DIVIDER_MOST);
    named_bits(" bottom=", ADC_LOW_METRES);
    named_bits(" top=", ADC_HIGH_METRES);
    named_count(" settings=", INNER_SETTINGS);
    named_count(" layout=", firmware_layout());
    named_count(" voltages=", INNER_TAKES_VOLTS);
}

static void show_status(void)
{
    struct firmware_status now;
    firmware_status(&now);
    text_put("ok ");
    text_put(modes[now.mode]);
    text_put(" fault=");
    text_put(faults[now.fault]);
    named_count(" tick=", now.tick);
    named_count(" left=", now.left);
    named_count(" recorded=", ring_count());
    named_count(" overruns=", now.overruns);
    named_count(" invalid=", now.invalid);
    text_put(" volts=");
    text_put_decimal(now.volts);
    text_put(" reading_m=");
    text_put_decimal(now.reading);
    text_put(" reference_m=");
    text_put_decimal(now.reference);
    named_bits(" ", now.volts);
    named_bits(" ", now.reading);
}

static void load(char *rest)
{
    static real numbers[NUMBERS];
    const char *name = text_word(&rest);
    const unsigned table = text_same(name, "reference") ? TABLE_REFERENCE : TABLE_VOLTS;
    uint32_t first = 0;
    uint32_t count = 0;
    if (table == TABLE_VOLTS && !text_same(name, "voltage")) {
        say(false, "table: expected voltage or reference");
        return;
    }
    if (!text_count(text_word(&rest), &first)) {
        say(false, "place: expected a whole number");
        return;
    }
    for (;;) {
        const char *word = text_word(&rest);
        if (*word == '\0') {
            break;
        }
        if (count == NUMBERS || !text_number(word, &numbers[count])) {
            say(false, "number: expected up to 48 decimals or bits");
            return;
        }
        count++;
    }
    say(firmware_load(table, first, numbers, count),
        "table: beyond limits, span or memory, or in use");
}

static void read_samples(char *rest)
{
    struct ring_sample sample;
    uint32_t first = 0;
    uint32_t count = 0;
    uint32_t i;
    if (!text_count(text_word(&rest), &first) || !text_count(text_word(&rest), &count)
        || count > READ_MOST) {
        say(false, "samples: expected the first one and up to 256");
        return;
    }
    text_put("ok");
    for (i = 0; i < count; i++) {
        bool there;
        board_mask(true);
        there = ring_get(first + i, &sample);
        board_mask(false);
        if (!there) {
            break;
        }
        named_count(" ", sample.tick);
        named_count(":", sample.flags);
        named_bits(":", sample.reference);
        named_bits(":", sample.volts);
        named_bits(":", sample.reading);
        board_feed();
    }
}

static void play_table(char *rest)
{
    uint32_t count = 0;
    uint32_t divider = 0;
    uint32_t lead = 0;
    const bool read = text_count(text_word(&rest), &count)
        && text_count(text_word(&rest), &divider) && text_count(text_word(&rest), &lead);
    say(read && firmware_play(count, divider, lead),
        "play: expected samples, intervals of a sample, intervals before; no fault");
}

static void run_table(char *rest)
{
    uint32_t count = 0;
    uint32_t periods = 0;
    uint32_t played = 0;
    const bool read = text_count(text_word(&rest), &count)
        && text_count(text_word(&rest), &periods) && text_count(text_word(&rest), &played);
    say(read && played <= 1u && firmware_run(count, periods, played == 1u),
        "run: expected samples, periods, whether voltages are added; no fault");
}

#if INNER_SETTINGS > 0
static void show_setting(char *rest)
{
    uint32_t place = 0;
    real numbers[INNER_SETTINGS];
    if (!text_count(text_word(&rest), &place) || place >= (uint32_t)INNER_SETTINGS) {
        say(false, "setting: expected its place, from 0");
        return;
    }
    (void)firmware_settings(numbers);
    text_put("ok ");
    text_put(inner_setting_list[place].name);
    text_put(" ");
    text_put(inner_setting_list[place].unit);
    named_bits(" ", numbers[place]);
    named_bits(" ", inner_setting_list[place].low);
    named_bits(" ", inner_setting_list[place].high);
    text_put(" ");
    text_put_decimal(numbers[place]);
}

static void stage_setting(char *rest)
{
    uint32_t place = 0;
    real number;
    if (!text_count(text_word(&rest), &place) || place >= (uint32_t)INNER_SETTINGS
        || !text_number(text_word(&rest), &number)) {
        say(false, "set: expected a place, from 0, and a number");
        return;
    }
    staged[place] = number;
    say(true, "");
}

/* Commands of the settings; false where it is none. */
static bool answer_settings(const char *verb, char *rest)
{
    if (text_same(verb, "setting")) {
        show_setting(rest);
    } else if (text_same(verb, "stage")) {
        has_staged = firmware_settings(staged);
        say(has_staged, "");
    } else if (text_same(verb, "set")) {
        stage_setting(rest);
    } else if (text_same(verb, "tune")) {
        say(has_staged && firmware_retune(staged),
            "tune: not staged, or a number is out of its range; nothing changed");
        has_staged = false;
    } else if (text_same(verb, "save")) {
        say(firmware_save(), "save: the output moves, or the board keeps nothing");
    } else {
        return false;
    }
    return true;
}
#else
static bool answer_settings(const char *verb, char *rest)
{
    (void)verb;
    (void)rest;
    return false;
}
#endif

static void one_number(char *rest, bool (*does)(real number), const char *problem)
{
    real number;
    say(text_number(text_word(&rest), &number) && does(number), problem);
}

static void exchange(char *rest)
{
    struct firmware_status now;
    real volts;
    if (!text_number(text_word(&rest), &volts) || !firmware_hold(volts)) {
        say(false, "exchange: expected a voltage within the limits; no fault");
        return;
    }
    firmware_status(&now);
    named_bits("ok ", now.reading);
}

static void answer(char *rest)
{
    const char *verb = text_word(&rest);
    if (text_same(verb, "ping")) {
        say(true, "");
    } else if (text_same(verb, "id")) {
        identify();
    } else if (text_same(verb, "state")) {
        show_status();
    } else if (text_same(verb, "hold")) {
        one_number(rest, firmware_hold, "hold: expected a voltage within the limits; no fault");
    } else if (text_same(verb, "exchange")) {
        exchange(rest);
    } else if (text_same(verb, "load")) {
        load(rest);
    } else if (text_same(verb, "play")) {
        play_table(rest);
    } else if (text_same(verb, "run")) {
        run_table(rest);
    } else if (text_same(verb, "follow")) {
        one_number(rest, firmware_follow, "follow: expected a displacement within the span, m; no fault");
    } else if (text_same(verb, "stop")) {
        say(firmware_stop(), "");
    } else if (text_same(verb, "clear")) {
        say(firmware_clear(), "clear: no fault, or not at the safe voltage yet");
    } else if (text_same(verb, "read")) {
        read_samples(rest);
    } else if (answer_settings(verb, rest)) {
        /* it has answered */
    } else {
        say(false, "command: expected ping, id, state, hold, exchange, load, play, run, follow, stop, "
               "clear, read, setting, stage, set, tune or save");
    }
    board_put('\n');
}

static void answer_line(void)
{
    if (too_long != 0u) {
        text_put("error line: longer than 1023 bytes\n");
    } else {
        line[length] = '\0';
        answer(line);
    }
    length = 0u;
    too_long = 0u;
}

uint32_t protocol_poll(void)
{
    uint32_t bytes;
    if (!board_linked()) {
        /* half a line of a client that has gone is not the next one's */
        length = 0u;
        too_long = 0u;
    }
    /* a line at most, and so many bytes: the watch over the samples goes on */
    for (bytes = 0u; bytes < LINE_BYTES; bytes++) {
        const int byte = board_get();
        if (byte < 0) {
            break;
        }
        if (byte == (int)'\n') {
            answer_line();
            last_line = board_millis();
            break;
        }
        if (byte != (int)'\r') {
            if ((length + 1u) < LINE_BYTES) {
                line[length] = (char)byte;
                length++;
            } else {
                too_long = 1u;
            }
        }
    }
    return board_millis() - last_line;
}
