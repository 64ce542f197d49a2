/* What the equations call, for four rows at once, as a unit of its own: it is the same for many models. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "quick.c"
#undef pow
#undef floor

#define FOR_THIS_MACHINE
#define CALLED __attribute__((visibility("hidden")))
#define WITH_CALLED
#include "lanes_processors.c"
