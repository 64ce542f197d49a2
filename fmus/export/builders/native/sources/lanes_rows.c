/* As many rows as there are lanes through the samples. */

/* values: behind those that are set there is room for the step, an argument of the equations. */
typedef struct {
    Lanes values[N_SET + 1], outputs[AT_LEAST_1(N_OUTPUTS)], slopes[N_STATES];
#ifdef SWITCHES
    int moving[N_STATES], n_moving; /* states of laws that are on; slopes of the others are not computed */
    bool on[N_SET], runs[N_RUNS];   /* whether a value is other than zero in any lane, and one of a run's */
#else
    bool on[1], runs[1];
#endif
} Group;

/* Lines for each state number i that can move. */
#ifdef SWITCHES
#define EACH_STATE(m, i, ...)                                                                                      \
    for (int i = 0; i < N_OWN_STATES; i++) {                                                                      \
        __VA_ARGS__                                                                                               \
    }                                                                                                             \
    for (int n_ = 0; n_ < (m)->n_moving; n_++) {                                                                  \
        int i = (m)->moving[n_];                                                                                  \
        __VA_ARGS__                                                                                               \
    }

/* One step, after whose states its error stands; where no law moves a state, of those of the model alone. */
#if N_OWN_STATES < N_STATES
#define LAST_STATE(m) ((m)->n_moving ? N_STATES : N_OWN_STATES)
#define STEP(m, next) ((m)->n_moving ? lanes_step : lanes_step_alone)((m)->values, (m)->on, (m)->runs, next)
#endif

VECTORS static void find_moving(Group *m) {
    m->n_moving = 0;
    for (int k = 0; k < N_SET; k++) {
        Bits other = (Bits)(m->values[k] != 0.0);
        m->on[k] = any_lane(&other);
    }
    for (int i = 0; i < N_RUNS; i++) {
        m->runs[i] = false;
        for (int k = RUNS[i]; k < RUNS[i + 1]; k++) m->runs[i] = m->runs[i] || m->on[RUN[k]];
    }
    memset(m->slopes, 0, sizeof m->slopes);
    for (int k = N_OWN_STATES; k < N_STATES; k++) {
        bool moves = SWITCHED_BY[k][0] == SWITCHED_BY[k][1];
        for (int by = SWITCHED_BY[k][0]; by < SWITCHED_BY[k][1]; by++) moves = moves || m->on[by];
        if (moves) m->moving[m->n_moving++] = k;
    }
}
#else
#define EACH_STATE(m, i, ...)                                                                                      \
    for (int i = 0; i < N_STATES; i++) {                                                                          \
        __VA_ARGS__                                                                                               \
    }
#endif

#ifndef STEP
#define LAST_STATE(m) N_STATES
#define STEP(m, next) lanes_step((m)->values, (m)->on, (m)->runs, next)
#endif

/* What has to be known to read what is asked. */
typedef struct {
    bool outputs, slopes, states[N_STATES];
} Needed;

static Needed needed_for(const Rows *asked) {
    Needed found = {0};
    for (size_t k = 0; k < asked->n_get; k++) {
        unsigned from = index_of(asked->get[k]);
        found.outputs = found.outputs || (from >= N_SET && from < FIRST_LOCAL);
        found.slopes = found.slopes || from >= FIRST_LOCAL;
        if (from < N_STATES) found.states[from] = true;
    }
    for (int k = 0; k < N_STATES; k++) found.states[k] = found.states[k] || found.outputs || found.slopes;
    return found;
}

/* The first lanes, as a condition. */
VECTORS static inline Bits lanes_below(int active) {
    Bits found = ALL_BITS(0);
    EACH(i) found[i] = i < active ? -1 : 0;
    return found;
}

/* Advance the lanes of `wanted`, with inputs held; false where no step is short enough.

   The arguments of the equations one after the other: states, inputs and parameters are so already. */
