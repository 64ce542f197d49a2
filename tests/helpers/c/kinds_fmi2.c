/* Whole numbers and truths as an FMI 2.0 co-simulation FMU, whose types count their value references each from 0:
   x' = n where `on` is true and else 0, m = n * mode, `odd` says whether n is; `count` counts the steps.
   It asks for the end of the simulation at the time `end` by discarding a step. */

#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

typedef struct { double x, end, time; int n, count, mode, on, ended; } State;
typedef struct { State now; } Instance;

static const State START = {0.5, 1e9, 0, 2, 0, 1, 1, 0};

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)type, (void)guid, (void)place, (void)functions, (void)visible, (void)logging;
    Instance *m = malloc(sizeof *m);
    m->now = START;
    return m;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2Reset(fmi2Component c) {
    ((Instance *)c)->now = START;
    return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stops, fmi2Real stop) {
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    ((Instance *)c)->now.time = start;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    State *s = &((Instance *)c)->now;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 1) return fmi2Error;
        values[i] = vr[i] ? s->end : s->x;
    }
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    State *s = &((Instance *)c)->now;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 1) return fmi2Error;
        *(vr[i] ? &s->end : &s->x) = values[i];
    }
    return fmi2OK;
}
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer values[]) {
    State *s = &((Instance *)c)->now;
    int known[] = {s->n, s->count, s->mode, s->n * s->mode};
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 3) return fmi2Error;
        values[i] = known[vr[i]];
    }
    return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer values[]) {
    State *s = &((Instance *)c)->now;
    int *known[] = {&s->n, &s->count, &s->mode};
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 2) return fmi2Error;
        *known[vr[i]] = values[i];
    }
    return fmi2OK;
}
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean values[]) {
    State *s = &((Instance *)c)->now;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 1) return fmi2Error;
        values[i] = vr[i] ? s->n % 2 != 0 : s->on;
    }
    return fmi2OK;
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean values[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != 0) return fmi2Error;
        ((Instance *)c)->now.on = values[i];
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real dt, fmi2Boolean final) {
    (void)final;
    State *s = &((Instance *)c)->now;
    if (!(dt > 0) || s->ended) return fmi2Error;
    s->ended = t + dt > s->end;
    if (s->ended) dt = s->end - t;
    s->x += s->on ? dt * s->n : 0;
    s->count++;
    s->time = t + dt;
    s->ended |= s->time >= s->end;
    return s->ended ? fmi2Discard : fmi2OK;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated) return fmi2Error;
    *value = ((Instance *)c)->now.ended;
    return fmi2OK;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Error;
    *value = ((Instance *)c)->now.time;
    return fmi2OK;
}

/* The standard wants every function in the library; these are never called. */
#define ABSENT(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2Error; }
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
ABSENT(fmi2SetDebugLogging, fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
ABSENT(fmi2GetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String v[])
ABSENT(fmi2SetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String v[])
ABSENT(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate *s)
ABSENT(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate s)
ABSENT(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate *s)
ABSENT(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate s, size_t *n)
ABSENT(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n)
ABSENT(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
ABSENT(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference z[], size_t n,
       const fmi2ValueReference v[], size_t k, const fmi2Real dv[], fmi2Real dz[])
ABSENT(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n,
       const fmi2Integer order[], const fmi2Real v[])
ABSENT(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n,
       const fmi2Integer order[], fmi2Real v[])
ABSENT(fmi2CancelStep, fmi2Component c)
ABSENT(fmi2GetStatus, fmi2Component c, const fmi2StatusKind s, fmi2Status *v)
ABSENT(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind s, fmi2Integer *v)
ABSENT(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind s, fmi2String *v)
