/* In place of derivatives.c where only simulations are wanted: the description says that derivatives are not
   offered, and a call is refused. */

static Status forward_derivative(Instance *m, const char *call, const unsigned *unknowns, size_t n_unknown,
                                 const unsigned *knowns, size_t n_known, const double *in, double *out) {
    (void)unknowns;
    (void)n_unknown;
    (void)knowns;
    (void)n_known;
    (void)in;
    (void)out;
    if (!allowed(m, call, ANY_MODE)) return ERROR;
    return refuse(m, ERROR, "%s: this build offers no derivatives", call);
}
