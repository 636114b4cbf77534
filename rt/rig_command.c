/* SPDX-License-Identifier: Apache-2.0 */
/* What the commands that run a rig have in common. */
#include "rt/rig_command.h"

#include "rt/options.h"

#include <signal.h>
#include <stdio.h>

#define ARENA_SIZE ((size_t)512 << 20) /* of address space; pages cost nothing until touched */

int rig_command(const char *name, const char *path, void *options,
                int (*body)(void *options, const struct rig *rig, struct arena *arena))
{
    const struct rig *rig;
    struct arena arena;
    struct error error;
    int status;

    if (arena_init(&arena, ARENA_SIZE, &error)) {
        return command_fail(name, &error);
    }
    status = rig_load(path, &arena, &rig, &error) ? command_fail(name, &error)
                                                  : body(options, rig, &arena);
    arena_fini(&arena);
    return status;
}

static void (*on_stop)(void *context);
static void *on_stop_context;

/* the handler is reset on entry, so that a second signal kills */
static void on_signal(int number)
{
    (void)number;
    on_stop(on_stop_context);
}

void rig_command_on_stop(void (*stop)(void *context), void *context)
{
    struct sigaction action = {.sa_handler = on_signal, .sa_flags = (int)SA_RESETHAND};

    on_stop = stop;
    on_stop_context = context;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

void rig_command_ignore_stop(void)
{
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
}

void rig_command_warn(const struct realtime_report *report, const char *clear)
{
    for (size_t i = 0; i < report->count; i++) {
        fprintf(stderr, "%swarning: %s\n", clear, report->warning[i]);
    }
}
