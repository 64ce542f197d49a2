/* Rows through a record whose inputs are samples of continuous signals: a step goes over four samples.

   An FMU holds its inputs over a communication step. Where inputs are samples of continuous signals, that makes an error
   of second order in the step, however exact the integrator is. A host that has the whole record can give a step the
   samples within it instead: the step is then exact to fifth order, and takes the place of four. At the samples within
   a step, the states are on cubics through its ends with their slopes. A row for which a step is no good makes four of a
   sample each, and what is no good even then is divided further, with its inputs held. */

enum { QUARTERS = 4 };
#define GUARD 100.0         /* times the tolerated error of a state: what a step may miss before it is divided */
#define LAST_WEIGHT (7.0 / 90) /* of the last stage */

/* States at the samples of a step. */
typedef Lanes Path[QUARTERS + 1][N_STATES];

/* Inputs (N_INPUTS) by quarters of a step, the first one at its start. */
typedef double Driving[QUARTERS + 1][AT_LEAST_1(N_INPUTS)];

VECTORS static void slopes_of(Group *m, const double *inputs, Lanes *slopes) {
    for (int j = 0; j < N_INPUTS; j++) m->values[FIRST_INPUT + j] = ALL(inputs[j]);
    lanes_f(m->values, m->on, m->runs, slopes);
}

/* Inputs by quarters of a quarter q of a step, on a curve of fourth order through those by quarters of the step. */
static void within_step(const Driving *whole, int q, Driving *part) {
    for (int i = 0; i <= QUARTERS; i++) {
        double s = q + (double)i / QUARTERS;
        for (int j = 0; j < N_INPUTS; j++) (*part)[i][j] = 0;
        for (int a = 0; a <= QUARTERS; a++) {
            double weight = 1;
            for (int b = 0; b <= QUARTERS; b++)
                if (b != a) weight *= (s - b) / (a - b);
            for (int j = 0; j < N_INPUTS; j++) (*part)[i][j] += weight * (*whole)[a][j];
        }
    }
}

/* Of each state, the slope of a stage, and from its slopes k so far how far `beyond` its start the next stage is, at a
   quarter of the step; then the slopes there. */
#define STAGE(stage, beyond, quarter)                                                                             \
    EACH_STATE(m, i, Lanes *k = stages[i]; k[stage] = after[i]; m->values[i] = x[i] + (beyond);)                  \
    slopes_of(m, (*driving)[quarter], after);

/* Advance the lanes of `going` from these slopes, and give those at the end; lanes for which the step is no good, `bad`,
   stay where they are.

   Method of order 5 with six stages, at quarters of the step: J. C. Butcher, Numerical Methods for Ordinary Differential
   Equations, section 32. A step is no good where it is unstable or by far too long: the slopes at its end are then not
   those of its last stage. How exact steps are that are good enough, this does not tell. */
VECTORS static void join(
    Group *m, const Driving *driving, double duration, const Bits *going, const Lanes *slopes, Bits *bad, Lanes *after) {
    Lanes x[N_STATES], stages[N_STATES][7], dt = ALL(duration); /* the stages of a state side by side, from 1 on */
    EACH_STATE(m, i, x[i] = m->values[i]; after[i] = slopes[i];)
    STAGE(1, dt / 4 * k[1], 1)
    STAGE(2, dt / 8 * (k[1] + k[2]), 1)
    STAGE(3, dt / 2 * (2 * k[3] - k[2]), 2)
    STAGE(4, dt / 16 * (3 * k[1] + 9 * k[4]), 3)
    STAGE(5, dt / 7 * (8 * k[5] + 12 * (k[3] - k[4]) + 2 * k[2] - 3 * k[1]), 4)
    STAGE(6, dt * (LAST_WEIGHT * (k[1] + k[6]) + 32.0 / 90 * (k[3] + k[5]) + 12.0 / 90 * k[4]), 4)
    Bits good = *going;
    EACH_STATE(
        m, i, Lanes error = LAST_WEIGHT * dt * (after[i] - stages[i][6]) / (GUARD * (TOLERANCE * NOMINALS[i]));
        good = good & (Bits)(MAGNITUDE(error) + m->values[i] * 0.0 <= 1.0);) /* false where one is not finite */
    EACH_STATE(m, i, m->values[i] = CHOICE(good, m->values[i], x[i]);)
    *bad = *going & ~good;
}

