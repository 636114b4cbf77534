/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands of coman-hil, and what they share. argv[0] of a command is its name. A command
 * returns an enum exit_status (base/options.h) and prints its manual for --help. Not RT-safe.
 */
#ifndef APP_CLI_CLI_H
#define APP_CLI_CLI_H

#include "base/error.h"
#include "base/memory_file.h"
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
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/socket.h>
#include <sys/un.h>

int cmd_accel(int argc, char **argv);
int cmd_bench(int argc, char **argv);
int cmd_check(int argc, char **argv);
int cmd_ctl(int argc, char **argv);
int cmd_dbc(int argc, char **argv);
int cmd_doctor(int argc, char **argv);
int cmd_eds(int argc, char **argv);
int cmd_generate(int argc, char **argv);
int cmd_identify(int argc, char **argv);
int cmd_import(int argc, char **argv);
int cmd_list(int argc, char **argv);
int cmd_plot(int argc, char **argv);
int cmd_protocol(int argc, char **argv);
int cmd_replay(int argc, char **argv);
int cmd_run(int argc, char **argv);
int cmd_task(int argc, char **argv);
int cmd_test(int argc, char **argv);
int cmd_validate(int argc, char **argv);

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

/* Reserved address space for a rig or a robot and its run, bytes; unused pages cost nothing. */
#define RIG_COMMAND_ARENA ((size_t)1 << 30)

/* Loads a rig into a new arena and calls body. Returns body's exit status. On an error, prints it
 * and returns its exit status. name: name of the command. */
int rig_command(const char *name, const char *path, void *options,
                int (*body)(void *options, const struct rig *rig, struct arena *arena));

/* Loads a robot in the same way; variant may be NULL. body returns an error code; its error is
 * printed here. */
int robot_command(const char *name, const char *path, const char *variant, const void *options,
                  enum error_code (*body)(const void *options, const struct robot *robot,
                                          struct arena *arena, struct error *error));

/* Adds the names of the installed rigs that can run a task to the error of a rig that cannot.
 * Leaves other errors as they are. task and input may be NULL. */
void rig_command_suggest(const char *rig, const char *task, const struct task_input *input,
                         struct error *error);

/* Warns on stderr if periodic traffic exceeds the capacity of its bus. */
void rig_command_warn_load(const char *name, const struct rig *rig);

/* Sets the function for stop signals. The first SIGINT or SIGTERM calls stop(context), which must
 * be async-signal-safe. A second one within half a second counts as the same stop; a later one
 * kills the process. Each SIGHUP and SIGPIPE (stderr has no reader) calls it too, unless the
 * signal was ignored or handled before. After rig_command_ignore_stop, SIGINT and SIGTERM kill
 * (except for such a second signal), and the other two do nothing. Another call replaces the
 * function. */
void rig_command_on_stop(void (*stop)(void *context), void *context);
void rig_command_ignore_stop(void);

/* Checks whether any of these signals has arrived. */
bool rig_command_stop_requested(void);

/* Prints a line on stderr for each warning. clear: sequence that removes a status line from the
 * terminal, or "". */
void rig_command_warn(const struct realtime_report *report, const char *clear);

/* ---- options and reports of tasks ---- */

/*
 * Functions common to commands that start a task: the options of sweep and follow, and the reports
 * of these tasks.
 */

