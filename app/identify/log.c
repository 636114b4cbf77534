/* SPDX-License-Identifier: Apache-2.0 */
/* Converts a candump log to the rows of a recording. */

#include "app/identify/identify.h"

#include "base/array.h"
#include "base/text.h"
#include "canbus/candump.h"
#include "rig/dbc.h"

#include <string.h>

/* A signal, and the bus and message that contain it. */
struct log_signal {
    size_t bus;
    const struct dbc_message *message;
    const struct dbc_signal *signal; /* NULL = no signal */
};

/* The signals to read from a log. */
struct log_source {
    const struct rig *rig;
    struct dbc **dbc; /* one per bus */
    struct log_signal position, deflection, command;
    struct log_signal current; /* in the message of the position, else none */
    double command_scale;      /* factor from the command to V or N m */
    enum command_kind command_kind;
    bool reported; /* the command is the state of the bridge that a board reports */
};

/* Returns whether a name ends with a word, or with a word and the number of an axis. */
static bool ends_in(const char *name, const char *word)
{
    const char *at = strstr(name, word);

    return at && (at == name || at[-1] == '_') &&
           at[strlen(word) + strspn(at + strlen(word), "_0123")] == '\0';
}

/* Conditions on a signal. NULL = any. */
struct log_wanted {
    const char *name;  /* the whole name */
    const char *word;  /* the end of the name */
    const char *joint; /* the joint of the signal */
    const char *unit;
    bool commanded; /* a frame of the host; only checked without a whole name */
};

/* Returns whether a signal meets the conditions. */
static bool is_log_wanted(const struct log_wanted *wanted, const struct dbc_message *message,
                          const struct dbc_signal *signal)
{
    if (wanted->name) {
        return !strcmp(signal->name, wanted->name);
    }
    return signal->comment && !strcmp(signal->comment, wanted->joint) &&
           !strcmp(signal->unit, wanted->unit) && ends_in(signal->name, wanted->word) &&
           (message->sender == 0) == wanted->commanded;
}

/* Finds the first signal of any bus that meets the conditions. Returns whether there is one. */
static bool find_log_signal(const struct log_source *source, const struct log_wanted *wanted,
                            struct log_signal *found)
{
    for (size_t bus = 0; bus < source->rig->nbus; bus++) {
        for (const struct dbc_message *m = source->dbc[bus]->message; m; m = m->next) {
            for (const struct dbc_signal *s = m->signal; s; s = s->next) {
                if (is_log_wanted(wanted, m, s)) {
                    *found = (struct log_signal){bus, m, s};
                    return true;
                }
            }
        }
    }
    return false;
}

/* Finds a signal in the message of the position, or none. */
static void find_beside(const struct log_source *source, const struct log_wanted *wanted,
                        struct log_signal *found)
{
    if (!find_log_signal(source, wanted, found) || found->message != source->position.message) {
        found->signal = NULL;
    }
}

/* Finds the signal of the joint's angle. For the angle of a rotor, also finds the deflection of the
 * spring. */
static bool find_angle(struct log_source *source, const char *joint, const char *name)
{
    static const char *const words[] = {"motor_position", "motor_encoder", "position",
                                        "pos_estimate"};
    struct log_wanted wanted = {.name = name};

    if (name && find_log_signal(source, &wanted, &source->position)) {
        return true;
    }
    for (size_t i = 0; i < ARRAY_COUNT(words); i++) {
        wanted = (struct log_wanted){.word = words[i], .joint = joint, .unit = "rad"};
        if (find_log_signal(source, &wanted, &source->position)) {
            wanted.word = "deflection";
            find_beside(source, &wanted, &source->deflection);
            return true;
        }
    }
    return false;
}

/* Finds the signal of the host's command: a voltage, a percentage of the supply, or a torque.
 * Without one, finds the state of the bridge that the board reports. */
static bool find_log_command(struct log_source *source, const char *joint, const char *name)
{
    static const struct log_wanted kinds[] = {
        {.word = "set_point", .unit = "V", .commanded = true},
        {.word = "target_voltage", .unit = "V", .commanded = true},
        {.word = "SET_OPEN_LOOP_pwm", .unit = "%", .commanded = true},
        {.word = "pwm", .unit = "%"},
        {.word = "torque", .unit = "Nm", .commanded = true},
        {.word = "current", .unit = "A", .commanded = true},
    };
    struct log_wanted wanted = {.name = name};

    if (name) {
        find_log_signal(source, &wanted, &source->command);
    }
    for (size_t i = 0; i < ARRAY_COUNT(kinds) && !source->command.signal; i++) {
        wanted = kinds[i];
        wanted.joint = joint;
        if (find_log_signal(source, &wanted, &source->command)) {
            source->command_kind = !strcmp(wanted.unit, "Nm")  ? COMMAND_TORQUE
                                   : !strcmp(wanted.unit, "A") ? COMMAND_CURRENT
                                                               : COMMAND_VOLTAGE;
            source->reported = !wanted.commanded;
        }
    }
    if (source->command.signal) {
        source->command_scale =
            !strcmp(source->command.signal->unit, "%") ? 0.01 * source->rig->supply_v : 1.0;
    }
    return source->command.signal != NULL;
}

/* Makes the DBC tables of the rig's buses, and finds the signals. */
static enum error_code open_source(const struct rig *rig, const char *joint,
                                   const struct bench_columns *columns, struct arena *arena,
                                   struct log_source *source, struct error *error)
{
    enum error_code code = ERROR_NONE;

