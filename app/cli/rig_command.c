/* SPDX-License-Identifier: Apache-2.0 */
/* Functions common to the commands with a rig or a robot. */
#include "app/cli/cli.h"

#include "base/array.h"
#include "base/config.h"
#include "contact/mesh/solid_store.h"

#include <signal.h>
#include <time.h>

int rig_command(const char *name, const char *path, void *options,
                int (*body)(void *options, const struct rig *rig, struct arena *arena))
{
    const struct rig *rig;
    struct arena arena;
    struct error error;
    int status;

    if (arena_init(&arena, RIG_COMMAND_ARENA, &error)) {
        return command_fail(name, &error);
    }

    /* The rig's check and the simulator share the solids of its meshes */
    if (solid_store_open(&error) || rig_load(path, &arena, &rig, &error)) {
        status = command_fail(name, &error);
    } else {
        /* Warn about keys with an old name */
        for (const struct yaml_old_key *old = rig->old_key; old; old = old->next) {
            fprintf(stderr,
                    "%scoman-hil %s: warning: %s:%d:%d: found old key \"personality\", expected "
                    "\"protocol\" with the name or the file of the protocol\n",
                    journal_prefix(JOURNAL_WARNING), name, old->mark.file, old->mark.line,
                    old->mark.column);
        }
        status = body(options, rig, &arena);
    }
    solid_store_close();
    arena_fini(&arena);
    return status;
}

int robot_command(const char *name, const char *path, const char *variant, const void *options,
                  enum error_code (*body)(const void *options, const struct robot *robot,
                                          struct arena *arena, struct error *error))
{
    char found[PATH_MAX];
    const struct robot *robot;
    struct arena arena;
    struct error error;
    enum error_code code;

    if (config_locate(CONFIG_ROBOT, path, found, &error) ||
        arena_init(&arena, RIG_COMMAND_ARENA, &error)) {
        return command_fail(name, &error);
    }
    code = robot_load(found, variant, &arena, &robot, &error);
    if (!code) {
        code = body(options, robot, &arena, &error);
    }
    arena_fini(&arena);
    return code ? command_fail(name, &error) : STATUS_OK;
}

/* Checks whether a rig can be simulated with a task. task NULL = without a task. */
static bool rig_can(const char *name, const char *task, const struct task_input *input)
{
    struct simulator_config config = {
        .clock = LOOP_CLOCK_FREE, .transport = TRANSPORT_LOCAL, .task = task, .task_input = input};
    struct simulator *simulator = NULL;
    struct error unused;
    struct arena arena;
    char notice[256];

    if (arena_init(&arena, RIG_COMMAND_ARENA, &unused)) {
        return false;
    }
    if (rig_load(name, &arena, &config.rig, &unused) ||
        simulator_create(&config, &arena, &simulator, notice, &unused)) {
        simulator = NULL;
    } else {
        simulator_destroy(simulator);
    }
    arena_fini(&arena);
    return simulator != NULL;
}

void rig_command_suggest(const char *rig, const char *task, const struct task_input *input,
                         struct error *error)
{
    struct error unused, first = *error;
    struct config_entry *entry;
    char names[300] = "", others[32];
    size_t count = 0, used = 0, more = 0;
    struct arena arena;

    /* Continue only if the rig works without the task, but not with it */
    if (error->code != ERROR_INPUT || !task || rig_can(rig, task, input) ||
        !rig_can(rig, NULL, NULL) || arena_init(&arena, RIG_COMMAND_ARENA, &unused)) {
        return;
    }
    if (!config_list(CONFIG_RIG, &arena, &entry, &count, &unused)) {
        for (size_t i = 0; i < count; i++) {
            bool can = rig_can(entry[i].path, task, input);
            bool room = used + strlen(entry[i].name) + 2 < sizeof names;

            if (can && room) {
                used += (size_t)sprintf(names + used, "%s%s", used ? ", " : "", entry[i].name);
            }
            more += can && !room;
        }
    }
    if (used) {
        others[0] = '\0';
        if (more) {
            snprintf(others, sizeof others, " and %zu more", more);
        }
        error_set(error, first.code, "%.400s; rigs that can run the task %s: %s%s", first.text,
                  task, names, others);
    }
    arena_fini(&arena);
}

