/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil accel: reads states of a robot as text from standard input and prints its generalized
 * accelerations, so that other programs can check the dynamics.
 */
#include "app/cli/cli.h"

#include "base/text.h"
#include "manual/accel.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

enum { SHOWN = 40 }; /* number of characters of a wrong word in a message */

/* Tolerance of a quaternion's length, because printed digits are rounded. */
#define QUATERNION_TOLERANCE 1e-3

/* The current line of standard input, of any length. */
struct reader {
    char *text;
    size_t size;
    long line, column; /* position of the last word, or of the line's end, from 1 */
};

/* Writes the name and unit of number i of a state: q, then v, then the joint torques. */
static void accel_describe_number(const struct robot *robot, size_t i, char *out, size_t size)
{
    static const char *const place[] = {"base position x (m)",   "base position y (m)",
                                        "base position z (m)",   "base quaternion w (1)",
                                        "base quaternion x (1)", "base quaternion y (1)",
                                        "base quaternion z (1)"};
    static const char *const motion[] = {
        "base linear velocity x (m/s)",    "base linear velocity y (m/s)",
        "base linear velocity z (m/s)",    "base angular velocity x (rad/s)",
        "base angular velocity y (rad/s)", "base angular velocity z (rad/s)"};
    static const char *const unit[3][2] = {{"rad", "m"}, {"rad/s", "m/s"}, {"N m", "N"}};
    static const char *const what[3] = {"position", "rate", "torque"};
    size_t base[3] = {robot->nq - robot->njoint, robot->nv - robot->njoint, 0};
    size_t part = 0;

    /* Finds which of the three vectors contains i, and its index there */
    while (i >= base[part] + robot->njoint) {
        i -= base[part++] + robot->njoint;
    }
    if (i < base[part]) {
        snprintf(out, size, "%s", part == 0 ? place[i] : motion[i]);
    } else {
        const struct robot_joint *joint = &robot->joint[i - base[part]];
        bool slides = joint->type == JOINT_PRISMATIC;

        snprintf(out, size, "%s %s (%s)", joint->name, part == 2 && slides ? "force" : what[part],
                 unit[part][slides]);
    }
}

/* Sets an error at the last word, "stdin:LINE:COLUMN: found ..., expected ...". */
static enum error_code accel_refuse(const struct reader *r, const char *found, const char *expected,
                                    struct error *error)
{
    return error_set(error, ERROR_INPUT, "stdin:%ld:%ld: found %s, expected %s", r->line, r->column,
                     found, expected);
}

/* Normalizes the quaternion at this place; refuses one whose length is not about 1. */
static enum error_code accel_normalize_quaternion(double *quaternion, long line, long column,
                                                  struct error *error)
{
    double length = hypot(hypot(quaternion[0], quaternion[1]), hypot(quaternion[2], quaternion[3]));

    if (!(fabs(length - 1.0) <= QUATERNION_TOLERANCE)) {
        return error_set(error, ERROR_INPUT,
                         "stdin:%ld:%ld: found a quaternion of length %g, expected 1 within %g",
                         line, column, length, QUATERNION_TOLERANCE);
    }
    for (int m = 0; m < 4; m++) {
        quaternion[m] /= length;
    }
    return ERROR_NONE;
}

/* Reads the numbers of a line; *count is 0 for a blank line and for a comment. */
static enum error_code accel_read_numbers(struct reader *r, const struct robot *robot,
                                          double *value, size_t wanted, size_t *count,
                                          struct error *error)
{
    static const char blanks[] = " \t\r\n";
    char *word = r->text + strspn(r->text, blanks), *end;
    long quaternion_column = 0;

    for (; *word && (*count > 0 || *word != '#'); word = end + strspn(end, blanks)) {
        const char after = *(end = word + strcspn(word, blanks));

        r->column = word - r->text + 1;
        if (*count == wanted) {
            char expected[64];

            snprintf(expected, sizeof expected, "the end of the line after %zu", wanted);
            return accel_refuse(r, "one more number", expected, error);
        }
        *end = '\0';
        if (!text_to_double(word, &value[*count])) {
            /* Refuse a word that is not a finite number; the error names the expected quantity */
            char found[64], expected[256], name[128];

            for (char *c = word; *c; c++) {
                *c = *c < 0x20 || *c > 0x7e ? '?' : *c;
            }
            snprintf(found, sizeof found, "\"%.*s%s\"", SHOWN, word,
                     strlen(word) > SHOWN ? "..." : "");
            accel_describe_number(robot, *count, name, sizeof name);
            snprintf(expected, sizeof expected, "a finite number: %s", name);
            return accel_refuse(r, found, expected, error);
        }
        *end = after;
        quaternion_column = *count == 3 ? r->column : quaternion_column;
        ++*count;
    }
    return robot->floating && *count == wanted
               ? accel_normalize_quaternion(value + 3, r->line, quaternion_column, error)
               : ERROR_NONE;
}

