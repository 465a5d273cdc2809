/* ---- limits, and tests of numbers without a library ---- */

static real magnitude(real value)
{
    return (value < (real)0) ? -value : value;
}

/* False for NaN and infinity. */
static bool is_finite(real value)
{
    const real nothing = value - value;
    return (nothing >= (real)0) && (nothing <= (real)0);
}

/* False for NaN. */
static bool is_a_number(real value)
{
    return (value < (real)0) || (value >= (real)0);
}

/* False for NaN and for numbers that soon overflow. */
static bool is_usable(real value)
{
    return magnitude(value) < USABLE;
}

/* The command within the limits; that nearest to 0 for NaN. */
static real clip(real volts)
{
    const real value = is_a_number(volts) ? volts : (real)0;
    return (value < LIMITS_LOW) ? LIMITS_LOW : ((value > LIMITS_HIGH) ? LIMITS_HIGH : value);
}
#if LAW_SLIDING || REPEATS

/* A number within `most` of 0. */
static real within(real value, real most)
{
    return (value < -most) ? -most : ((value > most) ? most : value);
}
#endif
#if FORWARD_ONLINE

static real not_a_number(void)
{
    const real zero = (real)0;
    return zero / zero;
}
#endif
#if LAW_SPACE || REPEATS

/* Sets numbers to 0. Through volatile, so that no compiler makes a call of memset of it. */
static void numbers_clear(real *numbers, uint32_t count)
{
    volatile real *place = numbers;
    uint32_t i;
    for (i = 0u; i < count; i++) {
        place[i] = (real)0;
    }
}
#endif
#if LAW_SPACE || TUNED

/* Copies numbers. Through volatile, so that no compiler makes a call of memcpy of it. */
static void numbers_copy(real *numbers, const real *from, uint32_t count)
{
    volatile real *place = numbers;
    uint32_t i;
    for (i = 0u; i < count; i++) {
        place[i] = from[i];
    }
}
#endif
