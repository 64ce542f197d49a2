/* A co-simulation FMU by FMI 2.0 that allows what the state machine of the standard (2.0.4, 4.2.4) allows, and a
   reset only of what was initialised, as some FMUs do. Calls that break it are errors, and a line in the file that
   the environment names.

   x' = u - p x with one Euler step for each communication step. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { X, U, P, Y, N };
typedef enum { INSTANTIATED = 1, INITIALIZATION = 2, COMPLETE = 4, FAILED = 8, ERRED = 16, TERMINATED = 32 } Mode;
typedef struct { double v[N], time; Mode mode; int set_up; } State;
typedef struct { State now; double promised; } Instance;

static const State START = {{1.0, 0.0, 0.5, 0.0}, 0.0, INSTANTIATED, 0};

static void note(const char *function, const char *why) {
    const char *file = getenv("STRICT_LOG");
    FILE *out = file ? fopen(file, "a") : NULL;
    if (!out) return;
    fprintf(out, "%s: %s\n", function, why);
    fclose(out);
}

static fmi2Status broken(Instance *m, const char *function, const char *why) {
    note(function, why);
    m->now.mode = ERRED;
    return fmi2Error;
}

#define ALLOW(modes) \
    Instance *m = c; \
    if (!(m->now.mode & (modes))) return broken(m, __func__, "not allowed in this state")
#define FORBID(condition, why) if (condition) return broken(m, __func__, why)

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)place, (void)visible, (void)logging;
    if (!name || !name[0] || type != fmi2CoSimulation || strcmp(guid, "{strict}") || !functions->logger) {
        note(__func__, "arguments");
        return NULL;
    }
    Instance *m = calloc(1, sizeof *m);
    m->now = START;
    m->promised = -HUGE_VAL;
    return m;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *m = c;
    if (m->now.mode == COMPLETE) note(__func__, "not terminated");
    free(m);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    ALLOW(INSTANTIATED);
    FORBID(m->now.set_up, "a second time");
    m->now.set_up = 1;
    m->now.time = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    ALLOW(INSTANTIATED);
    FORBID(!m->now.set_up, "before fmi2SetupExperiment");
    m->now.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    ALLOW(INITIALIZATION);
    m->now.mode = COMPLETE;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    ALLOW(COMPLETE | FAILED);
    m->now.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    ALLOW(INITIALIZATION | COMPLETE | FAILED | ERRED | TERMINATED);
    m->now = START;
    m->promised = -HUGE_VAL;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    ALLOW(INITIALIZATION | COMPLETE | FAILED | TERMINATED);
    m->now.v[Y] = m->now.v[X] + m->now.v[U];
    for (size_t i = 0; i < n; i++) {
        FORBID(vr[i] >= N, "no such variable");
        values[i] = m->now.v[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    ALLOW(INSTANTIATED | INITIALIZATION | COMPLETE);
    for (size_t i = 0; i < n; i++) {
        FORBID(vr[i] >= Y, "no variable that can be set");
        FORBID(vr[i] == X && m->now.mode == COMPLETE, "a state while running");
        if (!isfinite(values[i])) { /* by the importer's user, so no breach */
            m->now.mode = ERRED;
            return fmi2Error;
        }
        m->now.v[vr[i]] = values[i];
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real dt, fmi2Boolean no_state_before) {
    ALLOW(COMPLETE);
    FORBID(fabs(t - m->now.time) > 1e-9 * fmax(1.0, fabs(t)), "not where the last step ended");
    if (dt <= 0) {
        m->now.mode = ERRED;
        return fmi2Error;
    }
    if (dt > 0.5) {
        m->now.mode = FAILED;
        return fmi2Discard;
    }
    double *v = m->now.v;
    v[X] += dt * (v[U] - v[P] * v[X]);
    m->now.time = t + dt;
    if (no_state_before) m->promised = m->now.time;
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    ALLOW(INSTANTIATED | INITIALIZATION | COMPLETE | FAILED | TERMINATED);
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &m->now, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    ALLOW(INSTANTIATED | INITIALIZATION | COMPLETE | FAILED | ERRED | TERMINATED);
    FORBID(((State *)state)->time < m->promised, "an earlier state, against the promise of the last step");
    memcpy(&m->now, state, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(State);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte data[], size_t size) {
    (void)c;
    if (size < sizeof(State)) return fmi2Error;
    memcpy(data, state, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte data[], size_t size, fmi2FMUstate *state) {
    (void)c;
    if (size != sizeof(State)) return fmi2Error;
    *state = malloc(size);
    memcpy(*state, data, size);
    return fmi2OK;
}

#define ABSENT(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2Error; }
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
ABSENT(fmi2GetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer v[])
ABSENT(fmi2GetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean v[])
ABSENT(fmi2GetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String v[])
ABSENT(fmi2SetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer v[])
ABSENT(fmi2SetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean v[])
ABSENT(fmi2SetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String v[])
ABSENT(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference z[], size_t n,
       const fmi2ValueReference v[], size_t k, const fmi2Real dv[], fmi2Real dz[])
ABSENT(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n,
       const fmi2Integer order[], const fmi2Real v[])
ABSENT(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n,
       const fmi2Integer order[], fmi2Real v[])
ABSENT(fmi2CancelStep, fmi2Component c)
ABSENT(fmi2GetStatus, fmi2Component c, const fmi2StatusKind s, fmi2Status *v)
ABSENT(fmi2GetRealStatus, fmi2Component c, const fmi2StatusKind s, fmi2Real *v)
ABSENT(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind s, fmi2Integer *v)
ABSENT(fmi2GetBooleanStatus, fmi2Component c, const fmi2StatusKind s, fmi2Boolean *v)
ABSENT(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind s, fmi2String *v)
