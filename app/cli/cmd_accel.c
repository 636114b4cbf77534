/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil accel: reads states of a robot as text from standard input and prints its generalized
 * accelerations, so that other programs can check the dynamics.
 */
#include "app/cli/commands.h"

#include "app/cli/rig_command.h"
#include "base/arena.h"
#include "base/array.h"
#include "base/options.h"
#include "base/text.h"
#include "manual/accel.h"
#include "model/symbolic/builtin.h"
#include "sim/robot_dynamics.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* Longest number that is read; characters of a wrong word that a message shows. */
enum { NUMBER_SIZE = 512, SHOWN = 40 };

/* Tolerance of a quaternion's length: printed digits leave it at 1 only roughly. */
#define QUATERNION_TOLERANCE 1e-3

/* Reads words from a stream one after the other, with the place of each. Lines of any length. */
struct reader {
    FILE *in;
    long line, column;           /* of the next character, from 1 */
    long word_line, word_column; /* of the last word, or of the line's end */
    char word[NUMBER_SIZE];
};

enum lexeme { WORD_NUMBER, WORD_LINE_END, WORD_FILE_END };

/* Reads a character and counts its column. */
static int next_char(struct reader *r)
{
    int c = getc(r->in);

    r->column++;
    return c;
}

static void accel_put_back(struct reader *r, int c)
{
    ungetc(c, r->in);
    r->column--;
}

/* Reads the next word of the line into r->word, cut to what fits: no number is that long. */
static enum lexeme next_word(struct reader *r)
{
    size_t n = 0;
    int c;

    do {
        r->word_line = r->line;
        r->word_column = r->column;
        c = next_char(r);
    } while (c == ' ' || c == '\t' || c == '\r');
    if (c == '\n') {
        r->line++;
        r->column = 1;
        return WORD_LINE_END;
    }
    if (c == EOF) {
        return WORD_FILE_END;
    }
    for (; c != EOF && c != ' ' && c != '\t' && c != '\r' && c != '\n'; c = next_char(r)) {
        if (n + 1 < sizeof r->word) {
            /* A zero byte would hide what follows it */
            r->word[n++] = c == '\0' ? '?' : (char)c;
        }
    }
    accel_put_back(r, c);
    r->word[n] = '\0';
    return WORD_NUMBER;
}

/* Skips the rest of the line. */
static void accel_skip_line(struct reader *r)
{
    int c;

    do {
        c = next_char(r);
    } while (c != '\n' && c != EOF);
    r->line++;
    r->column = 1;
}

/* Copies a word, printable and short, for a message. */
static const char *accel_printable_word(const char *word, char out[SHOWN + 4])
{
    size_t n = strlen(word);

    for (size_t i = 0; i < n && i < SHOWN; i++) {
        out[i] = word[i] < 0x20 || word[i] > 0x7e ? '?' : word[i];
    }
    strcpy(out + (n < SHOWN ? n : SHOWN), n < SHOWN ? "" : "...");
    return out;
}

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

    /* Which of the three vectors i is in, and where */
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
static enum error_code bad_input(const struct reader *r, const char *found, const char *expected,
                                 struct error *error)
{
    return error_set(error, ERROR_INPUT, "stdin:%ld:%ld: found %s, expected %s", r->word_line,
                     r->word_column, found, expected);
}

/* Reports a line with too few or too many numbers; names the first that is missing. */
static enum error_code bad_count(const struct reader *r, const struct robot *robot, size_t count,
                                 size_t wanted, struct error *error)
{
    char found[64], expected[256], name[128];

    if (count < wanted) {
        accel_describe_number(robot, count, name, sizeof name);
        snprintf(found, sizeof found, "the end of the line after %zu number%s", count,
                 count == 1 ? "" : "s");
        snprintf(expected, sizeof expected, "%zu, next %s", wanted, name);
    } else {
        snprintf(found, sizeof found, "one more number");
        snprintf(expected, sizeof expected, "the end of the line after %zu", wanted);
    }
    return bad_input(r, found, expected, error);
}

/* Reports a word that is no finite number, and names the quantity that belongs there. */
static enum error_code bad_number(const struct reader *r, const struct robot *robot, size_t count,
                                  struct error *error)
{
    char word[SHOWN + 4], found[64], expected[256], name[128];

