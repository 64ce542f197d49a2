/* A ball that bounces, as an FMI 3.0 FMU for model exchange alone, strict about the mode of each call:
   h' = v, v' = -g, at h = 0 the velocity becomes -e v; `bounces` counts. At every quarter of a second `quarters`
   grows, and so does `ticks`; at `last` of them, or `stop` s, it asks for the end. A change of the discrete input `kick` changes v by as much,
   in two updates. Below `floor` it has no derivatives. */

#include "fmi3FunctionTypes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TIME, H, V, DER_H, DER_V, G, E, FLOOR, KICK, BOUNCES, QUARTERS, LAST, Z, TICKS, STOP };
typedef enum { INSTANTIATED = 1, INITIALIZATION = 2, EVENT = 4, CONTINUOUS = 8, TERMINATED = 16 } Mode;

typedef struct {
    double time, h, v, g, e, floor, next, stop;
    fmi3Int32 kick, done, bounces, quarters, last;
    Mode mode;
} State;

typedef struct {
    State now;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Ball;

static const State START = {0, 1, 0, 9.81, 0.7, -1e9, 0.25, 1e9, 0, 0, 0, 0, 1000000, INSTANTIATED};

static fmi3Status refuse(Ball *m, fmi3Status status, const char *why) {
    m->log(m->environment, status, "logStatusError", why);
    return status;
}

#define ALLOW(modes) \
    Ball *m = instance; \
    State *s = &m->now; \
    if (!(s->mode & (modes))) return refuse(m, fmi3Error, __func__)

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3InstantiateModelExchangeTYPE fmi3InstantiateModelExchange;
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    Ball *m = malloc(sizeof *m);
    *m = (Ball){START, environment, log};
    return m;
}

fmi3FreeInstanceTYPE fmi3FreeInstance;
void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

fmi3ResetTYPE fmi3Reset;
fmi3Status fmi3Reset(fmi3Instance instance) {
    ((Ball *)instance)->now = START;
    return fmi3OK;
}

fmi3EnterInitializationModeTYPE fmi3EnterInitializationMode;
fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stopDefined, fmi3Float64 stop) {
    (void)toleranceDefined, (void)tolerance, (void)stopDefined, (void)stop;
    ALLOW(INSTANTIATED);
    s->time = start;
    s->next = 0.25 * (floor(start / 0.25) + 1);
    s->mode = INITIALIZATION;
    return fmi3OK;
}

fmi3ExitInitializationModeTYPE fmi3ExitInitializationMode;
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    ALLOW(INITIALIZATION);
    s->done = s->kick;
    s->mode = EVENT;
    return fmi3OK;
}

fmi3EnterEventModeTYPE fmi3EnterEventMode;
fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    ALLOW(CONTINUOUS);
    s->mode = EVENT;
    return fmi3OK;
}

fmi3EnterContinuousTimeModeTYPE fmi3EnterContinuousTimeMode;
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    ALLOW(EVENT);
    s->mode = CONTINUOUS;
    return fmi3OK;
}

fmi3TerminateTYPE fmi3Terminate;
fmi3Status fmi3Terminate(fmi3Instance instance) {
    ALLOW(EVENT | CONTINUOUS);
    s->mode = TERMINATED;
    return fmi3OK;
}

fmi3UpdateDiscreteStatesTYPE fmi3UpdateDiscreteStates;
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *timed,
                                    fmi3Float64 *next) {
    ALLOW(EVENT);
    *again = *nominals = *values = false;
    if (s->h <= 0 && s->v < 0) {
        s->v *= -s->e;
        s->h = 0;
        s->bounces++;
        *values = true;
    }
    if (s->time >= s->next - 1e-12) {
        s->quarters++;
        s->next += 0.25;
    }
    if (s->done != s->kick) {
        int rest = s->kick - s->done, by = rest / 2 ? rest / 2 : rest; /* half, then half of the rest */
        s->v += by;
        s->done += by;
        *values = true;
        *again = s->done != s->kick;
    }
    *terminate = s->quarters >= s->last || s->time >= s->stop - 1e-12;
    *timed = true;
    *next = s->next;
    return fmi3OK;
}

fmi3CompletedIntegratorStepTYPE fmi3CompletedIntegratorStep;
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetPrior, fmi3Boolean *event,
                                       fmi3Boolean *terminate) {
    (void)noSetPrior;
    ALLOW(CONTINUOUS);
    (void)s;
    *event = *terminate = false;
    return fmi3OK;
}

fmi3SetTimeTYPE fmi3SetTime;
fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    ALLOW(CONTINUOUS);
    s->time = time;
    return fmi3OK;
}

fmi3SetContinuousStatesTYPE fmi3SetContinuousStates;
fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 x[], size_t n) {
    ALLOW(CONTINUOUS);
    if (n != 2) return refuse(m, fmi3Error, "it has two states");
    s->h = x[0], s->v = x[1];
    return fmi3OK;
}

fmi3GetContinuousStatesTYPE fmi3GetContinuousStates;
fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 x[], size_t n) {
    ALLOW(EVENT | CONTINUOUS);
    if (n != 2) return refuse(m, fmi3Error, "it has two states");
    x[0] = s->h, x[1] = s->v;
    return fmi3OK;
}

fmi3GetContinuousStateDerivativesTYPE fmi3GetContinuousStateDerivatives;
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 dx[], size_t n) {
    ALLOW(EVENT | CONTINUOUS);
    if (n != 2) return refuse(m, fmi3Error, "it has two states");
    if (s->h < s->floor) return refuse(m, fmi3Error, "below the floor there is nothing");
    dx[0] = s->v, dx[1] = -s->g;
    return fmi3OK;
}

