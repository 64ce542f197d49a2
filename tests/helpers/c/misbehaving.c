/* An FMI 2.0 co-simulation FMU of x' = -k x + u that misbehaves as its token asks: "FAULT@CALL".
 *
 * One library serves all faults, except those that happen while it is loaded (-DAT_LOAD).
 */
#define _GNU_SOURCE
#include <fenv.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

typedef unsigned int Reference;
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Callbacks;
typedef struct {
    char fault[32], call[32], name[64];
    double x, u, k, hidden, t;
    const Callbacks *callbacks;
    int steps;
} Model;

enum { OK, WARNING, DISCARD, ERROR, FATAL };
static double shared = 1.0;
static int made = 0;
static volatile int forever = 1;

static int deep(int n) {
    volatile char room[4096];
    room[n % 4096] = (char)n;
    return n < 0 ? 0 : deep(n + 1) + room[n % 4096];
}

static void *crash(void *unused) {
    (void)unused;
    *(volatile int *)0 = 1;
    return NULL;
}

static int is(const char *a, const char *b) { return strcmp(a, b) == 0; }

/* What ends the process, or never returns. */
static void end_by(const char *fault) {
    if (is(fault, "exit0")) exit(0);
    if (is(fault, "exit1")) exit(1);
    if (is(fault, "_exit0")) _exit(0);
    if (is(fault, "_exit7")) _exit(7);
    if (is(fault, "abort")) abort();
    if (is(fault, "segfault")) *(volatile int *)0 = 1;
    if (is(fault, "stack")) forever = deep(0);
    if (is(fault, "illegal")) raise(SIGILL);
    if (is(fault, "bus")) raise(SIGBUS);
    if (is(fault, "divide")) raise(SIGFPE);
    if (is(fault, "kill")) kill(getpid(), SIGKILL);
    if (is(fault, "terminate")) kill(getpid(), SIGTERM);
    if (is(fault, "trap")) raise(SIGTRAP);
    if (is(fault, "assert")) {
        fprintf(stderr, "model.c:42: step: Assertion `h > 0' failed.\n");
        abort();
    }
    if (is(fault, "says")) {
        printf("solver: the step is too small\n");
        abort();
    }
    if (is(fault, "endless")) while (forever) {}
    if (is(fault, "sleep")) for (;;) sleep(1000);
    if (is(fault, "deadlock")) {
        pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
        pthread_mutex_lock(&lock);
        pthread_mutex_lock(&lock);
    }
    if (is(fault, "thread")) {
        pthread_t other;
        pthread_create(&other, NULL, crash, NULL);
        pthread_join(other, NULL);
    }
    if (is(fault, "memory"))
        for (;;) {
            char *more = malloc(1 << 26);
            if (!more) abort();
            memset(more, 1, 1 << 26);
        }
    if (is(fault, "jump")) ((void (*)(void))(size_t)0x10)();
    if (is(fault, "cut_off")) { /* as a daemon closes what it has inherited, and goes on */
        for (int n = 3; n < 1024; n++) close(n);
        while (forever) {}
    }
    if (is(fault, "cuts_memory")) {
        for (int n = 3; n < 1024; n++)
            if (ftruncate(n, 0)) continue;
        while (forever) {}
    }
    if (is(fault, "shared_memory")) { /* 0.8 GB, which no limit of the system on data counts */
        for (int n = 0; n < 12; n++) {
            char *more = mmap(NULL, 1 << 26, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
            if (more == MAP_FAILED) abort();
            memset(more, 1, 1 << 26);
        }
        sleep(1000);
    }
    if (is(fault, "stop")) raise(SIGSTOP);
    if (is(fault, "alarm")) {
        alarm(1);
        for (;;) sleep(1000);
    }
    if (is(fault, "readonly")) {
        char *page = mmap(NULL, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        page[0] = 1;
    }
    if (is(fault, "twice")) {
        char *volatile once = malloc(64);
        free(once);
        free(once);
    }
}

/* What goes on, changed. Returns the status. */
static int disturb(Model *m) {
    const char *f = m->fault;
    if (is(f, "warning")) return WARNING;
    if (is(f, "discard")) return DISCARD;
    if (is(f, "error")) return ERROR;
    if (is(f, "fatal")) return FATAL;
    if (is(f, "status")) return 77;
    if (is(f, "null_message"))
        m->callbacks->logger(m->callbacks->environment, m->name, ERROR, "logStatusError", NULL);
    if (is(f, "formats"))
        m->callbacks->logger(m->callbacks->environment, m->name, ERROR, "logStatusError", "100%% %d", 5);
    if (is(f, "log_flood"))
        for (int i = 0; i < 2000; i++)
            m->callbacks->logger(m->callbacks->environment, m->name, WARNING, "log", "line %d", i);
    if (is(f, "print_flood"))
        for (int i = 0; i < 2000; i++) printf("line %d of very many\n", i);
    if (is(f, "no_line")) printf("%0100000d", 1);
    if (is(f, "closes_output")) { fclose(stdout); close(1); close(2); }
    if (is(f, "directory") && chdir("/")) return ERROR;
    if (is(f, "locale")) setlocale(LC_ALL, "de_DE.UTF-8");
    if (is(f, "rounding")) fesetround(FE_UPWARD);
    if (is(f, "traps")) feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
    if (is(f, "ignores_signals")) { signal(SIGINT, SIG_IGN); signal(SIGTERM, SIG_IGN); }
    if (is(f, "leak")) memset(malloc(1 << 16), 1, 1 << 16);
    if (is(f, "background") && m->steps == 0 && fork() == 0) { /* leaves session and parent */
        setsid();
        if (fork() == 0) sleep(600);
        _exit(0);
    }
    if (is(f, "child") && m->steps == 0 && fork() == 0) { sleep(600); _exit(0); }
    return OK;
}

static int at(Model *m, const char *call) {
    if (!is(m->call, call) || (is(call, "late") && m->t < 0.05)) return OK;
    end_by(m->fault);
    return disturb(m);
}

#ifdef AT_LOAD
__attribute__((constructor)) static void loaded(void) { end_by(AT_LOAD); }
#endif

void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                      const Callbacks *callbacks, int visible, int logging) {
    (void)type, (void)resources, (void)visible, (void)logging;
    Model *m = calloc(1, sizeof *m);
    sscanf(token, "%31[^@]@%31s", m->fault, m->call);
    snprintf(m->name, sizeof m->name, "%s", name);
    m->callbacks = callbacks;
    m->x = 1.0, m->k = 2.0;
    made++;
    if (at(m, "instantiate") > WARNING) return NULL;
    return m;
}
void fmi2FreeInstance(void *c) { if (at(c, "free") <= WARNING) free(c); }
int fmi2SetupExperiment(Model *m, int set, double tolerance, double t, int stops, double stop) {
    (void)set, (void)tolerance, (void)stops, (void)stop;
    m->t = t;
    return at(m, "setup");
}
int fmi2EnterInitializationMode(Model *m) {
    if (is(m->fault, "shared")) shared = m->x;
    return at(m, "enter");
}
int fmi2ExitInitializationMode(Model *m) { return at(m, "leave"); }
int fmi2Terminate(Model *m) { return at(m, "terminate"); }
int fmi2Reset(Model *m) {
    m->x = 1.0, m->k = 2.0, m->u = 0.0, m->steps = 0, m->t = 0.0;
    if (!is(m->fault, "survives")) m->hidden = 0.0;
    return at(m, "reset");
}
int fmi2SetReal(Model *m, const Reference *r, size_t n, const double *v) {
    for (size_t i = 0; i < n; i++) *(r[i] == 0 ? &m->x : r[i] == 1 ? &m->u : &m->k) = v[i];
    return at(m, "set");
}
int fmi2GetReal(Model *m, const Reference *r, size_t n, double *v) {
    double x = is(m->fault, "shared") ? shared : m->x;
    if (is(m->fault, "nan") && m->t > 0.05) x = NAN;
    if (is(m->fault, "infinite") && m->t > 0.05) x = INFINITY;
    for (size_t i = 0; i < n; i++) v[i] = r[i] == 0 ? x : r[i] == 1 ? m->u : r[i] == 2 ? m->k : 2 * x;
    return at(m, "get");
}
int fmi2DoStep(Model *m, double t, double dt, int unused) {
    (void)unused;
    m->t = t;
    int status = at(m, "step");
    if (status <= WARNING) status = at(m, "late");
    if (status > WARNING) return status;
    if (is(m->fault, "random")) m->x += 1e-6 * rand() / RAND_MAX;
    if (is(m->fault, "hidden") || is(m->fault, "survives")) m->hidden += dt * m->x;
    m->x += dt * (m->u - m->k * m->x - m->hidden);
    shared += dt * (m->u - m->k * shared);
    m->t = t + dt;
    m->steps++;
    return status;
}
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
#define MISSING(name) int name(void) { return ERROR; }
MISSING(fmi2CancelStep) MISSING(fmi2GetInteger) MISSING(fmi2GetBoolean) MISSING(fmi2GetString)
MISSING(fmi2SetInteger) MISSING(fmi2SetBoolean) MISSING(fmi2SetString) MISSING(fmi2GetFMUstate)
MISSING(fmi2SetFMUstate) MISSING(fmi2FreeFMUstate) MISSING(fmi2SerializedFMUstateSize)
MISSING(fmi2SerializeFMUstate) MISSING(fmi2DeSerializeFMUstate) MISSING(fmi2GetDirectionalDerivative)
MISSING(fmi2SetRealInputDerivatives) MISSING(fmi2GetRealOutputDerivatives) MISSING(fmi2GetStatus)
MISSING(fmi2GetRealStatus) MISSING(fmi2GetIntegerStatus) MISSING(fmi2GetBooleanStatus)
MISSING(fmi2GetStringStatus)
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *names) {
    (void)c, (void)on, (void)n, (void)names;
    return OK;
}
