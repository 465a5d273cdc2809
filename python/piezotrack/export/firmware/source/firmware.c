#include "firmware.h"

#include "board.h"
#include "protocol.h"
#include "ring.h"

static inner_state loop;
#if INNER_SETTINGS > 0
static inner_settings settings; /* in use: a start would take those of the design */
#endif
static struct firmware_status status = {MODE_OFF, FAULT_NONE, 0, 0, 0, 0, SAFE_VOLTS, 0, 0};
static real volts_table[TABLE_SAMPLES];
static real reference_table[TABLE_SAMPLES];

/* Of the table that is played or followed. */
static uint32_t table_count; /* samples; 0: a constant reference */
static uint32_t table_place; /* sample that comes next */
static uint32_t table_divider;
static uint32_t table_wait; /* intervals until the next sample */
static uint32_t table_periods; /* periods left; 0: without an end */
static bool table_played; /* whether the voltages are the feedforward of the loop */
static real constant; /* reference without a table, m */

static uint32_t overruns_in_a_row;
static uint32_t invalid_in_a_row;
static uint32_t last_sample; /* ms */
static volatile uint8_t sampled; /* a sample came since firmware_poll looked */

static real not_a_number(void)
{
    const real zero = (real)0;
    return zero / zero;
}

/* A displacement that the sensor can show; false for NaN. */
static bool is_shown(real metres)
{
    return (metres >= ADC_LOW_METRES) && (metres <= ADC_HIGH_METRES);
}

static bool is_allowed(real volts)
{
    return (volts >= LIMITS_LOW) && (volts <= LIMITS_HIGH);
}

/* Puts a voltage out: within the limits, and within the codes of the DAC. */
static void put_out(real volts)
{
    real code;
    real kept = volts;
    if (!(kept >= LIMITS_LOW)) {
        kept = (kept < LIMITS_LOW) ? LIMITS_LOW : SAFE_VOLTS;
    } else if (kept > LIMITS_HIGH) {
        kept = LIMITS_HIGH;
    } else {
        /* it is within */
    }
    code = (kept - DAC_ZERO_VOLTS) * DAC_CODES_PER_VOLT + (real)0.5;
    if (!(code >= (real)0)) {
        code = (real)0;
    } else if (code > DAC_CODE_MOST) {
        code = DAC_CODE_MOST;
    } else {
        /* it is one */
    }
    status.volts = kept;
    board_write((uint32_t)code);
}

/* At the safe voltage, and to stay there. */
static bool is_safe(void)
{
    return ((status.mode == MODE_OFF) || (status.mode == MODE_FAULT))
        && !((status.volts < SAFE_VOLTS) || (status.volts > SAFE_VOLTS));
}

static bool is_moving(void)
{
    return status.mode == MODE_HOLD || status.mode == MODE_PLAY || status.mode == MODE_RUN;
}

static void fail(enum firmware_fault fault)
{
    if (status.mode != MODE_FAULT) {
        ring_end();
        status.left = 0;
        status.mode = MODE_FAULT;
        status.fault = fault;
    }
}

/* A step of the way to the safe voltage; 1 where it is reached. */
static bool step_down(real *volts)
{
    const real way = SAFE_VOLTS - *volts;
    if (way > SAFE_STEP) {
        *volts += SAFE_STEP;
    } else if (way < -SAFE_STEP) {
        *volts -= SAFE_STEP;
    } else {
        *volts = SAFE_VOLTS;
        return true;
    }
    return false;
}

/* The voltage of the table for this interval. */
static real play(void)
{
    const real volts = volts_table[table_place];
    if (table_wait > 1u) {
        table_wait--;
    } else if (table_place + 1u < table_count) {
        table_place++;
        table_wait = table_divider;
    } else {
        status.mode = MODE_HOLD;
    }
    return volts;
}

/* A step of the loop: the reference of this sample, of the next one, and the feedforward. */
static real follow(real reading, real *reference)
{
    real next = constant;
    real forward = (real)0;
    *reference = constant;
    if (table_count > 0u) {
        const uint32_t after = table_place + 1u < table_count ? table_place + 1u : 0u;
        const bool stays = table_periods == 1u && after == 0u;
        *reference = reference_table[table_place];
        next = reference_table[stays ? table_place : after];
        forward = table_played ? volts_table[table_place] : (real)0;
        if (!stays) {
            if (after == 0u && table_periods > 1u) {
                table_periods--;
            }
            table_place = after;
        }
        status.left = status.left > 0u ? status.left - 1u : 0u;
    }
    return inner_step(&loop, *reference, next, reading, forward);
}