VECTORS static bool advance_group(Group *m, double duration, const Bits *wanted) {
    Lanes next[N_STATES + 1];
    double done[WIDTH] = {0}, h_now[WIDTH];
    bool moving[WIDTH], any = false;
    double whole = duration / number_of_parts(duration * (1 - TIME_TOLERANCE), LONGEST_STEP);
    EACH(i) {
        h_now[i] = whole;
        moving[i] = (*wanted)[i] != 0;
        any = any || moving[i];
    }
    while (any) {
        any = false;
        Lanes h = ALL(whole);
        EACH(i) if (moving[i]) h[i] = h_now[i] = least(least(h_now[i], LONGEST_STEP), duration - done[i]);
        m->values[N_SET] = h;
        STEP(m, next);
        int last = LAST_STATE(m);
        Lanes sum = next[last];
        EACH_STATE(m, k, sum = sum + next[k] * 0.0;) /* not a number where a state is not finite */
        Bits good = (Bits)(sum <= 1.0), going = ALL_BITS(0);
        EACH(i) going[i] = moving[i] ? -1 : 0;
        Bits taken = good & going;
        EACH_STATE(m, k, m->values[k] = CHOICE(taken, next[k], m->values[k]);)
        EACH(i) {
            if (!moving[i]) continue;
            double error = next[last][i];
            if (good[i]) {
                done[i] += h_now[i];
                moving[i] = duration - done[i] > TIME_TOLERANCE * duration;
                if (moving[i] && error > 0) h_now[i] *= least(GROWTH, SAFETY * pow(error, -1.0 / ORDER));
            } else {
                bool known = 1.0 < error && error < 1e300;
                h_now[i] *= known ? most(CUT, SAFETY * pow(error, -1.0 / ORDER)) : CUT;
                if (h_now[i] < SHORTEST * least(duration, LONGEST_STEP)) return false;
            }
            any = any || moving[i];
        }
    }
    return true;
}

/* Read what is asked of a sample, if it is one of those that are read. */
VECTORS static void read_group(
    Group *m, const Rows *asked, const Needed *needed, size_t row, size_t sample, int active) {
    size_t left_out = asked->first ? 0 : 1, place = sample / asked->every;
    if (sample % asked->every || place < left_out) return;
    size_t n_found = (asked->n_samples - 1) / asked->every + 1 - left_out;
    place -= left_out;
    if (needed->outputs) lanes_h(m->values, m->on, m->runs, m->outputs);
    if (needed->slopes) lanes_f(m->values, m->on, m->runs, m->slopes);
    for (size_t k = 0; k < asked->n_get; k++) {
        unsigned from = index_of(asked->get[k]);
        const Lanes *value = from < N_SET         ? &m->values[from]
                             : from < FIRST_LOCAL ? &m->outputs[from - N_SET]
                                                  : &m->slopes[LOCALS[from - FIRST_LOCAL]];
        for (int i = 0; i < active; i++)
            asked->found[((row + (size_t)i) * n_found + place) * asked->n_get + k] = (*value)[i];
    }
}

VECTORS static bool set_inputs(Group *m, const Rows *asked, const double *samples, size_t k) {
    for (size_t j = 0; j < asked->n_inputs; j++) {
        double x = samples[k * asked->n_inputs + j];
        unsigned into = index_of(asked->inputs[j]);
        if (!within(into, x)) return false;
        m->values[into] = ALL(x);
    }
    return true;
}

/* Set a group to its rows; the number of lanes that have one. */
VECTORS static int begin_group(Group *m, const Rows *asked, size_t row) {
    int active = asked->n_rows - row < WIDTH ? (int)(asked->n_rows - row) : WIDTH;
    for (size_t k = 0; k < N_SET; k++) {
        double given = k < asked->n_base ? asked->base[k] : NAN;
        m->values[k] = ALL(isnan(given) ? VARIABLES[k].start : given);
    }
    for (size_t k = 0; k < asked->n_put; k++)
        EACH(i) {
            size_t from = row + (size_t)(i < active ? i : 0); /* lanes without a row do as the first one */
            m->values[index_of(asked->put[k])][i] = asked->rows[from * asked->n_put + k];
        }
#ifdef SWITCHES
    find_moving(m);
#endif
    return active;
}

/* -1, or the first of the rows from this one on, if one of them cannot be advanced. */
VECTORS static long long group_of_rows(const Rows *asked, size_t row) {
    Group m;
    int active = begin_group(&m, asked, row);
    Bits going = lanes_below(active);
    Needed needed = needed_for(asked);
    read_group(&m, asked, &needed, row, 0, active);
    for (size_t k = 0; k + 1 < asked->n_samples; k++) {
        if (!set_inputs(&m, asked, asked->during, k)) return (long long)row;
        if (!advance_group(&m, asked->t[k + 1] - asked->t[k], &going)) return (long long)row;
        if (asked->after && !set_inputs(&m, asked, asked->after, k)) return (long long)row;
        read_group(&m, asked, &needed, row, k + 1, active);
    }
    return -1;
}
