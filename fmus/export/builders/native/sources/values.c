/* Values of variables by reference: what may be set when, and what follows from it. */

/* The place of a variable in the order of the model description; beyond all of them for what is no reference. */
static unsigned index_of(unsigned reference) { return reference - FIRST_REFERENCE; }

static void bind(Instance *m, const double *x) {
    m->arg[0] = x;
    m->arg[1] = m->now.values + FIRST_INPUT;
    m->arg[2] = m->now.values + FIRST_PARAMETER;
}

static void compute_slopes(Instance *m) {
    if (m->slopes_known) return;
    bind(m, m->now.values);
    m->res[0] = m->slopes;
    if (f(m->arg, m->res, m->iw, m->w, 0))
        for (int i = 0; i < N_STATES; i++) m->slopes[i] = NAN;
    m->slopes_known = true;
}

static void compute_outputs(Instance *m) {
    if (m->outputs_known || N_OUTPUTS == 0) return;
    bind(m, m->now.values);
    m->res[0] = m->outputs;
    if (h(m->arg, m->res, m->iw, m->w, 0))
        for (int i = 0; i < N_OUTPUTS; i++) m->outputs[i] = NAN;
    m->outputs_known = true;
}

static double value(Instance *m, unsigned i) {
    if (i < N_SET) return m->now.values[i];
    if (i < FIRST_LOCAL) {
        compute_outputs(m);
        return m->outputs[i - N_SET];
    }
    if (i == N_VARIABLES) return m->now.time;
    compute_slopes(m);
    return m->slopes[LOCALS[i - FIRST_LOCAL]];
}

static Status get_values(Instance *m, const char *call, const unsigned *references, size_t n, double *values) {
    if (!allowed(m, call, ANY_MODE)) return ERROR;
    if (n && !(given(m, call, references) && given(m, call, values))) return ERROR;
    for (size_t k = 0; k < n; k++)
        if (index_of(references[k]) >= N_VARIABLES + HAS_TIME)
            return refuse(m, ERROR, "%s: no variable has the reference %u", call, references[k]);
    for (size_t k = 0; k < n; k++) values[k] = value(m, index_of(references[k]));
    return OK;
}

/* Whether a variable may be set in the present mode. */
static Status settable(const Instance *m, const char *call, unsigned i) {
    bool running = (m->now.mode & RUNNING) != 0;
    if (i >= N_VARIABLES + HAS_TIME)
        return refuse(m, ERROR, "%s: no variable has the reference %u", call, i + FIRST_REFERENCE);
    if (i >= N_SET)
        return refuse(m, ERROR, "%s: the variable with reference %u is computed and cannot be set", call,
                      i + FIRST_REFERENCE);
    if (m->now.mode == STEP && i < FIRST_INPUT)
        return refuse(m, ERROR, "%s: state %s cannot be set while running; reset, set it, initialise",
                      call, VARIABLES[i].name);
    if (running && i >= FIRST_PARAMETER && VARIABLES[i].fixed)
        return refuse(m, ERROR, "%s: parameter %s is fixed; reset, set it, initialise", call, VARIABLES[i].name);
    if (m->now.mode == CONTINUOUS && i >= FIRST_PARAMETER)
        return refuse(m, ERROR, "%s: parameter %s can change in event mode only", call, VARIABLES[i].name);
    return OK;
}

/* Whether a value is finite and, but for a state, within the variable's bounds. */
static bool within(unsigned i, double x) {
    return isfinite(x) && (i < FIRST_INPUT || (VARIABLES[i].min <= x && x <= VARIABLES[i].max));
}

static Status acceptable(const Instance *m, const char *call, unsigned i, double x) {
    const Variable *v = &VARIABLES[i];
    if (within(i, x)) return OK;
    if (!isfinite(x)) return refuse(m, ERROR, "%s: %s = %g is not a finite number", call, v->name, x);
    return refuse(m, ERROR, "%s: %s = %g is outside %g to %g", call, v->name, x, v->min, v->max);
}

