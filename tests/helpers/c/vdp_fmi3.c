/* Van der Pol oscillator as an FMI 3.0 co-simulation FMU, strict about the order of calls:
   x0' = x1, x1' = mu (1 - x0^2) x1 - x0 + u, in Runge-Kutta steps of at most 1 ms.
   "fault" makes a step end early (1), ask for the end (2) or fail for good (3). */

#include "fmi3FunctionTypes.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_STEP 1e-3   /* s */
#define TIME_ERROR 1e-9 /* s, between the time of the host and that of the FMU */

enum { TIME, X0, X1, X1_DOT, MU, U, FAULT, N_VALUES };
typedef enum { INSTANTIATED, INITIALIZATION, STEP, TERMINATED } Mode;

typedef struct {
    double v[N_VALUES];
    Mode mode;
} State;

typedef struct {
    State now;
    fmi3Boolean logging;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Vdp;

static const State START = {{0, 2, 0, 0, 1.5, 0, 0}, INSTANTIATED};

static fmi3Status refuse(Vdp *m, fmi3Status status, const char *format, ...) {
    char text[200];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (m->logging) m->log(m->environment, status, "logStatusError", text);
    return status;
}

static void derivatives(const double *v, const double *x, double *dx) {
    dx[0] = x[1];
    dx[1] = v[MU] * (1 - x[0] * x[0]) * x[1] - x[0] + v[U];
}

static void rk4(double *v, double h) {
    static const double AT[4] = {0, 0.5, 0.5, 1}, WEIGHT[4] = {1, 2, 2, 1};
    double sum[2] = {0, 0}, k[2] = {0, 0};
    for (int i = 0; i < 4; i++) {
        double x[2] = {v[X0] + AT[i] * h * k[0], v[X1] + AT[i] * h * k[1]};
        derivatives(v, x, k);
        for (int j = 0; j < 2; j++) sum[j] += WEIGHT[i] * k[j];
    }
    v[X0] += h / 6 * sum[0];
    v[X1] += h / 6 * sum[1];
}

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3InstantiateCoSimulationTYPE fmi3InstantiateCoSimulation;
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean eventMode, fmi3Boolean early, const fmi3ValueReference required[], size_t nRequired,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)name, (void)resources, (void)visible, (void)required, (void)nRequired, (void)update;
    Vdp *m = malloc(sizeof *m);
    *m = (Vdp){START, logging, environment, log};
    if (strcmp(token, "{vdp-of-the-tests}"))
        refuse(m, fmi3Error, "the instantiation token is '%s'", token);
    else if (eventMode || early)
        refuse(m, fmi3Error, "there is no event mode and no early return");
    else
        return m;
    free(m);
    return NULL;
}

fmi3FreeInstanceTYPE fmi3FreeInstance;
void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

fmi3ResetTYPE fmi3Reset;
fmi3Status fmi3Reset(fmi3Instance instance) {
    ((Vdp *)instance)->now = START;
    return fmi3OK;
}

fmi3EnterInitializationModeTYPE fmi3EnterInitializationMode;
fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stopDefined, fmi3Float64 stop) {
    (void)toleranceDefined, (void)tolerance, (void)stopDefined, (void)stop;
    Vdp *m = instance;
    if (m->now.mode != INSTANTIATED) return refuse(m, fmi3Error, "initialization out of turn");
    m->now.v[TIME] = start;
    m->now.mode = INITIALIZATION;
    return fmi3OK;
}

fmi3ExitInitializationModeTYPE fmi3ExitInitializationMode;
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    Vdp *m = instance;
    if (m->now.mode != INITIALIZATION) return refuse(m, fmi3Error, "end of initialization out of turn");
    m->now.mode = STEP;
    return fmi3OK;
}

fmi3TerminateTYPE fmi3Terminate;
fmi3Status fmi3Terminate(fmi3Instance instance) {
    ((Vdp *)instance)->now.mode = TERMINATED;
    return fmi3OK;
}

fmi3GetFloat64TYPE fmi3GetFloat64;
fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                          size_t nValues) {
    Vdp *m = instance;
    if (m->now.mode == INSTANTIATED) return refuse(m, fmi3Error, "read before initialization");
    if (n != nValues) return refuse(m, fmi3Error, "%zu values for %zu variables", nValues, n);
    double dx[2];
    derivatives(m->now.v, m->now.v + X0, dx);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= N_VALUES) return refuse(m, fmi3Error, "there is no variable %u", vr[i]);
        values[i] = vr[i] == X1_DOT ? dx[1] : m->now.v[vr[i]];
    }
    return fmi3OK;
}

fmi3SetFloat64TYPE fmi3SetFloat64;
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 values[], size_t nValues) {
    Vdp *m = instance;
    if (n != nValues) return refuse(m, fmi3Error, "%zu values for %zu variables", nValues, n);
    for (size_t i = 0; i < n; i++) {
        int running = m->now.mode == STEP, always = vr[i] == MU || vr[i] == U;
        if (vr[i] >= N_VALUES || vr[i] == TIME || vr[i] == X1_DOT || (running && !always))
            return refuse(m, fmi3Error, "variable %u cannot be set now", vr[i]);
        if (!isfinite(values[i])) return refuse(m, fmi3Error, "variable %u = %g is not finite", vr[i], values[i]);
        m->now.v[vr[i]] = values[i];
    }
    return fmi3OK;
}

fmi3DoStepTYPE fmi3DoStep;
fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 dt, fmi3Boolean noSetPrior,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    (void)noSetPrior;
    Vdp *m = instance;
    double *v = m->now.v;
    int fault = (int)v[FAULT];
    if (m->now.mode != STEP) return refuse(m, fmi3Error, "a step out of turn");
    if (!(dt > 0)) return refuse(m, fmi3Error, "a step of %g s is not positive", dt);
    if (fabs(t - v[TIME]) > TIME_ERROR) return refuse(m, fmi3Error, "a step from %g s at %g s", t, v[TIME]);
    if (fault == 3) return refuse(m, fmi3Fatal, "broken for good");
    if (fault == 1) dt /= 2;
    int steps = (int)ceil(dt / MAX_STEP - TIME_ERROR);
    for (int i = 0; i < steps; i++) rk4(v, dt / steps);
    v[TIME] = t + dt;
    *event = false;
    *early = fault == 1;
    *terminate = fault == 2;
    *last = v[TIME];
    if (fault == 2) refuse(m, fmi3Warning, "the oscillator is worn out");
    return fmi3OK;
}

typedef Vdp Instance;
#include "states_fmi3.h"

fmi3SerializedFMUStateSizeTYPE fmi3SerializedFMUStateSize;
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size) {
    (void)instance, (void)state;
    *size = sizeof(State);
    return fmi3OK;
}

fmi3SerializeFMUStateTYPE fmi3SerializeFMUState;
fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    if (size != sizeof(State)) return refuse(instance, fmi3Error, "a state of %zu bytes", size);
    memcpy(bytes, state, size);
    return fmi3OK;
}

fmi3DeserializeFMUStateTYPE fmi3DeserializeFMUState;
fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state) {
    if (size != sizeof(State)) return refuse(instance, fmi3Error, "a state of %zu bytes", size);
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, bytes, size);
    return fmi3OK;
}

#include "absent_fmi3.h"
