/* The functions of FMI 3.0, in the order of its header: each hands on to what both versions share.
   Those for what this FMU has not are in fmi3_absent.c. */

#define ME(instance) ((Instance *)(instance))

static void tell(const Instance *m, Status status, const char *text) {
    m->log(m->environment, (fmi3Status)status, CATEGORIES[status == DISCARD], text);
}

static fmi3Status answer(Status status) { return (fmi3Status)status; }

static fmi3Status not_offered(const Instance *m, const char *call, const char *what) {
    return m ? answer(refuse(m, ERROR, "%s: %s", call, what)) : fmi3Error;
}

/* ---- inquiry, life ---- */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    if (!allowed(ME(c), __func__, ANY_MODE)) return fmi3Error;
    return answer(set_logging(ME(c), __func__, on, n, categories));
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    (void)resources;
    (void)visible;
    (void)logging;
    if (!name_and_token_fit(log, environment, name, token)) return NULL;
    return instance(name, MODEL_EXCHANGE, log, environment);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference required[],
                                         size_t n_required, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    const char *wrong = NULL;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)early_return;
    (void)required;
    (void)update;
    if (!name_and_token_fit(log, environment, name, token)) return NULL;
    if (event_mode) wrong = "there is no event mode in co-simulation (hasEventMode = false)";
    if (n_required) wrong = "there are no intermediate updates (providesIntermediateUpdate = false)";
    if (wrong) refuse_instance(log, environment, name, wrong);
    return wrong ? NULL : instance(name, CO_SIMULATION, log, environment);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)clock;
    (void)lock;
    (void)unlock;
    refuse_instance(log, environment, name, "scheduled execution is not offered, use co-simulation");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    (void)tolerance_defined;
    (void)tolerance;
    (void)stop_defined;
    (void)stop;
    if (!allowed(ME(c), __func__, INSTANTIATED)) return fmi3Error;
    if (set_start_time(ME(c), __func__, start) != OK) return fmi3Error;
    return answer(enter_mode(ME(c), __func__, INSTANTIATED, INITIALIZATION));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return answer(leave_initialization(ME(c), __func__)); }

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    return answer(enter_mode(ME(c), __func__, EVENT | CONTINUOUS, EVENT));
}

fmi3Status fmi3Terminate(fmi3Instance c) { return answer(enter_mode(ME(c), __func__, RUNNING, TERMINATED)); }

fmi3Status fmi3Reset(fmi3Instance c) { return answer(reset(ME(c), __func__)); }

/* ---- values: all variables are scalars of type Float64 ---- */

static bool as_many(const Instance *m, const char *call, size_t references, size_t values) {
    if (!m || references == values) return true;
    refuse(m, ERROR, "%s: %lu values for %lu scalar variables", call, (unsigned long)values,
           (unsigned long)references);
    return false;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t nv) {
    if (!as_many(ME(c), __func__, n, nv)) return fmi3Error;
    return answer(get_values(ME(c), __func__, vr, n, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t nv) {
    if (!as_many(ME(c), __func__, n, nv)) return fmi3Error;
    return answer(set_values(ME(c), __func__, vr, n, values));
}

/* ---- the state of the FMU, derivatives ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return answer(save(ME(c), __func__, state)); }

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return answer(restore(ME(c), __func__, state)); }

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) { return answer(forget(ME(c), __func__, state)); }

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    return answer(saved_size(ME(c), __func__, state, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return answer(to_bytes(ME(c), __func__, state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    return answer(from_bytes(ME(c), __func__, bytes, size, state));
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknown,
                                        const fmi3ValueReference knowns[], size_t n_known, const fmi3Float64 in[],
                                        size_t n_in, fmi3Float64 out[], size_t n_out) {
    if (!as_many(ME(c), __func__, n_known, n_in) || !as_many(ME(c), __func__, n_unknown, n_out)) return fmi3Error;
    return answer(forward_derivative(ME(c), __func__, unknowns, n_unknown, knowns, n_known, in, out));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknown,
                                    const fmi3ValueReference knowns[], size_t n_known, const fmi3Float64 in[],
                                    size_t n_in, fmi3Float64 out[], size_t n_out) {
    if (!as_many(ME(c), __func__, n_unknown, n_in) || !as_many(ME(c), __func__, n_known, n_out)) return fmi3Error;
    return answer(adjoint_derivative(ME(c), __func__, unknowns, n_unknown, knowns, n_known, in, out));
}

/* ---- events: there are none ---- */

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
    return allowed(ME(c), __func__, INITIALIZATION | EVENT) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *states, fmi3Boolean *defined, fmi3Float64 *next) {
    if (!allowed(ME(c), __func__, EVENT)) return fmi3Error;
    if (!given(ME(c), __func__, again) || !given(ME(c), __func__, end) || !given(ME(c), __func__, nominals) ||
        !given(ME(c), __func__, states) || !given(ME(c), __func__, defined) || !given(ME(c), __func__, next))
        return fmi3Error;
    *again = *end = *nominals = *states = *defined = fmi3False;
    *next = 0.0;
    return fmi3OK;
}

/* ---- model exchange ---- */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
    return answer(enter_mode(ME(c), __func__, EVENT, CONTINUOUS));
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_return, fmi3Boolean *event, fmi3Boolean *end) {
    (void)no_return;
    if (!allowed(ME(c), __func__, CONTINUOUS)) return fmi3Error;
    if (!given(ME(c), __func__, event) || !given(ME(c), __func__, end)) return fmi3Error;
    *event = *end = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) { return answer(set_time(ME(c), __func__, time)); }

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
    return answer(set_states(ME(c), __func__, x, n));
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 dx[], size_t n) {
    return answer(get_slopes(ME(c), __func__, dx, n));
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t n) {
    (void)indicators;
    if (!allowed(ME(c), __func__, COMPUTABLE)) return fmi3Error;
    return n ? not_offered(ME(c), __func__, "there are no event indicators") : fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
    return answer(get_states(ME(c), __func__, x, n));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t n) {
    return answer(get_nominals(ME(c), __func__, nominals, n));
}

static fmi3Status count(const Instance *m, const char *call, size_t n, size_t *into) {
    if (!allowed(m, call, ANY_MODE) || !given(m, call, into)) return fmi3Error;
    *into = n;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) { return count(ME(c), __func__, 0, n); }

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
    return count(ME(c), __func__, N_STATES, n);
}

/* ---- co-simulation ---- */

fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    return not_offered(ME(c), __func__, "there is no event mode to leave (hasEventMode = false)");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nv) {
    (void)vr;
    (void)n;
    (void)orders;
    (void)values;
    (void)nv;
    return not_offered(ME(c), __func__, "output derivatives are not offered (maxOutputDerivativeOrder = 0)");
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 duration, fmi3Boolean no_return,
                      fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
    (void)no_return;
    if (!allowed(ME(c), __func__, STEP)) return fmi3Error;
    if (!given(ME(c), __func__, event) || !given(ME(c), __func__, end) || !given(ME(c), __func__, early) ||
        !given(ME(c), __func__, last))
        return fmi3Error;
    Status status = do_step(ME(c), __func__, time, duration);
    *event = *end = *early = fmi3False;
    *last = ME(c)->now.time;
    return answer(status);
}