static Status set_values(Instance *m, const char *call, const unsigned *references, size_t n, const double *values) {
    if (!allowed(m, call, ANY_MODE & ~TERMINATED)) return ERROR;
    if (n && !(given(m, call, references) && given(m, call, values))) return ERROR;
    for (size_t k = 0; k < n; k++) {
        unsigned i = index_of(references[k]);
        if (settable(m, call, i) != OK) return ERROR;
        if (acceptable(m, call, i, values[k]) != OK) /* of a state, a solver may try another one */
            return m->now.mode == CONTINUOUS && i < FIRST_INPUT ? DISCARD : ERROR;
    }
    for (size_t k = 0; k < n; k++) m->now.values[index_of(references[k])] = values[k];
    forget_results(m);
    return OK;
}

#if FMI_VERSION == 2
/* Rates of inputs over the next communication step, after which they are zero again. */
static Status set_rates(Instance *m, const char *call, const unsigned *references, size_t n, const int *orders,
                        const double *rates) {
    if (!allowed(m, call, INSTANTIATED | INITIALIZATION | STEP)) return ERROR;
    if (n && !(given(m, call, references) && given(m, call, orders) && given(m, call, rates))) return ERROR;
    for (size_t k = 0; k < n; k++) {
        unsigned i = index_of(references[k]);
        if (i < FIRST_INPUT || i >= FIRST_PARAMETER)
            return refuse(m, ERROR, "%s: reference %u is not that of an input", call, references[k]);
        if (orders[k] != 1)
            return refuse(m, ERROR, "%s: %s: order %d; inputs are linear within a step", call, VARIABLES[i].name,
                          orders[k]);
        if (!isfinite(rates[k]))
            return refuse(m, ERROR, "%s: %s: a rate of %g is not a finite number", call, VARIABLES[i].name, rates[k]);
    }
    for (size_t k = 0; k < n; k++) m->now.rates[index_of(references[k]) - FIRST_INPUT] = rates[k];
    return OK;
}
#endif

/* ---- continuous states of model exchange ---- */

static Status states_fit(const Instance *m, const char *call, const void *array, size_t n) {
    if (n != N_STATES)
        return refuse(m, ERROR, "%s: there are %d states, not %lu", call, (int)N_STATES, (unsigned long)n);
    return given(m, call, array) ? OK : ERROR;
}

static Status set_states(Instance *m, const char *call, const double *x, size_t n) {
    if (!allowed(m, call, CONTINUOUS) || states_fit(m, call, x, n) != OK) return ERROR;
    for (unsigned i = 0; i < N_STATES; i++)
        if (acceptable(m, call, i, x[i]) != OK) return DISCARD; /* a solver may try a shorter step */
    memcpy(m->now.values, x, N_STATES * sizeof(double));
    forget_results(m);
    return OK;
}

static Status get_states(const Instance *m, const char *call, double *x, size_t n) {
    if (!allowed(m, call, COMPUTABLE) || states_fit(m, call, x, n) != OK) return ERROR;
    memcpy(x, m->now.values, N_STATES * sizeof(double));
    return OK;
}

static Status get_slopes(Instance *m, const char *call, double *dx, size_t n) {
    if (!allowed(m, call, COMPUTABLE) || states_fit(m, call, dx, n) != OK) return ERROR;
    compute_slopes(m);
    for (int i = 0; i < N_STATES; i++)
        if (!isfinite(m->slopes[i]))
            return refuse(m, DISCARD, "%s: the derivative of %s is not finite", call, VARIABLES[i].name);
    memcpy(dx, m->slopes, N_STATES * sizeof(double));
    return OK;
}

static Status get_nominals(const Instance *m, const char *call, double *nominals, size_t n) {
    if (!allowed(m, call, ANY_MODE) || states_fit(m, call, nominals, n) != OK) return ERROR;
    memcpy(nominals, NOMINALS, N_STATES * sizeof(double));
    return OK;
}

static Status set_time(Instance *m, const char *call, double time) {
    if (!allowed(m, call, EVENT | CONTINUOUS)) return ERROR;
    if (!isfinite(time)) return refuse(m, ERROR, "%s: time %g s is not finite", call, time);
    m->now.time = time;
    return OK;
}
