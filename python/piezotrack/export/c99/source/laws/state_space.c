/* ---- law in state space ---- */

static real law_dot(const real *a, const real *b)
{
    real sum = (real)0;
    uint32_t i;
    for (i = 0u; i < LAW_STATES; i++) {
        sum = sum + a[i] * b[i];
    }
    return sum;
}

static void law_rest(NAME_state *s)
{
    numbers_clear(s->law_x, LAW_STATES);
    s->law_error = (real)0;
    s->law_first = (real)0;
    s->law_offset = (real)0;
    s->law_begun = 0u;
    s->law_starts = 0u;
}

static void law_start(NAME_state *s, real volts)
{
    law_rest(s);
    s->law_first = volts;
    s->law_starts = 1u;
}

/* Advances the states by the last sample, whose error and excess are known now. */
static void law_advance(NAME_state *s, real error, real excess)
{
    real next[LAW_STATES];
    uint32_t i;
    for (i = 0u; i < LAW_STATES; i++) {
        next[i] = law_dot(&LAW_A[LAW_STATES * i], s->law_x) + LAW_B[i] * error;
    }
#if BACK
    for (i = 0u; i < LAW_STATES; i++) {
        next[i] += LAW_BACK[i] * excess;
    }
#else
    if ((excess * (law_dot(LAW_C, next) - law_dot(LAW_C, s->law_x))) < (real)0) {
        return; /* it would move the command further beyond the limit */
    }
#endif
    numbers_copy(s->law_x, next, LAW_STATES);
}

static real law_step(NAME_state *s, const struct sample *in)
{
    real volts;
    if (s->law_begun != 0u) {
        law_advance(s, s->law_error, in->excess);
    } else if (s->law_starts != 0u) {
        s->law_offset = s->law_first - LAW_D * in->error;
    } else {
        /* the states are 0 */
    }
    s->law_error = in->error;
    s->law_begun = 1u;
    volts = law_dot(LAW_C, s->law_x) + LAW_D * in->error + s->law_offset;
    if (is_finite(volts)) {
        return volts;
    }
    law_rest(s); /* overflow: start again */
    return (real)0;
}
