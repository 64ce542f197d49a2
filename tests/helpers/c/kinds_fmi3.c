/* Arrays, whole numbers and truths as an FMI 3.0 co-simulation FMU, strict about how many values a call brings:
   x' = u, y = A x, m = 2 n + mode, g = f where `on` is true and else 0; `count` counts the steps with `on`.
   It asks for the end of the simulation at the time `end`. */

#include "fmi3FunctionTypes.h"

#include <stdlib.h>
#include <string.h>

enum { TIME, A, U, X, Y, END, N, M, ON, COUNT, MODE, F, G, BIG };
typedef enum { INSTANTIATED, INITIALIZATION, STEP, TERMINATED } Mode;

typedef struct {
    double time, A[6], u[3], x[3], end;
    fmi3Int8 n;
    fmi3Int32 count;
    fmi3Int64 mode;
    fmi3UInt64 big;
    float f;
    fmi3Boolean on;
    Mode state;
} State;

typedef struct {
    State now;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Kinds;

static const State START = {0, {1, 2, 3, 4, 5, 6}, {1, 0, 0}, {0, 10, 0}, 1e9, 3, 0, 1, 0, 0, 0, INSTANTIATED};

static fmi3Status refuse(Kinds *m, const char *why) {
    m->log(m->environment, fmi3Error, "logStatusError", why);
    return fmi3Error;
}

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3InstantiateCoSimulationTYPE fmi3InstantiateCoSimulation;
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean eventMode, fmi3Boolean early, const fmi3ValueReference required[], size_t nRequired,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)eventMode, (void)early;
    (void)required, (void)nRequired, (void)update;
    Kinds *m = malloc(sizeof *m);
    *m = (Kinds){START, environment, log};
    return m;
}

fmi3FreeInstanceTYPE fmi3FreeInstance;
void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

fmi3ResetTYPE fmi3Reset;
fmi3Status fmi3Reset(fmi3Instance instance) {
    ((Kinds *)instance)->now = START;
    return fmi3OK;
}

fmi3EnterInitializationModeTYPE fmi3EnterInitializationMode;
fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stopDefined, fmi3Float64 stop) {
    (void)toleranceDefined, (void)tolerance, (void)stopDefined, (void)stop;
    Kinds *m = instance;
    m->now.time = start;
    m->now.state = INITIALIZATION;
    return fmi3OK;
}

fmi3ExitInitializationModeTYPE fmi3ExitInitializationMode;
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    ((Kinds *)instance)->now.state = STEP;
    return fmi3OK;
}

fmi3TerminateTYPE fmi3Terminate;
fmi3Status fmi3Terminate(fmi3Instance instance) {
    ((Kinds *)instance)->now.state = TERMINATED;
    return fmi3OK;
}

/* values of a variable of doubles, and how many */
static double *place(State *s, fmi3ValueReference vr, size_t *size) {
    switch (vr) {
    case TIME: *size = 1; return &s->time;
    case A: *size = 6; return s->A;
    case U: *size = 3; return s->u;
    case X: *size = 3; return s->x;
    case END: *size = 1; return &s->end;
    default: *size = 0; return NULL;
    }
}

fmi3GetFloat64TYPE fmi3GetFloat64;
fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                          size_t nValues) {
    Kinds *m = instance;
    State *s = &m->now;
    if (s->state == INSTANTIATED) return refuse(m, "read before initialization");
    double y[2] = {0, 0}, *at = values;
    for (int i = 0; i < 6; i++) y[i / 3] += s->A[i] * s->x[i % 3];
    for (size_t i = 0; i < n; i++) {
        size_t size = 2;
        const double *from = vr[i] == Y ? y : place(s, vr[i], &size);
        if (!from || at + size > values + nValues) return refuse(m, "another number of values is read");
        memcpy(at, from, size * sizeof *at);
        at += size;
    }
    return at == values + nValues ? fmi3OK : refuse(m, "more values than there are");
}

fmi3SetFloat64TYPE fmi3SetFloat64;
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 values[], size_t nValues) {
    Kinds *m = instance;
    const double *at = values;
    for (size_t i = 0; i < n; i++) {
        size_t size;
        double *into = place(&m->now, vr[i], &size);
        if (!into || at + size > values + nValues) return refuse(m, "another number of values is set");
        if (m->now.state == STEP && (vr[i] == X || vr[i] == END)) return refuse(m, "cannot be set in a run");
        memcpy(into, at, size * sizeof *at);
        at += size;
    }
    return at == values + nValues ? fmi3OK : refuse(m, "more values than there are");
}

