// Writes the statistics of glibc's allocator of each stage every 5 s to the folder ALLOCATOR_STATISTICS:
//   cc -O2 -shared -fPIC -o /tmp/statistics.so benches/allocator_statistics.c
//   ALLOCATOR_STATISTICS=/tmp/out LD_PRELOAD=/tmp/statistics.so cargo bench -p replica-tests --bench drive_soak
// A line: time (s), bytes of arenas, bytes mapped for single blocks, bytes in use in arenas, bytes free in arenas, RssAnon (bytes).
// The live heap is the sum of the second and the third number of bytes.
// At its end, each stage writes how often it has allocated (malloc, calloc, realloc, aligned) and how many bytes to STAGE.PID.calls.
#define _GNU_SOURCE
#include <errno.h>
#include <malloc.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t), *__libc_memalign(size_t, size_t);
static atomic_ulong calls, bytes;
static void count(size_t size) { calls++; bytes += size; }
void *malloc(size_t size) { count(size); return __libc_malloc(size); }
void *calloc(size_t n, size_t size) { count(n * size); return __libc_calloc(n, size); }
void *realloc(void *old, size_t size) { count(size); return __libc_realloc(old, size); }
void *aligned_alloc(size_t align, size_t size) { count(size); return __libc_memalign(align, size); }
int posix_memalign(void **out, size_t align, size_t size) { count(size); return (*out = __libc_memalign(align, size)) ? 0 : ENOMEM; }

// Private memory of this process, bytes.
static long private_bytes(void) {
    char text[4096];
    FILE *status = fopen("/proc/self/status", "r");
    size_t n = status ? fread(text, 1, sizeof text - 1, status) : 0;
    if (status) fclose(status);
    text[n] = 0;
    const char *line = strstr(text, "RssAnon:");
    return line ? strtol(line + 8, NULL, 10) * 1024 : 0;
}

static void *watch(void *folder) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s.%d.csv", (const char *)folder, program_invocation_short_name, getpid());
    FILE *out = fopen(path, "w");
    while (out) {
        struct mallinfo2 heap = mallinfo2();
        struct timespec now, pause = {5, 0};
        clock_gettime(CLOCK_MONOTONIC, &now);
        fprintf(out, "%ld,%zu,%zu,%zu,%zu,%ld\n", (long)now.tv_sec, heap.arena, heap.hblkhd, heap.uordblks, heap.fordblks, private_bytes());
        fflush(out);
        nanosleep(&pause, NULL);
    }
    return NULL;
}

__attribute__((constructor)) static void start(void) {
    pthread_t thread;
    char *folder = getenv("ALLOCATOR_STATISTICS");
    if (folder && strncmp(program_invocation_short_name, "replica-", 8) == 0) pthread_create(&thread, NULL, watch, folder);
}

__attribute__((destructor)) static void end(void) {
    char path[4096];
    char *folder = getenv("ALLOCATOR_STATISTICS");
    if (!folder || strncmp(program_invocation_short_name, "replica-", 8) != 0) return;
    snprintf(path, sizeof path, "%s/%s.%d.calls", folder, program_invocation_short_name, getpid());
    FILE *out = fopen(path, "w");
    if (out) fprintf(out, "%lu,%lu\n", calls, bytes), fclose(out);
}