/* The quarters of a step one after the other, for the lanes of `going`; slopes: at its start, then at its end. */
VECTORS static bool join_quarters(
    Group *m, const Driving *driving, double duration, const Bits *going, Lanes *slopes, Path *path) {
    double part = duration / QUARTERS;
    Lanes next[N_STATES], instead[N_STATES];
    for (int q = 0; q < QUARTERS; q++) {
        Driving own;
        Bits bad;
        within_step(driving, q, &own);
        join(m, &own, part, going, slopes, &bad, next);
        if (any_lane(&bad)) {
            for (int j = 0; j < N_INPUTS; j++) m->values[FIRST_INPUT + j] = ALL((own[0][j] + own[QUARTERS][j]) / 2);
            if (!advance_group(m, part, &bad)) return false;
            slopes_of(m, own[QUARTERS], instead);
            EACH_STATE(m, k, next[k] = CHOICE(bad, instead[k], next[k]);)
        }
        EACH_STATE(m, k, slopes[k] = CHOICE(*going, next[k], slopes[k]);
                   (*path)[q + 1][k] = CHOICE(*going, m->values[k], (*path)[q + 1][k]);)
    }
    return true;
}

/* A state at the samples within a step, from those at its ends and their slopes there. */
VECTORS static inline void fill_state(Path *path, int k, double duration, Lanes before, Lanes after) {
    Lanes begin = (*path)[0][k], rise = (*path)[QUARTERS][k] - begin;
    Lanes left = before * duration - rise, right = rise - after * duration;
    for (int q = 1; q < QUARTERS; q++) {
        double s = (double)q / QUARTERS;
        (*path)[q][k] = begin + rise * s + (left * (1 - s) + right * s) * (s * (1 - s));
    }
}

VECTORS static void fill(
    const Group *m, Path *path, double duration, const Lanes *before, const Lanes *after, const Needed *needed) {
    EACH_STATE(m, k, if (needed->states[k]) fill_state(path, k, duration, before[k], after[k]);)
}

/* All inputs at a sample. */
static void sampled(const Group *m, const Rows *asked, size_t k, double *inputs) {
    for (int j = 0; j < N_INPUTS; j++) inputs[j] = m->values[FIRST_INPUT + j][0];
    for (size_t j = 0; j < asked->n_inputs; j++)
        inputs[index_of(asked->inputs[j]) - FIRST_INPUT] = asked->during[k * asked->n_inputs + j];
}

static bool all_within(const Rows *asked) {
    for (size_t j = 0; j < asked->n_inputs; j++) {
        unsigned into = index_of(asked->inputs[j]);
        if (into < FIRST_INPUT || into >= FIRST_PARAMETER) return false;
        for (size_t k = 0; k < asked->n_samples; k++)
            if (!within(into, asked->during[k * asked->n_inputs + j])) return false;
    }
    return true;
}

/* -1, or the first of the rows from this one on, if one of them cannot be advanced. */
VECTORS static long long group_of_joined(const Rows *asked, size_t row) {
    Group m;
    Path path;
    Driving driving;
    Lanes slopes[N_STATES], after[N_STATES];
    Needed needed = needed_for(asked);
    int active = begin_group(&m, asked, row);
    size_t k = 0;
    Bits everyone = lanes_below(active), bad;
    sampled(&m, asked, 0, driving[0]);
    slopes_of(&m, driving[0], slopes);
    read_group(&m, asked, &needed, row, 0, active);
    for (; k + QUARTERS < asked->n_samples; k += QUARTERS) {
        double duration = asked->t[k + QUARTERS] - asked->t[k];
        for (int q = 0; q <= QUARTERS; q++) sampled(&m, asked, k + (size_t)q, driving[q]);
        EACH_STATE(&m, i, path[0][i] = m.values[i];)
        join(&m, &driving, duration, &everyone, slopes, &bad, after);
        EACH_STATE(&m, i, path[QUARTERS][i] = m.values[i];)
        fill(&m, &path, duration, slopes, after, &needed);
        if (any_lane(&bad)) {
            if (!join_quarters(&m, &driving, duration, &bad, slopes, &path)) return (long long)row;
            EACH_STATE(&m, i, after[i] = CHOICE(bad, slopes[i], after[i]);)
        }
        for (int q = 1; q <= QUARTERS; q++) {
            if (q < QUARTERS && (k + (size_t)q) % asked->every) continue;
            EACH_STATE(&m, i, m.values[i] = path[q][i];)
            for (int j = 0; j < N_INPUTS; j++) m.values[FIRST_INPUT + j] = ALL(driving[q][j]);
            read_group(&m, asked, &needed, row, k + (size_t)q, active);
        }
        memcpy(slopes, after, sizeof slopes);
    }
    for (; k + 1 < asked->n_samples; k++) { /* fewer samples than a step goes over are left */
        sampled(&m, asked, k, driving[0]);
        sampled(&m, asked, k + 1, driving[1]);
        for (int j = 0; j < N_INPUTS; j++) m.values[FIRST_INPUT + j] = ALL((driving[0][j] + driving[1][j]) / 2);
        if (!advance_group(&m, asked->t[k + 1] - asked->t[k], &everyone)) return (long long)row;
        for (int j = 0; j < N_INPUTS; j++) m.values[FIRST_INPUT + j] = ALL(driving[1][j]);
        read_group(&m, asked, &needed, row, k + 1, active);
    }
    return -1;
}
