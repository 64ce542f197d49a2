/* The life of an instance: made, put back to its start, and what it says when it refuses. */

static const char *const CATEGORIES[N_CATEGORIES] = {"logStatusError", "logStatusDiscard"};

/* Log a sentence and answer with a status; nothing else changes. */
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
static Status refuse(const Instance *m, Status status, const char *format, ...) {
    char text[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (m->log && m->logs[status == DISCARD]) tell(m, status, text);
    return status;
}

static const char *mode_name(int mode) {
    switch (mode) {
    case INSTANTIATED: return "instantiated";
    case INITIALIZATION: return "initialization mode";
    case EVENT: return "event mode";
    case CONTINUOUS: return "continuous-time mode";
    case STEP: return "step mode";
    default: return "terminated";
    }
}

/* Whether a call may be made now; a missing instance is refused without a word. */
static bool allowed(const Instance *m, const char *call, int modes) {
    if (!m) return false;
    if (m->now.mode & modes) return true;
    refuse(m, ERROR, "%s: not allowed now, the instance is in this state: %s", call, mode_name(m->now.mode));
    return false;
}

/* A pointer that must be given. */
static bool given(const Instance *m, const char *call, const void *pointer) {
    if (!pointer) refuse(m, ERROR, "%s: an argument is a null pointer", call);
    return pointer != NULL;
}

static void forget_results(Instance *m) { m->outputs_known = m->slopes_known = false; }

static void restart(Instance *m) {
    for (int i = 0; i < N_SET; i++) m->now.values[i] = VARIABLES[i].start;
    memset(m->now.rates, 0, sizeof m->now.rates);
    m->now.time = 0.0;
    m->now.mode = INSTANTIATED;
    m->any_time = false;
    forget_results(m);
}

static Instance *instance(const char *name, Kind kind, Logger log, Environment environment) {
    Instance *m = calloc(1, sizeof(Instance));
    if (!m) return NULL;
    m->now.kind = (int)kind;
    m->log = log;
    m->environment = environment;
    for (int i = 0; i < N_CATEGORIES; i++) m->logs[i] = true; /* what is refused is always said */
    snprintf(m->name, sizeof m->name, "%s", name);
    restart(m);
    return m;
}

/* Say why there will be no instance. */
static void refuse_instance(Logger log, Environment environment, const char *name, const char *text) {
    Instance *m = instance(name ? name : MODEL_NAME, CO_SIMULATION, log, environment);
    if (m) refuse(m, ERROR, "%s", text);
    free(m);
}

static bool name_and_token_fit(Logger log, Environment environment, const char *name, const char *token) {
    const char *wrong = NULL;
    if (!name || !*name)
        wrong = "the instance has no name; give one";
    else if (!token || strcmp(token, MODEL_TOKEN) != 0)
        wrong = "the token given is not " MODEL_TOKEN "; read it again from modelDescription.xml of this FMU";
    if (wrong) refuse_instance(log, environment, name, wrong);
    return !wrong;
}

static Status set_logging(Instance *m, const char *call, bool on, size_t n, const char *const *categories) {
    bool chosen[N_CATEGORIES] = {false};
    if (n && !given(m, call, categories)) return ERROR;
    for (size_t k = 0; k < n; k++) {
        int i = 0;
        while (i < N_CATEGORIES && (!categories[k] || strcmp(categories[k], CATEGORIES[i]) != 0)) i++;
        if (i == N_CATEGORIES)
            return refuse(m, ERROR, "%s: unknown category '%s'", call, categories[k] ? categories[k] : "");
        chosen[i] = true;
    }
    for (int i = 0; i < N_CATEGORIES; i++)
        if (n == 0 || chosen[i]) m->logs[i] = on;
    return OK;
}

/* ---- initialisation and end ---- */

static Status set_start_time(Instance *m, const char *call, double time) {
    if (!isfinite(time)) return refuse(m, ERROR, "%s: start time %g s is not finite", call, time);
    m->now.time = time;
    return OK;
}

static Status enter_mode(Instance *m, const char *call, int from, int to) {
    if (!allowed(m, call, from)) return ERROR;
    m->now.mode = to;
    return OK;
}

static Status leave_initialization(Instance *m, const char *call) {
    if (!allowed(m, call, INITIALIZATION)) return ERROR;
    m->now.mode = m->now.kind == CO_SIMULATION ? STEP : EVENT;
    return OK;
}

static Status reset(Instance *m, const char *call) {
    if (!allowed(m, call, ANY_MODE)) return ERROR;
    restart(m);
    return OK;
}
