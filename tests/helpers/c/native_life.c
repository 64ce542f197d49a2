/* Instances of an FMU from making to freeing, linked to its sources: both kinds of simulation, saved states,
   derivatives, calls that are refused. Prints a state at the end of each life and how often it was refused. */

#if FMI_VERSION == 2

#include "fmi2Functions.h"

#define CALL(name) fmi2##name
#define STATE_CALL(verb) fmi2##verb##FMUstate
typedef fmi2Component Component;
typedef fmi2FMUstate State;
typedef char Byte;
#define SIZE_OF_STATE fmi2SerializedFMUstateSize

#else

#include "fmi3Functions.h"

#define CALL(name) fmi3##name
#define STATE_CALL(verb) fmi3##verb##FMUState
#define fmi3DeSerializeFMUState fmi3DeserializeFMUState
typedef fmi3Instance Component;
typedef fmi3FMUState State;
typedef fmi3Byte Byte;
#define SIZE_OF_STATE fmi3SerializedFMUStateSize

#endif

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { INSTANCES = 100, STEPS = 5 };
#define DT 2e-3
#define REFERENCE(place) (FIRST_REFERENCE + (place)) /* of the variable at a place of the description */

static int wrong = 0; /* answers that were not the expected ones */

static void expect(int status, int expected, int line) {
    if (status == expected) return;
    printf("line %d: status %d instead of %d\n", line, status, expected);
    wrong++;
}
#define EXPECT(status, call) expect((int)(call), status, __LINE__)
#define DONE(call) EXPECT(0, call)
#define REFUSED(call) EXPECT(3, call)

#if FMI_VERSION == 2

static void heard(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String c, fmi2String text, ...) {
    (void)name;
    (void)s;
    if (strlen(c) && strlen(text)) ++*(int *)e;
}

static Component made(int co_simulation, int *refusals) {
    fmi2CallbackFunctions functions = {heard, calloc, free, NULL, NULL};
    functions.componentEnvironment = refusals;
    return fmi2Instantiate("one", co_simulation ? fmi2CoSimulation : fmi2ModelExchange, TOKEN, "", &functions, 0, 0);
}

static int set(Component c, const unsigned *r, size_t n, const double *v) { return fmi2SetReal(c, r, n, v); }
static int get(Component c, const unsigned *r, size_t n, double *v) { return fmi2GetReal(c, r, n, v); }

static int begin(Component c) {
    int status = fmi2SetupExperiment(c, 0, 0, 0, 0, 0);
    return status ? status : (int)fmi2EnterInitializationMode(c);
}

static int step(Component c, double t, double dt) { return fmi2DoStep(c, t, dt, 1); }

static int slopes(Component c, double *dx, size_t n) { return fmi2GetDerivatives(c, dx, n); }

static int along(Component c, unsigned out, unsigned in, double *v) {
    double one = 1.0;
    return fmi2GetDirectionalDerivative(c, &out, 1, &in, 1, &one, v);
}

static void other_types(Component c) {
    unsigned r = REFERENCE(0);
    int i = 0;
    DONE(fmi2GetInteger(c, NULL, 0, NULL));
    REFUSED(fmi2GetInteger(c, &r, 1, &i));
    REFUSED(fmi2SetBoolean(c, &r, 1, &i));
    REFUSED(fmi2CancelStep(c));
}

static int updated(Component c) {
    fmi2EventInfo info;
    return fmi2NewDiscreteStates(c, &info);
}

#else

static void heard(fmi3InstanceEnvironment e, fmi3Status s, fmi3String c, fmi3String text) {
    (void)s;
    if (strlen(c) && strlen(text)) ++*(int *)e;
}

static Component made(int co_simulation, int *refusals) {
    if (!co_simulation) return fmi3InstantiateModelExchange("one", TOKEN, "", 0, 0, refusals, heard);
    return fmi3InstantiateCoSimulation("one", TOKEN, "", 0, 0, 0, 0, NULL, 0, refusals, heard, NULL);
}

static int set(Component c, const unsigned *r, size_t n, const double *v) { return fmi3SetFloat64(c, r, n, v, n); }
static int get(Component c, const unsigned *r, size_t n, double *v) { return fmi3GetFloat64(c, r, n, v, n); }

static int begin(Component c) { return fmi3EnterInitializationMode(c, 0, 0, 0, 0, 0); }

static int step(Component c, double t, double dt) {
    fmi3Boolean event, end, early;
    double last;
    return fmi3DoStep(c, t, dt, 1, &event, &end, &early, &last);
}

static int slopes(Component c, double *dx, size_t n) { return fmi3GetContinuousStateDerivatives(c, dx, n); }

static int along(Component c, unsigned out, unsigned in, double *v) {
    double one = 1.0, back;
    int status = fmi3GetDirectionalDerivative(c, &out, 1, &in, 1, &one, 1, v, 1);
    DONE(fmi3GetAdjointDerivative(c, &out, 1, &in, 1, &one, 1, &back, 1));
    if (!(fabs(back - *v) <= 1e-9 * fabs(*v))) wrong++;
    return status;
}

