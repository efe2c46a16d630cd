/* A first-order lag as an FMI 2.0 unit, for co-simulation and for model exchange: tau dx/dt = u - x, y = u + x.
 *
 * A step of the co-simulation is exact for an input that is held.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef void *Component;
typedef unsigned int Reference;
typedef double Real;
typedef int Boolean;
typedef const char *String;
typedef enum { OK, WARNING, DISCARD, ERROR } Status;

enum { U, X, Y, TAU, RATE, COUNT };

typedef struct {
    Real value[COUNT];
} Lag;

typedef struct {
    Boolean needed, terminate, nominals, values, planned;
    Real next;
} Events;

static void outputs(Lag *lag)
{
    lag->value[RATE] = (lag->value[U] - lag->value[X]) / lag->value[TAU];
    lag->value[Y] = lag->value[U] + lag->value[X];
}

String fmi2GetTypesPlatform(void) { return "default"; }
String fmi2GetVersion(void) { return "2.0"; }
Status fmi2SetDebugLogging(Component c, Boolean on, size_t n, const String names[]) { return OK; }

Component fmi2Instantiate(String name, int type, String guid, String resources, const void *callbacks, Boolean visible,
                          Boolean logging)
{
    Lag *lag = calloc(1, sizeof(Lag));
    if (lag != NULL)
        lag->value[TAU] = 2.0;
    return lag;
}

void fmi2FreeInstance(Component c) { free(c); }
Status fmi2SetupExperiment(Component c, Boolean d, Real tolerance, Real start, Boolean e, Real stop) { return OK; }
Status fmi2EnterInitializationMode(Component c) { return OK; }
Status fmi2ExitInitializationMode(Component c) { return OK; }
Status fmi2Terminate(Component c) { return OK; }
Status fmi2Reset(Component c) { return OK; }

Status fmi2GetReal(Component c, const Reference reference[], size_t n, Real value[])
{
    outputs(c);
    for (size_t i = 0; i < n; i++)
        value[i] = ((Lag *)c)->value[reference[i]];
    return OK;
}

Status fmi2SetReal(Component c, const Reference reference[], size_t n, const Real value[])
{
    for (size_t i = 0; i < n; i++)
        ((Lag *)c)->value[reference[i]] = value[i];
    return OK;
}

Status fmi2DoStep(Component c, Real now, Real step, Boolean no_set_state)
{
    Real *v = ((Lag *)c)->value;
    v[X] = v[U] + (v[X] - v[U]) * exp(-step / v[TAU]);
    return OK;
}

Status fmi2EnterEventMode(Component c) { return OK; }
Status fmi2EnterContinuousTimeMode(Component c) { return OK; }

Status fmi2NewDiscreteStates(Component c, Events *events)
{
    memset(events, 0, sizeof *events);
    return OK;
}

Status fmi2SetTime(Component c, Real time) { return OK; }

Status fmi2CompletedIntegratorStep(Component c, Boolean no_set_state, Boolean *event, Boolean *terminate)
{
    *event = *terminate = 0;
    return OK;
}

Status fmi2SetContinuousStates(Component c, const Real x[], size_t n)
{
    ((Lag *)c)->value[X] = x[0];
    return OK;
}

Status fmi2GetContinuousStates(Component c, Real x[], size_t n)
{
    x[0] = ((Lag *)c)->value[X];
    return OK;
}

Status fmi2GetDerivatives(Component c, Real rate[], size_t n)
{
    outputs(c);
    rate[0] = ((Lag *)c)->value[RATE];
    return OK;
}

Status fmi2GetNominalsOfContinuousStates(Component c, Real nominal[], size_t n)
{
    nominal[0] = 1.0;
    return OK;
}

Status fmi2GetEventIndicators(Component c, Real indicator[], size_t n) { return OK; }

/* What the standard requires to exist and this unit has no use for. */
#define NONE(name) Status name(Component c) { return ERROR; }
NONE(fmi2GetInteger)
NONE(fmi2GetBoolean)
NONE(fmi2GetString)
NONE(fmi2SetInteger)
NONE(fmi2SetBoolean)
NONE(fmi2SetString)
NONE(fmi2GetFMUstate)
NONE(fmi2SetFMUstate)
NONE(fmi2FreeFMUstate)
NONE(fmi2SerializedFMUstateSize)
NONE(fmi2SerializeFMUstate)
NONE(fmi2DeSerializeFMUstate)
NONE(fmi2GetDirectionalDerivative)
NONE(fmi2SetRealInputDerivatives)
NONE(fmi2GetRealOutputDerivatives)
NONE(fmi2CancelStep)
NONE(fmi2GetStatus)
NONE(fmi2GetRealStatus)
NONE(fmi2GetIntegerStatus)
NONE(fmi2GetBooleanStatus)
NONE(fmi2GetStringStatus)
