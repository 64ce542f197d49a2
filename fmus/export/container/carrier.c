/* An FMI 2.0 co-simulation FMU that carries another FMU and laws around it, without Python.

   It takes the coupling steps of the slave in Python (runtime/coupled.py): read the motion at the ports, set
   what the laws give for the middle of the step, step, update the memory of the laws. */

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
#define SYMBOL(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define SYMBOL(library, name) dlsym(library, name)
#endif

#include "carrier.h"

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#define CASADI_SYMBOL_EXPORT static
#include "laws.c"
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include "fmi2Functions.h"
#include "fmi3FunctionTypes.h"

#define AT_LEAST_1(n) ((n) > 0 ? (n) : 1)
#define TIME_TOLERANCE 1e-9 /* of a coupling step, so that a whole number of them is seen as one */
enum { WARNING = 1, PATH = 4096 };

/* The functions of the carried FMU that are called, by their role here. */
#if BASE_EXCHANGE
#define STEPPING(EACH)                                                                                            \
    EACH(event, EnterEventMode) EACH(go_on, EnterContinuousTimeMode) EACH(completed, CompletedIntegratorStep)     \
    EACH(set_time, SetTime) EACH(set_states, SetContinuousStates) EACH(states, GetContinuousStates)               \
    EACH(nominals, GetNominalsOfContinuousStates) EACH(indicators, GetEventIndicators)
#else
#define STEPPING(EACH) EACH(step, DoStep)
#endif
#define USUAL(EACH)                                                                                               \
    EACH(reset, Reset) EACH(enter, EnterInitializationMode) EACH(leave, ExitInitializationMode)                   \
    EACH(terminate, Terminate) EACH(free, FreeInstance) STEPPING(EACH)
#if BASE_FMI == 2
#define OF_BASE(name) fmi2##name
#if BASE_EXCHANGE
#define OWN(EACH) EACH(slopes, GetDerivatives) EACH(update, NewDiscreteStates)
#else
#define OWN(EACH)
#endif
#define FUNCTIONS(EACH)                                                                                           \
    EACH(get, GetReal) EACH(set, SetReal) EACH(setup, SetupExperiment) EACH(instantiate, Instantiate)             \
    USUAL(EACH) OWN(EACH)
#else
#define OF_BASE(name) fmi3##name
#if BASE_EXCHANGE
#define OWN(EACH)                                                                                                 \
    EACH(slopes, GetContinuousStateDerivatives) EACH(update, UpdateDiscreteStates)                                \
    EACH(instantiate, InstantiateModelExchange)
#else
#define OWN(EACH) EACH(instantiate, InstantiateCoSimulation)
#endif
#define FUNCTIONS(EACH) EACH(get, GetFloat64) EACH(set, SetFloat64) USUAL(EACH) OWN(EACH)
#endif

typedef struct {
    void *base;
    const fmi2CallbackFunctions *host;
    char name[128];
    double values[N_VALUES];
    bool touched[N_VALUES]; /* settable variables whose value the carried FMU must be told */
    bool failed, running, ended, entered, stepped, seen; /* ended: terminated; seen: the motion is that of now */
    double start, time; /* s, beginning of the simulation and of its last step */
    double tolerance, stop; /* of the carried FMU, and s; below 0 and HUGE_VAL where the importer states none */
    double last, since; /* s, length of the last step; time from `earlier` to `motion`, HUGE_VAL for none */
    double earlier[AT_LEAST_1(N_MOTION)], before[AT_LEAST_1(N_MOTION)], motion[AT_LEAST_1(N_MOTION)];
    double told[AT_LEAST_1(N_TOLD)];
    double memory[AT_LEAST_1(N_MEMORY)];
    const double *arg[AT_LEAST_1(WORK_ARG)];
    double *res[AT_LEAST_1(WORK_RES)];
    int iw[AT_LEAST_1(WORK_IW)];
    double w[AT_LEAST_1(WORK_W)];
#if BASE_EXCHANGE
    double x[AT_LEAST_1(N_X)], nominal[AT_LEAST_1(N_X)]; /* its states, now and usually */
    double z[AT_LEAST_1(N_Z)], next[AT_LEAST_1(N_Z)];    /* its event indicators, at the start and end of a part */
    double jacobian[AT_LEAST_1(N_X * N_X)], factors[AT_LEAST_1(N_X * N_X)];
    int pivot[AT_LEAST_1(N_X)];
    bool known; /* the Jacobian of now */
    bool over;  /* whether it has asked for the end */
    double due; /* s, the next event of time */
    char why[160];
#endif
#define FIELD(role, function) OF_BASE(function##TYPE) *role;
    FUNCTIONS(FIELD)
} Instance;

