/* ---- observer of a Dahl hysteresis ---- */

static void hysteresis_rest(NAME_state *s)
{
    s->hysteresis_force = (real)0;
    s->hysteresis_slope = (real)0;
    s->observer_displacement = (real)0;
    s->observer_place = (real)0;
    s->observer_begun = 0u;
}

static void observer_rest(NAME_state *s)
{
    pid_rest(s);
    hysteresis_rest(s);
    s->observer_first = (real)0;
    s->observer_volts = (real)0;
    s->observer_starts = 0u;
}

static void observer_start(NAME_state *s, real volts)
{
    observer_rest(s);
    s->observer_first = volts;
    s->observer_volts = volts;
    s->observer_starts = 1u;
}

/* Moves the operator to a place on its path, in 16 pieces at most. */
static void observer_follow(NAME_state *s, real place)
{
    const struct dahl numbers = {HYSTERESIS_A1, HYSTERESIS_A2, HYSTERESIS_GAIN, 6u};
    const real way = place - s->observer_place;
    const real direction = (way < (real)0) ? (real)-1 : (real)1;
    real left = magnitude(way);
    uint32_t i;
    for (i = 0u; i < 16u; i++) {
        if (left > (real)0) {
            const real piece = (left < OBSERVER_PIECE) ? left : OBSERVER_PIECE;
            dahl_along(&numbers, &s->hysteresis_force, &s->hysteresis_slope, direction,
                       direction * piece);
            left -= piece;
        }
    }
    s->observer_place = place;
}

/* Corrects displacement and hysteresis by the measurement. */
static void observer_observe(NAME_state *s, const struct sample *in)
{
    real before;
    real kept;
    real ahead;
    if (s->observer_begun == 0u) {
        s->observer_begun = 1u;
        s->observer_displacement = in->measured;
        observer_follow(s, in->measured);
        return;
    }
    before = s->hysteresis_force;
    kept = OBSERVER_POLE * s->observer_displacement;
    ahead = kept + OBSERVER_FRESH * (in->applied - before);
    s->observer_displacement = ahead + OBSERVER_CORRECTION * (in->measured - ahead);
    observer_follow(s, s->observer_displacement);
    s->hysteresis_force += OBSERVER_CORRECTION
        * (in->applied - s->hysteresis_force - (in->measured - kept) / OBSERVER_FRESH);
}

static real observer_step(NAME_state *s, const struct sample *in)
{
    real volts;
    observer_observe(s, in);
    if (s->observer_starts != 0u) {
        s->observer_starts = 0u;
        pid_start(s, s->observer_first - s->hysteresis_force);
    }
    volts = pid_step(s, in) + s->hysteresis_force;
    if (is_finite(volts)) {
        s->observer_volts = volts;
    } else {
        hysteresis_rest(s); /* overflow: hold the output, and observe again */
    }
    return s->observer_volts;
}
