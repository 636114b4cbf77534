/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands of coman-hil and their common functions. argv[0] of a command is its name. A command
 * returns an enum exit_status (base/options.h), and prints its manual for --help. Not RT-safe.
 */
#ifndef APP_CLI_CLI_H
#define APP_CLI_CLI_H

#include "base/error.h"
#include "base/options.h"
#include "canbus/dbc.h"
#include "canbus/gateway.h"
#include "control/control.h"
#include "rig/rig.h"
#include "rt/realtime.h"
#include "sim/buses.h"
#include "sim/simulator.h"
#include "tasks/trajectory.h"
#include "viewer/viewer.h"

#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>

typedef int command_main(int argc, char **argv);
command_main cmd_accel, cmd_bench, cmd_check, cmd_ctl, cmd_dbc, cmd_doctor, cmd_eds, cmd_generate,
    cmd_identify, cmd_import, cmd_list, cmd_plot, cmd_protocol, cmd_replay, cmd_run, cmd_task,
    cmd_test, cmd_validate;

/* ---- topics of the manual with more than a text: coman-hil help TOPIC prints one ---- */

void topic_board(FILE *out);
void topic_fault(FILE *out);
void topic_rt(FILE *out);
void topic_signal(FILE *out);

/* ---- commands with a rig or a robot ---- */

/*
 * Functions common to commands with a rig or a robot: memory and errors, stopping by signals,
 * warnings about real time.
 */

/* Reserved address space for a rig or a robot and its run, bytes. Unused pages cost nothing. */
#define RIG_COMMAND_ARENA ((size_t)1 << 30)

/* Loads a rig into a new arena and calls body. Returns body's exit status. On an error, prints it
 * and returns its exit status. name is the name of the command. */
int rig_command(const char *name, const char *path, void *options,
                int (*body)(void *options, const struct rig *rig, struct arena *arena));

/* Loads a robot into a new arena and calls body. variant may be NULL. Prints the error if loading
 * or body fails, and returns its exit status. */
int robot_command(const char *name, const char *path, const char *variant, const void *options,
                  enum error_code (*body)(const void *options, const struct robot *robot,
                                          struct arena *arena, struct error *error));

/* For a rig that cannot run a task, adds the names of installed rigs that can to the error. Leaves
 * other errors unchanged. task and input may be NULL. */
void rig_command_suggest(const char *rig, const char *task, const struct task_input *input,
                         struct error *error);

/* Warns on stderr if periodic traffic exceeds the capacity of its bus. */
void rig_command_warn_load(const char *name, const struct rig *rig);

/* Sets the function for stop signals. It must be async-signal-safe.
 * The first SIGINT or SIGTERM calls stop(context). A second one within half a second counts as the
 * same stop; a later one kills the process. Each SIGHUP and SIGPIPE (stderr has no reader) calls
 * stop(context) too, unless the signal was ignored or handled before.
 * After rig_command_ignore_stop, SIGINT and SIGTERM kill the process, except a second signal within
 * half a second. SIGHUP and SIGPIPE then do nothing. A further call replaces the function. */
void rig_command_on_stop(void (*stop)(void *context), void *context);
void rig_command_ignore_stop(void);

/* Checks whether a stop signal has arrived. */
bool rig_command_stop_requested(void);

/* Prints a line on stderr for each warning. clear: sequence that removes a status line from the
 * terminal, or "". */
void rig_command_warn(const struct realtime_report *report, const char *clear);

/* ---- options and reports of tasks ---- */

/*
 * Functions common to commands that start a task: the options of the tasks sweep, excite and
 * follow, and the reports of these tasks.
 */

/* Options of the tasks sweep, excite and follow. */
struct task_options {
    const char *joint, *trajectory, *report; /* NULL = not given */
    int interpolation;                       /* enum trajectory_interpolation */
};

extern const struct word task_interpolation_words[];

/* Rows of an option table that fill a struct task_options. */
#define TASK_OPTION_ROWS(o)                                                                        \
    {"--joint",           OPTION_STRING,   "JOINT", "the joint that the task sweep identifies",    \
     .value = &(o).joint, .noun = "joints"},                                                       \
        {"--trajectory", OPTION_STRING, "FILE",                                                    \
         "the trajectory of the task follow: CSV with the titles time_s and JOINT_rad or "         \
         "JOINT_deg",                                                                              \
         .value = &(o).trajectory},                                                                \
        {"--interpolation",                                                                        \
         OPTION_ENUM,                                                                              \
         "HOW",                                                                                    \
         "cubic, the default, or linear between the rows of the trajectory",                       \
         .value = &(o).interpolation,                                                              \
         .words = task_interpolation_words},                                                       \
    {                                                                                              \
        "--report", OPTION_STRING, "DIR",                                                          \
            "when sweep or follow ends, write its results into this folder: tables as CSV, plots " \
            "as "                                                                                  \
            "SVG, and a page with all of it",                                                      \
            .value = &(o).report                                                                   \
    }