#define ME(c) ((Instance *)(c))

static void *LIBRARY; /* of the carried FMU, the same for all instances */

static fmi2Status refuse(Instance *m, fmi2Status status, const char *format, ...) {
    char said[800];
    va_list given;
    va_start(given, format);
    vsnprintf(said, sizeof said, format, given);
    va_end(given);
    m->host->logger(m->host->componentEnvironment, m->name, status, "logStatusError", "%s", said);
    return status;
}

/* ---- calls of the carried FMU ---- */

static int get_base(Instance *m, const unsigned *references, size_t n, double *values) {
#if BASE_FMI == 2
    return n ? (int)m->get(m->base, references, n, values) : 0;
#else
    return n ? (int)m->get(m->base, references, n, values, n) : 0;
#endif
}

static int set_base(Instance *m, const unsigned *references, size_t n, const double *values) {
#if BASE_FMI == 2
    return n ? (int)m->set(m->base, references, n, values) : 0;
#else
    return n ? (int)m->set(m->base, references, n, values, n) : 0;
#endif
}

#if BASE_EXCHANGE
#include "exchange.c"
#else
static int step_base(Instance *m, double t, double dt) {
#if BASE_FMI == 2
    return (int)m->step(m->base, t, dt, fmi2True);
#else
    fmi3Boolean event = false, ends = false, early = false;
    fmi3Float64 reached = t;
    int status = (int)m->step(m->base, t, dt, fmi3True, &event, &ends, &early, &reached);
    return ends || early ? (int)fmi2Error : status;
#endif
}

static int leave_base(Instance *m) { return (int)m->leave(m->base); }
#endif

static int enter_base(Instance *m) {
    bool exact = m->tolerance >= 0, ends = m->stop < HUGE_VAL;
#if BASE_FMI == 2
    int status = (int)m->setup(m->base, exact, exact ? m->tolerance : 0.0, m->start, ends, ends ? m->stop : 0.0);
    return status > WARNING ? status : (int)m->enter(m->base);
#else
    return (int)m->enter(m->base, exact, exact ? m->tolerance : 0.0, m->start, ends, ends ? m->stop : 0.0);
#endif
}

#if BASE_FMI == 3
static void heard(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    Instance *m = environment;
    (void)category;
    m->host->logger(m->host->componentEnvironment, m->name, (fmi2Status)status, "logStatusError", "%s",
                    message ? message : "");
}
#endif

/* The folder of the carried FMU from the URI of the resources; false where it is too long. */
static bool folder_of(const char *uri, char *folder) {
    size_t n = 0;
    const char *from = strncmp(uri, "file:", 5) ? uri : uri + 5;
#ifdef _WIN32
    if (!strncmp(from, "//localhost/", 12)) from += 11;
    if (!strncmp(from, "///", 3)) from += 2;
    if (!strncmp(from, "//", 2) && from[2] && from[3] == ':') from += 2; /* as some importers write a drive */
    if (from != uri && from[0] == '/' && from[1] && from[2] == ':') from++;
#else
    if (from != uri && !strncmp(from, "//", 2)) /* an authority, which may be empty */
        for (from += 2; *from && *from != '/';) from++;
#endif
    for (; *from && n < PATH - 1; from++) {
        char code[3] = {0};
        if (*from == '%' && isxdigit((unsigned char)from[1]) && isxdigit((unsigned char)from[2])) {
            memcpy(code, from + 1, 2);
            folder[n++] = (char)strtol(code, NULL, 16);
            from += 2;
        } else {
            folder[n++] = *from;
        }
    }
    folder[n] = '\0';
    return !*from && n + sizeof "/base/" BASE_LIBRARY + sizeof "/base/resources/" < PATH;
}

