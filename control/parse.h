/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Parses a line of text as a request of the control socket (control/control.h): first as JSON, then
 * by a table of the keys of each command. It does not check whether the named tunables, signals and
 * so on exist. Not RT-safe.
 */
#ifndef CONTROL_PARSE_H
#define CONTROL_PARSE_H

#include "base/error.h"

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum control_command {
    CONTROL_HELLO,
    CONTROL_STATUS,
    CONTROL_STATISTICS,
    CONTROL_LIST,
    CONTROL_GET,
    CONTROL_SET,
    CONTROL_FAULT,
    CONTROL_PUSH,
    CONTROL_PAUSE,
    CONTROL_RESUME,
    CONTROL_STEP,
    CONTROL_SPEED,
    CONTROL_RESET,
    CONTROL_CHECKPOINT,
    CONTROL_RESTORE,
    CONTROL_WAIT,
    CONTROL_SUBSCRIBE,
    CONTROL_UNSUBSCRIBE,
    CONTROL_STOP,
    CONTROL_COMMANDS,
};

enum control_list {
    CONTROL_LIST_TUNABLES,
    CONTROL_LIST_FAULTS,
    CONTROL_LIST_BODIES,
    CONTROL_LIST_SIGNALS,
    CONTROL_LIST_CHECKPOINTS,
    CONTROL_LIST_COMMANDS,
    CONTROL_LISTS,
};

enum { CONTROL_ID_MAX = 256, CONTROL_PATTERNS_MAX = 1024 };

struct control_request {
    json_t *root; /* owns the data behind the pointers */
    json_t *id;   /* a number or string; NULL = none */
    enum control_command command;
    enum control_list list;
    const char *name;  /* tunable, fault or body */
    const char *match; /* NULL = all */
    double value;      /* value of set, factor of speed */
    bool on;
    int64_t count;  /* ticks of step, slot, tick of wait */
    bool wait_time; /* wait: true = until time_s, false = until a tick */
    double time_s;  /* time of wait, duration of push */
    double force_n[3], moment_nm[3];
    const json_t *signals; /* a non-empty array of strings */
    double period_ms;
};

/* Type of a key's value and of its field in the request. */
enum key_type {
    KEY_TEXT,   /* const char * */
    KEY_REAL,   /* double */
    KEY_WHOLE,  /* int64_t */
    KEY_SWITCH, /* bool */
    KEY_VECTOR, /* double[3] */
    KEY_LIST,   /* enum control_list */
    KEY_NAMES,  /* const json_t *, an array of strings */
};

struct request_key {
    int command;
    const char *name;
    enum key_type type;
    bool required;
    size_t offset;   /* offset of the field */
    double min, max; /* range of numbers; KEY_NAMES: range of their count */
};

/* A table of commands and their keys. Each command also has the keys "id" and "cmd". */
struct request_table {
    const char *const *command;
    size_t ncommand;
    const struct request_key *key;
    size_t nkey;
};

/* Returns the index of the request's command, or -1 if it is not in the table. */
int request_find_command(const struct request_table *table, const json_t *root);
/* Copies the values of a command's keys to the fields of request. Missing keys leave their fields
 * unchanged. */
enum error_code request_read_keys(const struct request_table *table, int command, json_t *root,
                                  void *request, struct error *error);

/* Parses one line of size bytes, without its newline. number: line number from 1, for messages. The
 * text of an error is one printable line. After an error, root and id are set if they were parsed.
 * The caller must always call control_request_clear. */
enum error_code control_parse(const char *line, size_t size, uint64_t number,
                              struct control_request *request, struct error *error);

void control_request_clear(struct control_request *request);

/* Return the name of a command ("set") and of a list ("tunables"). */
const char *control_command_name(enum control_command command);
const char *control_list_name(enum control_list list);

/* Returns whether a name matches a pattern: * matches any characters, ? matches one. */
bool control_matches(const char *pattern, const char *name);

/* Makes a string for an answer. If text is not UTF-8 (a truncated character, or arbitrary bytes of
 * a client), every non-ASCII byte becomes "?". NULL = out of memory. */
json_t *control_text(const char *text);
json_t *control_number(double value); /* Makes a number for an answer; JSON null if not finite */

#endif
