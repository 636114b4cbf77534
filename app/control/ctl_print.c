/* SPDX-License-Identifier: Apache-2.0 */
/* Answers as text. What an answer lacks prints as nothing or zero: the server may be of another
 * version. */
#include "app/control/ctl_print.h"

#include <math.h>
#include <string.h>

enum { COLUMN = 12 }; /* least width of one of a row */

static const char *text(const json_t *object, const char *key)
{
    const char *found = json_string_value(json_object_get(object, key));

    return found ? found : "";
}

static double number(const json_t *object, const char *key)
{
    return json_number_value(json_object_get(object, key));
}

static long long whole(const json_t *object, const char *key)
{
    return (long long)json_integer_value(json_object_get(object, key));
}

static bool truth(const json_t *object, const char *key)
{
    return json_is_true(json_object_get(object, key));
}

void ctl_print_hello(const json_t *answer, FILE *out)
{
    fprintf(out, "%s %s, protocol %lld, process %lld, rig %s (%s)\n", text(answer, "program"),
            text(answer, "version"), whole(answer, "protocol"), whole(answer, "pid"),
            text(answer, "rig"), text(answer, "file"));
}

/* ---- status ---- */

static void print_time(const json_t *answer, FILE *out)
{
    double speed = number(answer, "speed");

    fprintf(out, "%s: %s, clock %s", text(answer, "rig"),
            truth(answer, "paused") ? "paused" : "running", text(answer, "clock"));
    if (strcmp(text(answer, "clock"), "real") == 0) {
        if (speed > 0.0) {
            fprintf(out, " x%g", speed);
        } else {
            fputs(", as fast as it goes", out);
        }
    }
    fprintf(out, "\n  file      %s\n", text(answer, "file"));
    fprintf(out, "  time      %.3f s, tick %lld of %g ms; %.3f s since the start\n",
            number(answer, "time_s"), whole(answer, "tick"), 1e3 * number(answer, "tick_s"),
            number(answer, "elapsed_s"));
    fprintf(out, "  overruns  %lld, lost ticks %lld\n", whole(answer, "overruns"),
            whole(answer, "lost_ticks"));
    fprintf(out, "  robot     %s%s\n", text(answer, "robot_hash"),
            truth(answer, "clamped") ? ", its links are held" : "");
}

static void print_task(const json_t *answer, FILE *out)
{
    const json_t *task = json_object_get(answer, "task");

    if (json_is_object(task)) {
        fprintf(out, "  task      %s, %s%s%s\n", text(task, "name"), text(task, "status"),
                text(task, "message")[0] ? ": " : "", text(task, "message"));
    }
    if (json_is_string(json_object_get(answer, "recording"))) {
        fprintf(out, "  recording %s\n", text(answer, "recording"));
    }
}

static void print_buses(const json_t *answer, FILE *out)
{
    const json_t *bus;
    size_t i;

    fprintf(out, "%-16s %-8s %12s %12s %8s %8s\n", "bus", "state", "received", "sent", "lost",
            "load");
    json_array_foreach(json_object_get(answer, "buses"), i, bus)
    {
        fprintf(out, "%-16s %-8s %12lld %12lld %8lld %6.1f %%\n", text(bus, "name"),
                text(bus, "state"), whole(bus, "rx_frames"), whole(bus, "tx_frames"),
                whole(bus, "rx_dropped") + whole(bus, "tx_dropped"), 100.0 * number(bus, "load"));
    }
}

/* names and numbers of an object, three to a line */
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
    const json_t *fault;
    size_t i;

    print_time(answer, out);
    print_task(answer, out);
    fputs("  faults   ", out);
    json_array_foreach(json_object_get(answer, "faults"), i, fault)
    {
        fprintf(out, " %s", json_string_value(fault));
    }
    fputs(i ? "\n" : " none\n", out);
    print_buses(answer, out);
    print_values("joints, rad", json_object_get(answer, "joints"), 4, out);
    print_values("contacts, force up, N", json_object_get(answer, "contacts"), 1, out);
}

/* ---- statistics ---- */

static void print_histogram(const char *name, const json_t *of, FILE *out)
{
    if (whole(of, "count") > 0) {
        fprintf(out, "%-10s %10.1f %10.1f %10.1f %10.1f %10.1f\n", name, number(of, "min_us"),
                number(of, "median_us"), number(of, "p99_us"), number(of, "max_us"),
                number(of, "mean_us"));
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
        print_histogram(name, value, out);
    }
    print_histogram("tick", json_object_get(answer, "work"), out);
    print_histogram("wake-up", json_object_get(answer, "wakeup"), out);
    fprintf(out, "overruns %lld", whole(answer, "overruns"));
    json_object_foreach(json_object_get(answer, "overruns_by"), name, value)
    {
        if (json_integer_value(value) > 0) {
            fprintf(out, ", %lld by %s", (long long)json_integer_value(value), name);
        }
    }
    fprintf(out, "; late after them %lld, deadlines dropped %lld, pauses %lld\n",
            whole(answer, "late_ticks"), whole(answer, "lost_ticks"), whole(answer, "pauses"));
    if (whole(lockstep, "steps") > 0) {
        fprintf(out, "lockstep: %lld steps, %lld mismatches, %lld malformed, %lld silences\n",
                whole(lockstep, "steps"), whole(lockstep, "mismatches"),
                whole(lockstep, "malformed"), whole(lockstep, "silences"));
    }
}

/* ---- lists ---- */

void ctl_print_tunable(const json_t *answer, FILE *out)
{
    fprintf(out, "%-40s %12.9g %-8s %.9g to %.9g%s\n", text(answer, "name"),
            number(answer, "value"), text(answer, "unit"), number(answer, "min"),
            number(answer, "max"), truth(answer, "whole") ? ", whole" : "");
}

static void print_entry(const char *list, const json_t *entry, FILE *out)
{
    if (json_is_string(entry)) {
        fprintf(out, "%s\n", json_string_value(entry));
    } else if (strcmp(list, "tunables") == 0) {
        ctl_print_tunable(entry, out);
    } else if (strcmp(list, "faults") == 0) {
        fprintf(out, "%-16s %-4s %s\n", text(entry, "name"), truth(entry, "active") ? "on" : "off",
                text(entry, "line"));
    } else {
        fprintf(out, "%lld  tick %lld, %.6f s%s\n", whole(entry, "slot"), whole(entry, "tick"),
                number(entry, "time_s"), whole(entry, "slot") ? "" : " (the start)");
    }
}

void ctl_print_list(const json_t *answer, FILE *out)
{
    static const char *const lists[] = {"tunables", "faults",      "bodies",
                                        "signals",  "checkpoints", "commands"};

    for (size_t k = 0; k < sizeof lists / sizeof lists[0]; k++) {
        const json_t *entry;
        size_t i;

        json_array_foreach(json_object_get(answer, lists[k]), i, entry)
        {
            print_entry(lists[k], entry, out);
        }
    }
}

/* ---- the rest ---- */

void ctl_print_moment(const char *what, const json_t *answer, FILE *out)
{
    fprintf(out, "%s: tick %lld, %.6f s", what, whole(answer, "tick"), number(answer, "time_s"));
    if (json_is_string(json_object_get(answer, "state_hash"))) {
        fprintf(out, ", state %s", text(answer, "state_hash"));
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

    fprintf(out, csv ? "%.9f" : "%12.6f", number(row, "time_s"));
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