/* The library at a path in UTF-8. */
static void *opened(const char *path) {
#ifdef _WIN32
    WCHAR wide[PATH];
    if (!MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, PATH)) return NULL;
    for (WCHAR *c = wide; *c; c++)
        if (*c == L'/') *c = L'\\';
    return (void *)LoadLibraryExW(wide, NULL, LOAD_WITH_ALTERED_SEARCH_PATH); /* with what lies beside it */
#else
    return dlopen(path, RTLD_NOW | RTLD_LOCAL);
#endif
}

/* ---- the laws ---- */

/* Read the motion at the ports; once between two steps where no input acts on it directly, for a carried FMU
   may compute all of its outputs anew after every input. */
static int see(Instance *m) {
    if (m->seen) return 0;
    int status = get_base(m, MOTION, N_MOTION, m->motion);
    m->seen = MOTION_IS_STATE && status <= WARNING;
    return status;
}

/* Set what the laws give, for the middle of a step of length dt. */
static int by_the_laws(Instance *m, double dt) {
    if (!N_TOLD) return 0;
    m->arg[0] = m->earlier;
    m->arg[1] = m->motion;
    m->arg[2] = m->values;
    m->arg[3] = &dt;
    m->arg[4] = &m->since;
    m->res[0] = m->told;
    if (push(m->arg, m->res, m->iw, m->w, 0)) return (int)fmi2Error;
    return set_base(m, TOLD, N_TOLD, m->told);
}

static int remember(Instance *m, double dt) {
    if (!N_MEMORY) return 0;
    m->arg[0] = m->before;
    m->arg[1] = m->motion;
    m->arg[2] = m->values;
    m->arg[3] = &dt;
    m->res[0] = m->memory;
    if (go_on(m->arg, m->res, m->iw, m->w, 0)) return (int)fmi2Error;
    memcpy(m->values + FIRST_MEMORY, m->memory, N_MEMORY * sizeof(double));
    return 0;
}

/* Tell the carried FMU the values of some of the settable variables. */
static int pass_on(Instance *m, const bool *some) {
    unsigned references[AT_LEAST_1(N_SET)];
    double values[AT_LEAST_1(N_SET)];
    size_t n = 0;
    for (size_t i = 0; i < N_SET; i++)
        if (some[i] && PASSED[i]) {
            references[n] = REFERENCES[i];
            values[n++] = m->values[i];
        }
    return set_base(m, references, n, values);
}