    accel_describe_number(robot, count, name, sizeof name);
    snprintf(found, sizeof found, "\"%s\"", accel_printable_word(r->word, word));
    snprintf(expected, sizeof expected, "a finite number: %s", name);
    return bad_input(r, found, expected, error);
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

/* Reads the numbers of the next line that has any; *found is false at the end of the input. */
static enum error_code read_state(struct reader *r, const struct robot *robot, double *value,
                                  size_t wanted, bool *found, struct error *error)
{
    long quaternion_column = 0;
    size_t count = 0;
    enum lexeme word;

    /* Words up to the end of the first line that has a number; comments and blank lines are
     * skipped */
    *found = false;
    while ((word = next_word(r)) == WORD_NUMBER || (word == WORD_LINE_END && count == 0)) {
        if (word == WORD_LINE_END) {
            continue;
        }
        if (count == 0 && r->word[0] == '#') {
            accel_skip_line(r);
            continue;
        }
        if (count == wanted) {
            return bad_count(r, robot, count, wanted, error);
        }
        if (!text_to_double(r->word, &value[count])) {
            return bad_number(r, robot, count, error);
        }
        quaternion_column = count == 3 ? r->word_column : quaternion_column;
        count++;
    }
    if (ferror(r->in)) {
        return error_set_errno(error, errno, "cannot read standard input");
    }

    /* The end of the input, or a line that must be whole */
    if (count == 0) {
        return ERROR_NONE;
    }
    if (count < wanted) {
        return bad_count(r, robot, count, wanted, error);
    }
    *found = true;
    return robot->floating
               ? accel_normalize_quaternion(value + 3, r->word_line, quaternion_column, error)
               : ERROR_NONE;
}

/* Writes numbers on a line, with all digits of a double, and flushes them. */
static enum error_code write_numbers(const double *value, size_t count, struct error *error)
{
    for (size_t i = 0; i < count; i++) {
        printf("%.17g%c", value[i], i + 1 < count ? ' ' : '\n');
    }
    if (fflush(stdout) == EOF) {
        return error_set_errno(error, errno, "cannot write to standard output");
    }
    return ERROR_NONE;
}

/* Answers a state with its accelerations by forward dynamics; refuses a state where one
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
                             r->word_line);
        }
    }
    return write_numbers(vdot, robot->nv, error);
}

/* Lists name and unit of each number of a state. */
static enum error_code list_numbers(const struct robot *robot, struct error *error)
{
    char name[128];

    for (size_t i = 0; i < robot->nq + robot->nv + robot->njoint; i++) {
        accel_describe_number(robot, i, name, sizeof name);
        puts(name);
    }
    return fflush(stdout) == EOF ? error_set_errno(error, errno, "cannot write to standard output")
                                 : ERROR_NONE;
}

enum { GENERIC, GENERATED };

/* Makes the dynamics of the implementation asked for. Close the library after their last use. */
static enum error_code make_dynamics(const struct robot *robot, int implementation,
                                     struct arena *arena, struct dynamics *d,
                                     struct symbolic_library *library, struct error *error)
{
    struct error notice;
    enum error_code code;

    if (implementation == GENERIC) {
        return dynamics_generic(robot, arena, d, error);
    }
    code = robot_dynamics_fastest(robot, arena, d, library, &notice, error);
    if (!code && strcmp(d->ops->name, "generated")) {
        code = error_set(error, ERROR_UNSUPPORTED,
                         "%.400s; coman-hil generate --module makes one for the robot of a rig",
                         notice.text);
    }
    return code;
}

/* Answers every state on standard input, until its end or the first error. */
static enum error_code accel_answer_all(const struct robot *robot, const struct dynamics *d,
                                        struct arena *arena, struct error *error)
{
    size_t wanted = robot->nq + robot->nv + robot->njoint;
    double *value = arena_alloc(arena, wanted, sizeof *value);
    double *vdot = arena_alloc(arena, robot->nv, sizeof *vdot);
    struct reader *r = arena_alloc(arena, 1, sizeof *r);
    enum error_code code;
    bool found;

    if (!value || !vdot || !r) {
        return error_set(error, ERROR_MEMORY, "no memory for a state of %s", robot->name);
    }
    *r = (struct reader){.in = stdin, .line = 1, .column = 1};
    for (;;) {
        code = read_state(r, robot, value, wanted, &found, error);
        if (code || !found) {
            return code;
        }
        code = accel_answer_state(d, value, vdot, r, error);
        if (code) {
            return code;
        }
    }
}

struct accel_options {
    const char *robot, *variant;
    bool list;
    int implementation;
};

/* Answers the states on standard input, or lists what a state consists of. */
static enum error_code accel_run(const void *context, const struct robot *robot,
                                 struct arena *arena, struct error *error)
{
    const struct accel_options *o = context;
    struct symbolic_library library = {0};
    struct dynamics d;
    enum error_code code;

    if (o->list) {
        return list_numbers(robot, error);
    }
    code = make_dynamics(robot, o->implementation, arena, &d, &library, error);
    if (!code) {
        code = accel_answer_all(robot, &d, arena, error);
    }
    symbolic_close(&library);
    return code;
}

int cmd_accel(int argc, char **argv)
{
    static struct accel_options o;
    static const struct word implementations[] = {
        {"generic", GENERIC}, {"generated", GENERATED}, {NULL, 0}};
    static const struct option_spec options[] = {
        {"--variant", OPTION_STRING, "NAME",
         "a variant of the robot file instead of the robot itself", .value = &o.variant},
        {"--implementation", OPTION_ENUM, "NAME",
         "generic, the numeric articulated-body algorithm (default), or generated, the symbolic "
         "generator's code, where it is built in or was made for a rig (generate --module)",
         .value = &o.implementation, .words = implementations},
        {"--list", OPTION_FLAG, NULL, "print the names of the numbers, one per line, and stop",
         .value = &o.list},
    };
    static const struct operand_spec operands[] = {
        {"ROBOT", "a robot's file or name, for example coman", true, &o.robot, .noun = "robots"}};
    static const struct command_spec spec = {
        .name = "accel",
        .summary = "Compute accelerations of a robot from states on standard input.",
        .option = options,
        .noption = ARRAY_COUNT(options),
        .operand = operands,
        .noperand = ARRAY_COUNT(operands),
        .manual = MANUAL_ACCEL,
    };
    int status;

    /* States are read only when the robot is valid */
    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    return robot_command("accel", o.robot, o.variant, &o, accel_run);
}