/* Options of the tasks sweep and follow. */
struct task_options {
    const char *joint, *trajectory, *report; /* NULL: not given */
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

/* Reads the input of the task with this name, and refuses options that it does not have; NULL:
 * no task. The input points into the options and the arena. ERROR_INPUT, ERROR_SYSTEM,
 * ERROR_MEMORY. */
enum error_code task_input_read(const struct task_options *options, const char *task,
                                const struct rig *rig, struct arena *arena,
                                struct task_input *input, struct error *error);

/* Writes the report of a task after any end; does nothing without a folder. */
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
    struct task_options input; /* of the task */
    struct option_list bus, fault, set, slcan;
    double duration_s;               /* INFINITY = not given */
    double http_linger_s;            /* -1 = not given */
    int64_t ticks, record_period_ms; /* ticks: 0 = not given */
    int64_t seed;                    /* -1 = the rig's */
    int clock, overrun, hold, wire;  /* -1 = the rig's */
    int transport;                   /* enum bus_transport */
    int record_format;               /* enum recorder_format; 0 = the rig's */
    bool settle, energy, force, quiet;
    bool trust; /* the rig may write and listen anywhere */
};

/* Reads the command line; returns false if the command must return *status now (options_read). */
bool run_options_read(int argc, char **argv, struct run_options *options, int *status);

/* Refuses two settings of a rig that is not installed, unless the command line trusts the rig or
 * overrides the setting: recording outside the working directory, and serving the page to other
 * machines. The error has file:line:column. */
enum error_code run_options_check_trust(const struct run_options *options, const struct rig *rig,
                                        struct error *error);

/* Reads the channels of --slcan. */
enum error_code run_options_read_slcan(const struct run_options *options, struct run_slcan *slcan,
                                       struct error *error);

/* Makes the simulator's configuration: the command line's settings, else the rig's. It points into
 * both, and has no gateway. */
enum error_code run_options_configure(const struct run_options *options, const struct rig *rig,
                                      struct simulator_config *config, struct error *error);

/* Checks whether a numeric address is reachable only from this machine. */
bool run_options_is_loopback(const char *host);

/* Parses "[HOST:]PORT", with an IPv6 address in brackets, as the value of an option. *given points
 * to host, or is NULL without one. example: text for the message. */
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
    double linger_s;       /* longest time for which it serves open pages after the run */
    char tokens[PATH_MAX]; /* file with the tokens; "" = none */
};

/* Joins the buses, starts the server, and prints each address on stderr; does nothing if no page
 * is requested. control: path of the control socket, NULL = none. service: the run is under a
 * service manager. Then the page does not stay after a run, its tokens are in the manager's runtime
 * directory, and no token is printed, as into any journal. The options may say otherwise. */
enum error_code page_open(struct page *page, const struct run_options *options, bool service,
                          struct simulator *simulator, const char *control, struct error *error);

/* Prints on stderr the visuals that a page cannot show, with reasons. */
void page_print_lacks(const struct robot *robot);

/* Checks whether the page stays after the run: a client watches it, and the user has not stopped
 * the run. */
bool page_stays(const struct page *page, enum loop_end end);

/* Sends the pages the end of the run. stays: page_linger follows, and the recording is
 * complete. */
void page_tell_end(const struct page *page, const struct simulator *simulator, enum loop_end end,
                   bool stays);

/* Serves the open pages until they are closed, the time has passed, or the user stops it by a
 * signal or through control (may be NULL). */
void page_linger(const struct page *page, const struct control *control);

/* Print a line about the clients after the run, and free the page's resources; call them before
 * the simulator is destroyed. */
void page_print(const struct page *page);
void page_close(struct page *page);

/* ---- the file of the tokens ---- */

/*
 * The file that keeps a page's tokens and port between runs, so that an open page finds the next
 * run of the same folder at the same address. Only its owner may read it.
 */

/* Contents of the file; port 0: none. */
struct page_tokens {
    char token[2][VIEWER_TOKEN]; /* to look, and to control */
    uint16_t port;
};

/* Writes the default path for runs in the working directory: coman-hil/pages/HASH in
 * $XDG_STATE_HOME or $HOME/.local/state, HASH being the hash of the directory's path. Returns
 * false if neither variable is set. */
bool token_file_default(char *path, size_t size);

/* Reads the file; *tokens has port 0 if there is none. Returns ERROR_INPUT if it is not such a
 * file, if another user owns it, or if others may read or write it. */
