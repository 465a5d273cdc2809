/* ---- which readings are measurements ---- */

static uint32_t one_more(uint32_t count)
{
    return (count < UINT32_MAX) ? (count + 1u) : count;
}

#if JUMPS
/* Whether a reading is a measurement: not NaN, nor overload such as 9.91e37, nor a jump. The way
   that is allowed grows with the samples since the last one. */
static bool readings_accept(NAME_state *s, real reading)
{
    const bool inside = (reading >= SPAN_LOW) && (reading <= SPAN_HIGH);
    const real samples = (real)s->reading_since + (real)1;
    if (inside && ((s->reading_begun == 0u)
                   || (magnitude(reading - s->reading_last) <= SPAN_JUMP * samples))) {
        s->reading_last = reading;
        s->reading_since = 0u;
        s->reading_begun = 1u;
        return true;
    }
    s->reading_since = one_more(s->reading_since);
    if (!is_finite(reading)) {
        s->refused_not_finite = one_more(s->refused_not_finite);
    } else if (!inside) {
        s->refused_outside = one_more(s->refused_outside);
    } else {
        s->refused_jumps = one_more(s->refused_jumps);
    }
    return false;
}
#else
/* Whether a reading is a measurement: not NaN, nor overload such as 9.91e37. */
static bool readings_accept(NAME_state *s, real reading)
{
    if ((reading >= SPAN_LOW) && (reading <= SPAN_HIGH)) {
        return true;
    }
    if (!is_finite(reading)) {
        s->refused_not_finite = one_more(s->refused_not_finite);
    } else {
        s->refused_outside = one_more(s->refused_outside);
    }
    return false;
}
#endif

static void readings_rest(NAME_state *s)
{
    s->refused_not_finite = 0u;
    s->refused_outside = 0u;
    s->refused_jumps = 0u;
#if JUMPS
    s->reading_last = (real)0;
    s->reading_since = 0u;
    s->reading_begun = 0u;
#endif
}
