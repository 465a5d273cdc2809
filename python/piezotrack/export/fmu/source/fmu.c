/*
 * FMI 2.0 for co-simulation around NAME_step. A communication step is one sampling interval, or a
 * whole number of them, in which the inputs are held; the outputs are those of its last sample.
 * The declarations are those that the standard gives, of the functions that it asks for.
 */
#include <stddef.h>
#include <string.h>

#include "NAME.h"

#include "unit.h"

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif


typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef char fmi2Byte;
typedef const fmi2Char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef int fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
    NAME_state state;
    double in[UNIT_INPUTS]; /* by value reference */
    fmi2CallbackFunctions functions;
    char name[128];
} unit_t;

static void begin(unit_t *unit)
{
    size_t i;
    for (i = 0; i < UNIT_INPUTS; i++) {
        unit->in[i] = 0.0;
    }
    unit->in[UNIT_APPLIED] = UNIT_NO_REPORT;
    NAME_init(&unit->state);
}

static fmi2Status refuse(const unit_t *unit, fmi2String why)
{
    if (unit->functions.logger != NULL) {
        unit->functions.logger(
            unit->functions.componentEnvironment, unit->name, fmi2Error, "error", "%s", why);
    }
    return fmi2Error;
}

EXPORTED const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORTED const char *fmi2GetVersion(void)
{
    return "2.0";
}

EXPORTED fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                                       fmi2String resources, const fmi2CallbackFunctions *functions,
                                       fmi2Boolean visible, fmi2Boolean logging)
{
    unit_t *unit;
    (void)resources;
    (void)visible;
    (void)logging;
    if (functions == NULL || functions->allocateMemory == NULL || name == NULL || guid == NULL
        || type != fmi2CoSimulation || strcmp(guid, UNIT_GUID) != 0) {
        return NULL;
    }
    unit = functions->allocateMemory(1, sizeof *unit);
    if (unit == NULL) {
        return NULL;
    }
    unit->functions = *functions;
    (void)strncpy(unit->name, name, sizeof unit->name - 1u);
    unit->name[sizeof unit->name - 1u] = 0;
    begin(unit);
    return unit;
}

EXPORTED void fmi2FreeInstance(fmi2Component c)
{
    unit_t *unit = c;
    if (unit != NULL) {
        unit->functions.freeMemory(unit);
    }
}

static void step(unit_t *unit)
{
    const NAME_real reference = (NAME_real)unit->in[UNIT_REFERENCE];
    const NAME_real measured = (NAME_real)unit->in[UNIT_MEASURED];
#if FORWARD_ONLINE
    (void)NAME_step(&unit->state, reference, (NAME_real)unit->in[UNIT_NEXT], measured);
#elif FORWARD_TABLE
    (void)NAME_step(&unit->state, reference, measured);
#else
    (void)NAME_step(&unit->state, reference, measured, (NAME_real)unit->in[UNIT_FEEDFORWARD]);
#endif
}

EXPORTED fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean noSet)
{
    unit_t *unit = c;
    const double *in = unit->in;
    const double whole = h / UNIT_INTERVAL;
    long steps;
    long k;
    (void)time;
    (void)noSet;
    if (!(whole > 0.5 && whole < 1e9)) {
        return refuse(unit, "the step is not a whole number of sampling intervals");
    }
    steps = (long)(whole + 0.5);
    if (whole - (double)steps > 1e-6 || (double)steps - whole > 1e-6) {
        return refuse(unit, "the step is not a whole number of sampling intervals");
    }
    for (k = 0; k < steps; k++) {
        if (in[UNIT_APPLIED] < 0.1 * UNIT_NO_REPORT) {
            (void)NAME_applied(&unit->state, (NAME_real)in[UNIT_APPLIED]);
        }
        step(unit);
    }
    return fmi2OK;
}

EXPORTED fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference *which, size_t count,
                                fmi2Real *values)
{
    const unit_t *unit = c;
    const NAME_command *last = &unit->state.last;
    size_t i;
    for (i = 0; i < count; i++) {
        switch (which[i]) {
        case UNIT_COMMAND:
            values[i] = (double)last->volts;
            break;
        case UNIT_UNCLIPPED:
            values[i] = (double)last->unclipped;
            break;
        case UNIT_FEEDFORWARD_PART:
            values[i] = (double)last->feedforward;
            break;
        case UNIT_FEEDBACK_PART:
            values[i] = (double)last->feedback;
            break;
        case UNIT_REPETITIVE_PART:
            values[i] = (double)last->repetitive;
            break;
        case UNIT_ERROR:
            values[i] = (double)last->error;
            break;
        default:
            if (which[i] >= UNIT_INPUTS) {
                return refuse(unit, "there is no such real variable");
            }
            values[i] = unit->in[which[i]];
            break;
        }
    }
    return fmi2OK;
}

