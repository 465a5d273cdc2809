/* ---- the feedback law ---- */

/* What the feedback law is told of a sample. */
struct sample {
    real error; /* reference less filtered measurement, m */
    real excess; /* command applied in the sample before less its unclipped command */
#if TOLD_MEASURED
    real measured; /* filtered measurement, m */
#endif
#if TOLD_APPLIED
    real applied; /* command at the actuator since the sample before */
#endif
#if TOLD_FEEDFORWARD
    real feedforward; /* the other parts of this command */
#endif
};
