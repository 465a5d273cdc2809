/* ---- disturbance observer ---- */

static void observer_rest(NAME_state *s)
{
#if LAW_SLIDING
    sliding_rest(s);
#else
    pid_rest(s);
#endif
    s->observer_disturbance = (real)0;
    s->observer_error = (real)0;
    s->observer_feedforward = (real)0;
    s->observer_first = (real)0;
    s->observer_volts = (real)0;
    s->observer_begun = 0u;
    s->observer_starts = 0u;
}

static void observer_start(NAME_state *s, real volts)
{
    observer_rest(s);
    s->observer_first = volts;
    s->observer_volts = volts;
    s->observer_starts = 1u;
}

/* The disturbance that explains the last sample; while the command is clipped it gets no larger in
   the direction that moves the command further beyond the limit. */
static void observer_observe(NAME_state *s, const struct sample *in)
{
    const real needed = -OBSERVER_INVERSE * (in->error - OBSERVER_POLE * s->observer_error);
    const real found = needed - (in->applied - s->observer_feedforward);
    const real step = OBSERVER_FRESH * (found - s->observer_disturbance);
    const real next = s->observer_disturbance + step;
    if (!(((in->excess * step) > (real)0)
          && (magnitude(next) > magnitude(s->observer_disturbance)))) {
        s->observer_disturbance = next;
    }
}

static real observer_step(NAME_state *s, const struct sample *in)
{
    real inside;
    real volts;
    if (s->observer_begun != 0u) {
        observer_observe(s, in);
    }
#if LAW_SLIDING
    inside = sliding_step(s, in);
#else
    inside = pid_step(s, in);
#endif
    if (s->observer_starts != 0u) {
        /* a bumpless start is a disturbance that is forgotten as it is observed */
        s->observer_starts = 0u;
        s->observer_disturbance = inside - s->observer_first;
    }
    volts = inside - s->observer_disturbance;
    if (is_finite(volts)) {
        s->observer_error = in->error;
        s->observer_feedforward = in->feedforward;
        s->observer_begun = 1u;
        s->observer_volts = volts;
    } else {
        /* overflow: hold the output, observe again from the next sample on */
        s->observer_disturbance = (real)0;
        s->observer_begun = 0u;
    }
    return s->observer_volts;
}
