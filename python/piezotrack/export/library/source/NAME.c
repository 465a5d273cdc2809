/*
@facts
 */
#include <math.h>

#include "NAME.h"

#include "settings.h"

int NAME_init(NAME_state *s)
{
    s->controller = piezotrack_new(&settings, NULL, 0);
    s->place = 0;
    s->last = piezotrack_last(s->controller);
    return s->controller != NULL;
}

int NAME_start(NAME_state *s, NAME_real present)
{
    if (!NAME_init(s)) {
        return 0;
    }
    if (!piezotrack_start(s->controller, present)) {
        NAME_free(s);
        return 0;
    }
    s->last = piezotrack_last(s->controller);
    return 1;
}

#if FORWARD_ONLINE
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real next, NAME_real measured)
{
    const double volts = piezotrack_step(s->controller, reference, next, measured);
    s->last = piezotrack_last(s->controller);
    return volts;
}
#elif FORWARD_TABLE
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real measured)
{
    const double feedforward = table[s->place];
    const double volts = piezotrack_step_given(s->controller, reference, measured, feedforward);
    s->place = (s->place + 1) % (sizeof table / sizeof table[0]);
    s->last = piezotrack_last(s->controller);
    return volts;
}
#else
NAME_real NAME_step(
    NAME_state *s, NAME_real reference, NAME_real measured, NAME_real feedforward)
{
    const double volts = piezotrack_step_given(s->controller, reference, measured, feedforward);
    s->last = piezotrack_last(s->controller);
    return volts;
}
#endif

int NAME_applied(NAME_state *s, NAME_real volts)
{
    return piezotrack_applied(s->controller, volts);
}

void NAME_reset(NAME_state *s)
{
    piezotrack_reset(s->controller);
    s->last = piezotrack_last(s->controller);
}

void NAME_free(NAME_state *s)
{
    piezotrack_free(s->controller);
    s->controller = NULL;
}
