/* SPDX-License-Identifier: Apache-2.0 */
/* Prints answers as text. Missing keys print as empty or zero, because the server may have another
 * version. */
#include "control/ctl_print.h"

#include "base/array.h"
#include "base/text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { COLUMN = 12 }; /* smallest width of a value in a row */

/* Returns the text of a key of an object; "" if the key is missing. */
static const char *text_of(const json_t *object, const char *key)
{
    const char *found = json_string_value(json_object_get(object, key));

    return found ? found : "";
}

static double number_of(const json_t *object, const char *key)
{
    return json_number_value(json_object_get(object, key));
}

static long long integer_of(const json_t *object, const char *key)
{
    return (long long)json_integer_value(json_object_get(object, key));
}

static bool is_true(const json_t *object, const char *key)
{
    return json_is_true(json_object_get(object, key));
}

/* ---- what may be printed ---- */

json_t *ctl_parse_printable(char *line)
{
    json_t *answer;
    unsigned code;
    char *text;

    text_make_printable(line);
    text = strdup(line);
    /* Replace an escaped control character by a question mark */
    for (char *at = text; at && (at = strchr(at, '\\')) && at[1]; at += *at == '\\' ? 2 : 1) {
        const bool coded = sscanf(at, "\\u%4x", &code) == 1 && strlen(at) >= 6;

        if (coded ? code < 0x20 || (code >= 0x7f && code < 0xa0) : strchr("bfnr", at[1]) != NULL) {
            char *rest = at + (coded ? 6 : 2);

            *at = '?';
            memmove(at + 1, rest, strlen(rest) + 1);
        }
    }
    answer = text ? json_loads(text, 0, NULL) : NULL;
    free(text);
    return answer;
}

/* ---- the first answer ---- */

void ctl_print_hello(const json_t *answer, FILE *out)
{
    fprintf(out, "%s %s, protocol %lld, process %lld, rig %s (%s)\n", text_of(answer, "program"),
            text_of(answer, "version"), integer_of(answer, "protocol"), integer_of(answer, "pid"),
            text_of(answer, "rig"), text_of(answer, "file"));
}

/* ---- status ---- */

/* Prints a table of the buses. */
static void ctl_print_buses(const json_t *answer, FILE *out)
{
    const json_t *bus;
    size_t i;

    fprintf(out, "%-16s %-8s %12s %12s %8s %8s\n", "bus", "state", "received", "sent", "lost",
            "load");
    json_array_foreach(json_object_get(answer, "buses"), i, bus)
    {
        fprintf(out, "%-16s %-8s %12lld %12lld %8lld %6.1f %%\n", text_of(bus, "name"),
                text_of(bus, "state"), integer_of(bus, "rx_frames"), integer_of(bus, "tx_frames"),
                integer_of(bus, "rx_dropped") + integer_of(bus, "tx_dropped"),
                100.0 * number_of(bus, "load"));
    }
}

/* Prints the keys and numbers of an object, three per line. */
static void print_values(const char *title, json_t *object, int digits, FILE *out)
{
    const char *name;
    json_t *value;
    int column = 0;

    if (json_object_size(object) == 0) {
        return;
    }
    fprintf(out, "%s\n", title);
    json_object_foreach(object, name, value)
    {
        fprintf(out, "%s%-16s %*.*f", column % 3 ? "  " : "", name, 8, digits,
                json_number_value(value));
        column++;
        if (column % 3 == 0) {
            fputc('\n', out);
        }
    }
    if (column % 3) {
        fputc('\n', out);
    }
}

void ctl_print_status(const json_t *answer, FILE *out)
{
    const json_t *fault, *task = json_object_get(answer, "task");
    size_t i;

    double speed = number_of(answer, "speed");

    fprintf(out, "%s: %s, clock %s", text_of(answer, "rig"),
            is_true(answer, "paused") ? "paused" : "running", text_of(answer, "clock"));
    if (strcmp(text_of(answer, "clock"), "real") == 0) {
        if (speed > 0.0) {
            fprintf(out, " x%g", speed);
        } else {
            fputs(", as fast as possible", out);
        }
    }
    fprintf(out, "\n  file      %s\n", text_of(answer, "file"));
    fprintf(out, "  time      %.3f s, tick %lld of %g ms; %.3f s since the start\n",
            number_of(answer, "time_s"), integer_of(answer, "tick"),
            1e3 * number_of(answer, "tick_s"), number_of(answer, "elapsed_s"));
    fprintf(out, "  overruns  %lld, lost ticks %lld\n", integer_of(answer, "overruns"),
            integer_of(answer, "lost_ticks"));
    fprintf(out, "  robot     %s%s\n", text_of(answer, "robot_hash"),
            is_true(answer, "clamped") ? ", links clamped" : "");
    if (json_is_object(task)) {
        fprintf(out, "  task      %s, %s%s%s\n", text_of(task, "name"), text_of(task, "status"),
                text_of(task, "message")[0] ? ": " : "", text_of(task, "message"));
    }
    if (json_is_string(json_object_get(answer, "recording"))) {
        fprintf(out, "  recording %s\n", text_of(answer, "recording"));
    }
    fputs("  faults   ", out);
    json_array_foreach(json_object_get(answer, "faults"), i, fault)
    {
        fprintf(out, " %s", json_string_value(fault));
    }
    fputs(i ? "\n" : " none\n", out);

    /* Print the external boards, if the rig has any, and the times of their last frames */
    const json_t *board;

    json_array_foreach(json_object_get(answer, "external"), i, board)
    {
        fprintf(out, "  external  %s on %s: %s, ", text_of(board, "board"), text_of(board, "bus"),
                is_true(board, "silent") ? "silent" : "heard");
        if (json_is_null(json_object_get(board, "heard_s"))) {
            fputs("never heard\n", out);
        } else {
            fprintf(out, "last %.3f s ago\n",
                    number_of(answer, "time_s") - number_of(board, "heard_s"));
        }
    }

    ctl_print_buses(answer, out);
    print_values("joints, rad", json_object_get(answer, "joints"), 4, out);
    print_values("contacts, force up, N", json_object_get(answer, "contacts"), 1, out);
}