void rig_command_warn_load(const char *name, const struct rig *rig)
{
    char text[384];

    for (size_t b = 0; b < rig->nbus; b++) {
        if (rig_bus_over_budget(rig, b, text, sizeof text)) {
            fprintf(stderr, "%scoman-hil %s: warning: %s\n", journal_prefix(JOURNAL_WARNING), name,
                    text);
        }
    }
}

/* Function that a signal calls; NULL while it changes. */
static void (*_Atomic on_stop)(void *context);
static void *_Atomic on_stop_context;
static atomic_bool stop_requested;

/* Two stops within this time are one, because `timeout` signals a process and then its group. */
#define ONE_STOP_NS INT64_C(500000000)
static _Atomic int64_t stopped_ns; /* time of the first SIGINT or SIGTERM; 0 = none */

/* Signals that request a stop any number of times. A closing terminal sends several SIGHUP, and
 * each line written to a pipe without a reader causes a SIGPIPE. */
static struct polite_signal {
    int number;
    bool taken;
} polite_signals[] = {{SIGHUP, false}, {SIGPIPE, false}};

/* Records a stop and calls its function. A second SIGINT or SIGTERM, well after the first, kills
 * the process. Async-signal-safe. */
static void on_signal(int number)
{
    void (*stop)(void *context) = atomic_load(&on_stop);

    if (number == SIGINT || number == SIGTERM) {
        struct timespec now = {0};
        int64_t now_ns, first_ns = 0;

        clock_gettime(CLOCK_MONOTONIC, &now);
        now_ns = now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
        if (!atomic_compare_exchange_strong(&stopped_ns, &first_ns, now_ns)) {
            if (now_ns - first_ns > ONE_STOP_NS) {
                signal(number, SIG_DFL);
                raise(number);
            }
            return;
        }
    }
    atomic_store(&stop_requested, true);
    if (stop) {
        stop(atomic_load(&on_stop_context));
    }
}

bool rig_command_stop_requested(void)
{
    return atomic_load(&stop_requested);
}

void rig_command_on_stop(void (*stop)(void *context), void *context)
{
    /* Restart an interrupted write */
    const struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESTART};

    atomic_store(&stopped_ns, 0);
    atomic_store(&on_stop, NULL);
    atomic_store(&on_stop_context, context);
    atomic_store(&on_stop, stop);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    for (size_t i = 0; i < ARRAY_COUNT(polite_signals); i++) {
        struct sigaction before;

        /* Handle a polite signal, unless it is ignored (nohup, systemd's IgnoreSIGPIPE) or has
         * another handler (a service's reload) */
        if (!polite_signals[i].taken && !sigaction(polite_signals[i].number, NULL, &before)) {
            polite_signals[i].taken = before.sa_handler == SIG_DFL;
        }
        if (polite_signals[i].taken) {
            sigaction(polite_signals[i].number, &action, NULL);
        }
    }
}

void rig_command_ignore_stop(void)
{
    /* Nothing is left to stop, so the next signal kills the process, except a duplicate of the last
     * one */
    if (atomic_load(&stopped_ns) == 0) {
        signal(SIGINT, SIG_DFL);
        signal(SIGTERM, SIG_DFL);
    }
    /* Further SIGHUP and SIGPIPE must not interrupt the summary */
    for (size_t i = 0; i < ARRAY_COUNT(polite_signals); i++) {
        if (polite_signals[i].taken) {
            signal(polite_signals[i].number, SIG_IGN);
        }
    }
}

void rig_command_warn(const struct realtime_report *report, const char *clear)
{
    for (size_t i = 0; i < report->count; i++) {
        fprintf(stderr, "%s%swarning: %s\n", clear, journal_prefix(JOURNAL_WARNING),
                report->warning[i]);
    }
}
