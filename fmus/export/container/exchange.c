/* A carried FMU for model exchange, integrated over each step.

   Between two steps it is in event mode, where inputs and tunable parameters may be set. A step begins and ends with an
   update of its discrete states, and stops at every event of state, time or step within. Each step begins afresh.

   Linearly implicit Euler steps are extrapolated, which is exact to high order and also for stiff equations:
   P. Deuflhard, SIAM Review 27 (1985), 505-535; E. Hairer, G. Wanner, Solving Ordinary Differential Equations II,
   section IV.9. */

#define TOLERANCE 1e-9 /* of a state and of its nominal value, of the integration */
#define NUDGE 1.5e-8   /* of the same, of a finite difference */
#define LEAST_PART 1e-9 /* of a step: events that are nearer are at the same time; shorter parts have failed */
enum { MOST_PARTS = 100000, MOST_EVENTS = 10000 };
enum { LEAST_ROWS = 3 }; /* of a table: with less, parts would stay as short as a low order needs */

/* An error, and why, which the refusal of the step tells. */
static int because(Instance *m, const char *format, ...) {
    va_list given;
    va_start(given, format);
    vsnprintf(m->why, sizeof m->why, format, given);
    va_end(given);
    return (int)fmi2Error;
}

static int set_point(Instance *m, double t, const double *x) {
    int status = (int)m->set_time(m->base, t);
    return status > WARNING || !N_X ? status : (int)m->set_states(m->base, x, N_X);
}

/* Derivatives (N_X); a discarded call, and results that are not finite, ask for a shorter part. */
static int slopes(Instance *m, double t, const double *x, double *dx) {
    int status = set_point(m, t, x);
    if (status > WARNING || !N_X) return status;
    status = (int)m->slopes(m->base, dx, N_X);
    for (int i = 0; i < N_X && status <= WARNING; i++)
        if (!isfinite(dx[i])) status = (int)fmi2Discard;
    return status;
}

/* In event mode, come to new discrete states, or to the end for which the FMU asks (`over`). */
static int settle(Instance *m) {
    for (int k = 0; k < MOST_EVENTS; k++) {
#if BASE_FMI == 2
        fmi2EventInfo info = {fmi2False, fmi2False, fmi2False, fmi2False, fmi2False, 0.0};
        int status = (int)m->update(m->base, &info);
        bool again = info.newDiscreteStatesNeeded, ends = info.terminateSimulation;
        m->due = info.nextEventTimeDefined ? info.nextEventTime : HUGE_VAL;
#else
        fmi3Boolean again = false, ends = false, nominals = false, states = false, timed = false;
        fmi3Float64 then = 0.0;
        int status = (int)m->update(m->base, &again, &ends, &nominals, &states, &timed, &then);
        m->due = timed ? then : HUGE_VAL;
#endif
        if (status > WARNING) return status;
        m->over = ends;
        if (ends || !again) return 0;
    }
    return because(m, "discrete states do not settle within %d updates", MOST_EVENTS);
}

/* Leave event mode, with the states and indicators that hold then. */
static int go_on_from(Instance *m, double t) {
    int status = (int)m->go_on(m->base);
    if (status <= WARNING && N_X) status = (int)m->states(m->base, m->x, N_X);
    if (status <= WARNING && N_X) status = (int)m->nominals(m->base, m->nominal, N_X);
    if (status <= WARNING) status = set_point(m, t, m->x);
    if (status <= WARNING && N_Z) status = (int)m->indicators(m->base, m->z, N_Z);
    m->known = false;
    return status;
}

/* LU factors (N_X, N_X), by rows, with pivots in place; false where the matrix is singular. */
static bool factored(double *a, int *pivot) {
    for (int k = 0; k < N_X; k++) {
        int best = k;
        for (int i = k + 1; i < N_X; i++)
            if (fabs(a[i * N_X + k]) > fabs(a[best * N_X + k])) best = i;
        pivot[k] = best;
        if (!(fabs(a[best * N_X + k]) > 0)) return false;
        for (int j = 0; best != k && j < N_X; j++) {
            double kept = a[k * N_X + j];
            a[k * N_X + j] = a[best * N_X + j];
            a[best * N_X + j] = kept;
        }
        for (int i = k + 1; i < N_X; i++) {
            double share = a[i * N_X + k] /= a[k * N_X + k];
            for (int j = k + 1; share != 0 && j < N_X; j++) a[i * N_X + j] -= share * a[k * N_X + j];
        }
    }
    return true;
}