/* Reads the input of the task with this name; NULL = no task. Refuses options that the task does
 * not have. The input points into the options and the arena. ERROR_INPUT, ERROR_SYSTEM,
 * ERROR_MEMORY. */
enum error_code task_input_read(const struct task_options *options, const char *task,
                                const struct rig *rig, struct arena *arena,
                                struct task_input *input, struct error *error);

/* Writes the report of a task that has ended in any way. Does nothing without a folder. */
enum error_code task_report_write(const struct task *task, const char *folder, struct error *error);

/* ---- the command line of run ---- */

/* The command line of coman-hil run, and the simulator configuration that results. */

enum { RUN_HOST_SIZE = 64 }; /* room for any numeric address */

/* The channels of --slcan, with the memory of their strings. */
struct run_slcan {
    size_t count;
    struct gateway_slcan channel[GATEWAY_SLCAN];
    char bus[GATEWAY_SLCAN][RUN_HOST_SIZE], host[GATEWAY_SLCAN][RUN_HOST_SIZE];
};

/* The options as given; strings belong to the command line. */
struct run_options {
    const char *rig, *task, *stimulus, *record, *gateway, *control, *http, *ready, *token_file;
    struct task_options input; /* options of the task */
    struct option_list bus, fault, set, slcan;
    double duration_s;               /* INFINITY = not given */
    double http_linger_s;            /* -1 = not given */
    int64_t ticks, record_period_ms; /* ticks: 0 = not given */
    int64_t seed;                    /* -1 = as in the rig */
    int clock, overrun, hold, wire;  /* -1 = as in the rig */
    int transport;                   /* enum bus_transport */
    int record_format;               /* enum recorder_format; 0 = as in the rig */
    bool settle, energy, force, quiet;
    bool trust; /* allow the rig to write to any folder and to serve other machines */
};

/* Reads the command line. Returns false if the command must return *status immediately
 * (options_read). */
bool run_options_read(int argc, char **argv, struct run_options *options, int *status);

/* Refuses two settings of a rig that is not installed: recording outside the working directory, and
 * serving the page to other machines. It allows them if the command line trusts the rig or
 * overrides the setting. The error has file:line:column. */
enum error_code run_options_check_trust(const struct run_options *options, const struct rig *rig,
                                        struct error *error);

/* Reads the channels of --slcan. */
enum error_code run_options_read_slcan(const struct run_options *options, struct run_slcan *slcan,
                                       struct error *error);

/* Makes the simulator's configuration. The command line's settings have priority over the rig's.
 * The configuration points into both, and has no gateway. */
enum error_code run_options_configure(const struct run_options *options, const struct rig *rig,
                                      struct simulator_config *config, struct error *error);

/* Checks whether a numeric address is reachable only from this machine. */
bool run_options_is_loopback(const char *host);

/* Parses "[HOST:]PORT" as the value of an option; an IPv6 address is in brackets. *given points to
 * host, or is NULL without a host. example is a text for the message. */
enum error_code run_options_parse_address(const char *option, const char *text, const char *example,
                                          char host[RUN_HOST_SIZE], const char **given,
                                          uint16_t *port, struct error *error);

/* Returns the address for the page from the command line or the rig; NULL = no page. */
const char *run_options_http(const struct run_options *given, const struct rig *rig);

/* ---- the page of a run ---- */

/* The page of a run (viewer/viewer.h), as requested by the command line and the rig. */

/* The page of one run. */
struct page {
    struct viewer *viewer; /* NULL = none */
    struct bus_ports ports;
    double linger_s;       /* time for which it serves open pages after the run, at most */
    char tokens[PATH_MAX]; /* file with the tokens; "" = none */
};

/* Joins the buses, starts the server, and prints each address on stderr. Does nothing if no page is
 * requested. control is the path of the control socket, NULL = none. service: the run is under a
 * service manager. By default, the page then closes at the end of the run, and its tokens are in
 * the manager's runtime directory. Addresses are printed without tokens, because other users can
 * read the journal. */
enum error_code page_open(struct page *page, const struct run_options *options, bool service,
                          struct simulator *simulator, const char *control, struct error *error);

/* Prints the visuals that a page cannot show, with the reasons, on stderr. */
void page_print_lacks(const struct robot *robot);

/* Checks whether the page stays open after the run: a client watches it, and the user has not
 * stopped the run. */
bool page_stays(const struct page *page, enum loop_end end);