enum error_code token_file_read(const char *path, struct page_tokens *tokens, struct error *error);

/* Replaces the file, with mode 0600, and creates missing folders. ERROR_SYSTEM. */
enum error_code token_file_write(const char *path, const struct page_tokens *tokens,
                                 struct error *error);

/* ---- the file of --ready ---- */

/*
 * The file of --ready. It appears, complete, when clients can connect to a run or a page, and gives
 * the addresses. Each line is NAME='VALUE', readable with "." in a shell. Entries that do not apply
 * are omitted: pid, clock, control (path of the control socket), gateway_host, gateway_port, tables
 * (hashes of the buses' DBC files), page, page_view (addresses to control and to look only). Only
 * its owner may read it.
 */

/* Addresses of a run. */
struct ready {
    const char *clock; /* as in --clock; "" or NULL here and below = none */
    const char *control;
    const char *gateway_host; /* NULL = no gateway */
    uint16_t gateway_port;
    const char *tables; /* from dbc_hash_rig */
    const char *page, *page_view;
};

/* Removes the file of an earlier run that was killed. ERROR_INPUT: a link, a file that no run has
 * written, or a file of a run that goes on stays. ERROR_SYSTEM. All functions do nothing without a
 * path. */
enum error_code ready_begin(const char *path, struct error *error);

/* Writes the file under a temporary name, and renames it when it is complete. ERROR_INPUT as of
 * ready_begin; ERROR_INPUT, ERROR_SYSTEM: as whole_file_close. */
enum error_code ready_write(const char *path, const struct ready *ready, struct error *error);

/* Removes the file of this process, because clients can no longer connect. */
void ready_end(const char *path);

/* ---- hashes of DBC files ---- */

/*
 * The text of a bus's DBC file, and hashes of it. A client with files of `coman-hil dbc` compares
 * the hashes to check that its files belong to the running rig.
 */

/* Writes a DBC to *text, which must be zeroed and is freed by the caller. ERROR_MEMORY. */
enum error_code dbc_hash_write_text(const struct dbc *dbc, struct memory_file *text,
                                    struct error *error);

/* Writes "BUS=HASH BUS=HASH ..." to *hashes, owned by arena. HASH is the 64-bit FNV-1a hash
 * (base/hash.h, 16 hexadecimal digits) of the bytes from dbc_hash_write_text. Omits a bus whose
 * messages do not fit in a DBC file. ERROR_MEMORY. */
enum error_code dbc_hash_rig(const struct rig *rig, struct arena *arena, const char **hashes,
                             struct error *error);

/* ---- recorded runs ---- */

/*
 * The recorded run whose controller --stimulus plays: its length, its state hash, and the requests
 * of clients of the control socket or the page. Such requests are not frames, so they are not
 * played.
 */

struct recorded_run {
    uint64_t ticks;      /* 0 = unknown: a log without a recording, or a killed run */
    char state_hash[24]; /* at its end */
    size_t requests;     /* number of requests: pushes, tunables, manual faults */
    char first[160];     /* "TIME s TEXT" of the first of them */
};

/* Reads summary.json and events.log of a recording; missing or damaged values stay 0. */
void recorded_run_read(const char *directory, struct recorded_run *run);

/* Prints a warning about requests, before the run. */
void recorded_run_warn(const struct recorded_run *run, const char *directory, FILE *out);

/* Prints whether a run with this number of ticks has ended in the recording's state; prints
 * nothing if the lengths differ. */
void recorded_run_compare(const struct recorded_run *run, uint64_t ticks, uint64_t state_hash,
                          FILE *out);

/* ---- files beside the recording of a run ---- */

/* Writes DIRECTORY/firmware-BOARD.bin after the run for every board that has kept a download (rig
 * key keep_firmware): program memory, then data memory, 65536 words of 16 bits each, low byte
 * first, 0xffff for words that were not received. A '/' in the board's name becomes '-'.
 * ERROR_SYSTEM. */