/* ---- FMI 2.0 ---- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

static void begin(Instance *m) {
    memcpy(m->values, START, sizeof START);
    memset(m->touched, 0, sizeof m->touched);
    memset(m->earlier, 0, sizeof m->earlier);
    memset(m->motion, 0, sizeof m->motion);
    m->since = HUGE_VAL;
    m->failed = m->running = m->ended = m->stepped = m->seen = false;
#if BASE_EXCHANGE
    *m->why = '\0';
    m->over = false;
#endif
}

#define TEXT_OF(name) #name
#define IN_TEXT(name) TEXT_OF(name)
#define FIND(role, function)                                                                                      \
    if (!(m->role = (OF_BASE(function##TYPE) *)SYMBOL(LIBRARY, IN_TEXT(OF_BASE(function)))))                      \
        return refuse(m, fmi2Error, "the carried FMU has no function %s", IN_TEXT(OF_BASE(function))), false;

static bool found(Instance *m) {
    FUNCTIONS(FIND)
    return true;
}

static bool carried(Instance *m, const char *uri) {
    char path[PATH], resources[PATH + sizeof "/base/resources/"];
    if (!folder_of(uri, path)) return refuse(m, fmi2Error, "the path of its resources is too long"), false;
    size_t n = strlen(path);
#if BASE_FMI == 2
    snprintf(resources, sizeof resources, "%s/base/resources", uri);
#else
    snprintf(resources, sizeof resources, "%s/base/resources/", path);
#endif
    snprintf(path + n, sizeof path - n, "/base/%s", BASE_LIBRARY);
    if (!(LIBRARY = opened(path)))
        return refuse(m, fmi2Error, "the carried FMU cannot be loaded: %s", path), false;
    if (!found(m)) return false;
#if BASE_FMI == 2
    fmi2Type kind = BASE_EXCHANGE ? fmi2ModelExchange : fmi2CoSimulation;
    m->base = m->instantiate(m->name, kind, BASE_TOKEN, resources, m->host, fmi2False, fmi2True);
#else
#if BASE_EXCHANGE
    m->base = m->instantiate(m->name, BASE_TOKEN, resources, fmi3False, fmi3True, m, heard);
#else
    m->base = m->instantiate(m->name, BASE_TOKEN, resources, fmi3False, fmi3True, fmi3False, fmi3False, NULL, 0, m,
                             heard, NULL);
#endif
#endif
    if (!m->base) refuse(m, fmi2Error, "the carried FMU cannot be instantiated");
    return m->base != NULL;
}

void fmi2FreeInstance(fmi2Component c) {
    if (c && ME(c)->base) ME(c)->free(ME(c)->base);
    free(c); /* the library of the carried FMU stays loaded: its other instances may use it */
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)visible, (void)logging;
    if (!functions || !functions->logger || !name || !guid || !resources) return NULL;
    Instance *m = calloc(1, sizeof(Instance));
    if (!m) return NULL;
    m->host = functions;
    m->tolerance = -1.0;
    m->stop = HUGE_VAL;
    snprintf(m->name, sizeof m->name, "%s", name);
    begin(m);
    bool fits = type == fmi2CoSimulation && !strcmp(guid, TOKEN);
    if (!fits) refuse(m, fmi2Error, "the guid or the type is not that of this FMU");
    if (!fits || !carried(m, resources)) {
        fmi2FreeInstance(m);
        return NULL;
    }
    return m;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    ME(c)->start = start;
    ME(c)->tolerance = tolerance_defined ? tolerance : -1.0;
    ME(c)->stop = stop_defined ? stop : HUGE_VAL;
    return fmi2OK;
}

static fmi2Status answer(Instance *m, int status, const char *call) {
    if (status <= WARNING) return fmi2OK;
    m->failed = true;
#if BASE_EXCHANGE
    if (*m->why) return refuse(m, fmi2Error, "%s: the carried FMU fails: %s", call, m->why);
#endif
    return refuse(m, fmi2Error, "%s: the carried FMU answers with status %d", call, status);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Instance *m = c;
    int status = m->entered ? (int)m->reset(m->base) : 0; /* no state but that of a new instance before */
    m->entered = true;
    if (status <= WARNING) status = pass_on(m, m->touched);
    if (status <= WARNING) status = by_the_laws(m, 0.0);
    if (status <= WARNING) status = enter_base(m);
    return answer(m, status, __func__);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *m = c;
    int status = pass_on(m, INPUTS);
    m->since = HUGE_VAL;
    if (status <= WARNING) status = get_base(m, MOTION, N_MOTION, m->motion);
    if (status <= WARNING) status = by_the_laws(m, 0.0);
    if (status <= WARNING) status = leave_base(m);
    m->running = status <= WARNING;
    return answer(m, status, __func__);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    Instance *m = c;
    m->ended = true;
    return m->running && !m->failed ? answer(m, (int)m->terminate(m->base), __func__) : fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    begin(ME(c));
    return fmi2OK;
}