/* Informs the pages about the end of the run. stays: page_linger follows, and the recording is
 * complete. */
void page_tell_end(const struct page *page, const struct simulator *simulator, enum loop_end end,
                   bool stays);

/* Serves the open pages until all are closed, the time has passed, or the user stops it by a signal
 * or through control. control may be NULL. */
void page_linger(const struct page *page, const struct control *control);

/* page_print prints a line about the clients after the run. page_close frees the page's resources.
 * Call both before the simulator is destroyed. */
void page_print(const struct page *page);
void page_close(struct page *page);

/* ---- the file of the tokens ---- */

/*
 * Keeps a page's tokens and port in a file between runs, so that an open page reconnects to the
 * next run in the same folder. Only the file's owner may read it.
 */

/* Contents of the file; port 0 = no file. */
struct page_tokens {
    char token[2][VIEWER_TOKEN]; /* token for viewing, token for control */
    uint16_t port;
};

/* Writes the default path for runs in the working directory: coman-hil/pages/HASH in
 * $XDG_STATE_HOME or $HOME/.local/state. HASH is a hash of the directory's path. Returns false if
 * neither variable is set. */
bool token_file_default(char *path, size_t size);

/* Reads the file. tokens->port is 0 if there is no file. Returns ERROR_INPUT if it is not a token
 * file, if another user owns it, or if others may read or write it. */
enum error_code token_file_read(const char *path, struct page_tokens *tokens, struct error *error);

/* Replaces the file, with mode 0600, and creates missing folders. ERROR_SYSTEM. */
enum error_code token_file_write(const char *path, const struct page_tokens *tokens,
                                 struct error *error);

/* ---- the file of --ready ---- */

/*
 * Writes the file of --ready, which gives the addresses of a run or a page. It appears when clients
 * can connect, and is then complete. Only its owner may read it.
 * Each line is NAME='VALUE', readable with "." in a shell. Names: pid, clock, control (path of the
 * control socket), gateway_host, gateway_port, page (address with control) and page_view (address
 * without control). Entries that do not apply are omitted.
 */

/* Addresses of a run. */
struct ready {
    const char *clock; /* as in --clock; "" or NULL = none, also below */
    const char *control;
    const char *gateway_host; /* NULL = no gateway */
    uint16_t gateway_port;
    const char *page, *page_view;
};

/* Removes the file of an earlier run that was killed. Leaves a link, a file that no run has
 * written, and a file of a run that still exists, and returns ERROR_INPUT. Otherwise ERROR_SYSTEM.
 * Without a path, these three functions do nothing. */
enum error_code ready_begin(const char *path, struct error *error);

/* Writes the file under a temporary name, then renames it. ERROR_INPUT as in ready_begin;
 * ERROR_INPUT and ERROR_SYSTEM as in whole_file_close. */
enum error_code ready_write(const char *path, const struct ready *ready, struct error *error);

/* Removes the file of this process. Call it when clients can no longer connect. */
void ready_end(const char *path);

/* ---- recorded runs ---- */

/*
 * The recorded run that --stimulus replays: its length, its state hash, and the requests from
 * clients of the control socket or the page. These requests are not frames, so --stimulus does not
 * replay them.
 */

struct recorded_run {
    uint64_t ticks;      /* 0 = unknown, because the log has no recording or the run was killed */
    char state_hash[24]; /* state at the end of the run */
    size_t requests;     /* number of requests: pushes, tunables, manual faults */
    char first[160];     /* the first request, as "TIME s TEXT" */
};

/* Reads summary.json and events.log of a recording; missing or damaged values stay 0. */
void recorded_run_read(const char *directory, struct recorded_run *run);

/* Prints a warning if the recorded run has requests. Call it before the run. */
void recorded_run_warn(const struct recorded_run *run, const char *directory, FILE *out);

/* Prints whether a run with this number of ticks has the same final state as the recording. Prints
 * nothing if the lengths differ. */
void recorded_run_compare(const struct recorded_run *run, uint64_t ticks, uint64_t state_hash,
                          FILE *out);

/* ---- files beside the recording of a run ---- */

/* Writes DIRECTORY/firmware-BOARD.bin after the run for every board that has stored a download (rig
 * key keep_firmware). The file has program memory, then data memory: 65536 words of 16 bits each,
 * low byte first, and 0xffff for words that were not received. A '/' in the board's name becomes
 * '-'. ERROR_SYSTEM. */
enum error_code firmware_write(const struct simulator *simulator, const char *directory,
                               struct error *error);

/* ---- rate-limited log lines ---- */

