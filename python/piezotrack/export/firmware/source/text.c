#include "text.h"

#include "board.h"

#if REAL_BYTES == 4
typedef uint32_t bits;
#else
typedef uint64_t bits;
#endif

union pattern {
    real number;
    bits bits;
};

#define DIGITS (2u * REAL_BYTES)
/* Decimal exponents that are read; beyond them a number is none. */
#define EXPONENT_MOST 400

static char digit_of(uint32_t number)
{
    return "0123456789abcdef"[number & 15u];
}

void text_put(const char *text)
{
    while (*text != '\0') {
        board_put(*text);
        text++;
    }
}

void text_put_count(uint32_t count)
{
    char digits[10];
    int n = 0;
    do {
        digits[n] = digit_of(count % 10u);
        count /= 10u;
        n++;
    } while (count > 0u);
    while (n > 0) {
        n--;
        board_put(digits[n]);
    }
}

void text_put_bits(real number)
{
    union pattern pattern;
    uint32_t left;
    pattern.number = number;
    board_put('x');
    for (left = DIGITS; left > 0u; left--) {
        board_put(digit_of((uint32_t)(pattern.bits >> (4u * (left - 1u))) & 15u));
    }
}

void text_put_decimal(real number)
{
    uint32_t whole;
    uint32_t place = 100000u;
    int exponent = 0;
    real scaled;
    if (!((number - number) <= (real)0)) {
        text_put("nan");
        return;
    }
    if (number < (real)0) {
        board_put('-');
        number = -number;
    }
    if (number > (real)0) {
        bool far = number >= (real)10;
        while (far) {
            number /= (real)10;
            exponent++;
            far = number >= (real)10;
        }
        far = number < (real)1;
        while (far) {
            number *= (real)10;
            exponent--;
            far = number < (real)1;
        }
    }
    scaled = number * (real)100000 + (real)0.5;
    whole = (uint32_t)scaled;
    if (whole >= 1000000u) {
        whole /= 10u;
        exponent++;
    }
    board_put(digit_of(whole / place));
    board_put('.');
    for (place /= 10u; place > 0u; place /= 10u) {
        board_put(digit_of((whole / place) % 10u));
    }
    board_put('e');
    if (exponent < 0) {
        board_put('-');
        exponent = -exponent;
    }
    text_put_count((uint32_t)exponent);
}

char *text_word(char **line)
{
    char *begin = *line;
    char *end;
    while (*begin == ' ') {
        begin++;
    }
    end = begin;
    while (*end != '\0' && *end != ' ') {
        end++;
    }
    if (*end == ' ') {
        *end = '\0';
        end++;
    }
    *line = end;
    return begin;
}

bool text_same(const char *one, const char *other)
{
    while (*one != '\0' && *one == *other) {
        one++;
        other++;
    }
    return *one == *other;
}

bool text_count(const char *word, uint32_t *count)
{
    uint32_t value = 0;
    if (*word == '\0') {
        return false;
    }
    for (; *word != '\0'; word++) {
        const uint32_t digit = (uint32_t)(unsigned char)*word - (uint32_t)'0';
        if (digit > 9u || value > (UINT32_MAX - digit) / 10u) {
            return false;
        }
        value = 10u * value + digit;
    }
    *count = value;
    return true;
}

/* The value of a hexadecimal digit; 16 where it is none. */
static uint32_t value_of(char digit)
{
    uint32_t value;
    for (value = 0u; value < 16u; value++) {
        const char known = digit_of(value);
        if (known == digit) {
            break;
        }
    }
    return value;
}

static bool hexadecimal(const char *word, real *number)
{
    union pattern pattern;
    uint32_t n;
    pattern.bits = 0u;
    for (n = 0u; word[n] != '\0'; n++) {
        const uint32_t digit = value_of(word[n]);
        if ((digit > 15u) || (n == DIGITS)) {
            return false;
        }
        pattern.bits = (pattern.bits << 4u) | (bits)digit;
    }
    *number = pattern.number;
    return n == DIGITS;
}

bool text_number(const char *word, real *number)
{
    real value = (real)0;
    real sign = (real)1;
    int digits = 0;
    int exponent = 0;
    int power = 0;
    bool below = false;
    bool down = false;
    if (*word == 'x') {
        return hexadecimal(word + 1, number);
    }
    if (*word == '-' || *word == '+') {
        sign = (*word == '-') ? (real)-1 : (real)1;
        word++;
    }
    for (; (*word >= '0' && *word <= '9') || (*word == '.' && !below); word++) {
        if (*word == '.') {
            below = true;
        } else {
            value = (real)10 * value + (real)(*word - '0');
            exponent -= below ? 1 : 0;
            digits++;
        }
    }
    if (digits > 0 && digits < 40 && (*word == 'e' || *word == 'E')) {
        word++;
        if (*word == '-' || *word == '+') {
            down = *word == '-';
            word++;
        }
        if (*word == '\0') {
            return false;
        }
        for (; *word >= '0' && *word <= '9' && power < EXPONENT_MOST; word++) {
            power = 10 * power + (*word - '0');
        }
    }
    if (digits == 0 || digits >= 40 || *word != '\0') {
        return false;
    }
    exponent += down ? -power : power;
    for (; exponent > 0; exponent--) {
        value *= (real)10;
    }
    for (; exponent < 0; exponent++) {
        value /= (real)10;
    }
    if (!((value - value) <= (real)0)) {
        return false;
    }
    *number = sign * value;
    return true;
}
