/* ---- the controller ---- */

/* The command at the actuator: the last one, or what was reported. */
static real voltage(const NAME_state *s)
{
    return (s->stepped != 0u) ? (s->last.unclipped + s->excess) : s->last.volts;
}

NAME_real NAME_step(
#if FORWARD_ONLINE
    NAME_state *s, NAME_real reference, NAME_real next, NAME_real measured)
#elif FORWARD_TABLE
    NAME_state *s, NAME_real reference, NAME_real measured)
#else
    NAME_state *s, NAME_real reference, NAME_real measured, NAME_real feedforward)
#endif
{
#if FORWARD_ONLINE
    const real feedforward = online_step(s, reference, next);
#elif FORWARD_TABLE
    const real feedforward = table_step(s);
#endif
    const bool measurement_ok = readings_accept(s, measured);
    const bool reference_fits = (reference >= REFERENCE_LOW) && (reference <= REFERENCE_HIGH);
#if TOLD_APPLIED
    const real applied = voltage(s);
#endif
#if PAUSES
    real learns = s->excess;
#endif
#if REPEATS
    real repetitive;
#endif
#if LAW_ANY
    bool begins = false;
#endif
    real used = feedforward;
    real feedback = s->last.feedback;
    real error = s->last.error;
    real unclipped;
    real volts;
    bool feedforward_ok = true;
    if (!is_usable(used)) {
        feedforward_ok = false;
        used = s->last.feedforward;
    } else if (used < FAR_LOW) {
        used = FAR_LOW;
    } else if (used > FAR_HIGH) {
        used = FAR_HIGH;
    } else {
        /* it is used as it is */
    }
    if (s->apart != 0u) {
        /* the first sample after a start or a report */
#if PAUSES
        if ((s->reported != 0u) && (magnitude(s->excess) <= APPLIED_NEAR)) {
            learns = (real)0;
        }
#endif
        s->stepped = 1u;
        s->reported = 0u;
        s->apart = 0u;
#if LAW_ANY
        begins = s->has_present != 0u;
        s->has_present = 0u;
#else
        s->has_present = 0u; /* without feedback nothing can hold it */
#endif
    }
#if PAUSES
    repetitive = repetitive_step(s, s->unlearnt, learns);
#elif REPEATS
    repetitive = repetitive_step(s, s->unlearnt);
#endif
#if LAW_ANY
    if (begins) {
#if REPEATS
        feedback = s->present - used - repetitive;
#else
        feedback = s->present - used;
#endif
        feedback_start(s, feedback);
        s->excess = (real)0;
    }
#endif
#if REPEATS
    s->unlearnt = (real)0;
#endif
    if (measurement_ok && reference_fits) {
#if FILTERED
        const real filtered = filters_step(s, measured);
#else
        const real filtered = measured;
#endif
#if LAW_ANY
        struct sample in;
#endif
        error = reference - filtered;
#if LAW_ANY
        in.error = error;
        in.excess = s->excess;
#if TOLD_MEASURED
        in.measured = filtered;
#endif
#if TOLD_APPLIED
        in.applied = applied;
#endif
#if TOLD_FEEDFORWARD && REPEATS
        in.feedforward = used + repetitive;
#elif TOLD_FEEDFORWARD
        in.feedforward = used;
#endif
        volts = feedback_step(s, &in);
        feedback = is_finite(volts) ? volts : feedback;
#endif
#if REPEATS
        s->unlearnt = error;
#endif
    }
#if REPEATS
    unclipped = feedback + used + repetitive;
#else
    unclipped = feedback + used;
#endif
    if (!is_finite(unclipped)) {
        unclipped = s->last.volts; /* the sum overflowed */
    }
    volts = clip(unclipped);
    s->excess = volts - unclipped;
    s->last.volts = volts;
    s->last.unclipped = unclipped;
    s->last.feedforward = used;
    s->last.feedback = feedback;
#if REPEATS
    s->last.repetitive = repetitive;
#else
    s->last.repetitive = (real)0;
#endif
    s->last.error = error;
    s->last.saturated = ((s->excess < (real)0) || (s->excess > (real)0)) ? 1u : 0u;
    s->last.measurement_ok = measurement_ok ? 1u : 0u;
    s->last.reference_ok = (reference_fits && feedforward_ok) ? 1u : 0u;
    return volts;
}

#if FORWARD_ONLINE
/* How much of the feedforward reached the stage: that is what the inverse remembers. */
static void remember_reached(NAME_state *s)
{
    const real asked = s->last.feedforward;
    real there = s->last.volts;
    real reached = clip(asked);
    if (s->reported != 0u) {
        /* of a huge command the excess has lost the voltage to rounding */
        there = voltage(s);
        there = (there < FAR_LOW) ? FAR_LOW : there;
        there = (there > FAR_HIGH) ? FAR_HIGH : there;
    }
    if (s->excess < -APPLIED_NEAR) {
        reached = (reached < there) ? reached : there;
    } else if (s->excess > APPLIED_NEAR) {
        reached = (reached > there) ? reached : there;
    } else {
        /* the report is the command */
    }
    if ((reached < asked) || (reached > asked)) {
        inverse_remember(s, reached);
    }
}

#endif
int NAME_applied(NAME_state *s, NAME_real volts)
{
    if (!is_finite(volts)) {
        return 0;
    }
    if ((s->stepped != 0u) && (volts >= FAR_LOW) && (volts <= FAR_HIGH)) {
        s->excess = volts - s->last.unclipped;
        s->reported = 1u;
        s->apart = 1u;
    }
#if FORWARD_ONLINE
    remember_reached(s);
#endif
    return 1;
}

static void rest(NAME_state *s, real volts)
{
    s->last.volts = volts;
    s->last.unclipped = (real)0;
    s->last.feedforward = (real)0;
    s->last.feedback = (real)0;
    s->last.repetitive = (real)0;
    s->last.error = (real)0;
    s->last.saturated = 0u;
    s->last.measurement_ok = 0u;
    s->last.reference_ok = 0u;
    s->excess = (real)0;
    s->stepped = 0u;
    s->reported = 0u;
    s->apart = 1u;
    readings_rest(s);
#if LAW_ANY
    feedback_rest(s);
#endif
#if REPEATS
    repetitive_rest(s);
    s->unlearnt = (real)0;
#endif
#if FILTERED
    filters_rest(s);
#endif
#if FORWARD_ONLINE
    inverse_rest(s);
#endif
}

void NAME_init(NAME_state *s)
{
#if TUNED
    NAME_settings_default(&s->settings);
#endif
    rest(s, clip((real)0));
    s->present = (real)0;
    s->has_present = 0u;
#if FORWARD_TABLE
    s->place = 0u;
#endif
}

int NAME_start(NAME_state *s, NAME_real present)
{
    if (!((present >= LIMITS_LOW) && (present <= LIMITS_HIGH))) {
        return 0;
    }
    NAME_init(s);
    s->last.volts = present;
    s->present = present;
    s->has_present = 1u;
    return 1;
}

void NAME_reset(NAME_state *s)
{
    const real present = clip(voltage(s));
    if (s->stepped != 0u) {
        s->present = present;
        s->has_present = 1u;
    }
    rest(s, present);
}
