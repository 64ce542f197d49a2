/* What is included here once for any processor and once for vectors of four doubles, under other names. */

#define LANES_PASTED(name, ending) name##_##ending
#define LANES_ENDING(name, ending) LANES_PASTED(name, ending)
#define LANES(name) LANES_ENDING(name, PROCESSOR)

#if !defined(FOR_THIS_MACHINE) || !defined(__x86_64__)
#define FOR_ANY
#define PROCESSOR any
#include "lanes.h"
#ifdef WITH_CALLED
#include "lanes_called.c"
#endif
#ifdef WITH_ROWS
#include "lanes_equations.c"
#include "lanes_rows.c"
#endif
#undef PROCESSOR
#endif

#if defined(__x86_64__)
#define PROCESSOR avx2
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif
#include "lanes.h"
#ifdef WITH_CALLED
#include "lanes_called.c"
#endif
#ifdef WITH_ROWS
#include "lanes_equations.c"
#include "lanes_rows.c"
#endif
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#undef PROCESSOR
#endif
