/* ---- feedforward from a table of one period ---- */

static real table_step(NAME_state *s)
{
    const uint32_t place = (s->place < TABLE_SAMPLES) ? s->place : 0u;
    s->place = ((place + 1u) < TABLE_SAMPLES) ? (place + 1u) : 0u;
    return TABLE[place];
}