enum error_code firmware_write(const struct simulator *simulator, const char *directory,
                               struct error *error);

/* ---- rate-limited log lines ---- */

/*
 * Rate-limited log lines for a terminal or a log: of lines with the same key the first few in a
 * second are printed, the others are counted and summed up in one line. As long as a flood lasts
 * there is only that line, after 2 s, 4 s, ... and finally every minute. However many keys there
 * are, at most a few hundred lines are printed in a second. Time is passed in.
 */

enum {
    EVENTLOG_KEYS = 64, /* keys at a time; further ones share one entry */
    EVENTLOG_BURST = 5, /* lines of one key printed in the first window, of one second */
    EVENTLOG_TEXT = 256,
};

/* The lines of one key in the present window. */
struct eventlog_entry {
    bool used;
    uint64_t key;
    int64_t since_ns, window_ns;
    uint64_t lines, held;     /* printed and held back in this window */
    char last[EVENTLOG_TEXT]; /* the last line held back */
};

struct eventlog {
    FILE *out;
    const char *clear; /* printed before each line: "" or the sequence that wipes a status line */
    const char *where; /* printed in a summary: where all lines are; NULL = nothing */
    const char *(*prefix)(uint64_t key); /* printed after clear; NULL = nothing */
    uint64_t printed, held;
    struct eventlog_entry entry[EVENTLOG_KEYS + 1]; /* the last one is shared */
};

/* Prints or suppresses one line (text without newline). */
void eventlog_put(struct eventlog *log, int64_t now_ns, uint64_t key, const char *text);

/* Prints summaries of lines suppressed in windows that have ended; `all`: in every window. */
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
    /* the manager kills a service after this time without a notification; 0 = never */
    int64_t watchdog_ns;
    /* the watchdog's state */
    bool ready;
    uint64_t beat;
    int64_t feed_ns;
};

/* State of the loop for the monitor. */
struct notify_health {
    bool ready; /* the first tick has run, or the loop waits for its STEP in lockstep */
    /* changes while the loop is alive: with each tick, and while it waits for a STEP */
    uint64_t beat;
};

/* Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID, and removes them from the environment so
 * that no child process sends notifications for this one. An unreachable socket counts as no
 * manager. */
void notify_open(struct notify *notify);

/* Call it once per period of the monitor. Sends READY=1 when the loop is ready. Then feeds the
 * watchdog after half of its time, if the beat has changed since the last feed. A failed run ends,
 * and the manager gets its exit status. */
void notify_watch(struct notify *notify, const struct notify_health *health, int64_t now_ns);

/* Sends the status line for `systemctl status`. */
void notify_status(const struct notify *notify, const char *text);

/* Announce that the run is ending (STOPPING=1), or restarting (RELOADING=1) until the next
 * READY=1. */
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
    bool terminal, quiet;        /* quiet: warnings and errors alone */
    void (*each)(void *context); /* called in the thread once per period; NULL = none */
    /* Called in the thread with each event; NULL = none */
    void (*event)(void *context, uint64_t key, const char *text);
    void *context;
};

struct monitor {
    struct monitor_config config;
    struct eventlog log;
    atomic_bool stop;
    bool replaced; /* another run will follow, so this one is no longer ready; `each` sets it */
    pthread_t thread;
    int64_t next_status_ns;
    char where[PATH_MAX + 32]; /* of the log */
    /* Values at the last status line, for the real-time factor and the loads */
    struct simulator_status last;
};

/* Starts the thread. */
enum error_code monitor_start(struct monitor *monitor, const struct monitor_config *config,
                              struct error *error);

/* Prints a line of the log, in the thread or after it. A quiet run prints warnings and errors
 * alone. */
void monitor_put(struct monitor *monitor, int64_t now_ns, uint64_t key, const char *text);

/* Prints the remaining events and joins the thread. */
void monitor_stop(struct monitor *monitor);

#endif