    *source = (struct log_source){.rig = rig, .dbc = arena_alloc(arena, rig->nbus, sizeof(void *))};
    if (!source->dbc) {
        return error_set(error, ERROR_MEMORY, "no memory for the tables of the buses");
    }
    for (size_t i = 0; i < rig->nbus && !code; i++) {
        code = rig_dbc(rig, i, arena, &source->dbc[i], error);
    }
    if (code) {
        return code;
    }
    if (!find_angle(source, joint, columns->title[SIGNAL_POSITION])) {
        return error_set(error, ERROR_INPUT,
                         "found no signal with the angle of joint %s, expected its name as column "
                         "\"position\" of a bench (coman-hil dbc has the names)",
                         joint);
    }
    find_beside(source,
                &(struct log_wanted){
                    .name = columns->current_is_optional ? NULL : columns->title[SIGNAL_CURRENT],
                    .word = "current",
                    .joint = joint,
                    .unit = "A"},
                &source->current);
    source->command_kind = bench_command(columns);
    if (!find_log_command(source, joint,
                          columns->title[COLUMN_COMMAND + (int)source->command_kind])) {
        return error_set(error, ERROR_INPUT,
                         "found no signal with a voltage, a torque or a current for joint %s, "
                         "expected its name as column \"voltage\", \"torque\" or "
                         "\"set_current\" of a bench",
                         joint);
    }
    return ERROR_NONE;
}

/* Reads a signal from a frame of a bus. Returns whether the frame contains it. */
static bool read_signal(const struct log_source *source, const struct log_signal *of, size_t bus,
                        const struct bus_frame *frame, double *value)
{
    return of->signal && of->bus == bus && dbc_find_frame(source->dbc[bus], frame) == of->message &&
           dbc_read_signal(of->message, of->signal, frame, value);
}

/* The present command, and its integral over time since the last row. */
struct log_command {
    bool given;
    double value, sum; /* sum: integral, value times ns */
    int64_t since_ns;
};

/* Integrates the command up to this time. */
static void command_pass(struct log_command *command, int64_t now_ns)
{
    if (command->given && now_ns > command->since_ns) {
        command->sum += command->value * (double)(now_ns - command->since_ns);
    }
    command->since_ns = now_ns;
}

/* Reads all frames of a log, and stores rows while there is room. *count receives the number of all
 * rows. */
static enum error_code read_frames(const struct log_source *source, const char *path, size_t room,
                                   struct recording *r, size_t *count, struct error *error)
{
    struct candump_reader reader;
    struct bus_frame frame;
    char name[16];
    struct log_command command = {.given = false};
    double angle, yields;
    int64_t last = 0;
    bool end = false;
    enum error_code code = candump_open(&reader, path, error);

    *count = 0;
    if (code) {
        return code;
    }
    while (!(code = candump_next(&reader, &frame, name, &end, error)) && !end) {
        const struct rig *rig = source->rig;
        const int named = rig_find_bus(rig, name);
        const int found = named >= 0 ? named : TEXT_FIND(rig->bus, rig->nbus, interface, name);
        const size_t bus = (size_t)found;

        if (found < 0) {
            continue;
        }
        if (read_signal(source, &source->command, bus, &frame, &angle)) {
            command_pass(&command, frame.time_ns);
            command.value = source->command_scale * angle;
            command.given = true;
            if (source->reported && *count > 0 && *count <= room) {
                r->voltage[*count - 1] = command.value;
            }
        }
        if (!command.given || !read_signal(source, &source->position, bus, &frame, &angle) ||
            (*count > 0 && frame.time_ns <= last)) {
            continue;
        }
        command_pass(&command, frame.time_ns);
        r->begin_ns = *count == 0 ? frame.time_ns : r->begin_ns;
        if (*count < room) {
            yields = 0.0;
            read_signal(source, &source->deflection, bus, &frame, &yields);
            r->time[*count] = 1e-9 * (double)(frame.time_ns - r->begin_ns);
            r->signal[SIGNAL_POSITION][*count] = angle - yields;
            r->voltage[*count] =
                *count > 0 ? command.sum / (double)(frame.time_ns - last) : command.value;
            r->enabled[*count] = true;
            if (r->signal[SIGNAL_CURRENT]) {
                double *current = &r->signal[SIGNAL_CURRENT][*count];

                *current = 0.0;
                read_signal(source, &source->current, bus, &frame, current);
            }
        }
        command.sum = 0.0;
        last = frame.time_ns;
        ++*count;
    }
    candump_close(&reader);
    return code;
}

enum error_code recording_read_log(const struct rig *rig, const char *joint,
                                   const struct bench_columns *columns, struct arena *arena,
                                   struct recording *r, struct error *error)
{
    struct log_source source;
    size_t count = 0;
    enum error_code code = open_source(rig, joint, columns, arena, &source, error);

    r->gain = 1.0;
    r->voltage_before = true;
    r->command = source.command_kind;
    code = code ? code : read_frames(&source, r->file, 0, r, &count, error);
    if (!code && count < 16) {
        code = error_set(error, ERROR_INPUT,
                         "%.200s: found %zu angles of joint %s (%s) behind a first command (%s), "
                         "expected 16 or more frames, of an interface or a bus of the rig",
                         r->file, count, joint, source.position.signal->name,
                         source.command.signal->name);
    }
    const bool has[SIGNALS] = {
        [SIGNAL_POSITION] = true, [SIGNAL_CURRENT] = source.current.signal != NULL};

    if (code || (code = recording_alloc(r, count, has, arena, error))) {
        return code;
    }
    r->count = count;
    return read_frames(&source, r->file, count, r, &count, error);
}
