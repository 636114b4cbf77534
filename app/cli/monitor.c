/* SPDX-License-Identifier: Apache-2.0 */
/* Prints events and the status line in a thread. */
#include "app/cli/cli.h"

#include <time.h>

enum { LINE_SIZE = 320 };

/* Period of the thread, and of the status line on a terminal and in a log. */
#define POLL_NS (50 * CLOCK_MS)
#define TERMINAL_NS (250 * CLOCK_MS)
#define LOG_NS (5 * CLOCK_SECOND)

/* Returns the load of the busiest bus since `before`, percent of its bit rate in virtual time. */
static double find_busiest_bus(const struct simulator *simulator,
                               const struct simulator_status *before,
                               const struct simulator_status *status, size_t *bus)
{
    const struct rig *rig = simulator_configuration(simulator)->rig;
    double span = (double)(status->time_ns - before->time_ns) * 1e-9, most = 0.0;

    *bus = 0;
    for (size_t b = 0; b < rig->nbus && span > 0.0; b++) {
        double bits = (double)(status->bus[b].bits - before->bus[b].bits);
        double load = 100.0 * bits / span / (double)rig->bus[b].bitrate;

        if (load > most) {
            most = load;
            *bus = b;
        }
    }
    return most;
}

/* Writes the text of the status line. before is the status at the last line, zeros at first. */
static void monitor_format(const struct simulator *simulator, const struct simulator_status *before,
                           const struct simulator_status *status, char *text, size_t size)
{
    const struct rig *rig = simulator_configuration(simulator)->rig;
    int64_t wall = status->elapsed_ns - before->elapsed_ns;
    double rtf = wall > 0 ? (double)(status->time_ns - before->time_ns) / (double)wall : 0.0;
    double force = 0.0, load;
    struct task_runner_status task = {0};
    uint64_t lost = 0;
    size_t bus;

    /* Sums the vertical contact forces of all bodies, and the frames that buses have lost */
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        force += status->force_z[c];
    }
    for (size_t b = 0; b < rig->nbus; b++) {
        lost += status->bus[b].rx_dropped + status->bus[b].tx_dropped;
    }
    if (simulator_task_runner(simulator)) {
        task_runner_read(simulator_task_runner(simulator), &task);
    }
    load = find_busiest_bus(simulator, before, status, &bus);
    snprintf(text, size,
             "%9.3f s  x%.2f  overruns %llu  pauses %llu  ground %.1f N  %s %.0f %%  lost %llu%s%s",
             (double)status->time_ns * 1e-9, rtf, (unsigned long long)status->overruns,
             (unsigned long long)status->pauses, force, rig->bus[bus].name, load,
             (unsigned long long)lost, task.message[0] ? "  " : "", task.message);
}

/* Prints the status if a tick has run since the last status: in place, as a line, or to the
 * manager. */
static void print_status(struct monitor *monitor)
{
    struct simulator_status status;
    char text[LINE_SIZE];

    if (!simulator_read(monitor->config.simulator, &status) || status.tick == monitor->last.tick) {
        return;
    }
    monitor_format(monitor->config.simulator, &monitor->last, &status, text, sizeof text);
    notify_status(monitor->config.manager, text);
    if (monitor->config.terminal) {
        fprintf(monitor->log.out, "\r\033[K%s", text);
    } else if (monitor->config.manager->descriptor < 0) {
        fprintf(monitor->log.out, "%s\n", text);
    }
    fflush(monitor->log.out);
    monitor->last = status;
}

static const char *event_prefix(uint64_t key)
{
    return journal_prefix(simulator_event_priority(key));
}

void monitor_put(struct monitor *monitor, int64_t now_ns, uint64_t key, const char *text)
{
    if (!monitor->config.quiet || simulator_event_priority(key) <= JOURNAL_WARNING) {
        eventlog_put(&monitor->log, now_ns, key, text);
    }
}

/* Prints the simulator's events through the log, and passes them to the event function. */
static void print_events(struct monitor *monitor, int64_t now)
{
    char text[EVENTLOG_TEXT];
    uint64_t key;

    while (simulator_next_event(monitor->config.simulator, &key, text, sizeof text)) {
        if (monitor->config.event) {
            monitor->config.event(monitor->config.context, key, text);
        }
        monitor_put(monitor, now, key, text);
    }
    eventlog_flush(&monitor->log, now, false);
}

/* Main function of the thread: works until it is stopped. */
static void *monitor_main(void *context)
{
    struct monitor *monitor = context;
    struct clock *clock = clock_monotonic();

    while (!atomic_load(&monitor->stop)) {
        int64_t now = clock_now(clock);

        simulator_watch_interfaces(monitor->config.simulator, now);
        print_events(monitor, now);

        /* Notify the service manager that the run is ready and alive. In lockstep the loop is
         * ready when it waits for the first STEP, before the first tick. */
        const struct simulator *simulator = monitor->config.simulator;
        struct notify_health health = {.beat = simulator_beat(simulator)};
        struct simulator_status status;

        health.ready =
            !monitor->replaced &&
            (simulator_read(simulator, &status) ||
             (simulator_configuration(simulator)->clock == LOOP_CLOCK_LOCKSTEP && health.beat > 0));
        notify_watch(monitor->config.manager, &health, now);
        if (monitor->config.each) {
            monitor->config.each(monitor->config.context);
        }
        if (!monitor->config.quiet && now >= monitor->next_status_ns) {
            print_status(monitor);
            monitor->next_status_ns = now + (monitor->config.terminal ? TERMINAL_NS : LOG_NS);
        }
        clock_sleep_until(clock, now + POLL_NS);
    }
    return NULL;
}

enum error_code monitor_start(struct monitor *monitor, const struct monitor_config *config,
                              struct error *error)
{
    const char *record = simulator_configuration(config->simulator)->record;
    bool terminal = config->terminal;
    int reason;

    memset(monitor, 0, sizeof *monitor);
    monitor->config = *config;
    monitor->log.out = config->out;
    monitor->log.prefix = event_prefix;
    monitor->log.where = monitor->where;
    snprintf(monitor->where, sizeof monitor->where,
             record ? " (%s/events.log has all)" : " (run --record DIR: DIR/events.log has all)",
             record);
    monitor->log.clear = terminal && !config->quiet ? "\r\033[K" : "";
    monitor->next_status_ns = clock_now(clock_monotonic()) + (terminal ? TERMINAL_NS : LOG_NS);
    reason = pthread_create(&monitor->thread, NULL, monitor_main, monitor);
    if (reason) {
        return error_set_errno(error, reason, "cannot start the status thread");
    }
    return ERROR_NONE;
}

void monitor_stop(struct monitor *monitor)
{
    int64_t now = clock_now(clock_monotonic());

    atomic_store(&monitor->stop, true);
    pthread_join(monitor->thread, NULL);
    print_events(monitor, now);
    eventlog_flush(&monitor->log, now, true);
    if (monitor->config.terminal && !monitor->config.quiet) {
        /* The last status line stays on the screen */
        print_status(monitor);
        fputc('\n', monitor->log.out);
    }
}
