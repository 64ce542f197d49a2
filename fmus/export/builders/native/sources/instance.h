/* What one instance holds. All of it is here: there are no globals, and no memory is asked for in a step. */

#if FMI_VERSION == 2

#include "fmi2Functions.h"

typedef fmi2CallbackLogger Logger;
typedef fmi2ComponentEnvironment Environment;
#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#undef fmi2FullName
#define PASTED(a, b) a##b
#define PREFIXED(a, b) PASTED(a, b)
#define fmi2FullName(name) PREFIXED(FMI2_FUNCTION_PREFIX, name)
#endif

#else

#include "fmi3Functions.h"

typedef fmi3LogMessageCallback Logger;
typedef fmi3InstanceEnvironment Environment;

#endif

/* Answers of a call, with the numbers that FMI 2 and FMI 3 share. */
typedef enum { OK = 0, DISCARD = 2, ERROR = 3 } Status;

typedef enum { MODEL_EXCHANGE = 1, CO_SIMULATION = 2 } Kind;

/* Modes of FMI's state machine, as bits of a set. */
enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8,
    STEP = 16,
    TERMINATED = 32,
    RUNNING = EVENT | CONTINUOUS | STEP,
    COMPUTABLE = INITIALIZATION | RUNNING | TERMINATED,
    ANY_MODE = INSTANTIATED | COMPUTABLE
};

enum { N_SET = N_STATES + N_INPUTS + N_PARAMETERS, N_VARIABLES = N_SET + N_OUTPUTS + N_LOCALS };
enum { FIRST_INPUT = N_STATES, FIRST_PARAMETER = N_STATES + N_INPUTS, FIRST_LOCAL = N_SET + N_OUTPUTS };

#define AT_LEAST_1(n) ((n) > 0 ? (n) : 1) /* C has no arrays without elements */

/* All that there is to the state of an FMU; without gaps, so that its bytes repeat. */
typedef struct {
    double values[AT_LEAST_1(N_SET)];   /* states, inputs, parameters */
    double rates[AT_LEAST_1(N_INPUTS)]; /* of the inputs over the next communication step, 1/s */
    double time;                      /* s */
    int kind, mode;
} Memory;

/* What a saved state says it is, before what it holds. */
typedef struct {
    char token[sizeof MODEL_TOKEN];
    Memory memory;
} Saved;

typedef struct {
    Memory now;
    double outputs[AT_LEAST_1(N_OUTPUTS)], slopes[N_STATES]; /* computed when first asked for after a change */
    bool outputs_known, slopes_known;
    bool any_time; /* a restored state may go on at any time, the equations do not contain it */

    double next[N_STATES], before[N_STATES]; /* of an internal step, of a communication step */
    double first[AT_LEAST_1(N_INPUTS)];      /* inputs at the start of a communication step */
    double seed[AT_LEAST_1(N_SET)];          /* of a derivative: by states, inputs, parameters */
    double tangent[N_STATES + N_OUTPUTS];    /* by slopes, outputs */
    const double *arg[WORK_ARG];
    double *res[WORK_RES];
    int iw[AT_LEAST_1(WORK_IW)];
    double w[AT_LEAST_1(WORK_W)];

    Logger log;
    Environment environment;
    bool logs[N_CATEGORIES];
    char name[128];
} Instance;

static void tell(const Instance *m, Status status, const char *text);