/* Read some variables of the carried FMU to their places; after a step they must be finite. */
static fmi2Status read_base(Instance *m, const unsigned *references, const size_t *places, size_t n, double *value) {
    double read[N_VALUES];
    int status = get_base(m, references, n, read);
    if (status > WARNING) return answer(m, status, "fmi2GetReal");
    for (size_t k = 0; k < n; k++) {
        if (m->stepped && !isfinite(read[k]))
            return refuse(m, fmi2Discard, "the carried FMU is no longer finite after t = %g s", m->time);
        value[places[k]] = read[k];
    }
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Instance *m = c;
    unsigned references[N_VALUES];
    size_t places[N_VALUES], asked = 0;
    for (size_t k = 0; k < n; k++) {
        unsigned i = vr[k];
        if (i >= N_VALUES) return refuse(m, fmi2Error, "there is no variable with reference %u", i);
        value[k] = m->values[i];
        if (!m->running || (i >= FIRST_MEMORY && i < N_SET)) continue;
        if (asked == N_VALUES) { /* one of them is asked for twice */
            fmi2Status status = read_base(m, references, places, asked, value);
            if (status != fmi2OK) return status;
            asked = 0;
        }
        references[asked] = REFERENCES[i];
        places[asked++] = k;
    }
    fmi2Status status = asked ? read_base(m, references, places, asked, value) : fmi2OK;
    if (!asked || status != fmi2OK || !MOTION_IS_STATE) return status;
    return answer(m, see(m), __func__); /* while the outputs are computed */
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Instance *m = c;
    unsigned references[AT_LEAST_1(N_SET)];
    double values[AT_LEAST_1(N_SET)];
    size_t passed = 0;
    bool at_once = m->running && !m->failed, laws = false;
    int status = 0;
    for (size_t k = 0; k < n; k++) {
        unsigned i = vr[k];
        if (i >= N_SET) return refuse(m, fmi2Error, "the variable with reference %u is computed and cannot be set", i);
        if (!(value[k] >= LEAST[i] && value[k] <= MOST[i]))
            return refuse(m, fmi2Error, "%s = %g is outside %g to %g", NAMES[i], value[k], LEAST[i], MOST[i]);
        m->values[i] = value[k];
        if (!at_once) m->touched[i] = true;
        if (!INPUTS[i]) {
            m->seen = false;
            m->since = HUGE_VAL; /* it moves otherwise than before */
        }
        if (!PASSED[i]) laws = true;
        if (!at_once || !PASSED[i]) continue;
        if (passed == N_SET) { /* one of them is set twice */
            if (status <= WARNING) status = set_base(m, references, passed, values);
            passed = 0;
        }
        references[passed] = REFERENCES[i];
        values[passed++] = value[k];
    }
    if (!at_once) return fmi2OK;
    if (status <= WARNING) status = set_base(m, references, passed, values);
    if (laws) {
        if (status <= WARNING) status = see(m);
        if (status <= WARNING) status = by_the_laws(m, 0.0);
    }
    return answer(m, status, __func__);
}

/* The accelerations after a step of length dt from `before` on: those over this step, but over the step before
   too where this one is much shorter, for a difference over little time is inaccurate. */
static void went(Instance *m, double dt) {
    if (m->since < HUGE_VAL && dt < m->last / 2) {
        m->since += dt;
    } else {
        memcpy(m->earlier, m->before, sizeof m->before);
        m->since = dt;
    }
    m->last = dt;
}