void firmware_sample(uint32_t code, unsigned from_converters)
{
    /* a code at an end is that of a sensor out of its range, or of a cable that is torn */
    const bool invalid = ((from_converters & BOARD_INVALID) != 0u) || (code == 0u)
        || (code >= (uint32_t)ADC_CODE_MOST);
    const bool overrun = (from_converters & BOARD_OVERRUN) != 0u;
    struct ring_sample sample;
    real volts = status.volts;
    real reference = not_a_number();
    bool records = true;
    status.tick++;
    status.reading = invalid ? not_a_number() : ADC_ZERO_METRES + (real)code * ADC_METRES_PER_CODE;
    sample.flags = 0u;
    if (invalid) {
        sample.flags |= SAMPLE_INVALID;
    }
    if (overrun) {
        sample.flags |= SAMPLE_OVERRUN;
    }
    if (invalid && status.invalid < UINT32_MAX) {
        status.invalid++;
    }
    if (overrun && status.overruns < UINT32_MAX) {
        status.overruns++;
    }
    overruns_in_a_row = overrun ? overruns_in_a_row + 1u : 0u;
    if (overruns_in_a_row >= OVERRUNS_MOST && is_moving()) {
        fail(FAULT_OVERRUN);
    }
    switch (status.mode) {
    case MODE_RAMP:
        if (step_down(&volts)) {
            status.mode = MODE_OFF;
        }
        break;
    case MODE_PLAY:
        if (table_place == 0u && table_wait > table_divider) {
            records = false; /* the first voltage, before the record */
        } else {
            records = table_wait == table_divider;
            status.left = table_count - table_place - 1u;
        }
        volts = play();
        break;
    case MODE_RUN:
        volts = follow(status.reading, &reference);
        sample.flags |= SAMPLE_LOOP | (inner_saturated(&loop) ? SAMPLE_SATURATED : 0u);
        invalid_in_a_row = inner_reading_ok(&loop) ? 0u : invalid_in_a_row + 1u;
        if (invalid_in_a_row >= INVALID_MOST) {
            fail(FAULT_READING);
        }
        break;
    case MODE_FAULT:
        (void)step_down(&volts);
        break;
    case MODE_OFF:
        volts = SAFE_VOLTS;
        break;
    default: /* MODE_HOLD: the voltage that is there */
        break;
    }
    put_out(volts);
    status.reference = reference;
    if (records) {
        sample.tick = status.tick;
        sample.reference = reference;
        sample.volts = status.volts;
        sample.reading = status.reading;
        ring_add(&sample);
    }
    sampled = 1;
}

void firmware_init(void)
{
    inner_init(&loop);
    status.volts = SAFE_VOLTS;
    status.reading = not_a_number();
    status.reference = not_a_number();
#if INNER_SETTINGS > 0
    {
        inner_settings saved;
        inner_settings_default(&settings);
        /* refused where they are of another controller */
        if (board_recall(&saved, (uint32_t)sizeof saved) && inner_retune(&loop, &saved)) {
            settings = saved;
        }
    }
#endif
    put_out(SAFE_VOLTS);
    ring_begin(0u);
    last_sample = board_millis();
}

void firmware_poll(void)
{
    const uint32_t now = board_millis();
    const uint32_t since_line = protocol_poll();
    board_mask(true);
    if (sampled != 0u) {
        sampled = 0;
        last_sample = now;
    }
    if (is_moving() && (!board_linked() || (since_line > LINK_TIMEOUT_MS))) {
        fail(FAULT_LINK);
    }
    if (((now - last_sample) > SAMPLING_TIMEOUT_MS) && !is_safe()) {
        fail(FAULT_SAMPLING);
        put_out(SAFE_VOLTS); /* no sample leads it there */
    }
    board_mask(false);
    board_feed();
}

void firmware_status(struct firmware_status *there)
{
    board_mask(true);
    *there = status;
    board_mask(false);
}

/* From here on: what the protocol asks for. All of it is held back from the samples. */

bool firmware_hold(real volts)
{
    bool done;
    board_mask(true);
    done = is_allowed(volts) && (status.mode != MODE_FAULT);
    if (done) {
        status.mode = MODE_HOLD;
        status.left = 0u;
        ring_begin(0u);
        put_out(volts);
    }
    board_mask(false);
    return done;
}

