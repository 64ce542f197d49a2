/* The FMU of strict_fmi2.c by FMI 3.0: it allows what the state machine of co-simulation (3.0.1, 4.2.1) allows, and a
   reset only of what was initialised, as some FMUs do. Calls that break it are errors, and a line in the file that
   the environment names.

   x' = u - p x with one Euler step for each communication step. */

#include "fmi3FunctionTypes.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TIME, X, U, P, Y, N };
typedef enum { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, DISCARDED = 8, TERMINATED = 16 } Mode;
typedef struct { double v[N]; Mode mode; } State;
typedef struct { State now; double promised; } Instance;

static const State START = {{0.0, 1.0, 0.0, 0.5, 0.0}, INSTANTIATED};

static void note(const char *function, const char *why) {
    const char *file = getenv("STRICT_LOG");
    FILE *out = file ? fopen(file, "a") : NULL;
    if (!out) return;
    fprintf(out, "%s: %s\n", function, why);
    fclose(out);
}

static fmi3Status broken(Instance *m, const char *function, const char *why) {
    note(function, why);
    m->now.mode = TERMINATED; /* as after every error */
    return fmi3Error;
}

#define ALLOW(modes) \
    Instance *m = instance; \
    if (!(m->now.mode & (modes))) return broken(m, __func__, "not allowed in this state")
#define FORBID(condition, why) if (condition) return broken(m, __func__, why)

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3InstantiateCoSimulationTYPE fmi3InstantiateCoSimulation;
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean eventMode, fmi3Boolean early, const fmi3ValueReference required[], size_t nRequired,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)resources, (void)visible, (void)logging, (void)required, (void)environment, (void)update;
    if (!name || !name[0] || strcmp(token, "{strict}") || !log || eventMode || early || nRequired) {
        note(__func__, "arguments");
        return NULL;
    }
    Instance *m = calloc(1, sizeof *m);
    m->now = START;
    m->promised = -HUGE_VAL;
    return m;
}

fmi3FreeInstanceTYPE fmi3FreeInstance;
void fmi3FreeInstance(fmi3Instance instance) {
    Instance *m = instance;
    if (m->now.mode == STEP) note(__func__, "not terminated");
    free(m);
}

fmi3EnterInitializationModeTYPE fmi3EnterInitializationMode;
fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean hasTolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean hasStop, fmi3Float64 stop) {
    (void)hasTolerance, (void)tolerance, (void)hasStop, (void)stop;
    ALLOW(INSTANTIATED);
    m->now.v[TIME] = start;
    m->now.mode = INITIALIZATION;
    return fmi3OK;
}

fmi3ExitInitializationModeTYPE fmi3ExitInitializationMode;
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    ALLOW(INITIALIZATION);
    m->now.mode = STEP;
    return fmi3OK;
}

fmi3TerminateTYPE fmi3Terminate;
fmi3Status fmi3Terminate(fmi3Instance instance) {
    ALLOW(STEP | DISCARDED);
    m->now.mode = TERMINATED;
    return fmi3OK;
}

fmi3ResetTYPE fmi3Reset;
fmi3Status fmi3Reset(fmi3Instance instance) {
    ALLOW(INITIALIZATION | STEP | DISCARDED | TERMINATED);
    m->now = START;
    m->promised = -HUGE_VAL;
    return fmi3OK;
}

fmi3GetFloat64TYPE fmi3GetFloat64;
fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                          size_t nValues) {
    ALLOW(INITIALIZATION | STEP | DISCARDED | TERMINATED);
    FORBID(n != nValues, "number of values");
    m->now.v[Y] = m->now.v[X] + m->now.v[U];
    for (size_t i = 0; i < n; i++) {
        FORBID(vr[i] >= N, "no such variable");
        values[i] = m->now.v[vr[i]];
    }
    return fmi3OK;
}

fmi3SetFloat64TYPE fmi3SetFloat64;
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 values[], size_t nValues) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP);
    FORBID(n != nValues, "number of values");
    for (size_t i = 0; i < n; i++) {
        FORBID(vr[i] == TIME || vr[i] >= Y, "no variable that can be set");
        FORBID(vr[i] == X && m->now.mode == STEP, "a state while running");
        if (!isfinite(values[i])) { /* by the importer's user, so no breach */
            m->now.mode = TERMINATED;
            return fmi3Error;
        }
        m->now.v[vr[i]] = values[i];
    }
    return fmi3OK;
}

fmi3DoStepTYPE fmi3DoStep;
fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 dt, fmi3Boolean noStateBefore,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    ALLOW(STEP);
    FORBID(!event || !terminate || !early || !last, "no place for an answer");
    FORBID(fabs(t - m->now.v[TIME]) > 1e-9 * fmax(1.0, fabs(t)), "not where the last step ended");
    if (dt <= 0) {
        m->now.mode = TERMINATED;
        return fmi3Error;
    }
    if (dt > 0.5) {
        m->now.mode = DISCARDED;
        return fmi3Discard;
    }
    double *v = m->now.v;
    v[X] += dt * (v[U] - v[P] * v[X]);
    *last = v[TIME] = t + dt;
    *event = *terminate = *early = false;
    if (noStateBefore) m->promised = v[TIME];
    return fmi3OK;
}

fmi3GetFMUStateTYPE fmi3GetFMUState;
fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP | DISCARDED | TERMINATED);
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &m->now, sizeof(State));
    return fmi3OK;
}

fmi3SetFMUStateTYPE fmi3SetFMUState;
fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP | DISCARDED | TERMINATED);
    FORBID(((State *)state)->v[TIME] < m->promised, "an earlier state, against the promise of the last step");
    memcpy(&m->now, state, sizeof(State));
    return fmi3OK;
}

fmi3FreeFMUStateTYPE fmi3FreeFMUState;
fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3SerializedFMUStateSizeTYPE fmi3SerializedFMUStateSize;
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size) {
    (void)instance, (void)state;
    *size = sizeof(State);
    return fmi3OK;
}

fmi3SerializeFMUStateTYPE fmi3SerializeFMUState;
fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    (void)instance;
    if (size < sizeof(State)) return fmi3Error;
    memcpy(bytes, state, sizeof(State));
    return fmi3OK;
}

fmi3DeserializeFMUStateTYPE fmi3DeserializeFMUState;
fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state) {
    (void)instance;
    if (size != sizeof(State)) return fmi3Error;
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi3OK;
}

#include "absent_fmi3.h"