/*
 * Limits the rate of log lines. For each key it prints the first EVENTLOG_BURST lines in a second,
 * counts the others, and prints one summary line. If lines keep coming, it prints only summaries,
 * after 2 s, 4 s, ... and finally every minute. For any number of keys it prints at most a few
 * hundred lines per second. The caller passes the time.
 */

enum {
    EVENTLOG_KEYS = 64, /* number of keys at a time; further keys share one entry */
    EVENTLOG_BURST = 5, /* lines printed per key in the first window of one second */
    EVENTLOG_TEXT = 256,
};

/* The lines of one key in the current window. */
struct eventlog_entry {
    bool used;
    uint64_t key;
    int64_t since_ns, window_ns;
    uint64_t lines, held;     /* lines printed and lines suppressed in this window */
    char last[EVENTLOG_TEXT]; /* the last suppressed line */
};

struct eventlog {
    FILE *out;
    const char *clear; /* printed before each line: "" or the sequence that clears a status line */
    const char *where; /* printed in a summary: where to find all lines; NULL = nothing */
    const char *(*prefix)(uint64_t key); /* text printed after clear, by key; NULL = none */
    uint64_t printed, held;
    struct eventlog_entry entry[EVENTLOG_KEYS + 1]; /* the last entry is shared */
};

/* Prints or suppresses one line (text without newline). */
void eventlog_put(struct eventlog *log, int64_t now_ns, uint64_t key, const char *text);

/* Prints summaries of suppressed lines for windows that have ended. all: for all windows. */
void eventlog_flush(struct eventlog *log, int64_t now_ns, bool all);

/* ---- the service manager ---- */

/*
 * Notifies a service manager by datagrams of sd_notify(3), and feeds its watchdog. Without a
 * manager (no NOTIFY_SOCKET) all functions do nothing.
 */

/* The connection to a manager. */
struct notify {
    int descriptor; /* -1 = no manager */
    struct sockaddr_un address;
    socklen_t length;
    /* the manager kills the service after this time without a notification; 0 = never */
    int64_t watchdog_ns;
    /* state of the watchdog */
    bool ready;
    uint64_t beat;
    int64_t feed_ns;
};

/* State of the loop for the monitor. */
struct notify_health {
    bool ready; /* the first tick has run, or in lockstep the loop waits for its first STEP */
    /* changes with each tick, and while the loop waits for a STEP */
    uint64_t beat;
};

/* Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID, and removes them from the environment so
 * that no child process sends notifications for this one. An unreachable socket counts as no
 * manager. */
void notify_open(struct notify *notify);

/* Sends READY=1 when the loop is ready. Then notifies the watchdog after half of its time, if the
 * beat has changed since the last notification. Call it once per period of the monitor. */
void notify_watch(struct notify *notify, const struct notify_health *health, int64_t now_ns);

/* Sends the status line for `systemctl status`. */
void notify_status(const struct notify *notify, const char *text);

/* notify_stopping announces the end of the run (STOPPING=1). notify_reloading announces a restart
 * (RELOADING=1), which lasts until the next READY=1. */
void notify_stopping(const struct notify *notify);
void notify_reloading(struct notify *notify);

void notify_close(struct notify *notify);

/* ---- the thread that prints events and status ---- */

/*
 * Background thread of a run: prints events (rate-limited) and the status line. On a terminal it
 * updates the line in place four times a second, otherwise it prints a line every five seconds. A
 * service manager gets the status instead of lines, and notifications that the run is alive.
 */

/* Inputs of the thread; the caller owns the pointers. */
struct monitor_config {
    struct simulator *simulator;
    struct notify *manager;      /* owned by the caller */
    FILE *out;                   /* stderr, or a test's file */
    bool terminal, quiet;        /* quiet: print only warnings and errors */
    void (*each)(void *context); /* called in the thread once per period; NULL = none */
    /* Called in the thread with each event; NULL = none */
    void (*event)(void *context, uint64_t key, const char *text);
    void *context;
};

struct monitor {
    struct monitor_config config;
    struct eventlog log;
    atomic_bool stop;
    bool replaced; /* another run will follow, so this one is not ready; `each` sets it */
    pthread_t thread;
    int64_t next_status_ns;
    char where[PATH_MAX + 32]; /* location of the log, for summaries */
    /* Values at the last status line, for the real-time factor and the loads */
    struct simulator_status last;
};

/* Starts the thread. */
enum error_code monitor_start(struct monitor *monitor, const struct monitor_config *config,
                              struct error *error);

/* Prints a line of the log. Call it in the thread, or after the thread has ended. A quiet run
 * prints only warnings and errors. */
void monitor_put(struct monitor *monitor, int64_t now_ns, uint64_t key, const char *text);

/* Prints the remaining events and joins the thread. */
void monitor_stop(struct monitor *monitor);

#endif
