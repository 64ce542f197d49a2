/* A host that is not Python and knows nothing but FMI 2.0: LIBRARY GUID RESOURCES. Loads an FMU of co-simulation,
   makes ten steps of 10 ms, ends, and leaves the library loaded, as hosts do that unload nothing. */

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

typedef void *Component;
typedef void Logger(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger *logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Functions;

static void heard(void *e, const char *name, int status, const char *category, const char *text, ...) {
    va_list more;
    (void)e, (void)name, (void)status, (void)category;
    va_start(more, text);
    vprintf(text, more);
    va_end(more);
    printf("\n");
}

static void *library;

static void *found(const char *name) {
    void *function = dlsym(library, name);
    if (function) return function;
    printf("no %s\n", name);
    exit(1);
}
#define CALL(type, name) ((type)found("fmi2" #name))
#define DONE(call) if ((call) != 0) { printf("%s\n", #call); return 1; }

int main(int n, char *given[]) {
    Functions functions = {heard, calloc, free, NULL, NULL};
    Component c;
    if (n != 4 || !(library = dlopen(given[1], RTLD_NOW | RTLD_LOCAL))) {
        printf("%s\n", n == 4 ? dlerror() : "LIBRARY GUID RESOURCES");
        return 1;
    }
    c = CALL(Component(*)(const char *, int, const char *, const char *, const Functions *, int, int), Instantiate)(
        "one", 1, given[2], given[3], &functions, 0, 1);
    if (!c) return 1;
    DONE(CALL(int (*)(Component, int, double, double, int, double), SetupExperiment)(c, 0, 0.0, 0.0, 0, 0.0));
    DONE(CALL(int (*)(Component), EnterInitializationMode)(c));
    DONE(CALL(int (*)(Component), ExitInitializationMode)(c));
    for (int k = 0; k < 10; k++) DONE(CALL(int (*)(Component, double, double, int), DoStep)(c, k * 0.01, 0.01, 1));
    DONE(CALL(int (*)(Component), Terminate)(c));
    CALL(void (*)(Component), FreeInstance)(c);
    printf("ended\n");
    return 0;
}