static void solve(const double *a, const int *pivot, double *b) {
    for (int k = 0; k < N_X; k++) {
        double kept = b[pivot[k]];
        b[pivot[k]] = b[k];
        b[k] = kept;
    }
    for (int i = 1; i < N_X; i++)
        for (int j = 0; j < i; j++) b[i] -= a[i * N_X + j] * b[j];
    for (int i = N_X - 1; i >= 0; i--) {
        for (int j = i + 1; j < N_X; j++) b[i] -= a[i * N_X + j] * b[j];
        b[i] /= a[i * N_X + i];
    }
}

static double scale_of(const Instance *m, int i) {
    double usual = fabs(m->nominal[i]), now = fabs(m->x[i]);
    return now > usual ? now : usual > 0 ? usual : 1.0;
}

/* Derivatives of the slopes by the states at t, by finite differences. */
static int linearise(Instance *m, double t) {
    double dx[AT_LEAST_1(N_X)], moved[AT_LEAST_1(N_X)];
    int status = slopes(m, t, m->x, dx);
    for (int j = 0; j < N_X && status <= WARNING; j++) {
        double kept = m->x[j], by = NUDGE * scale_of(m, j);
        m->x[j] = kept + by;
        status = slopes(m, t, m->x, moved);
        if (status == (int)fmi2Discard) { /* there may be no values on this side */
            m->x[j] = kept - by;
            by = -by;
            status = slopes(m, t, m->x, moved);
        }
        m->x[j] = kept;
        for (int i = 0; i < N_X && status <= WARNING; i++) m->jacobian[i * N_X + j] = (moved[i] - dx[i]) / by;
    }
    m->known = status <= WARNING;
    return status;
}

/* States x1 after h s, from those at t, in a number of linearly implicit Euler steps. */
static int by_euler(Instance *m, double t, double h, int steps, double *x1) {
    double by = h / steps, dx[AT_LEAST_1(N_X)];
    for (int i = 0; i < N_X; i++)
        for (int j = 0; j < N_X; j++) m->factors[i * N_X + j] = (i == j) - by * m->jacobian[i * N_X + j];
    if (!factored(m->factors, m->pivot)) return (int)fmi2Discard;
    memcpy(x1, m->x, N_X * sizeof(double));
    for (int k = 1; k <= steps; k++) {
        int status = slopes(m, t + k * by, x1, dx);
        if (status > WARNING) return status;
        for (int i = 0; i < N_X; i++) dx[i] *= by;
        solve(m->factors, m->pivot, dx);
        for (int i = 0; i < N_X; i++) x1[i] += dx[i];
    }
    return 0;
}

/* States x1 after h s, from those at t; error: at most 1 where they are exact enough; order: of the error. */
static int extrapolated(Instance *m, double t, double h, double *x1, double *error, int *order) {
    double table[COLUMNS][AT_LEAST_1(N_X)];
    int status = m->known ? 0 : linearise(m, t);
    *error = N_X ? HUGE_VAL : 0.0;
    *order = 1;
    for (int row = 0; row < COLUMNS && (*error > 1 || (N_X && row < LEAST_ROWS)) && status <= WARNING; row++) {
        status = by_euler(m, t, h, row + 1, x1);
        if (status > WARNING || !row) {
            memcpy(table[0], x1, N_X * sizeof(double));
            continue;
        }
        double largest = 0;
        for (int i = 0; i < N_X; i++) {
            double best = x1[i], before = 0;
            for (int k = 0; k < row; k++) { /* Aitken and Neville, along the row */
                double above = table[k][i];
                table[k][i] = before = best;
                best += (best - above) / ((row + 1.0) / (row - k) - 1.0);
            }
            table[row][i] = best;
            largest = fmax(largest, fabs(best - before) / (TOLERANCE * scale_of(m, i)));
            if (!isfinite(best)) status = (int)fmi2Discard;
        }
        *error = largest;
        *order = row;
    }
    for (int i = 0; i < N_X; i++) x1[i] = table[*order][i];
    return status;
}

/* Whether a state event lies between the states of `z` and those x at t, whose indicators are left in `next`. */
static int crossed(Instance *m, double t, const double *x, bool *hit) {
    *hit = false;
    if (!N_Z) return 0;
    int status = set_point(m, t, x);
    if (status <= WARNING) status = (int)m->indicators(m->base, m->next, N_Z);
    for (int i = 0; i < N_Z; i++) *hit = *hit || (m->z[i] > 0) != (m->next[i] > 0);
    return status;
}

