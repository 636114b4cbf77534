/* SPDX-License-Identifier: Apache-2.0 */
/* The kinds come from faults_help, so that a new one takes part without a change here. */
#include "tests/soak/fault_lines.h"

#include <stdio.h>

static const double BROKEN_SPRING_S = 0.15;

enum { WORDS_MAX = 8, WIRE_MOST = 12, BUSES = 64 };

void fault_lines_init(struct fault_lines *lines, const struct rig *rig, bool wire, uint64_t seed,
                      size_t kind)
{
    memset(lines, 0, sizeof *lines);
    lines->rig = rig;
    lines->wire = wire;
    lines->random = random_named(seed, "lines");
    lines->kind = kind;
    for (size_t i = 0; i < FAULTS_MAX; i++) {
        lines->line[i] = lines->text[i];
    }
}

static size_t below(struct fault_lines *lines, size_t count)
{
    return (size_t)(random_uniform(&lines->random) * (double)count);
}

static double between(struct fault_lines *lines, double from, double to)
{
    return from + (to - from) * random_uniform(&lines->random);
}

/* ---- what a line consists of ---- */

static bool has_motor(const struct robot_joint *joint)
{
    return joint->sea.present;
}

static bool has_valve(const struct robot_joint *joint)
{
    return joint->hydraulic.present;
}

/* A joint that has it, "TARGET JOINT"; false when none has. */
static bool write_joint(struct fault_lines *lines, bool (*has)(const struct robot_joint *joint),
                        const char *target, char *text, size_t size)
{
    const struct robot *robot = lines->rig->robot;
    size_t joint = below(lines, robot->njoint);

    for (size_t tried = 0; tried < robot->njoint; tried++) {
        if (has(&robot->joint[joint])) {
            return snprintf(text, size, "%s %s", target, robot->joint[joint].name) > 0;
        }
        joint = below(lines, robot->njoint);
    }
    return false;
}

static int write_sensor(struct fault_lines *lines, char *text, size_t size)
{
    static const char *const of_joint[] = {"link_encoder", "motor_encoder", "current", "torque",
                                           "temperature"};
    static const char *const of_ft[] = {"fx", "fy", "fz", "tx", "ty", "tz"};
    static const char *const of_imu[] = {"gyro_x",  "gyro_y", "gyro_z", "accel_x", "accel_y",
                                         "accel_z", "mag_x",  "mag_y",  "mag_z",   "quat_w",
                                         "quat_x",  "quat_y", "quat_z"};
    const struct robot *robot = lines->rig->robot;
    size_t which = below(lines, 8);

    if (which == 0 && robot->imu_frame >= 0) {
        return snprintf(text, size, "sensor imu.%s",
                        of_imu[below(lines, sizeof of_imu / sizeof *of_imu)]);
    }
    if (which <= 2 && robot->nft > 0) {
        const char *name = robot->ft[below(lines, robot->nft)].name;

        return which == 1 ? snprintf(text, size, "sensor %s", name)
                          : snprintf(text, size, "sensor %s.%s", name, of_ft[below(lines, 6)]);
    }
    return snprintf(text, size, "sensor %s.%s", robot->joint[below(lines, robot->njoint)].name,
                    of_joint[below(lines, 5)]);
}

static int write_board(const struct fault_lines *lines, size_t index, char *text, size_t size)
{
    const struct board_config *board = &lines->rig->boards.board[index];

    return snprintf(text, size, "board %s/%d", lines->rig->bus[board->bus].name, board->address);
}

/* A bus that can take one more; -1 = none. */
static int choose_bus(struct fault_lines *lines, bool on_wire)
{
    size_t bus = below(lines, lines->rig->nbus);

    if (on_wire && lines->on_wire[bus % BUSES]++ >= WIRE_MOST) {
        return -1;
    }
    return (int)bus;
}

/* A value that means something for each parameter that a kind of fault may have; false: unknown. */
static bool choose_value(struct fault_lines *lines, const char *key, double *value)
{
    const struct {
        const char *key;
        double from, to;
    } known[] = {
        {"amplitude", 0.01, 5.0}, {"gain", -2.0, 2.0},   {"offset", -1.0, 1.0},
        {"period", 0.002, 0.5},   {"delay", 0.001, 0.2}, {"share", 0.05, 0.95},
        {"dwell", 0.001, 0.1},    {"factor", 2.0, 50.0}, {"watchdog", 0.01, 1.0},
        {"p", 0.01, 0.5},         {"volts", 1.0, 45.0},  {"flow", 1e-4, 1e-3},
    };

    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (!strcmp(known[i].key, key)) {
            *value = between(lines, known[i].from, known[i].to);
            return true;
        }
    }
    return false;
}

