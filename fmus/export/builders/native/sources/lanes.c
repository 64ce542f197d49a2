/* Rows of values through one step or a whole record, four or eight at once; not a part of FMI, for hosts that know it.

   Every row is advanced as one instance of its own would be: the same internal steps, divided the same way. */

#if defined(__GNUC__) && HAS_LANES
#include "lanes.h"

/* Whether processor and system have the vectors that the code is for. */
#if defined(__x86_64__)
#include <cpuid.h>

static bool has_vectors(void) {
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_AVX)) return false;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & 6) != 6 || !__get_cpuid_count(7, 0, &a, &b, &c, &d)) return false;
#if WIDTH == 8
    unsigned needed = bit_AVX512F | bit_AVX512DQ | bit_AVX512VL;
    return (low & 0xe6) == 0xe6 && (b & needed) == needed;
#else
    return b & bit_AVX2;
#endif
}
#else
static bool has_vectors(void) { return true; }
#endif

/* What is asked: rows of values to set at first, samples of inputs that all rows share, what to read. */
typedef struct {
    size_t n_base;
    const double *base; /* the first of all that can be set, or all; what is not a number has its start value */
    size_t n_rows, n_put;
    const unsigned *put;
    const double *rows; /* (n_rows, n_put) */
    size_t n_samples;
    const double *t;    /* (n_samples) */
    size_t n_inputs;
    const unsigned *inputs;
    const double *during, *after; /* (n_samples - 1, n_inputs) over a step, and set once it is made, or none */
    size_t n_get;
    const unsigned *get;
    int first;          /* whether values before the first step are read too */
    double *found;      /* (n_rows, (n_samples - 1) / every + first, n_get) */
    int processor;      /* 0 at first; then what is known, for the question takes longer than a step */
    int joined;         /* whether a step goes over four samples: `during` has all samples (n_samples, n_inputs) then */
    size_t every;       /* a divisor of n_samples - 1: every so-manyth sample after the first one is read */
} Rows;

enum { WITHOUT_VECTORS = 1, WITH_VECTORS };

#ifdef FOR_THIS_MACHINE
#define CALLED VECTORS __attribute__((visibility("hidden"))) void
#else
#define CALLED VECTORS static __attribute__((noinline)) void
#endif
#ifndef FOR_THIS_MACHINE
#include "lanes_called.c"
#endif
#include "lanes_equations.c"
#include "lanes_rows.c"
#ifdef JOINS
#include "lanes_joined.c"
#endif

#if defined(FMI2_OVERRIDE_FUNCTION_PREFIX) || defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define LANES_NAMED(name) name
#elif FMI_VERSION == 2
#define LANES_NAMED(name) LANES_PREFIXED(FMI2_FUNCTION_PREFIX, name)
#else
#define LANES_NAMED(name) LANES_PREFIXED(FMI3_FUNCTION_PREFIX, name)
#endif
#define LANES_JOINED(prefix, name) prefix##name
#define LANES_PREFIXED(prefix, name) LANES_JOINED(prefix, name)

#if FMI_VERSION == 2
#define LANES_EXPORTED FMI2_Export
#else
#define LANES_EXPORTED FMI3_Export
#endif

/* Number of rows that take the time of little more than one. */
LANES_EXPORTED int LANES_NAMED(railfmi_rows_at_once)(void) { return WIDTH; }

/* -1, or the first row that cannot be set or advanced; an instance of its own tells why. */
LANES_EXPORTED long long LANES_NAMED(railfmi_rows_2)(Rows *asked) {
    if (!asked->processor) asked->processor = has_vectors() ? WITH_VECTORS : WITHOUT_VECTORS;
    if (asked->processor == WITHOUT_VECTORS) return 0;
    if (asked->n_base > N_SET || asked->n_samples == 0 || asked->every == 0) return 0;
    for (size_t k = 0; k < asked->n_base; k++)
        if (!isnan(asked->base[k]) && !within((unsigned)k, asked->base[k])) return 0;
    for (size_t k = 0; k < asked->n_put; k++)
        if (index_of(asked->put[k]) >= N_SET) return 0;
    for (size_t k = 0; k < asked->n_inputs; k++)
        if (index_of(asked->inputs[k]) >= N_SET) return 0;
    for (size_t k = 0; k < asked->n_get; k++)
        if (index_of(asked->get[k]) >= N_VARIABLES) return 0;
    for (size_t i = 0; i < asked->n_rows; i++)
        for (size_t k = 0; k < asked->n_put; k++)
            if (!within(index_of(asked->put[k]), asked->rows[i * asked->n_put + k])) return (long long)i;
    long long failed = -1;
#ifdef JOINS
    if (asked->joined) {
        if (!all_within(asked)) return 0;
        for (size_t row = 0; row < asked->n_rows && failed < 0; row += WIDTH) failed = group_of_joined(asked, row);
        return failed;
    }
#endif
    for (size_t row = 0; row < asked->n_rows && failed < 0; row += WIDTH) failed = group_of_rows(asked, row);
    return failed;
}

#ifdef JOINS
/* Number of samples that a step may go over. */
LANES_EXPORTED int LANES_NAMED(railfmi_joins)(void) { return QUARTERS; }
#endif

#endif