fmi3GetNominalsOfContinuousStatesTYPE fmi3GetNominalsOfContinuousStates;
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 x[], size_t n) {
    ALLOW(EVENT | CONTINUOUS);
    (void)s;
    for (size_t i = 0; i < n; i++) x[i] = 1;
    return fmi3OK;
}

fmi3GetEventIndicatorsTYPE fmi3GetEventIndicators;
fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 z[], size_t n) {
    ALLOW(EVENT | CONTINUOUS);
    if (n != 1) return refuse(m, fmi3Error, "it has one event indicator");
    z[0] = s->h == 0 && s->v > 0 ? 1e-12 : s->h; /* leaving the ground is no event */
    return fmi3OK;
}

static double *place(State *s, fmi3ValueReference vr) {
    switch (vr) {
    case H: return &s->h;
    case V: return &s->v;
    case G: return &s->g;
    case E: return &s->e;
    case FLOOR: return &s->floor;
    case STOP: return &s->stop;
    default: return NULL;
    }
}

fmi3GetFloat64TYPE fmi3GetFloat64;
fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                          size_t nValues) {
    ALLOW(INITIALIZATION | EVENT | CONTINUOUS);
    if (n != nValues) return refuse(m, fmi3Error, "scalars have one value");
    for (size_t i = 0; i < n; i++) {
        const double *from = place(s, vr[i]);
        values[i] = from ? *from : vr[i] == DER_H ? s->v : vr[i] == DER_V ? -s->g : vr[i] == TICKS ? s->quarters : s->time;
    }
    return fmi3OK;
}

fmi3SetFloat64TYPE fmi3SetFloat64;
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 values[], size_t nValues) {
    ALLOW(INSTANTIATED | INITIALIZATION | EVENT);
    if (n != nValues) return refuse(m, fmi3Error, "scalars have one value");
    for (size_t i = 0; i < n; i++) {
        double *into = place(s, vr[i]);
        if (!into || (s->mode == EVENT && vr[i] != G)) return refuse(m, fmi3Error, "cannot be set now");
        *into = values[i];
    }
    return fmi3OK;
}

fmi3GetInt32TYPE fmi3GetInt32;
fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Int32 values[],
                        size_t nValues) {
    ALLOW(INITIALIZATION | EVENT | CONTINUOUS);
    if (n != nValues) return refuse(m, fmi3Error, "scalars have one value");
    for (size_t i = 0; i < n; i++)
        values[i] = vr[i] == KICK ? s->kick : vr[i] == BOUNCES ? s->bounces : vr[i] == LAST ? s->last : s->quarters;
    return fmi3OK;
}

fmi3SetInt32TYPE fmi3SetInt32;
fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Int32 values[],
                        size_t nValues) {
    ALLOW(INSTANTIATED | INITIALIZATION | EVENT);
    if (n != nValues) return refuse(m, fmi3Error, "scalars have one value");
    for (size_t i = 0; i < n; i++) *(vr[i] == KICK ? &s->kick : &s->last) = values[i];
    return fmi3OK;
}

typedef Ball Instance;
#include "states_fmi3.h"

/* The standard wants every function in the library; these are never called. */
#define UNUSED(name) fmi3Status name(void); fmi3Status name(void) { return fmi3Error; }
fmi3Instance fmi3InstantiateCoSimulation(void);
fmi3Instance fmi3InstantiateCoSimulation(void) { return NULL; }
fmi3Instance fmi3InstantiateScheduledExecution(void);
fmi3Instance fmi3InstantiateScheduledExecution(void) { return NULL; }
UNUSED(fmi3SetDebugLogging) UNUSED(fmi3EnterStepMode) UNUSED(fmi3DoStep)
UNUSED(fmi3GetFloat32) UNUSED(fmi3GetInt8) UNUSED(fmi3GetUInt8) UNUSED(fmi3GetInt16) UNUSED(fmi3GetUInt16)
UNUSED(fmi3GetUInt32) UNUSED(fmi3GetInt64) UNUSED(fmi3GetUInt64) UNUSED(fmi3GetBoolean) UNUSED(fmi3GetString)
UNUSED(fmi3GetBinary) UNUSED(fmi3GetClock) UNUSED(fmi3SetFloat32) UNUSED(fmi3SetInt8) UNUSED(fmi3SetUInt8)
UNUSED(fmi3SetInt16) UNUSED(fmi3SetUInt16) UNUSED(fmi3SetUInt32) UNUSED(fmi3SetInt64) UNUSED(fmi3SetUInt64)
UNUSED(fmi3SetBoolean) UNUSED(fmi3SetString) UNUSED(fmi3SetBinary) UNUSED(fmi3SetClock)
UNUSED(fmi3SerializedFMUStateSize) UNUSED(fmi3SerializeFMUState) UNUSED(fmi3DeserializeFMUState)
UNUSED(fmi3GetNumberOfVariableDependencies) UNUSED(fmi3GetVariableDependencies)
UNUSED(fmi3GetDirectionalDerivative) UNUSED(fmi3GetAdjointDerivative)
UNUSED(fmi3EnterConfigurationMode) UNUSED(fmi3ExitConfigurationMode)
UNUSED(fmi3GetIntervalDecimal) UNUSED(fmi3GetIntervalFraction) UNUSED(fmi3GetShiftDecimal)
UNUSED(fmi3GetShiftFraction) UNUSED(fmi3SetIntervalDecimal) UNUSED(fmi3SetIntervalFraction)
UNUSED(fmi3SetShiftDecimal) UNUSED(fmi3SetShiftFraction) UNUSED(fmi3EvaluateDiscreteStates)
UNUSED(fmi3GetNumberOfEventIndicators) UNUSED(fmi3GetNumberOfContinuousStates)
UNUSED(fmi3GetOutputDerivatives) UNUSED(fmi3ActivateModelPartition)
