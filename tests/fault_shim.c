/* Preloaded into a run: stops or starves it at a chosen call that writes, or lets the clock jump.
 *
 *   FAULT_DIR    only calls on files below this directory count: write, pwrite, ftruncate, fsync, rename, unlink, mkdir
 *   FAULT_AT     the call (from 1) at which it happens; 0 or absent: never
 *   FAULT_KIND   kill: SIGKILL before the call. torn: SIGKILL in the middle of it, between two pages of 4096 bytes of the
 *                file as the kernel would be interrupted, or before it. Otherwise an error number, as 28 for a full disk: from then on
 *                every call that writes fails with it; if the first of them makes its file longer, it still writes half.
 *   FAULT_SPLIT  file that gets a line for each write into more than one page: its file, offset and length
 *   FAULT_COUNT  file that gets the number of calls at the end of the process
 *   FAULT_CLOCK  if set, the real-time clock jumps by up to a year back and forth at every look; the monotonic one does not
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

#define REAL(type, name, ...) static type (*real)(__VA_ARGS__); \
    if (!real) real = (type (*)(__VA_ARGS__))dlsym(RTLD_NEXT, name)

static const char *dir, *kind;
static long at, calls;
static int error_number; /* of FAULT_KIND, 0 if it kills */

__attribute__((constructor)) static void begin(void) {
    dir = getenv("FAULT_DIR");
    kind = getenv("FAULT_KIND");
    at = getenv("FAULT_AT") ? atol(getenv("FAULT_AT")) : 0;
    error_number = kind ? atoi(kind) : 0;
}

__attribute__((destructor)) static void end(void) {
    const char *path = getenv("FAULT_COUNT");
    FILE *file = path ? fopen(path, "w") : NULL;
    if (file) {
        fprintf(file, "%ld\n", calls);
        fclose(file);
    }
}

static int below(const char *path) { return dir && path && strncmp(path, dir, strlen(dir)) == 0; }

static int ours(int fd) {
    char link[64], path[PATH_MAX];
    if (!dir) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, sizeof path - 1);
    if (n < 0) return 0;
    path[n] = 0;
    return below(path);
}

/* Counts a call. 0: go on. 1: now is the moment. 2: it has passed (calls that need room fail). */
static int due(void) {
    long now = __atomic_add_fetch(&calls, 1, __ATOMIC_SEQ_CST);
    if (!at || now < at) return 0;
    if (!error_number && now == at && strcmp(kind, "kill") == 0) kill(getpid(), SIGKILL);
    return now == at ? 1 : 2;
}

#define PAGE 4096

/* How much of a write there is before the boundary of two pages that is nearest to its middle, from below or at all. */
static size_t pages(size_t n, off64_t offset) {
    off64_t middle = (offset + (off64_t)n / 2) / PAGE * PAGE, next = offset / PAGE * PAGE + PAGE;
    off64_t cut = middle > offset ? middle : next;
    return cut < offset + (off64_t)n ? (size_t)(cut - offset) : 0;
}

/* Notes a write that lies in more than one page, and so could be torn: file, offset, length. */
static void note(int fd, size_t n, off64_t offset) {
    const char *list = getenv("FAULT_SPLIT");
    char link[64], path[PATH_MAX];
    if (!list || !n || offset / PAGE == (offset + (off64_t)n - 1) / PAGE) return;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return;
    path[length] = 0;
    FILE *file = fopen(list, "a");
    if (!file) return;
    fprintf(file, "%s %lld %zu\n", path, (long long)offset, n);
    fclose(file);
}

/* How many bytes of a write still succeed; sets `stop` if the process ends after it. */
static ssize_t allowed(int fd, size_t n, off64_t offset, int *stop) {
    struct stat64 file;
    *stop = 0;
    int counted = ours(fd), state = counted ? due() : 0;
    if (counted) note(fd, n, offset);
    if (!state || (!error_number && state == 2)) return (ssize_t)n;
    if (error_number) {
        int grows = fstat64(fd, &file) == 0 && offset >= file.st_size;
        return state == 1 && grows && n > 1 ? (ssize_t)(n / 2) : -1;
    }
    *stop = 1;
    return (ssize_t)pages(n, offset);
}

#define WRITE(offset, call_real)                         \
    int stop;                                            \
    ssize_t n = allowed(fd, count, (offset), &stop), done = 0;     \
    if (n < 0) {                                         \
        errno = error_number;                            \
        return -1;                                       \
    }                                                    \
    count = (size_t)n;                                   \
    if (!stop || count) done = call_real;                \
    if (stop) kill(getpid(), SIGKILL);                   \
    return done;

ssize_t write(int fd, const void *data, size_t count) {
    REAL(ssize_t, "write", int, const void *, size_t);
    WRITE(lseek64(fd, 0, SEEK_CUR), real(fd, data, count))
}
ssize_t pwrite(int fd, const void *data, size_t count, off_t offset) {
    REAL(ssize_t, "pwrite", int, const void *, size_t, off_t);
    WRITE(offset, real(fd, data, count, offset))
}
ssize_t pwrite64(int fd, const void *data, size_t count, off64_t offset) {
    REAL(ssize_t, "pwrite64", int, const void *, size_t, off64_t);
    WRITE(offset, real(fd, data, count, offset))
}

/* The others happen whole or not at all; of these only mkdir and a growing file need room. */
#define WHOLE(counted, needs_room, call_real)                  \
    int state = (counted) ? due() : 0;                         \
    if (state == 1 && !error_number) kill(getpid(), SIGKILL);  \
    if (state && error_number && (needs_room)) {               \
        errno = error_number;                                  \
        return -1;                                             \
    }                                                          \
    return call_real;

int ftruncate(int fd, off_t length) {
    REAL(int, "ftruncate", int, off_t);
    WHOLE(ours(fd), 0, real(fd, length))
}
int ftruncate64(int fd, off64_t length) {
    REAL(int, "ftruncate64", int, off64_t);
    WHOLE(ours(fd), 0, real(fd, length))
}
int fsync(int fd) {
    REAL(int, "fsync", int);
    WHOLE(ours(fd), 0, real(fd))
}
int rename(const char *old, const char *new) {
    REAL(int, "rename", const char *, const char *);
    WHOLE(below(new), 0, real(old, new))
}
int unlink(const char *path) {
    REAL(int, "unlink", const char *);
    WHOLE(below(path), 0, real(path))
}
int mkdir(const char *path, mode_t mode) {
    REAL(int, "mkdir", const char *, mode_t);
    WHOLE(below(path), 1, real(path, mode))
}

/* Up to a year back and forth, another jump at every look. */
static time_t jump(void) {
    static unsigned state = 12345;
    if (!getenv("FAULT_CLOCK")) return 0;
    state = state * 1103515245u + 12345u;
    return (time_t)(state >> 1) % 63072000 - 31536000;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    REAL(int, "clock_gettime", clockid_t, struct timespec *);
    int result = real(clock, now);
    if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) now->tv_sec += jump();
    return result;
}
int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    REAL(int, "gettimeofday", struct timeval *, void *);
    int result = real(now, zone);
    if (result == 0) now->tv_sec += jump();
    return result;
}
time_t time(time_t *out) {
    REAL(time_t, "time", time_t *);
    time_t now = real(NULL) + jump();
    if (out) *out = now;
    return now;
}