/* ---- statistics ---- */

/* Prints a histogram as a row of a table, us. Prints nothing if the histogram is empty. */
static void ctl_print_histogram(const char *name, const json_t *of, FILE *out)
{
    if (integer_of(of, "count") > 0) {
        fprintf(out, "%-10s %10.1f %10.1f %10.1f %10.1f %10.1f\n", name, number_of(of, "min_us"),
                number_of(of, "median_us"), number_of(of, "p99_us"), number_of(of, "max_us"),
                number_of(of, "mean_us"));
    }
}

void ctl_print_statistics(const json_t *answer, FILE *out)
{
    const json_t *lockstep = json_object_get(answer, "lockstep");
    const char *name;
    json_t *value;

    fprintf(out, "%-10s %10s %10s %10s %10s %10s\n", "us", "min", "median", "p99", "max", "mean");
    json_object_foreach(json_object_get(answer, "phases"), name, value)
    {
        ctl_print_histogram(name, value, out);
    }
    ctl_print_histogram("tick", json_object_get(answer, "work"), out);
    ctl_print_histogram("wake-up", json_object_get(answer, "wakeup"), out);
    fprintf(out, "overruns %lld", integer_of(answer, "overruns"));
    json_object_foreach(json_object_get(answer, "overruns_by"), name, value)
    {
        if (json_integer_value(value) > 0) {
            fprintf(out, ", %lld by %s", (long long)json_integer_value(value), name);
        }
    }
    fprintf(out, "; late after them %lld, deadlines skipped %lld, pauses %lld\n",
            integer_of(answer, "late_ticks"), integer_of(answer, "lost_ticks"),
            integer_of(answer, "pauses"));
    if (integer_of(lockstep, "steps") > 0) {
        fprintf(out, "lockstep: %lld steps, %lld mismatches, %lld malformed, %lld silences\n",
                integer_of(lockstep, "steps"), integer_of(lockstep, "mismatches"),
                integer_of(lockstep, "malformed"), integer_of(lockstep, "silences"));
    }
}

/* ---- lists ---- */

void ctl_print_tunable(const json_t *answer, FILE *out)
{
    fprintf(out, "%-40s %12.9g %-8s %.9g to %.9g%s\n", text_of(answer, "name"),
            number_of(answer, "value"), text_of(answer, "unit"), number_of(answer, "min"),
            number_of(answer, "max"), is_true(answer, "whole") ? ", whole" : "");
}

void ctl_print_list(const json_t *answer, FILE *out)
{
    static const char *const lists[] = {"tunables", "faults",      "bodies",
                                        "signals",  "checkpoints", "commands"};

    for (size_t k = 0; k < ARRAY_COUNT(lists); k++) {
        const json_t *entry;
        size_t i;

        json_array_foreach(json_object_get(answer, lists[k]), i, entry)
        {
            if (json_is_string(entry)) {
                fprintf(out, "%s\n", json_string_value(entry));
            } else if (strcmp(lists[k], "tunables") == 0) {
                ctl_print_tunable(entry, out);
            } else if (strcmp(lists[k], "faults") == 0) {
                fprintf(out, "%-16s %-4s %s\n", text_of(entry, "name"),
                        is_true(entry, "active") ? "on" : "off", text_of(entry, "line"));
            } else {
                fprintf(out, "%lld  tick %lld, %.6f s%s\n", integer_of(entry, "slot"),
                        integer_of(entry, "tick"), number_of(entry, "time_s"),
                        integer_of(entry, "slot") ? "" : " (the start)");
            }
        }
    }
}

/* ---- the rest ---- */

void ctl_print_moment(const char *what, const json_t *answer, FILE *out)
{
    fprintf(out, "%s: tick %lld, %.6f s", what, integer_of(answer, "tick"),
            number_of(answer, "time_s"));
    if (json_is_string(json_object_get(answer, "state_hash"))) {
        fprintf(out, ", state %s", text_of(answer, "state_hash"));
    }
    fputc('\n', out);
}

void ctl_print_titles(const json_t *answer, bool csv, FILE *out)
{
    const json_t *title;
    size_t i;

    fputs(csv ? "time_s" : "      time_s", out);
    json_array_foreach(json_object_get(answer, "signals"), i, title)
    {
        if (csv) {
            fprintf(out, ",%s", json_string_value(title));
        } else {
            fprintf(out, "  %*s", COLUMN, json_string_value(title));
        }
    }
    fputc('\n', out);
}

void ctl_print_row(const json_t *answer, const json_t *row, bool csv, FILE *out)
{
    const json_t *titles = json_object_get(answer, "signals"), *value;
    size_t i;

    fprintf(out, csv ? "%.9f" : "%12.6f", number_of(row, "time_s"));
    json_array_foreach(json_object_get(row, "values"), i, value)
    {
        double found = json_is_number(value) ? json_number_value(value) : (double)NAN;
        int width = (int)json_string_length(json_array_get(titles, i));

        if (csv) {
            fprintf(out, ",%.9g", found);
        } else {
            fprintf(out, "  %*.6g", width > COLUMN ? width : COLUMN, found);
        }
    }
    fputc('\n', out);
}