bool firmware_load(unsigned table, uint32_t first, const real *numbers, uint32_t count)
{
    uint32_t i;
    if (first > TABLE_SAMPLES || count > TABLE_SAMPLES - first || status.mode == MODE_PLAY
        || ((status.mode == MODE_RUN) && (table_count > 0u))) {
        return false; /* a table in use is not changed */
    }
    for (i = 0; i < count; i++) {
        const real number = numbers[i];
        if (table == TABLE_VOLTS ? !is_allowed(number) : !is_shown(number)) {
            return false;
        }
    }
    for (i = 0; i < count; i++) {
        board_mask(true);
        if (table == TABLE_VOLTS) {
            volts_table[first + i] = numbers[i];
        } else {
            reference_table[first + i] = numbers[i];
        }
        board_mask(false);
    }
    return true;
}

bool firmware_play(uint32_t count, uint32_t divider, uint32_t lead)
{
    bool done;
    board_mask(true);
    done = (count > 0u) && (count <= TABLE_SAMPLES) && (divider > 0u) && (divider <= DIVIDER_MOST)
        && (lead <= (UINT32_MAX - divider)) && (status.mode != MODE_FAULT);
    if (done) {
        table_count = count;
        table_place = 0u;
        table_divider = divider;
        table_wait = divider + lead;
        status.left = count;
        status.mode = MODE_PLAY;
        ring_begin(count);
    }
    board_mask(false);
    return done;
}

static bool run(uint32_t count, uint32_t periods, bool played, real reference)
{
    bool done;
    board_mask(true);
    done = status.mode != MODE_FAULT;
    if (done && (status.mode != MODE_RUN)) {
        invalid_in_a_row = 0u;
        done = inner_start(&loop, status.volts);
#if INNER_SETTINGS > 0
        if (done) {
            (void)inner_retune(&loop, &settings);
        }
#endif
    }
    if (done) {
        const bool ends = (count > 0u) && (periods <= (UINT32_MAX / count));
        table_count = count;
        table_place = 0u;
        table_periods = periods;
        table_played = played;
        constant = reference;
        status.left = ends ? (count * periods) : 0u;
        status.mode = MODE_RUN;
        ring_begin(status.left);
    }
    board_mask(false);
    return done;
}

bool firmware_run(uint32_t count, uint32_t periods, bool played)
{
    if (count == 0u || count > TABLE_SAMPLES || (played && (INNER_TAKES_VOLTS == 0))) {
        return false;
    }
    return run(count, periods, played, (real)0);
}

bool firmware_follow(real reference)
{
    return is_shown(reference) && run(0u, 0u, false, reference);
}

bool firmware_stop(void)
{
    board_mask(true);
    if (is_moving()) {
        ring_end();
        status.left = 0;
        status.mode = MODE_RAMP;
    }
    board_mask(false);
    return true;
}

bool firmware_clear(void)
{
    bool done = false;
    board_mask(true);
    if (status.mode == MODE_FAULT && !(status.volts < SAFE_VOLTS || status.volts > SAFE_VOLTS)) {
        status.mode = MODE_OFF;
        status.fault = FAULT_NONE;
        done = true;
    }
    board_mask(false);
    return done;
}

uint32_t firmware_layout(void)
{
#if INNER_SETTINGS > 0
    return settings.layout;
#else
    return 0u;
#endif
}

bool firmware_settings(real *numbers)
{
#if INNER_SETTINGS > 0
    uint32_t i;
    for (i = 0; i < (uint32_t)INNER_SETTINGS; i++) {
        numbers[i] = settings.value[i];
    }
    return true;
#else
    (void)numbers;
    return false;
#endif
}

bool firmware_retune(const real *numbers)
{
#if INNER_SETTINGS > 0
    inner_settings next;
    uint32_t i;
    bool done;
    for (i = 0; i < (uint32_t)INNER_SETTINGS; i++) {
        next.value[i] = numbers[i];
    }
    inner_settings_seal(&next);
    board_mask(true);
    done = inner_retune(&loop, &next);
    if (done) {
        settings = next;
    }
    board_mask(false);
    return done;
#else
    (void)numbers;
    return false;
#endif
}

bool firmware_save(void)
{
#if INNER_SETTINGS > 0
    /* a memory that is written may hold up the samples */
    return !is_moving() && board_store(&settings, (uint32_t)sizeof settings);
#else
    return false;
#endif
}