/* ---- lines ---- */

/* " key=value" for each parameter, some of those that may be left out; words as "key=X",
 * "[key=X]" */
static bool write_parameters(struct fault_lines *lines, char *const *word, size_t nword, char *text,
                             size_t size, struct error *error)
{
    int used = 0;

    text[0] = '\0';
    for (size_t i = 0; i < nword; i++) {
        bool optional = word[i][0] == '[';
        char *key = word[i] + optional;
        double value;

        key[strcspn(key, "=")] = '\0';
        if (!choose_value(lines, key, &value)) {
            error_set(error, ERROR_INPUT,
                      "faults_help lists a parameter \"%s\" that has no range here", key);
            return false;
        }
        if (!optional || random_uniform(&lines->random) < 0.5) {
            used += snprintf(text + used, size - (size_t)used, " %s=%.4f", key,
                             !strcmp(key, "factor") ? floor(value) : value);
        }
    }
    return true;
}

/* "TARGET ..." for a line of faults_help; false when this rig has no such target left */
static bool write_target(struct fault_lines *lines, const char *target, bool on_wire, char *text,
                         size_t size)
{
    if (!strcmp(target, "motor")) {
        return write_joint(lines, has_motor, target, text, size);
    }
    if (!strcmp(target, "sensor")) {
        return write_sensor(lines, text, size) > 0;
    }
    if (!strcmp(target, "board")) {
        return write_board(lines, below(lines, lines->rig->boards.nboard), text, size) > 0;
    }
    if (!strcmp(target, "bus")) {
        int bus = choose_bus(lines, on_wire);

        return bus >= 0 && snprintf(text, size, "bus %s", lines->rig->bus[bus].name) > 0;
    }
    if (!strcmp(target, "valve")) {
        return write_joint(lines, has_valve, target, text, size);
    }
    if (!strcmp(target, "hydraulic_supply") &&
        lines->rig->robot->hydraulic_supply.accumulator == 0.0) {
        return false;
    }
    return snprintf(text, size, "%s", target) > 0;
}

/* One line of the kind; false with error->code when something is unknown, or without when the kind
 * does not exist here. A broken spring is whole again before its ends are turns apart, which is no
 * state of any robot: it would fling the link about at a turn a step. */
static bool write_line(struct fault_lines *lines, size_t kind, double from_s, double to_s,
                       struct error *error)
{
    char help[256], target[96], parameters[96], *rest, *word[WORDS_MAX];
    bool on_wire;
    size_t count = 0;

    faults_help(kind, help, sizeof help);
    on_wire = strstr(help, "(wire mode)") != NULL;
    if (on_wire && !lines->wire) {
        return false;
    }
    help[strcspn(help, ":")] = '\0';
    for (char *w = strtok_r(help, " ", &rest); w && count < WORDS_MAX;
         w = strtok_r(NULL, " ", &rest)) {
        word[count++] = w;
    }
    /* Target, "...", kind, parameters */
    if (count < 3) {
        error_set(error, ERROR_INPUT, "faults_help: line %zu is not as expected", kind);
        return false;
    }
    if (!write_target(lines, word[0], on_wire, target, sizeof target) ||
        !write_parameters(lines, word + 3, count - 3, parameters, sizeof parameters, error)) {
        return false;
    }
    if (!strcmp(word[2], "spring_break")) {
        to_s = fmin(to_s, from_s + BROKEN_SPRING_S);
    }
    snprintf(lines->text[lines->count++], FAULT_TEXT_SIZE, "%s %s%s %.3f..%.3f", target, word[2],
             parameters, from_s, to_s);
    lines->of_kind[kind % LINE_KINDS_MAX]++;
    return true;
}

bool fault_lines_add(struct fault_lines *lines, size_t count, double from_s, double to_s,
                     double longest_s, struct error *error)
{
    const size_t kinds = faults_help(0, NULL, 0);

    error->code = ERROR_NONE;
    while (count > 0 && lines->count < FAULTS_MAX) {
        double length = between(lines, 0.1, longest_s);
        double begin = between(lines, from_s, to_s - length);

        if (write_line(lines, lines->kind++ % kinds, begin, begin + length, error)) {
            count--;
        } else if (error->code) {
            return false;
        }
    }
    return true;
}

void fault_lines_add_power_cycle(struct fault_lines *lines, double from_s, double to_s)
{
    for (size_t i = 0; i < lines->rig->boards.nboard && lines->count < FAULTS_MAX; i++) {
        char target[96];

        write_board(lines, i, target, sizeof target);
        snprintf(lines->text[lines->count++], FAULT_TEXT_SIZE, "%s off %.3f..%.3f", target, from_s,
                 to_s);
    }
}