/* Shorten a part of h s in which an event lies to the one that ends just after it. */
static int up_to_event(Instance *m, double t, double *h, double *x1, double least) {
    double early = 0, error, between[AT_LEAST_1(N_X)];
    int status = 0, order;
    while (*h - early > least && status <= WARNING) {
        double middle = (early + *h) / 2;
        bool hit = false;
        status = extrapolated(m, t, middle, between, &error, &order);
        if (status <= WARNING) status = crossed(m, t + middle, between, &hit);
        if (!hit) {
            early = middle;
        } else {
            *h = middle;
            memcpy(x1, between, N_X * sizeof(double));
        }
    }
    return status;
}

/* One part of at most h s, which may become shorter; event: whether it ends at one of state. */
static int part_of(Instance *m, double t, double *h, double *longer, double least, bool *event) {
    double x1[AT_LEAST_1(N_X)], error = 0, known = *longer;
    int order = 1, status;
    for (;;) {
        status = extrapolated(m, t, *h, x1, &error, &order);
        if (status <= WARNING && error <= 1) status = crossed(m, t + *h, x1, event);
        if (status > WARNING && status != (int)fmi2Discard) return status;
        if (status <= WARNING && error <= 1) break;
        known = 0; /* what was hoped for is too long */
        *h *= status > WARNING ? 0.25 : fmax(0.1, 0.9 * pow(error, -1.0 / (order + 1)));
        if (*h < least) return because(m, "no part of it is short enough at t = %g s", t);
    }
    *longer = fmax(known, *h * fmin(4.0, 0.9 * pow(fmax(error, 1e-9), -1.0 / (order + 1))));
    if (*event) status = up_to_event(m, t, h, x1, least);
    if (status > WARNING) return status;
    memcpy(m->x, x1, N_X * sizeof(double));
    m->known = false;
    return set_point(m, t + *h, m->x);
}

/* Whether the FMU asks for an event at the end of a part. */
static int completed(Instance *m, bool *event) {
#if BASE_FMI == 2
    fmi2Boolean enter = fmi2False, ends = fmi2False;
    int status = (int)m->completed(m->base, fmi2True, &enter, &ends);
#else
    fmi3Boolean enter = false, ends = false;
    int status = (int)m->completed(m->base, true, &enter, &ends);
#endif
    *event = *event || enter;
    return ends ? because(m, "it asks to end the simulation") : status;
}

/* Go on in event mode; whether it asks for the end there, `over` says. */
static int to_events(Instance *m) {
    int status = (int)m->event(m->base);
    return status > WARNING ? status : settle(m);
}

static int step_base(Instance *m, double t, double dt) {
    double now = t, h = dt, longer = dt, least_part = LEAST_PART * dt;
    int status = m->over ? 0 : settle(m);
    if (m->over) return because(m, "it asks to end the simulation at t = %g s", t);
    if (status <= WARNING) status = go_on_from(m, t);
    for (int k = 0; status <= WARNING && t + dt - now > least_part; k++) {
        double upto = fmin(t + dt, m->due);
        bool event = false;
        if (k == MOST_PARTS)
            return because(m, "it takes more than %d parts up to t = %g s", MOST_PARTS, now);
        if (upto - now > least_part) {
            h = fmin(longer, upto - now);
            if (upto - now - h < least_part) h = upto - now;
            status = part_of(m, now, &h, &longer, least_part, &event);
            now = upto - now - h > least_part ? now + h : upto;
        } else {
            now = upto;
            status = set_point(m, now, m->x);
        }
        if (status <= WARNING) status = completed(m, &event);
        if (status > WARNING) break;
        if (event || now >= m->due - least_part) {
            status = to_events(m);
            if (m->over && t + dt - now <= least_part) return status; /* the step is made; no other one will be */
            if (m->over) return because(m, "it asks to end the simulation at t = %g s", now);
            if (status <= WARNING) status = go_on_from(m, now);
        } else {
            memcpy(m->z, m->next, sizeof m->z);
        }
    }
    return status > WARNING ? status : to_events(m);
}

static int leave_base(Instance *m) {
    int status = (int)m->leave(m->base);
    if (status <= WARNING) status = settle(m);
    return m->over ? because(m, "it asks to end the simulation before it began") : status;
}
