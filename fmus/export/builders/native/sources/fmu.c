/* The whole FMU as one unit: all that is not an FMI function is static, so that nothing else is seen outside.

   Compile it to a shared library with
       cc -std=c99 -O2 -ffp-contract=off -fvisibility=hidden -fPIC -shared
          -DFMI2_OVERRIDE_FUNCTION_PREFIX -DFMI3_OVERRIDE_FUNCTION_PREFIX fmu.c -o NAME.so -lm
   Without the two definitions every function has the model's name as a prefix, for static linking. */

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function" /* CasADi offers more than is asked here */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#if defined(IN_ROWS) && defined(__clang__)
#define SELDOM_CALLED _Pragma("clang optimize off") /* by rows; half of the compiler's time */
#define OFTEN_CALLED _Pragma("clang optimize on")
#else
#define SELDOM_CALLED
#define OFTEN_CALLED
#endif
#define CASADI_SYMBOL_EXPORT static
#include "quick.c"
SELDOM_CALLED
#include "equations.c"
#undef pow
#undef floor
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include "instance.h"

#include "instance.c"
OFTEN_CALLED
#include "values.c"
#include "stepping.c"
SELDOM_CALLED
#include "states.c"
#include "derivatives.c"
OFTEN_CALLED
#include "lanes.c"
SELDOM_CALLED

#if FMI_VERSION == 2
#include "fmi2.c"
#else
#include "fmi3.c"
#include "fmi3_absent.c"
#endif
