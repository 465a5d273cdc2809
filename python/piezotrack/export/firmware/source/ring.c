#include "ring.h"

static struct ring_sample samples[RING_SAMPLES];
static volatile uint32_t recorded;
static volatile uint32_t wanted;
static volatile uint8_t recording;

void ring_begin(uint32_t count)
{
    recorded = 0;
    wanted = count;
    recording = 1;
}

void ring_end(void)
{
    recording = 0;
}

void ring_add(const struct ring_sample *sample)
{
    if (recording != 0u) {
        samples[recorded % RING_SAMPLES] = *sample;
        recorded++;
        if ((recorded == wanted) || (recorded == UINT32_MAX)) {
            recording = 0;
        }
    }
}

uint32_t ring_count(void)
{
    return recorded;
}

bool ring_get(uint32_t number, struct ring_sample *sample)
{
    const uint32_t there = recorded;
    if ((number >= there) || ((there - number) > RING_SAMPLES)) {
        return false;
    }
    *sample = samples[number % RING_SAMPLES];
    return true;
}
