/* A communication step in internal steps, divided where the method's own error estimate asks for it.

   Every communication step begins afresh: how the last one was divided is forgotten, so that a restart
   from the same values repeats a run to the last bit. */

#define SHORTEST 1e-7       /* of the step that is tried first; below this a step has failed */
#define TIME_TOLERANCE 1e-9 /* of the communication step */
#define LATE_TOLERANCE 1e-3 /* of the communication step, between the importer's clock and this one */
#define SAFETY 0.9
#define GROWTH 4.0
#define CUT 0.1
#define ORDER 3

static double least(double a, double b) { return b < a ? b : a; }
static double most(double a, double b) { return b > a ? b : a; }

/* How many steps of at most `longest` make up a duration. */
static double number_of_parts(double duration, double longest) {
    double rest = fmod(duration, longest);
    double whole = floor((duration - rest) / longest + 0.5);
    return most(1.0, rest > 0 ? whole + 1.0 : whole);
}

static bool all_finite(const double *x) {
    for (int i = 0; i < N_STATES; i++)
        if (!isfinite(x[i])) return false;
    return true;
}

static bool moves(const Instance *m) {
    for (int i = 0; i < N_INPUTS; i++)
        if (m->now.rates[i] != 0) return true;
    return false;
}

/* Set the inputs to what they are some time after the start of a communication step, where they were `first`. */
static void move_inputs(Instance *m, const double *first, double after) {
    for (int i = 0; i < N_INPUTS; i++) m->now.values[FIRST_INPUT + i] = first[i] + m->now.rates[i] * after;
}

/* Advance the states, and the inputs that have rates; false, with all as it was, where no step is short enough.

   Within an internal step, inputs are held at what they are in its middle. */
static bool advance(Instance *m, double duration) {
    double *x = m->now.values, done = 0.0, error = 0.0;
    double h_now = duration / number_of_parts(duration * (1 - TIME_TOLERANCE), LONGEST_STEP);
    const bool moving = moves(m);
    memcpy(m->before, x, sizeof m->before);
    memcpy(m->first, x + FIRST_INPUT, N_INPUTS * sizeof(double));
    forget_results(m);
    while (duration - done > TIME_TOLERANCE * duration) {
        h_now = least(least(h_now, LONGEST_STEP), duration - done);
        if (moving) move_inputs(m, m->first, done + h_now / 2);
        bind(m, x);
        m->arg[3] = &h_now;
        m->res[0] = m->next;
        m->res[1] = &error;
        bool failed = step(m->arg, m->res, m->iw, m->w, 0) != 0;
        if (!failed && error <= 1.0 && all_finite(m->next)) { /* the error may be blind to NaN */
            memcpy(x, m->next, sizeof m->next);
            done += h_now;
            bool more = duration - done > TIME_TOLERANCE * duration;
            if (more && error > 0) h_now *= least(GROWTH, SAFETY * pow(error, -1.0 / ORDER));
        } else {
            bool known = !failed && 1.0 < error && error < 1e300;
            h_now *= known ? most(CUT, SAFETY * pow(error, -1.0 / ORDER)) : CUT;
            if (h_now < SHORTEST * least(duration, LONGEST_STEP)) {
                memcpy(x, m->before, sizeof m->before);
                memcpy(x + FIRST_INPUT, m->first, N_INPUTS * sizeof(double));
                return false;
            }
        }
    }
    if (moving) {
        move_inputs(m, m->first, duration);
        memset(m->now.rates, 0, sizeof m->now.rates);
    }
    return true;
}

static Status do_step(Instance *m, const char *call, double time, double duration) {
    if (!allowed(m, call, STEP)) return ERROR;
    if (!isfinite(time)) return refuse(m, ERROR, "%s: time %g s is not finite", call, time);
    if (!(duration > 0 && isfinite(duration)))
        return refuse(m, ERROR, "%s: step size %g s is not positive and finite", call, duration);
    double gap = fabs(time - m->now.time);
    if (!m->any_time && gap > LATE_TOLERANCE * duration + TIME_TOLERANCE * fabs(time))
        return refuse(m, ERROR, "%s: begins at %.9g s, but the instance is at %.9g s", call, time, m->now.time);
    for (int i = 0; i < N_INPUTS; i++) {
        double end = m->now.values[FIRST_INPUT + i] + m->now.rates[i] * duration;
        const Variable *v = &VARIABLES[FIRST_INPUT + i];
        if (m->now.rates[i] != 0 && !within((unsigned)(FIRST_INPUT + i), end))
            return refuse(m, DISCARD, "%s: at its rate, %s would end at %g, outside %g to %g", call, v->name, end,
                          v->min, v->max);
    }
    if (!advance(m, duration))
        return refuse(m, DISCARD, "%s: no step is short enough after t = %g s", call, time);
    m->now.time = time + duration;
    m->any_time = false;
    return OK;
}
