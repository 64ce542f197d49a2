/* Loops over the generated function `step` and over FMI 2.0 instances, so that no Python is timed. */
#include <stddef.h>

#define SHOWN __attribute__((visibility("default")))

static void advance(const double *x, const double *u, const double *p, double dt, double *next) {
    const double *arg[WORK_ARG];
    double *res[WORK_RES], w[WORK_W], error;
    int iw[WORK_IW];
    arg[0] = x; arg[1] = u; arg[2] = p; arg[3] = &dt;
    res[0] = next; res[1] = &error;
    step(arg, res, iw, w, 0);
}

SHOWN void bare(double *x, const double *u, const double *p, double dt, int n) {
    double next[N_STATES];
    for (int k = 0; k < n; k++) {
        advance(x, u, p, dt, next);
        for (int i = 0; i < N_STATES; i++) x[i] = next[i];
    }
}

SHOWN void rows(const double *x, const double *u, const double *p, double dt, int n, int times) {
    double next[N_STATES];
    for (int t = 0; t < times; t++)
        for (int k = 0; k < n; k++) advance(x + k * N_STATES, u, p, dt, next);
}

typedef int (*Plain)(void *);
typedef int (*Values)(void *, const unsigned *, size_t, double *);
typedef int (*Setup)(void *, int, double, double, int, double);
typedef int (*Step)(void *, double, double, int);
typedef struct { Plain reset, enter, leave; Values set, get; Setup setup; Step step; } Calls;

SHOWN void steps(const Calls *f, void *c, double dt, int n) {
    for (int k = 0; k < n; k++) f->step(c, k * dt, dt, 1);
}

SHOWN void restarts(const Calls *f, void **copies, int n, const unsigned *refs, size_t n_x,
                    const double *x, double dt) {
    double value[n_x];
    for (int k = 0; k < n; k++) {
        void *c = copies[k];
        for (size_t i = 0; i < n_x; i++) value[i] = x[i];
        f->reset(c);
        f->set(c, refs, n_x, value);
        f->setup(c, 0, 0, 0, 0, 0);
        f->enter(c);
        f->leave(c);
        f->step(c, 0, dt, 1);
        f->get(c, refs, n_x, value);
    }
}
