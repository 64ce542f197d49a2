/* Rows through a record whose inputs are samples of continuous signals: a step goes over four samples.

   At the samples within a step, the states are on cubics through its ends with their slopes. A row for which a step is
   no good makes four of a sample each, and what is no good even then is divided further, with its inputs held. */

enum { QUARTERS = 4, N_JOINED = N_SET + 1 + QUARTERS * N_INPUTS + N_STATES };

/* States at the samples of a step. */
typedef Lanes Path[QUARTERS + 1][N_STATES];

/* Inputs (N_INPUTS) by quarters of a step, the first one at its start. */
typedef double Driving[QUARTERS + 1][AT_LEAST_1(N_INPUTS)];

VECTORS static void slopes_of(Group *m, const double *inputs, Lanes *slopes) {
    for (int j = 0; j < N_INPUTS; j++) m->values[FIRST_INPUT + j] = ALL(inputs[j]);
    lanes_f(m->values, slopes);
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

/* Advance the lanes of `going` from these slopes, and give those at the end; lanes for which the step is no good, `bad`,
   stay where they are. */
VECTORS static void join(
    Group *m, const Driving *driving, double duration, const Bits *going, const Lanes *slopes, Bits *bad, Lanes *after) {
    Lanes given[N_JOINED], next[2 * N_STATES + 1];
    memcpy(given, m->values, sizeof m->values);
    for (int j = 0; j < N_INPUTS; j++) given[FIRST_INPUT + j] = ALL((*driving)[0][j]);
    Lanes *rest = given + N_SET;
    *rest++ = ALL(duration);
    for (int i = 1; i <= QUARTERS; i++)
        for (int j = 0; j < N_INPUTS; j++) *rest++ = ALL((*driving)[i][j]);
    memcpy(rest, slopes, N_STATES * sizeof(Lanes));
    lanes_joined(given, next);
    Lanes sum = ALL(0.0);
    for (int k = 0; k < 2 * N_STATES + 1; k++) sum = sum + next[k] * 0.0; /* not a number where one is not finite */
    sum = sum + next[N_STATES];
    Bits good = (Bits)(sum <= 1.0) & *going;
    for (int k = 0; k < N_STATES; k++) m->values[k] = CHOICE(good, next[k], m->values[k]);
    *bad = *going & ~good;
    memcpy(after, next + N_STATES + 1, N_STATES * sizeof(Lanes));
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
            for (int k = 0; k < N_STATES; k++) next[k] = CHOICE(bad, instead[k], next[k]);
        }
        for (int k = 0; k < N_STATES; k++) {
            slopes[k] = CHOICE(*going, next[k], slopes[k]);
            (*path)[q + 1][k] = CHOICE(*going, m->values[k], (*path)[q + 1][k]);
        }
    }
    return true;
}

/* States at the samples within a step, from those at its ends and their slopes there. */
VECTORS static void fill(Path *path, double duration, const Lanes *before, const Lanes *after, const Needed *needed) {
    for (int k = 0; k < N_STATES; k++) {
        if (!needed->states[k]) continue;
        Lanes begin = (*path)[0][k], rise = (*path)[QUARTERS][k] - begin;
        Lanes left = before[k] * duration - rise, right = rise - after[k] * duration;
        for (int q = 1; q < QUARTERS; q++) {
            double s = (double)q / QUARTERS;
            (*path)[q][k] = begin + rise * s + (left * (1 - s) + right * s) * (s * (1 - s));
        }
    }
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
        memcpy(path[0], m.values, sizeof path[0]);
        join(&m, &driving, duration, &everyone, slopes, &bad, after);
        memcpy(path[QUARTERS], m.values, sizeof path[QUARTERS]);
        fill(&path, duration, slopes, after, &needed);
        if (any_lane(&bad)) {
            if (!join_quarters(&m, &driving, duration, &bad, slopes, &path)) return (long long)row;
            for (int j = 0; j < N_STATES; j++) after[j] = CHOICE(bad, slopes[j], after[j]);
        }
        for (int q = 1; q <= QUARTERS; q++) {
            if (q < QUARTERS && (k + (size_t)q) % asked->every) continue;
            memcpy(m.values, path[q], sizeof path[q]);
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