/* Coupling steps, as many as `duration` needs; the status of the first call that was refused. */
static int advance(Instance *m, double t, double duration) {
    bool single = duration <= LONGEST_STEP * (1 + TIME_TOLERANCE / 2); /* as the general case finds, slowly */
    double steps = single ? 1.0 : fmax(1.0, ceil(duration / LONGEST_STEP - TIME_TOLERANCE)), dt = duration / steps;
    int status = N_TOLD || N_MEMORY ? see(m) : 0;
    for (double k = 0; k < steps && status <= WARNING; k++) {
        status = by_the_laws(m, dt);
        if (status <= WARNING) status = step_base(m, t + k * dt, dt);
        m->seen = false;
        memcpy(m->before, m->motion, sizeof m->motion);
        went(m, dt);
        if (!N_MEMORY && (!N_TOLD || k + 1 == steps)) continue; /* nobody asks yet how it moves */
        if (status <= WARNING) status = see(m);
        if (status <= WARNING) status = remember(m, dt);
    }
    return status;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real duration, fmi2Boolean no_state_before) {
    Instance *m = c;
    (void)no_state_before;
    if (m->failed) return refuse(m, fmi2Error, "it failed before; reset it");
    if (!m->running || m->ended) return refuse(m, fmi2Error, "it is not initialised, or terminated; reset it");
    if (!(duration > 0 && duration < HUGE_VAL)) return refuse(m, fmi2Error, "step size %g s is not positive", duration);
    int status = advance(m, t, duration);
    m->stepped = true;
    m->time = t;
    if (status <= WARNING) return fmi2OK;
    m->failed = true;
#if BASE_EXCHANGE
    if (*m->why) return refuse(m, fmi2Discard, "the carried FMU cannot make the step at t = %g s: %s", t, m->why);
#endif
    return refuse(m, fmi2Discard, "the carried FMU cannot make the step at t = %g s (status %d)", t, status);
}

#define NONE_OF_TYPE(type)                                                                                    \
    fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##type value[]) {  \
        (void)vr, (void)value;                                                                                \
        return n ? refuse(ME(c), fmi2Error, "there are Real variables only") : fmi2OK;                        \
    }                                                                                                         \
    fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference vr[], size_t n,                        \
                             const fmi2##type value[]) {                                                      \
        (void)vr, (void)value;                                                                                \
        return n ? refuse(ME(c), fmi2Error, "there are Real variables only") : fmi2OK;                        \
    }

NONE_OF_TYPE(Integer)
NONE_OF_TYPE(Boolean)
NONE_OF_TYPE(String)

#define NOT_HERE(name, ...)                                                    \
    fmi2Status name(fmi2Component c, __VA_ARGS__) {                            \
        return refuse(ME(c), fmi2Error, "this FMU does not offer " #name);     \
    }

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
NOT_HERE(fmi2GetFMUstate, fmi2FMUstate *state)
NOT_HERE(fmi2SetFMUstate, fmi2FMUstate state)
NOT_HERE(fmi2FreeFMUstate, fmi2FMUstate *state)
NOT_HERE(fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t *size)
NOT_HERE(fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
NOT_HERE(fmi2DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
NOT_HERE(fmi2GetDirectionalDerivative, const fmi2ValueReference unknowns[], size_t n_unknown,
         const fmi2ValueReference knowns[], size_t n_known, const fmi2Real in[], fmi2Real out[])
NOT_HERE(fmi2SetRealInputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
         const fmi2Real value[])
NOT_HERE(fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
         fmi2Real value[])
NOT_HERE(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *value)
NOT_HERE(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *value)
NOT_HERE(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *value)
NOT_HERE(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *value)
NOT_HERE(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *value)

fmi2Status fmi2CancelStep(fmi2Component c) { return refuse(ME(c), fmi2Error, "there is no step to cancel"); }

/* A carried PythonFMU drops its interpreter when the host says so. */
FMI2_Export void finalizePythonInterpreter(void) {
    if (LIBRARY) {
        void (*release)(void) = (void (*)(void))SYMBOL(LIBRARY, "finalizePythonInterpreter");
        if (release) release();
    }
}
