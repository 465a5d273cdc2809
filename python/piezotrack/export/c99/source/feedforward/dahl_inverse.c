/* ---- feedforward: inverse of a Dahl stage, sample by sample ---- */

/* Moves the operator by one piece of a way. */
static void inverse_along(NAME_inverse *at, real direction, real distance)
{
    const struct dahl numbers = {INVERSE_A1, INVERSE_A2, INVERSE_GAIN, 4u};
    dahl_along(&numbers, &at->force, &at->slope, direction, distance);
}

/* The operator after a monotone way; false where that is too long. */
static bool inverse_travel(NAME_inverse *at, real distance)
{
    const real direction = (distance < (real)0) ? (real)-1 : (real)1;
    real left = magnitude(distance);
    uint32_t i;
    if (!(left > INVERSE_PIECE)) {
        inverse_along(at, direction, distance);
        return true;
    }
    if (left > INVERSE_LONGEST) {
        return false;
    }
    for (i = 0u; i < INVERSE_MOST_PIECES; i++) {
        if (!(left > INVERSE_PIECE)) {
            break;
        }
        inverse_along(at, direction, direction * INVERSE_PIECE);
        left -= INVERSE_PIECE;
    }
    inverse_along(at, direction, direction * left);
    return true;
}

/* Whether the cubic with these end velocities rises without a turn. */
static bool is_straight(real w0, real rise, real w1)
{
    const real steepest = (real)3 * magnitude(rise);
    return ((w0 * rise) >= (real)0) && ((w1 * rise) >= (real)0) && (magnitude(w0) <= steepest)
        && (magnitude(w1) <= steepest);
}

/* Along the cubic that turns, from turning point to turning point. */
static bool inverse_travel_turning(NAME_inverse *at, real w0, real rise, real w1)
{
    const real c3 = w0 + w1 - (real)2 * rise;
    const real c2 = rise - w0 - c3;
    const real root = square_root(c2 * c2 - (real)3 * c3 * w0);
    const real q = -(c2 + ((c2 < (real)0) ? -root : root));
    const real a = q / ((real)3 * c3);
    const real b = w0 / q;
    real turn[2];
    real here = (real)0;
    uint32_t i;
    turn[0] = (a < b) ? a : b;
    turn[1] = (a < b) ? b : a;
    for (i = 0u; i < 2u; i++) {
        real leg = (real)0;
        if ((turn[i] > (real)0) && (turn[i] < (real)1)) {
            const real there = turn[i] * (w0 + turn[i] * (c2 + turn[i] * c3));
            leg = there - here;
            here = there;
        }
        if (!inverse_travel(at, leg)) {
            return false;
        }
    }
    return inverse_travel(at, rise - here);
}

/* The drive for displacement, velocity and acceleration; NaN, and nothing changed, without it. */
static real inverse_step(NAME_inverse *state, real x, real v, real a)
{
    NAME_inverse at = *state;
    const real rise = x - at.x;
    const real w = v * REFERENCE_DT;
    real volts;
    real sign;
    bool found;
    if (!(is_usable(x) && is_usable(v) && is_usable(a))) {
        return not_a_number();
    }
    if ((at.begun != 0u) && !is_straight(at.w, rise, w)) {
        found = inverse_travel_turning(&at, at.w, rise, w);
    } else {
        found = inverse_travel(&at, rise);
    }
    if (!found) {
        return not_a_number();
    }
    sign = (v > (real)0) ? (real)1 : ((v < (real)0) ? (real)-1 : (real)0);
    volts = (INVERSE_INERTIA * a + INVERSE_DAMPING * v + INVERSE_STIFFNESS * x)
        + (INVERSE_LEVEL * at.force + sign * INVERSE_FRICTION * at.slope);
    if (!is_finite(volts)) {
        return not_a_number();
    }
    at.x = x;
    at.w = w;
    at.begun = 1u;
    *state = at;
    return volts;
}

/* What the inverse gives where the stage went another way than the reference, by `way`, less the
   drive that the stage got. */
static real inverse_excess(const NAME_state *s, real way, real volts, NAME_inverse *after)
{
    const real faster = way / REFERENCE_DT;
    *after = s->before;
    return inverse_step(after, s->target[0] + s->off_before[0] + way, s->target[1] + faster,
                        s->target[2] + (faster - s->off_before[1]) / REFERENCE_DT) - volts;
}

/* Remembers the drive that the stage got in place of the last one: finds the way for which the
   inverse gives it, by false position with the weights of the Illinois rule (Dowell and Jarratt
   1971), from beyond the step of Newton's method. The inverse is evaluated 42 times at most, some 8
   times mostly. */
