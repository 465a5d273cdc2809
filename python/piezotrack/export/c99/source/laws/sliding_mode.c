/* ---- sliding mode control with a boundary layer ---- */

static void sliding_start(NAME_state *s, real volts)
{
    s->sliding_integral = (real)0;
    s->sliding_change = (real)0;
    s->sliding_error = (real)0;
    s->sliding_base = volts;
    s->sliding_volts = volts;
    s->sliding_begun = 0u;
    s->sliding_starts = 1u;
}

static void sliding_rest(NAME_state *s)
{
    sliding_start(s, (real)0);
    s->sliding_starts = 0u;
}

/* The first output is the one to begin with: as much of it as can be is integral. */
static void sliding_begin(NAME_state *s, real error)
{
    if (SLIDING_INTEGRAL > (real)0) {
        const real inside = within(s->sliding_base, SLIDING_SWITCHING);
        s->sliding_integral = inside / SLIDING_GAIN - error * ((real)1 + SLIDING_INTEGRAL);
        s->sliding_base -= inside;
    } else {
        s->sliding_base -= within(SLIDING_GAIN * error, SLIDING_SWITCHING);
    }
}

static real sliding_step(NAME_state *s, const struct sample *in)
{
    const real error = in->error;
    const bool begun = s->sliding_begun != 0u;
    const real old = begun ? s->sliding_error : error;
    real change;
    real step;
    real integral;
    real surface;
    real asked;
    real volts;
    if (!begun && (s->sliding_starts != 0u)) {
        sliding_begin(s, error);
    }
    s->sliding_starts = 0u;
    change = s->sliding_change + SLIDING_FRESH * (error - old - s->sliding_change);
    step = SLIDING_INTEGRAL * error;
    integral = s->sliding_integral + step;
    surface = error + SLIDING_DERIVATIVE * change + integral;
    if (!is_finite(surface)) {
        s->sliding_begun = 0u;
        s->sliding_change = (real)0;
        return s->sliding_volts;
    }
    asked = SLIDING_GAIN * surface;
    volts = within(asked, SLIDING_SWITCHING);
    /* beyond the layer or the limits, the integral does not go further out */
    if (!((((volts - asked) * step) < (real)0) || ((in->excess * step) < (real)0))) {
        s->sliding_integral = integral;
    }
    s->sliding_change = change;
    s->sliding_error = error;
    s->sliding_begun = 1u;
    s->sliding_volts = volts + s->sliding_base;
    return s->sliding_volts;
}
