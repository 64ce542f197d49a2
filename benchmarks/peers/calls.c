/* The calls of an FMU and the laws of an effect in bare loops, so that no Python is timed. */
#include <stdbool.h>
#include <stddef.h>

#define SHOWN __attribute__((visibility("default")))

typedef int (*Step2)(void *, double, double, int);
typedef int (*Step3)(void *, double, double, bool, bool *, bool *, bool *, double *);
typedef int (*Values2)(void *, const unsigned *, size_t, double *);
typedef int (*Values3)(void *, const unsigned *, size_t, double *, size_t);

static void step_of(int fmi, void *f, void *c, double t, double dt) {
    bool event, ends, early;
    double reached;
    if (fmi == 2) ((Step2)f)(c, t, dt, 1);
    else ((Step3)f)(c, t, dt, true, &event, &ends, &early, &reached);
}

static void values_of(int fmi, void *f, void *c, const unsigned *refs, size_t n, double *values) {
    if (fmi == 2) ((Values2)f)(c, refs, n, values);
    else ((Values3)f)(c, refs, n, values, n);
}

/* f: set, doStep, get. */
SHOWN void steps(int fmi, void **f, void *c, const double *t, int n) {
    for (int k = 0; k < n; k++) step_of(fmi, f[1], c, t[k], t[k + 1] - t[k]);
}

/* Each row of u (n, n_u) held over a step, after which a row of y (n, n_y) is read. */
SHOWN void calls(int fmi, void **f, void *c, const double *t, int n, const unsigned *u_refs, size_t n_u, double *u,
                 const unsigned *y_refs, size_t n_y, double *y) {
    for (int k = 0; k < n; k++) {
        values_of(fmi, f[0], c, u_refs, n_u, u + n_u * k);
        step_of(fmi, f[1], c, t[k], t[k + 1] - t[k]);
        values_of(fmi, f[2], c, y_refs, n_y, y + n_y * k);
    }
}

static volatile double KEPT; /* so that the compiler leaves no computation out */

/* motion (n + 1, n_m); z: what the laws are given; the results are not kept. */
SHOWN void arithmetic(const double *motion, int n_m, const double *z, double dt, int n) {
    const double *arg[WORK_ARG];
    double *res[WORK_RES], w[WORK_W], told[N_TOLD + 1], memory[N_MEMORY + 1];
    int iw[WORK_IW];
    for (int k = 0; k < n; k++, motion += n_m) {
        arg[0] = motion; arg[1] = z; arg[2] = &dt;
        res[0] = told;
        push(arg, res, iw, w, 0);
        for (int i = 0; i < N_TOLD; i++) KEPT = told[i];
        if (N_MEMORY == 0) continue;
        arg[1] = motion + n_m; arg[2] = z; arg[3] = &dt;
        res[0] = memory;
        go_on(arg, res, iw, w, 0);
        for (int i = 0; i < N_MEMORY; i++) KEPT = memory[i];
    }
}