static void other_types(Component c) {
    unsigned r = REFERENCE(0);
    int32_t i = 0;
    bool on = false;
    DONE(fmi3GetInt32(c, NULL, 0, NULL, 0));
    REFUSED(fmi3GetInt32(c, &r, 1, &i, 1));
    REFUSED(fmi3SetBoolean(c, &r, 1, &on, 1));
    REFUSED(fmi3EnterConfigurationMode(c));
}

static int updated(Component c) {
    fmi3Boolean again, end, nominals, states, defined;
    double next;
    return fmi3UpdateDiscreteStates(c, &again, &end, &nominals, &states, &defined, &next);
}

#endif

static void saved_and_restored(Component c) {
    State one = NULL, two = NULL;
    size_t size = 0;
    DONE(STATE_CALL(Get)(c, &one));
    DONE(STATE_CALL(Get)(c, &one)); /* into the same */
    DONE(SIZE_OF_STATE(c, one, &size));
    Byte *bytes = malloc(size);
    DONE(STATE_CALL(Serialize)(c, one, bytes, size));
    REFUSED(STATE_CALL(Serialize)(c, one, bytes, size - 1));
    DONE(STATE_CALL(DeSerialize)(c, bytes, size, &two));
    REFUSED(STATE_CALL(DeSerialize)(c, bytes, size - 1, &two));
    bytes[0] ^= 1;
    REFUSED(STATE_CALL(DeSerialize)(c, bytes, size, &two));
    free(bytes);
    DONE(STATE_CALL(Set)(c, two));
    REFUSED(STATE_CALL(Set)(c, NULL));
    DONE(STATE_CALL(Free)(c, &one));
    DONE(STATE_CALL(Free)(c, &two));
    DONE(STATE_CALL(Free)(c, &two));
}

static void refused(Component c) {
    unsigned unknown = 100000, output = REFERENCE(FIRST_OUTPUT), input = REFERENCE(FIRST_INPUT);
    double value = 0.0, nan_value = NAN;
    REFUSED(get(c, &unknown, 1, &value));
    REFUSED(set(c, &unknown, 1, &value));
    REFUSED(set(c, &output, 1, &value));
    REFUSED(set(c, &input, 1, &nan_value));
    REFUSED(set(c, &input, 1, NULL));
    REFUSED(step(NULL, 0, DT));
    other_types(c);
}

static void all_read(Component c) {
    for (unsigned i = 0; i < N_VARIABLES; i++) {
        unsigned r = REFERENCE(i);
        double v = NAN;
        DONE(get(c, &r, 1, &v));
        if (!isfinite(v)) wrong++;
    }
}

static double co_simulated(Component c) {
    unsigned state = REFERENCE(0), input = REFERENCE(FIRST_INPUT);
    double x = 0.1, y, u = 1.0;
    DONE(set(c, &state, 1, &x));
    DONE(begin(c));
    DONE(CALL(ExitInitializationMode)(c));
    for (int k = 0; k < STEPS; k++) {
        DONE(set(c, &input, 1, &u));
        DONE(step(c, k * DT, DT));
        all_read(c);
    }
    saved_and_restored(c);
    refused(c);
    REFUSED(step(c, STEPS * DT, -DT));
    DONE(step(c, STEPS * DT, DT));
    REFUSED(step(c, 0, DT));
    DONE(along(c, REFERENCE(FIRST_OUTPUT), REFERENCE(FIRST_INPUT), &y));
    DONE(get(c, &state, 1, &y));
    return y;
}

static double exchanged(Component c) {
    double x[N_STATES], dx[N_STATES];
    DONE(begin(c));
    DONE(CALL(ExitInitializationMode)(c));
    DONE(updated(c));
    DONE(CALL(EnterContinuousTimeMode)(c));
    DONE(CALL(GetContinuousStates)(c, x, N_STATES));
    for (int k = 0; k < STEPS; k++) {
        DONE(CALL(SetTime)(c, k * DT));
        DONE(slopes(c, dx, N_STATES));
        for (int i = 0; i < N_STATES; i++) x[i] += 1e-6 * dx[i];
        DONE(CALL(SetContinuousStates)(c, x, N_STATES));
        all_read(c);
    }
    REFUSED(slopes(c, dx, N_STATES + 1));
    REFUSED(step(c, 0, DT));
    saved_and_restored(c);
    refused(c);
    return x[0];
}

int main(void) {
    Component all[INSTANCES];
    double end[INSTANCES];
    int refusals = 0;
    for (int i = 0; i < INSTANCES; i++) all[i] = made(i % 2, &refusals);
    for (int life = 0; life < 2; life++)
        for (int i = 0; i < INSTANCES; i++) {
            if (life) DONE(CALL(Reset)(all[i]));
            end[i] = i % 2 ? co_simulated(all[i]) : exchanged(all[i]);
            if (end[i] != end[i % 2]) wrong++;
            DONE(CALL(Terminate)(all[i]));
        }
    for (int i = 0; i < INSTANCES; i++) CALL(FreeInstance)(all[i]);
    CALL(FreeInstance)(NULL);
    printf("%.17g %.17g, refusals heard %d, wrong %d\n", end[0], end[1], refusals, wrong);
    return wrong != 0;
}
