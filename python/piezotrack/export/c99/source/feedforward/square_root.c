/* ---- square root ---- */

#if SINGLE
typedef uint32_t pattern; /* as many bits as a number */
#define STORED 23u /* bits of the mantissa that are stored */
#define BIAS 127 /* of the exponent */
#else
typedef uint64_t pattern; /* as many bits as a number */
#define STORED 52u /* bits of the mantissa that are stored */
#define BIAS 1023 /* of the exponent */
#endif

/* The square root, rounded correctly: its binary digits one after the other. */
static real square_root(real x)
{
    union { real value; pattern bits; } number;
    const pattern one = 1u;
    pattern field;
    pattern mantissa;
    pattern root = 0u;
    pattern left = 0u;
    int32_t exponent;
    uint32_t i;
    if (!(x > (real)0) || !is_finite(x)) {
        return (x < (real)0) ? ((real)0 / (x - x)) : x;
    }
    number.value = x;
    field = number.bits >> STORED;
    exponent = (int32_t)field;
    mantissa = number.bits & ((one << STORED) - one);
    if (exponent == 0) {
        exponent = 1;
        while ((mantissa >> STORED) == 0u) {
            mantissa <<= 1u;
            exponent -= 1;
        }
    }
    mantissa |= one << STORED;
    exponent -= BIAS;
    if ((exponent % 2) != 0) {
        mantissa <<= 1u;
        exponent -= 1;
    }
    for (i = 0u; i < (STORED + 2u); i++) {
        const uint32_t taken = 2u * i;
        pattern pair = 0u;
        pattern next;
        if (taken <= STORED) {
            const uint32_t shift = STORED - taken;
            pair = (mantissa >> shift) & 3u;
        } else if (taken == (STORED + 1u)) {
            pair = (mantissa << 1u) & 3u;
        } else {
            /* there are no more digits */
        }
        left = (left << 2u) | pair;
        next = 2u * root;
        root = next;
        if (left >= ((2u * next) + one)) {
            left -= (2u * next) + one;
            root = next + one;
        }
    }
    root = (root >> 1u) + (root & one);
    exponent = (exponent / 2) + BIAS;
    field = (pattern)exponent;
    number.bits = (field << STORED) + (root - (one << STORED));
    return number.value;
}
