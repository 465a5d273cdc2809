/* ---- settings: the numbers above, changed while the controller runs ---- */

/* CRC-32 (IEEE 802.3, as of zlib) of some bytes, from that of the bytes before. */
static uint32_t settings_crc(uint32_t before, const unsigned char *bytes, uint32_t count)
{
    uint32_t crc = ~before;
    uint32_t i;
    uint32_t k;
    for (i = 0u; i < count; i++) {
        crc ^= bytes[i];
        for (k = 0u; k < 8u; k++) {
            crc = (crc >> 1u) ^ (((crc & 1u) != 0u) ? 0xEDB88320u : 0u);
        }
    }
    return ~crc;
}

/* That of version, layout and numbers, byte by byte as they are in memory. */
static uint32_t settings_checksum(const NAME_settings *settings)
{
    const uint32_t word = (uint32_t)sizeof(uint32_t);
    uint32_t crc = settings_crc(0u, (const unsigned char *)&settings->version, word);
    crc = settings_crc(crc, (const unsigned char *)&settings->layout, word);
    return settings_crc(
        crc, (const unsigned char *)settings->value, (uint32_t)sizeof(settings->value));
}

void NAME_settings_seal(NAME_settings *settings)
{
    settings->version = SETTINGS_VERSION;
    settings->layout = SETTINGS_LAYOUT;
    settings->checksum = settings_checksum(settings);
}

void NAME_settings_default(NAME_settings *settings)
{
    numbers_copy(settings->value, SETTINGS_DEFAULT, (uint32_t)NAME_SETTINGS);
    NAME_settings_seal(settings);
}

/* Whether they are of this controller, whole, and every number is within its range. */
static bool settings_fit(const NAME_settings *settings)
{
    uint32_t i;
    if ((settings->version != SETTINGS_VERSION) || (settings->layout != SETTINGS_LAYOUT)
        || (settings->checksum != settings_checksum(settings))) {
        return false;
    }
    for (i = 0u; i < (uint32_t)NAME_SETTINGS; i++) {
        const real value = settings->value[i];
        /* false for NaN */
        if (!((value >= NAME_setting_list[i].low) && (value <= NAME_setting_list[i].high))) {
            return false;
        }
    }
    return true;
}

#if LAW_ANY || FILTERED
/* Whether some of the numbers are other ones. */
static bool settings_differ(const real *now, const real *next, uint32_t count)
{
    uint32_t i;
    for (i = 0u; i < count; i++) {
        if ((next[i] < now[i]) || (next[i] > now[i])) {
            return true;
        }
    }
    return false;
}

#endif
int NAME_retune(NAME_state *s, const NAME_settings *settings)
{
#if LAW_ANY || FILTERED
    const real *now = s->settings.value;
#endif
    const real *next = settings->value;
#if FILTERED
    uint32_t i;
#endif
    bool anew;
    if (!settings_fit(settings)) {
        return 0;
    }
#if LAW_ANY
    /* all but the gains of a PID, whose state is right for other gains too */
    anew = settings_differ(now, next, SETTINGS_KEPT)
        || settings_differ(&now[SETTINGS_KEPT_END], &next[SETTINGS_KEPT_END],
                           (uint32_t)NAME_SETTINGS - SETTINGS_KEPT_END);
#else
    anew = true;
#endif
#if FILTERED
    for (i = 0u; i < FILTER_COUNT; i++) {
        const uint32_t first = SETTINGS_FILTERS + 5u * i;
        if (settings_differ(&now[first], &next[first], 5u)) {
            s->filter_begun[i] = 0u;
        }
    }
#endif
    if ((s->stepped != 0u) && anew) {
        /* the law starts anew from the command that is there */
        s->present = clip(voltage(s));
        s->has_present = 1u;
        s->apart = 1u;
    }
    numbers_copy(s->settings.value, next, (uint32_t)NAME_SETTINGS);
    s->settings.checksum = settings->checksum;
    return 1;
}
