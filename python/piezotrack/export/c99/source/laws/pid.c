/* ---- incremental PID with back-calculation antiwindup ---- */

static void pid_start(NAME_state *s, real volts)
{
    s->pid_volts = volts;
    s->pid_e1 = (real)0;
    s->pid_e2 = (real)0;
    s->pid_begun = 0u;
}

static void pid_rest(NAME_state *s)
{
    pid_start(s, (real)0);
}

static real pid_step(NAME_state *s, const struct sample *in)
{
    const real error = in->error;
    const bool begun = s->pid_begun != 0u;
    /* the first error stands for the earlier ones too: no derivative kick */
    const real e1 = begun ? s->pid_e1 : error;
    const real e2 = begun ? s->pid_e2 : error;
    const real rise = error - e1;
    const real bend = rise - (e1 - e2);
    const real change = PID_PROPORTIONAL * rise + PID_INTEGRAL * error + PID_DERIVATIVE * bend
        + PID_TRACKING * in->excess;
    real volts;
    if (!begun && !(magnitude(PID_INTEGRAL) > (real)0) && !(magnitude(s->pid_volts) > (real)0)) {
        /* nothing would ever make up for what the first error asks for */
        s->pid_volts = PID_PROPORTIONAL * error;
    }
    volts = s->pid_volts + change;
    if (is_finite(volts)) {
        s->pid_volts = volts;
        s->pid_e1 = error;
        s->pid_e2 = e1;
        s->pid_begun = 1u;
    } else {
        /* overflow: hold the output, start again from the next error */
        s->pid_begun = 0u;
    }
    return s->pid_volts;
}
