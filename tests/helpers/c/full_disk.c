/* A disk that takes no more: loaded before the C library (LD_PRELOAD), it lets changes of files fail.
 *
 * disk_fails(folder, n, error): from the n-th change of anything in the folder on, each fails with this error.
 * disk_changes(): how many changes there were since then, made or not.
 * disk_everywhere(count): also in the processes that are started from here, which count in this file too and
 * find the rest in the environment (DISK_COUNT, DISK_FOLDER, DISK_FROM, DISK_ERROR). There, the first write
 * that fails has written half of its bytes, as where a disk becomes full.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static char folder[PATH_MAX];
static long from = -1, own = 0, *changes = &own;
static int error = 0;

void disk_fails(const char *path, long n, int number) {
    snprintf(folder, sizeof folder, "%s", path);
    from = n, *changes = 0, error = number;
}
long disk_changes(void) { return *changes; }

void disk_everywhere(const char *count) {
    int file = open(count, O_RDWR);
    void *map = mmap(NULL, sizeof own, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (map != MAP_FAILED) changes = map;
    close(file);
}
__attribute__((constructor)) static void started(void) {
    const char *count = getenv("DISK_COUNT");
    if (!count) return;
    snprintf(folder, sizeof folder, "%s", getenv("DISK_FOLDER"));
    disk_everywhere(count);
    error = atoi(getenv("DISK_ERROR")), from = atol(getenv("DISK_FROM"));
}

/* 0: the change is made; 1: it fails; 2: it is the first that fails, where all processes count together */
static int fails(const char *path) {
    if (from < 0 || strncmp(path, folder, strlen(folder)) != 0) return 0;
    long n = __atomic_fetch_add(changes, 1, __ATOMIC_RELAXED);
    if (n < from) return 0;
    errno = error;
    return n == from && changes != &own ? 2 : 1;
}
static int open_fails(int number) {
    char link[64], path[PATH_MAX];
    if (from < 0) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", number);
    ssize_t n = readlink(link, path, sizeof path - 1);
    if (n < 0) return 0;
    path[n] = 0;
    return fails(path);
}
static int path_fails(const char *path) {
    char full[2 * PATH_MAX], here[PATH_MAX];
    if (from < 0 || !path) return 0;
    if (path[0] == '/') return fails(path);
    if (!getcwd(here, sizeof here)) return 0;
    snprintf(full, sizeof full, "%s/%s", here, path);
    return fails(full);
}

#define REAL(name) \
    static __typeof__(name) *real; \
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, #name)
#define CHANGES (O_WRONLY | O_RDWR | O_CREAT | O_TRUNC)
#define MODE \
    va_list rest; \
    va_start(rest, flags); \
    mode_t mode = flags & O_CREAT ? va_arg(rest, mode_t) : 0; \
    va_end(rest)
#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        REAL(name); \
        MODE; \
        return flags & CHANGES && path_fails(path) ? -1 : real(path, flags, mode); \
    }
#define OPENAT(name) \
    int name(int at, const char *path, int flags, ...) { \
        REAL(name); \
        MODE; \
        return at == AT_FDCWD && flags & CHANGES && path_fails(path) ? -1 : real(at, path, flags, mode); \
    }
#define FOPEN(name) \
    FILE *name(const char *path, const char *how) { \
        REAL(name); \
        return strpbrk(how, "wa+") && path_fails(path) ? NULL : real(path, how); \
    }
OPEN(open) OPEN(open64) OPENAT(openat) OPENAT(openat64) FOPEN(fopen) FOPEN(fopen64)
ssize_t write(int file, const void *data, size_t n) {
    REAL(write);
    int how = open_fails(file);
    if (how == 2 && n > 1) return real(file, data, n / 2);
    return how ? -1 : real(file, data, n);
}
ssize_t writev(int file, const struct iovec *data, int n) {
    REAL(writev);
    return open_fails(file) ? -1 : real(file, data, n);
}
ssize_t pwrite64(int file, const void *data, size_t n, off64_t at) {
    REAL(pwrite64);
    return open_fails(file) ? -1 : real(file, data, n, at);
}
int rename(const char *a, const char *b) {
    REAL(rename);
    return path_fails(b) ? -1 : real(a, b);
}
int mkdir(const char *path, mode_t mode) {
    REAL(mkdir);
    return path_fails(path) ? -1 : real(path, mode);
}