#define SCALARS(Type, type, ...)                                                                                   \
    fmi3Get##Type##TYPE fmi3Get##Type;                                                                             \
    fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, type values[],        \
                             size_t nValues) {                                                                     \
        State *s = &((Kinds *)instance)->now;                                                                      \
        if (n != nValues) return refuse(instance, "scalars have one value");                                       \
        for (size_t i = 0; i < n; i++) switch (vr[i]) { __VA_ARGS__ default: return refuse(instance, "no " #Type); } \
        return fmi3OK;                                                                                             \
    }
#define SETS(Type, type, reference, member)                                                                        \
    fmi3Set##Type##TYPE fmi3Set##Type;                                                                             \
    fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const type values[],  \
                             size_t nValues) {                                                                     \
        if (n != 1 || nValues != 1 || vr[0] != reference) return refuse(instance, "no " #Type " to be set");       \
        ((Kinds *)instance)->now.member = values[0];                                                               \
        return fmi3OK;                                                                                             \
    }
#define CASE(reference, value) case reference: values[i] = (value); break;

SCALARS(Int8, fmi3Int8, CASE(N, s->n))
SETS(Int8, fmi3Int8, N, n)
SCALARS(Int16, fmi3Int16, CASE(M, (fmi3Int16)(2 * s->n + s->mode)))
SCALARS(Boolean, fmi3Boolean, CASE(ON, s->on))
SETS(Boolean, fmi3Boolean, ON, on)
SCALARS(Int32, fmi3Int32, CASE(COUNT, s->count))
SETS(Int32, fmi3Int32, COUNT, count)
SCALARS(Int64, fmi3Int64, CASE(MODE, s->mode))
SETS(Int64, fmi3Int64, MODE, mode)
SCALARS(Float32, fmi3Float32, CASE(F, s->f) CASE(G, s->on ? s->f : 0))
SETS(Float32, fmi3Float32, F, f)
SCALARS(UInt64, fmi3UInt64, CASE(BIG, s->big))
SETS(UInt64, fmi3UInt64, BIG, big)

fmi3DoStepTYPE fmi3DoStep;
fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 dt, fmi3Boolean noSetPrior,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    (void)noSetPrior;
    Kinds *m = instance;
    State *s = &m->now;
    *event = *terminate = *early = false;
    if (s->time >= s->end) return refuse(m, "a step after the end");
    if (!(dt > 0)) return refuse(m, "a step that is not positive");
    for (int i = 0; i < 3; i++) s->x[i] += dt * s->u[i];
    s->count += s->on;
    s->time = t + dt;
    if (s->time >= s->end) m->log(m->environment, fmi3Warning, "logStatusWarning", "the road ends here");
    *terminate = s->time >= s->end;
    *last = s->time;
    return fmi3OK;
}

typedef Kinds Instance;
#include "states_fmi3.h"

/* The standard wants every function in the library; these are never called. */
#define UNUSED(name) fmi3Status name(void); fmi3Status name(void) { return fmi3Error; }
UNUSED(fmi3SetDebugLogging) UNUSED(fmi3EnterEventMode) UNUSED(fmi3EnterStepMode)
fmi3Instance fmi3InstantiateModelExchange(void);
fmi3Instance fmi3InstantiateModelExchange(void) { return NULL; }
fmi3Instance fmi3InstantiateScheduledExecution(void);
fmi3Instance fmi3InstantiateScheduledExecution(void) { return NULL; }
UNUSED(fmi3GetUInt8) UNUSED(fmi3GetUInt16) UNUSED(fmi3GetUInt32) UNUSED(fmi3GetString) UNUSED(fmi3GetBinary)
UNUSED(fmi3GetClock) UNUSED(fmi3SetUInt8) UNUSED(fmi3SetInt16) UNUSED(fmi3SetUInt16) UNUSED(fmi3SetUInt32)
UNUSED(fmi3SetString) UNUSED(fmi3SetBinary) UNUSED(fmi3SetClock) UNUSED(fmi3SerializedFMUStateSize)
UNUSED(fmi3SerializeFMUState) UNUSED(fmi3DeserializeFMUState)
UNUSED(fmi3GetNumberOfVariableDependencies) UNUSED(fmi3GetVariableDependencies)
UNUSED(fmi3GetDirectionalDerivative) UNUSED(fmi3GetAdjointDerivative)
UNUSED(fmi3EnterConfigurationMode) UNUSED(fmi3ExitConfigurationMode)
UNUSED(fmi3GetIntervalDecimal) UNUSED(fmi3GetIntervalFraction) UNUSED(fmi3GetShiftDecimal)
UNUSED(fmi3GetShiftFraction) UNUSED(fmi3SetIntervalDecimal) UNUSED(fmi3SetIntervalFraction)
UNUSED(fmi3SetShiftDecimal) UNUSED(fmi3SetShiftFraction)
UNUSED(fmi3EvaluateDiscreteStates) UNUSED(fmi3UpdateDiscreteStates)
UNUSED(fmi3EnterContinuousTimeMode) UNUSED(fmi3CompletedIntegratorStep) UNUSED(fmi3SetTime)
UNUSED(fmi3SetContinuousStates) UNUSED(fmi3GetContinuousStateDerivatives) UNUSED(fmi3GetEventIndicators)
UNUSED(fmi3GetContinuousStates) UNUSED(fmi3GetNominalsOfContinuousStates)
UNUSED(fmi3GetNumberOfEventIndicators) UNUSED(fmi3GetNumberOfContinuousStates)
UNUSED(fmi3GetOutputDerivatives) UNUSED(fmi3ActivateModelPartition)
