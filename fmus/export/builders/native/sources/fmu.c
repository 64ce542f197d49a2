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
#define CASADI_SYMBOL_EXPORT static
#include "quick.c"
#if defined(IN_ROWS) && defined(__clang__)
#pragma clang optimize off /* a third of the compiler's time */
#endif
#include "equations.c"
#if defined(IN_ROWS) && defined(__clang__)
#pragma clang optimize on
#endif
#undef pow
#undef floor
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include "instance.h"

#include "instance.c"
#include "values.c"
#include "stepping.c"
#include "states.c"
#include "derivatives.c"
#include "lanes.c"

#if FMI_VERSION == 2
#include "fmi2.c"
#else
#include "fmi3.c"
#include "fmi3_absent.c"
#endif
