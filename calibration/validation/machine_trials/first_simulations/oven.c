/* An oven as an FMI 2.0 co-simulation unit: one heat capacity, a linear loss, a heater.
 *
 *   C dT/dt = V^2 / R - G (T - T_ambient),   I = V / R
 *
 * Advanced by the exact step of the linear equation with the inputs held. Types as in fmi2TypesPlatform.h; written here
 * so that a C compiler alone is enough.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;

enum { HEATER_VOLTAGE, AMBIENT, T_DEGC, T_K, HEATER_CURRENT, HEAT_CAPACITY, LOSS, HEATER_OHM, COUNT };

static const double START[COUNT] = {0.0, 20.0, 20.0, 293.15, 0.0, 6000.0, 4.0, 20.0};

typedef struct {
    double value[COUNT];
} Oven;

static void outputs(Oven *oven)
{
    oven->value[T_K] = oven->value[T_DEGC] + 273.15;
    oven->value[HEATER_CURRENT] = oven->value[HEATER_VOLTAGE] / oven->value[HEATER_OHM];
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) { return fmi2OK; }

fmi2Component fmi2Instantiate(fmi2String name, int type, fmi2String guid, fmi2String resources, const void *callbacks,
                              fmi2Boolean visible, fmi2Boolean logging)
{
    Oven *oven = malloc(sizeof(Oven));
    if (oven != NULL)
        memcpy(oven->value, START, sizeof START);
    return oven;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop)
{
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    outputs(c);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }

fmi2Status fmi2Reset(fmi2Component c)
{
    memcpy(((Oven *)c)->value, START, sizeof START);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    outputs(c);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= COUNT)
            return fmi2Error;
        value[i] = ((Oven *)c)->value[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= COUNT)
            return fmi2Error;
        ((Oven *)c)->value[vr[i]] = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real step, fmi2Boolean no_set_state)
{
    double *v = ((Oven *)c)->value;
    double settles = v[AMBIENT] + v[HEATER_VOLTAGE] * v[HEATER_VOLTAGE] / v[HEATER_OHM] / v[LOSS];
    v[T_DEGC] = settles + (v[T_DEGC] - settles) * exp(-v[LOSS] * step / v[HEAT_CAPACITY]);
    return fmi2OK;
}

/* What the standard requires to exist and this unit has no use for. */
#define NONE(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2Error; }
NONE(fmi2GetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
NONE(fmi2GetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
NONE(fmi2GetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[])
NONE(fmi2SetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
NONE(fmi2SetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
NONE(fmi2SetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
NONE(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate *state)
NONE(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate state)
NONE(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate *state)
NONE(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate state, size_t *size)
NONE(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
NONE(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
NONE(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns,
     const fmi2ValueReference known[], size_t knowns, const fmi2Real seed[], fmi2Real sensitivity[])
NONE(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
     const fmi2Real value[])
NONE(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
     fmi2Real value[])
NONE(fmi2CancelStep, fmi2Component c)
NONE(fmi2GetStatus, fmi2Component c, int kind, fmi2Status *value)
NONE(fmi2GetRealStatus, fmi2Component c, int kind, fmi2Real *value)
NONE(fmi2GetIntegerStatus, fmi2Component c, int kind, fmi2Integer *value)
NONE(fmi2GetBooleanStatus, fmi2Component c, int kind, fmi2Boolean *value)
NONE(fmi2GetStringStatus, fmi2Component c, int kind, fmi2String *value)