EXPORTED fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference *which, size_t count,
                                const fmi2Real *values)
{
    unit_t *unit = c;
    size_t i;
    for (i = 0; i < count; i++) {
        if (which[i] >= UNIT_INPUTS) {
            return refuse(unit, "only inputs can be set");
        }
        unit->in[which[i]] = values[i];
    }
    return fmi2OK;
}

EXPORTED fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference *which, size_t count,
                                   fmi2Boolean *values)
{
    const unit_t *unit = c;
    const NAME_command *last = &unit->state.last;
    size_t i;
    for (i = 0; i < count; i++) {
        switch (which[i]) {
        case UNIT_SATURATED:
            values[i] = (fmi2Boolean)last->saturated;
            break;
        case UNIT_MEASUREMENT_OK:
            values[i] = (fmi2Boolean)last->measurement_ok;
            break;
        case UNIT_REFERENCE_OK:
            values[i] = (fmi2Boolean)last->reference_ok;
            break;
        default:
            return refuse(unit, "there is no such Boolean variable");
        }
    }
    return fmi2OK;
}

EXPORTED fmi2Status fmi2Reset(fmi2Component c)
{
    begin(c);
    return fmi2OK;
}

/* What there is nothing to do for. */

EXPORTED fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tolerance,
                                        fmi2Real start, fmi2Boolean s, fmi2Real stop)
{
    (void)c;
    (void)t;
    (void)tolerance;
    (void)start;
    (void)s;
    (void)stop;
    return fmi2OK;
}

EXPORTED fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count,
                                        const fmi2String *categories)
{
    (void)c;
    (void)on;
    (void)count;
    (void)categories;
    return fmi2OK;
}

#define NOTHING_TO_DO(function)                       \
    EXPORTED fmi2Status function(fmi2Component c)     \
    {                                                 \
        (void)c;                                      \
        return fmi2OK;                                \
    }

NOTHING_TO_DO(fmi2EnterInitializationMode)
NOTHING_TO_DO(fmi2ExitInitializationMode)
NOTHING_TO_DO(fmi2Terminate)

/* What the description says that the unit does not have. */

#define NOT_THERE(function, ...)                                 \
    EXPORTED fmi2Status function(fmi2Component c, __VA_ARGS__)   \
    {                                                            \
        return refuse(c, #function " is not there");             \
    }
#define WHICH const fmi2ValueReference *which, size_t count

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

NOT_THERE(fmi2GetInteger, WHICH, fmi2Integer *values)
NOT_THERE(fmi2GetString, WHICH, fmi2String *values)
NOT_THERE(fmi2SetInteger, WHICH, const fmi2Integer *values)
NOT_THERE(fmi2SetBoolean, WHICH, const fmi2Boolean *values)
NOT_THERE(fmi2SetString, WHICH, const fmi2String *values)
NOT_THERE(fmi2GetFMUstate, fmi2FMUstate *state)
NOT_THERE(fmi2SetFMUstate, fmi2FMUstate state)
NOT_THERE(fmi2FreeFMUstate, fmi2FMUstate *state)
NOT_THERE(fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t *size)
NOT_THERE(fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte *bytes, size_t size)
NOT_THERE(fmi2DeSerializeFMUstate, const fmi2Byte *bytes, size_t size, fmi2FMUstate *state)
NOT_THERE(fmi2GetDirectionalDerivative, const fmi2ValueReference *unknown, size_t unknowns,
          const fmi2ValueReference *known, size_t knowns, const fmi2Real *change, fmi2Real *values)
NOT_THERE(fmi2SetRealInputDerivatives, WHICH, const fmi2Integer *order, const fmi2Real *values)
NOT_THERE(fmi2GetRealOutputDerivatives, WHICH, const fmi2Integer *order, fmi2Real *values)
NOT_THERE(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *value)
NOT_THERE(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *value)
NOT_THERE(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *value)
NOT_THERE(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *value)
NOT_THERE(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *value)

EXPORTED fmi2Status fmi2CancelStep(fmi2Component c)
{
    return refuse(c, "fmi2CancelStep is not there");
}