static void inverse_remember(NAME_state *s, real volts)
{
    NAME_inverse after;
    NAME_inverse kept;
    real outside = (real)0;
    real inside = (real)0;
    real far;
    real near;
    real way;
    real same;
    bool above;
    bool found = false;
    bool was_outside = false;
    bool was_inside = false;
    uint32_t i;
    if (s->has_target == 0u) {
        return;
    }
    far = inverse_excess(s, (real)0, volts, &kept);
    near = far;
    same = DRIVE_SAME * (magnitude(far + volts) + magnitude(volts));
    above = far > (real)0;
    way = -far * INVERSE_PROBE / (inverse_excess(s, INVERSE_PROBE, volts, &after) - far);
    way = ((magnitude(way) > (real)0) && is_finite(way)) ? ((real)1.25 * way) : INVERSE_PROBE;
    for (i = 0u; (i < 16u) && !found; i++) {
        /* to one side, then to the other, then four times as far */
        const bool onward = (i % 2u) == 0u;
        const real place = onward ? way : -way;
        const real excess = inverse_excess(s, place, volts, &after);
        if (is_finite(excess) && ((excess > (real)0) != above)) {
            inside = place;
            near = excess;
            kept = after;
            found = true;
        }
        if (!onward) {
            way *= (real)4;
        }
    }
    if (!found) {
        return;
    }
    found = magnitude(near) <= same;
    for (i = 0u; (i < 24u) && !found; i++) {
        const real crossing = outside - far * (inside - outside) / (near - far);
        const bool lies = ((crossing > outside) && (crossing < inside))
            || ((crossing < outside) && (crossing > inside));
        const real place = lies ? crossing : ((real)0.5 * (outside + inside));
        const real excess = inverse_excess(s, place, volts, &after);
        const bool beyond = ((excess > (real)0) == above) || !is_a_number(excess);
        if (magnitude(excess) <= same) {
            inside = place;
            kept = after;
            found = true;
        } else if (beyond) {
            outside = place;
            far = excess;
            if (was_outside) {
                near *= (real)0.5;
            }
        } else {
            inside = place;
            near = excess;
            kept = after;
            if (was_inside) {
                far *= (real)0.5;
            }
        }
        was_outside = beyond;
        was_inside = !beyond;
    }
    s->inverse = kept;
    s->off[0] = s->off_before[0] + inside;
    s->off[1] = inside / REFERENCE_DT;
}

static void inverse_rest(NAME_state *s)
{
    s->inverse.x = (real)0;
    s->inverse.w = (real)0;
    s->inverse.force = (real)0;
    s->inverse.slope = (real)0;
    s->inverse.begun = 0u;
    s->before = s->inverse;
    s->target[0] = (real)0;
    s->target[1] = (real)0;
    s->target[2] = (real)0;
    s->off[0] = (real)0;
    s->off[1] = (real)0;
    s->off_before[0] = (real)0;
    s->off_before[1] = (real)0;
    s->past[0] = (real)0;
    s->past[1] = (real)0;
    s->has_target = 0u;
    s->has_past = 0u;
}

/* The feedforward for the next sample of the reference, which is `next` one sample later: central
   differences, or backward ones where `next` is not a number. */
static real online_step(NAME_state *s, real reference, real next)
{
    const bool known = s->has_past != 0u;
    const real first = known ? s->past[0] : reference;
    const real before = known ? s->past[1] : reference;
    const bool ahead = is_a_number(next);
    const real v = ahead ? ((real)0.5 * (next - before) / REFERENCE_DT)
                         : ((reference - before) / REFERENCE_DT);
    const real a = ahead ? ((next - (real)2 * reference + before) / REFERENCE_DT_SQUARED)
                         : ((reference - (real)2 * before + first) / REFERENCE_DT_SQUARED);
    real drive;
    s->before = s->inverse;
    s->off_before[0] = s->off[0];
    s->off_before[1] = s->off[1];
    s->off[0] = (real)0;
    s->off[1] = (real)0;
#if DELAYED
    s->target[0] = reference + REFERENCE_DELAY * (v + REFERENCE_HALF_DELAY * a) - REFERENCE_OFFSET;
    s->target[1] = v + REFERENCE_DELAY * a;
#else
    s->target[0] = reference - REFERENCE_OFFSET;
    s->target[1] = v;
#endif
    s->target[2] = a;
    s->has_target =
        (is_finite(s->target[0]) && is_finite(s->target[1]) && is_finite(a)) ? 1u : 0u;
    drive = inverse_step(&s->inverse, s->target[0], s->target[1], a);
    if (is_finite(reference)) {
        s->past[0] = before;
        s->past[1] = reference;
        s->has_past = 1u;
    } else if (known) {
        s->past[0] = before;
        s->past[1] = (real)2 * before - first;
    } else {
        /* there was no reference yet */
    }
    if ((drive < LIMITS_LOW) || (drive > LIMITS_HIGH)) {
        inverse_remember(s, clip(drive));
    }
    return drive;
}
