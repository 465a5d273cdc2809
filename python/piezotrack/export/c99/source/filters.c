/* ---- filters of the measurement, one after the other ---- */

/* The filtered measurement; each filter begins in the steady state of the first one. */
static real filters_step(NAME_state *s, real measured)
{
    real value = measured;
    uint32_t i;
    for (i = 0u; i < FILTER_COUNT; i++) {
        const real *c = &FILTERS[5u * i];
        real *memory = &s->filter_memory[2u * i];
        const real in = value;
        if (s->filter_begun[i] != 0u) {
            value = c[0] * in + memory[0];
            memory[0] = c[1] * in - c[3] * value + memory[1];
            memory[1] = c[2] * in - c[4] * value;
        } else {
            memory[0] = in - c[0] * in;
            memory[1] = (c[2] - c[4]) * in;
        }
        s->filter_begun[i] = 1u;
    }
    return value;
}

static void filters_rest(NAME_state *s)
{
    uint32_t i;
    for (i = 0u; i < FILTER_COUNT; i++) {
        s->filter_begun[i] = 0u;
    }
}
