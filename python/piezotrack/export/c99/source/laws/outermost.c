/* ---- the law that the loop calls ---- */

static void feedback_rest(NAME_state *s)
{
#if LAW_SPACE
    law_rest(s);
#elif LAW_DISTURBANCE || LAW_DAHL
    observer_rest(s);
#elif LAW_DAMPED
    damping_rest(s);
#elif LAW_SLIDING
    sliding_rest(s);
#else
    pid_rest(s);
#endif
}

static void feedback_start(NAME_state *s, real volts)
{
#if LAW_SPACE
    law_start(s, volts);
#elif LAW_DISTURBANCE || LAW_DAHL
    observer_start(s, volts);
#elif LAW_DAMPED
    damping_start(s, volts);
#elif LAW_SLIDING
    sliding_start(s, volts);
#else
    pid_start(s, volts);
#endif
}

static real feedback_step(NAME_state *s, const struct sample *in)
{
#if LAW_SPACE
    return law_step(s, in);
#elif LAW_DISTURBANCE || LAW_DAHL
    return observer_step(s, in);
#elif LAW_DAMPED
    return damping_step(s, in);
#elif LAW_SLIDING
    return sliding_step(s, in);
#else
    return pid_step(s, in);
#endif
}
