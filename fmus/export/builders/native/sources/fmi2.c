/* The functions of FMI 2.0, in the order of its header: each hands on to what both versions share. */

#define ME(c) ((Instance *)(c))

/* The logger formats what it is given, so a percent sign must be two. */
static void tell(const Instance *m, Status status, const char *text) {
    char format[800];
    size_t n = 0;
    for (; *text && n < sizeof format - 2; text++) {
        if (*text == '%') format[n++] = '%';
        format[n++] = *text;
    }
    format[n] = '\0';
    m->log(m->environment, m->name, (fmi2Status)status, CATEGORIES[status == DISCARD], format);
}

static fmi2Status answer(Status status) { return (fmi2Status)status; }

/* ---- inquiry, life ---- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    if (!allowed(ME(c), __func__, ANY_MODE)) return fmi2Error;
    return answer(set_logging(ME(c), __func__, on != fmi2False, n, categories));
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources;
    (void)visible;
    (void)logging;
    if (!functions || !functions->logger) return NULL;
    if (!name_and_token_fit(functions->logger, functions->componentEnvironment, name, guid)) return NULL;
    Kind kind = type == fmi2CoSimulation ? CO_SIMULATION : MODEL_EXCHANGE;
    return instance(name, kind, functions->logger, functions->componentEnvironment);
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    (void)tolerance_defined;
    (void)tolerance;
    (void)stop_defined;
    (void)stop;
    if (!allowed(ME(c), __func__, INSTANTIATED)) return fmi2Error;
    return answer(set_start_time(ME(c), __func__, start));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return answer(enter_mode(ME(c), __func__, INSTANTIATED, INITIALIZATION));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return answer(leave_initialization(ME(c), __func__)); }

fmi2Status fmi2Terminate(fmi2Component c) { return answer(enter_mode(ME(c), __func__, RUNNING, TERMINATED)); }

fmi2Status fmi2Reset(fmi2Component c) { return answer(reset(ME(c), __func__)); }

/* ---- values: all variables are Real ---- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    return answer(get_values(ME(c), __func__, vr, n, value));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    return answer(set_values(ME(c), __func__, vr, n, value));
}

static fmi2Status none_of_type(const Instance *m, const char *call, size_t n) {
    if (!allowed(m, call, ANY_MODE)) return fmi2Error;
    return n ? answer(refuse(m, ERROR, "%s: there are Real variables only", call)) : fmi2OK;
}

#define NONE_OF_TYPE(type)                                                                                    \
    fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##type value[]) {  \
        (void)vr;                                                                                             \
        (void)value;                                                                                          \
        return none_of_type(ME(c), __func__, n);                                                              \
    }                                                                                                         \
    fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference vr[], size_t n,                        \
                             const fmi2##type value[]) {                                                      \
        (void)vr;                                                                                             \
        (void)value;                                                                                          \
        return none_of_type(ME(c), __func__, n);                                                              \
    }

NONE_OF_TYPE(Integer)
NONE_OF_TYPE(Boolean)
NONE_OF_TYPE(String)

/* ---- the state of the FMU, derivatives ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) { return answer(save(ME(c), __func__, state)); }

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return answer(restore(ME(c), __func__, state)); }

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) { return answer(forget(ME(c), __func__, state)); }

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    return answer(saved_size(ME(c), __func__, state, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    return answer(to_bytes(ME(c), __func__, state, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    return answer(from_bytes(ME(c), __func__, bytes, size, state));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknown,
                                        const fmi2ValueReference knowns[], size_t n_known, const fmi2Real in[],
                                        fmi2Real out[]) {
    return answer(forward_derivative(ME(c), __func__, unknowns, n_unknown, knowns, n_known, in, out));
}

/* ---- model exchange: there are no events ---- */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    return answer(enter_mode(ME(c), __func__, EVENT | CONTINUOUS, EVENT));
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    static const fmi2EventInfo NOTHING = {fmi2False, fmi2False, fmi2False, fmi2False, fmi2False, 0.0};
    if (!allowed(ME(c), __func__, EVENT) || !given(ME(c), __func__, info)) return fmi2Error;
    *info = NOTHING;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    return answer(enter_mode(ME(c), __func__, EVENT, CONTINUOUS));
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_return, fmi2Boolean *event, fmi2Boolean *end) {
    (void)no_return;
    if (!allowed(ME(c), __func__, CONTINUOUS)) return fmi2Error;
    if (!given(ME(c), __func__, event) || !given(ME(c), __func__, end)) return fmi2Error;
    *event = *end = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { return answer(set_time(ME(c), __func__, time)); }

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    return answer(set_states(ME(c), __func__, x, n));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real dx[], size_t n) {
    return answer(get_slopes(ME(c), __func__, dx, n));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t n) {
    (void)indicators;
    if (!allowed(ME(c), __func__, COMPUTABLE)) return fmi2Error;
    return n ? answer(refuse(ME(c), ERROR, "%s: there are no event indicators", __func__)) : fmi2OK;
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    return answer(get_states(ME(c), __func__, x, n));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t n) {
    return answer(get_nominals(ME(c), __func__, nominals, n));
}

/* ---- co-simulation: steps are made at once, inputs held or linear ---- */

static fmi2Status not_offered(const Instance *m, const char *call, const char *what) {
    return m ? answer(refuse(m, ERROR, "%s: %s", call, what)) : fmi2Error;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    return answer(set_rates(ME(c), __func__, vr, n, order, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr;
    (void)n;
    (void)order;
    (void)value;
    return not_offered(ME(c), __func__, "output derivatives are not offered (maxOutputDerivativeOrder = 0)");
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real duration, fmi2Boolean no_return) {
    (void)no_return;
    return answer(do_step(ME(c), __func__, time, duration));
}

fmi2Status fmi2CancelStep(fmi2Component c) { return not_offered(ME(c), __func__, "no step is ever pending"); }

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind;
    (void)value;
    return not_offered(ME(c), __func__, "no step is ever pending");
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return not_offered(ME(c), __func__, "only the last successful time is known");
    if (!allowed(ME(c), __func__, COMPUTABLE) || !given(ME(c), __func__, value)) return fmi2Error;
    *value = ME(c)->now.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)kind;
    (void)value;
    return not_offered(ME(c), __func__, "there is no status of this type");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated) return not_offered(ME(c), __func__, "only whether it terminated is known");
    if (!allowed(ME(c), __func__, COMPUTABLE) || !given(ME(c), __func__, value)) return fmi2Error;
    *value = fmi2False; /* a step never ends the simulation */
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)kind;
    (void)value;
    return not_offered(ME(c), __func__, "no step is ever pending");
}