/* Reads the numbers of the next line that has any; *found is false at the end of the input. */
static enum error_code accel_read_state(struct reader *r, const struct robot *robot, double *value,
                                        size_t wanted, bool *found, struct error *error)
{
    enum error_code code = ERROR_NONE;
    size_t count = 0;
    ssize_t length = 0;

    while (!code && count == 0 && (length = getline(&r->text, &r->size, stdin)) > 0) {
        r->line++;
        /* Refuses a zero byte, because it would hide the text after it */
        for (ssize_t i = 0; i < length; i++) {
            r->text[i] = r->text[i] ? r->text[i] : '?';
        }
        code = accel_read_numbers(r, robot, value, wanted, &count, error);
    }
    if (length < 0 && !feof(stdin)) {
        return error_set_errno(error, errno, "cannot read standard input");
    }
    *found = count > 0;
    if (!code && count > 0 && count < wanted) {
        char text[64], expected[256], name[128];

        r->column = length + (r->text[length - 1] != '\n');
        accel_describe_number(robot, count, name, sizeof name);
        snprintf(text, sizeof text, "the end of the line after %zu number%s", count,
                 count == 1 ? "" : "s");
        snprintf(expected, sizeof expected, "%zu, next %s", wanted, name);
        return accel_refuse(r, text, expected, error);
    }
    return code;
}

/* Answers a state with its accelerations by forward dynamics; refuses a state whose result
 * overflows. */
static enum error_code accel_answer_state(const struct dynamics *d, double *value, double *vdot,
                                          const struct reader *r, struct error *error)
{
    const struct robot *robot = d->robot;

    d->ops->forward(d, value, value + robot->nq, value + robot->nq + robot->nv, NULL, vdot);
    for (size_t i = 0; i < robot->nv; i++) {
        if (!isfinite(vdot[i])) {
            return error_set(error, ERROR_INPUT,
                             "stdin:%ld:1: found numbers so large that an acceleration overflows, "
                             "expected a state that a robot can be in",
                             r->line);
        }
    }

    /* Write numbers on a line, with all digits of a double, and flush them */
    for (size_t i = 0; i < robot->nv; i++) {
        printf("%.17g%c", vdot[i], i + 1 < robot->nv ? ' ' : '\n');
    }
    if (fflush(stdout) == EOF) {
        return error_set_errno(error, errno, "cannot write to standard output");
    }
    return ERROR_NONE;
}

/* Answers each state on standard input until its end or the first error, or lists the numbers of a
 * state. */
static enum error_code accel_run(const void *context, const struct robot *robot,
                                 struct arena *arena, struct error *error)
{
    const size_t wanted = robot->nq + robot->nv + robot->njoint;
    const bool *list = context;
    double *value = arena_alloc(arena, wanted, sizeof *value);
    double *vdot = arena_alloc(arena, robot->nv, sizeof *vdot);
    struct reader r = {.text = NULL};
    struct dynamics d;
    enum error_code code;
    bool found = true;

    if (*list) {
        char name[128];

        /* List name and unit of each number of a state */
        for (size_t i = 0; i < robot->nq + robot->nv + robot->njoint; i++) {
            accel_describe_number(robot, i, name, sizeof name);
            puts(name);
        }
        return fflush(stdout) == EOF
                   ? error_set_errno(error, errno, "cannot write to standard output")
                   : ERROR_NONE;
    }
    if (!value || !vdot) {
        return error_set(error, ERROR_MEMORY, "no memory for a state of %s", robot->name);
    }
    code = dynamics_generic(robot, arena, &d, error);
    while (!code && !(code = accel_read_state(&r, robot, value, wanted, &found, error)) && found) {
        code = accel_answer_state(&d, value, vdot, &r, error);
    }
    free(r.text);
    return code;
}

int cmd_accel(int argc, char **argv)
{
    static const char *robot;
    static bool list;
    static const struct option_spec options[] = {
        {"--list", OPTION_FLAG, NULL, "print the names of the numbers, one per line, and stop",
         .value = &list},
    };
    static const struct operand_spec operands[] = {
        {"ROBOT", "a robot's file or name, for example coman", true, &robot, .noun = "robots"}};
    static const struct command_spec spec = {
        .name = "accel",
        .summary = "Compute accelerations of a robot from states on standard input.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_ACCEL,
    };
    int status;

    /* Reads states only if the robot is valid */
    return options_read(&spec, argc, argv, &status)
               ? robot_command("accel", robot, NULL, &list, accel_run)
               : status;
}
