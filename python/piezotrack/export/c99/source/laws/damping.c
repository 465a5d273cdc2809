/* ---- damping by a filter of the measurement ---- */

static void damping_forget(NAME_state *s)
{
    s->damping_s1 = (real)0;
    s->damping_s2 = (real)0;
#if !FOLLOWS
    s->damping_origin = (real)0;
    s->damping_begun = 0u;
#endif
}

static void damping_start(NAME_state *s, real volts)
{
    pid_start(s, volts);
    damping_forget(s);
    s->damping_volts = volts;
}

static void damping_rest(NAME_state *s)
{
    pid_rest(s);
    damping_forget(s);
    s->damping_volts = (real)0;
}

static real damping_step(NAME_state *s, const struct sample *in)
{
    real place;
    real damping;
    real volts;
#if FOLLOWS
    place = -in->error; /* of the stage that the inverse makes follow */
#else
    if (s->damping_begun == 0u) {
        s->damping_origin = in->measured;
        s->damping_begun = 1u;
    }
    place = in->measured - s->damping_origin;
#endif
    damping = DAMPING_B0 * place + s->damping_s1;
    s->damping_s1 = DAMPING_B1 * place - DAMPING_A1 * damping + s->damping_s2;
    s->damping_s2 = DAMPING_B2 * place - DAMPING_A2 * damping;
    volts = pid_step(s, in) + damping;
    if (is_finite(volts)) {
        s->damping_volts = volts;
    } else {
        /* overflow: hold the output, count from the next reading */
        damping_forget(s);
    }
    return s->damping_volts;
}
