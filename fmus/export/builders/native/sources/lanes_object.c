/* What the equations call, for several rows at once, as a unit of its own: it is the same for many models. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "quick.c"
#undef pow
#undef floor

#include "lanes.h"
#define CALLED VECTORS __attribute__((visibility("hidden"))) void
#include "lanes_called.c"
