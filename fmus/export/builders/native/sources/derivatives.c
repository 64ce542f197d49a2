/* Partial derivatives by automatic differentiation: of state derivatives and outputs (unknowns) by states,
   inputs and parameters (knowns). A state is an output too: its derivative by itself is 1. */

static Status knowns_fit(const Instance *m, const char *call, const unsigned *references, size_t n) {
    for (size_t k = 0; k < n; k++)
        if (index_of(references[k]) >= N_SET)
            return refuse(m, ERROR, "%s: the variable with reference %u is no state, input or parameter", call,
                          references[k]);
    return OK;
}

/* An unknown's place in the tangent; -1 for a state, -2 for what is not an unknown. */
static int place_of(unsigned reference) {
    unsigned i = index_of(reference);
    if (i < N_STATES) return -1;
    if (i < N_SET || i >= N_VARIABLES) return -2;
    return i < FIRST_LOCAL ? (int)(N_STATES + i - N_SET) : (int)LOCALS[i - FIRST_LOCAL];
}

static Status unknowns_fit(const Instance *m, const char *call, const unsigned *references, size_t n) {
    for (size_t k = 0; k < n; k++)
        if (place_of(references[k]) == -2)
            return refuse(m, ERROR, "%s: the variable with reference %u is no output or state derivative", call,
                          references[k]);
    return OK;
}

static Status derivative_call_fits(const Instance *m, const char *call, const unsigned *unknowns, size_t n_unknown,
                                   const unsigned *knowns, size_t n_known) {
    if (!allowed(m, call, COMPUTABLE)) return ERROR;
    if (n_unknown && !given(m, call, unknowns)) return ERROR;
    if (n_known && !given(m, call, knowns)) return ERROR;
    if (knowns_fit(m, call, knowns, n_known) != OK) return ERROR;
    return unknowns_fit(m, call, unknowns, n_unknown);
}

/* out[unknown] = sum over knowns of d unknown/d known * in[known] */
static Status forward_derivative(Instance *m, const char *call, const unsigned *unknowns, size_t n_unknown,
                                 const unsigned *knowns, size_t n_known, const double *in, double *out) {
    if (derivative_call_fits(m, call, unknowns, n_unknown, knowns, n_known) != OK) return ERROR;
    if ((n_known && !given(m, call, in)) || (n_unknown && !given(m, call, out))) return ERROR;
    memset(m->seed, 0, sizeof m->seed);
    for (size_t k = 0; k < n_known; k++) m->seed[index_of(knowns[k])] += in[k];
    bind(m, m->now.values);
    m->arg[3] = m->seed;
    m->res[0] = m->tangent;
    if (forward(m->arg, m->res, m->iw, m->w, 0)) return refuse(m, ERROR, "%s: cannot be computed here", call);
    for (size_t k = 0; k < n_unknown; k++) {
        int place = place_of(unknowns[k]);
        out[k] = place < 0 ? m->seed[index_of(unknowns[k])] : m->tangent[place];
    }
    return OK;
}

#if FMI_VERSION == 3
/* out[known] = sum over unknowns of in[unknown] * d unknown/d known */
static Status adjoint_derivative(Instance *m, const char *call, const unsigned *unknowns, size_t n_unknown,
                                 const unsigned *knowns, size_t n_known, const double *in, double *out) {
    if (derivative_call_fits(m, call, unknowns, n_unknown, knowns, n_known) != OK) return ERROR;
    if ((n_unknown && !given(m, call, in)) || (n_known && !given(m, call, out))) return ERROR;
    memset(m->tangent, 0, sizeof m->tangent);
    for (size_t k = 0; k < n_unknown; k++) {
        int place = place_of(unknowns[k]);
        if (place >= 0) m->tangent[place] += in[k];
    }
    bind(m, m->now.values);
    m->arg[3] = m->tangent;
    m->res[0] = m->seed;
    if (reverse(m->arg, m->res, m->iw, m->w, 0)) return refuse(m, ERROR, "%s: cannot be computed here", call);
    for (size_t k = 0; k < n_unknown; k++)
        if (place_of(unknowns[k]) == -1) m->seed[index_of(unknowns[k])] += in[k];
    for (size_t k = 0; k < n_known; k++) out[k] = m->seed[index_of(knowns[k])];
    return OK;
}
#endif
