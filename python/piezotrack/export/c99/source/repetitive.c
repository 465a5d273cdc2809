/* ---- repetitive part ---- */

/* A sum of products, as two sums that the processor can compute side by side. */
static real weighted(const real *entries, const real *taps, uint32_t count)
{
    real even = (real)0;
    real odd = (real)0;
    uint32_t i;
    for (i = 0u; (i + 1u) < count; i += 2u) {
        even += entries[i] * taps[i];
        odd += entries[i + 1u] * taps[i + 1u];
    }
    if (i < count) {
        even += entries[i] * taps[i];
    }
    return even + odd;
}

/* The filter Q of what was learnt a period ago, without its memory. */
static real line_filtered(const NAME_state *s)
{
    uint32_t first = s->line_next + REPETITIVE_UNREAD;
    uint32_t older = REPETITIVE_COUNT;
    real sum;
    if (first >= REPETITIVE_ENTRIES) {
        first -= REPETITIVE_ENTRIES;
    }
    if (older > (REPETITIVE_ENTRIES - first)) {
        older = REPETITIVE_ENTRIES - first;
    }
    sum = weighted(&s->learnt[first], REPETITIVE_TAPS, older);
    if (older < REPETITIVE_COUNT) {
        sum = sum + weighted(s->learnt, &REPETITIVE_TAPS[older], REPETITIVE_COUNT - older);
    }
    return sum;
}

#if PAUSES || LEADS
/* The entry that was written `age` samples before the next one. */
static uint32_t line_entry(const NAME_state *s, uint32_t age)
{
    const uint32_t next = s->line_next;
    return (next >= age) ? (next - age) : (next + REPETITIVE_ENTRIES - age);
}

#endif
#if PAUSES
static void line_store(NAME_state *s, real sum, real volts, real learns)
#else
static void line_store(NAME_state *s, real sum, real learns)
#endif
{
#if PAUSES
    s->given[s->line_next] = volts;
#endif
    s->learnt[s->line_next] = sum;
#if LEADS
    /* the error belongs to an earlier sample, as the stage answers later */
    s->learnt[line_entry(s, REPETITIVE_LEAD)] += learns;
#else
    s->learnt[s->line_next] += learns;
#endif
    s->line_next = ((s->line_next + 1u) < REPETITIVE_ENTRIES) ? (s->line_next + 1u) : 0u;
}

/* A voltage within the range of the limits; 0 where it is not a number. */
static real line_bounded(real volts)
{
    return is_a_number(volts) ? within(volts, LIMITS_RANGE) : (real)0;
}

#if PAUSES
/* States of learning. */
#define LEARNS 0u
#define HOLDS 1u
#define RESUMES 2u

/* Holds for another period, of as many samples as keeps it in phase with the reference. */
static void line_hold_another(NAME_state *s)
{
    s->behind += REPETITIVE_AHEAD;
    s->left = REPETITIVE_WHOLE;
    if ((s->behind > (real)0.5) && (s->left < REPETITIVE_ENTRIES)) {
        s->behind -= (real)1;
        s->left += 1u;
    } else if ((s->behind < -(real)0.5) && (s->left > 1u)) {
        s->behind += (real)1;
        s->left -= 1u;
    } else {
        /* in phase */
    }
    s->learning = HOLDS;
}

/* The end of a held period: another one where too much was clipped, and once more after that. */
static void line_end_held(NAME_state *s)
{
    s->inward = 0u;
    s->well = (s->clipped > (REPETITIVE_WHOLE / 4u)) ? 0u : one_more(s->well);
    s->clipped = 0u;
    if (s->well < 2u) {
        line_hold_another(s);
    } else {
        s->well = 0u;
        s->learning = RESUMES;
        s->left = REPETITIVE_ENTRIES;
    }
}

