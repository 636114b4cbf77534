/* SPDX-License-Identifier: Apache-2.0 */
/*
 * usage: rt_guard_victim WAY
 * A loop whose plant does in tick 7 what a real-time loop may not, for the guard to catch;
 * "nothing" does nothing, "bystander" lets another thread do it all the while.
 */
#include "rt/loop.h"
#include "rt/realtime.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { TICKS = 20, BAD_TICK = 7, PAGE = 4096 };

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static void *volatile kept; /* so that the compiler leaves allocations alone */
static volatile unsigned char *fresh;
static char text[256];
static atomic_bool ended;

static void do_malloc(void)
{
    kept = malloc(32);
}

static void do_free(void)
{
    free(kept);
}

/* The C library allocates for so many directives with positions, in each of its versions */
static void do_digits(void)
{
#define EIGHT "%1$d%1$d%1$d%1$d%1$d%1$d%1$d%1$d"
    (void)!snprintf(text, sizeof text, EIGHT EIGHT EIGHT EIGHT EIGHT EIGHT EIGHT EIGHT, TICKS);
}

static void do_mutex(void)
{
    pthread_mutex_lock(&mutex);
    pthread_mutex_unlock(&mutex);
}

static void do_open(void)
{
    close(open("/dev/null", O_RDONLY | O_CLOEXEC));
}

/* A function that may write, but not on this descriptor */
static void do_write(void)
{
    (void)!write(STDOUT_FILENO, "a line\n", 7);
}

/* No function of any library */
static void do_instruction(void)
{
    long number = SYS_getppid;

    __asm__ volatile("syscall" : "+a"(number) : : "rcx", "r11", "memory");
}

static void do_fault(void)
{
    fresh[0] = 1;
}

static void do_nothing(void)
{
}

static const struct way {
    const char *name;
    void (*act)(void);
} ways[] = {
    {"malloc", do_malloc},   {"free", do_free},
    {"digits", do_digits},   {"mutex", do_mutex},
    {"open", do_open},       {"write", do_write},
    {"fault", do_fault},     {"instruction", do_instruction},
    {"nothing", do_nothing}, {"bystander", do_nothing},
};

static const struct way *way;
static int tick;

static bool victim_plant(void *context, int64_t now_ns)
{
    (void)context;
    (void)now_ns;
    if (tick++ == BAD_TICK) {
        way->act();
    }
    return true;
}

static void *stand_by(void *unused)
{
    (void)unused;
    while (!atomic_load(&ended)) {
        do_malloc();
        do_free();
        do_mutex();
        do_open();
    }
    return NULL;
}

int main(int argc, char **argv)
{
    struct loop_config config = {
        .clock = LOOP_CLOCK_FREE,
        .ticks = TICKS,
        .machine = {.plant = victim_plant},
    };
    struct arena arena;
    struct error error;
    struct loop *loop;
    pthread_t thread;

    for (size_t i = 0; i < sizeof ways / sizeof ways[0] && argc == 2; i++) {
        way = strcmp(ways[i].name, argv[1]) ? way : &ways[i];
    }
    fresh = mmap(NULL, PAGE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (!way || fresh == MAP_FAILED || arena_init(&arena, 16 << 20, &error) ||
        loop_create(&config, &arena, &loop, &error)) {
        return 2;
    }
    arena_seal(&arena);
    kept = malloc(32);
    if (!strcmp(way->name, "bystander") && pthread_create(&thread, NULL, stand_by, NULL)) {
        return 2;
    }
    realtime_touch();
    loop_run(loop);
    atomic_store(&ended, true);
    if (!strcmp(way->name, "bystander")) {
        pthread_join(thread, NULL);
    }
    return loop_stats(loop)->ticks == TICKS ? 0 : 1;
}
