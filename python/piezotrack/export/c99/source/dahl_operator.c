/* ---- the hysteresis of Dahl ---- */

struct dahl {
    real a1; /* 1/m */
    real a2; /* 1/m^2 */
    real gain; /* curvature of the branch from rest */
    uint32_t terms; /* of the power series */
};

/* Force and slope of the hysteresis after a monotone way: a power series in the distance. */
static void dahl_along(
    const struct dahl *numbers, real *force, real *slope, real direction, real distance)
{
    const uint32_t terms = numbers->terms;
    const real decay = -(direction * numbers->a1);
    const real spring = -numbers->a2;
    real d[DAHL_TERMS]; /* derivatives of the force along the path */
    real f;
    real g;
    uint32_t k;
    d[0] = *slope;
    d[1] = spring * *force + (decay * *slope + numbers->gain);
    for (k = 2u; k < terms; k++) {
        d[k] = spring * d[k - 2u] + decay * d[k - 1u];
    }
    f = d[terms - 1u];
    g = d[terms - 1u];
    for (k = terms - 1u; k >= 1u; k--) {
        f = distance * DAHL_RECIPROCAL[k + 1u] * f + d[k - 1u];
        if (k > 1u) {
            g = distance * DAHL_RECIPROCAL[k] * g + d[k - 1u];
        }
    }
    *force = distance * f + *force;
    *slope = distance * g + d[0];
}