/* Whether to learn in this sample; `clipped` is of the sample before. */
static void line_follow(NAME_state *s, bool clipped)
{
    if (s->learning == HOLDS) {
        s->left = (s->left > 0u) ? (s->left - 1u) : 0u;
        s->clipped = clipped ? one_more(s->clipped) : s->clipped;
        if (s->left == 0u) {
            line_end_held(s);
        }
        return;
    }
    if ((s->learning == RESUMES) && (s->left > 1u)) {
        s->left -= 1u;
    } else {
        s->learning = LEARNS;
    }
    s->since = one_more(s->since);
    if (clipped && (s->since >= REPETITIVE_WHOLE)) {
        s->since = 0u;
        s->clipped = 0u;
    }
    s->clipped = clipped ? one_more(s->clipped) : s->clipped;
    if (clipped && (s->clipped > (REPETITIVE_WHOLE / 4u))) {
        s->since = UINT32_MAX;
        s->clipped = 0u;
        s->inward = 0u;
        s->behind = (real)0;
        line_hold_another(s);
    }
}

/* Whether a held period was clipped by what is held, and not by the reference. */
static bool line_is_latched(NAME_state *s, real error, real excess, bool clipped)
{
    if (s->learning != HOLDS) {
        return false;
    }
    if (clipped && ((excess * error) > (real)0)) {
        s->inward += 1u;
    }
    return (s->left <= 1u) && (s->inward > (REPETITIVE_WHOLE / 4u))
        && (s->inward > (s->clipped / 2u));
}

static void line_forget_half(NAME_state *s)
{
    uint32_t i;
    for (i = 0u; i < REPETITIVE_ENTRIES; i++) {
        s->learnt[i] *= (real)0.5;
        s->given[i] *= (real)0.5;
    }
}

/* A sample while command or memory are affected by saturation. */
static real line_saturated(NAME_state *s, real error, real excess, bool clipped)
{
    const bool was_held = s->learning == HOLDS;
    const real volts = s->repetitive_volts;
    real out;
    if (line_is_latched(s, error, excess, clipped)) {
        line_forget_half(s);
    }
    line_follow(s, clipped);
    if (!was_held && clipped) {
        /* as much of uRC as takes the command to the limit */
        const real used = volts + excess;
        const real low = (volts < (real)0) ? volts : (real)0;
        const real high = (volts > (real)0) ? volts : (real)0;
        line_store(s, (used < low) ? low : ((used > high) ? high : used), volts, (real)0);
    } else if (!was_held) {
        line_store(s, volts, volts, REPETITIVE_GAIN * error);
    } else {
        /* what is held is not written again */
    }
    if (s->learning == LEARNS) {
        out = REPETITIVE_POLE * volts + line_filtered(s);
    } else {
        out = s->given[line_entry(s, (s->learning == HOLDS) ? s->left : REPETITIVE_WHOLE)];
    }
    s->repetitive_volts = line_bounded(out);
    return s->repetitive_volts;
}

#endif
static void repetitive_rest(NAME_state *s)
{
    numbers_clear(s->learnt, REPETITIVE_ENTRIES);
    s->repetitive_volts = (real)0;
    s->line_next = 0u;
#if PAUSES
    numbers_clear(s->given, REPETITIVE_ENTRIES);
    s->behind = (real)0;
    s->left = 0u;
    s->since = UINT32_MAX;
    s->clipped = 0u;
    s->inward = 0u;
    s->well = 0u;
    s->learning = LEARNS;
#endif
}

#if PAUSES
/* uRC of this sample, from error and excess of the sample before. */
static real repetitive_step(NAME_state *s, real error, real excess)
{
    const bool clipped = (excess < (real)0) || (excess > (real)0);
    const real volts = s->repetitive_volts;
    if (clipped || (s->learning != LEARNS)) {
        return line_saturated(s, error, excess, clipped);
    }
    s->since = one_more(s->since);
    line_store(s, volts, volts, REPETITIVE_GAIN * error);
    s->repetitive_volts = line_bounded(REPETITIVE_POLE * volts + line_filtered(s));
    return s->repetitive_volts;
}
#else
/* uRC of this sample, from the error of the sample before; it learns under saturation too. */
static real repetitive_step(NAME_state *s, real error)
{
    const real volts = s->repetitive_volts;
    line_store(s, volts, REPETITIVE_GAIN * error);
    s->repetitive_volts = line_bounded(REPETITIVE_POLE * volts + line_filtered(s));
    return s->repetitive_volts;
}
#endif
