/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil accel: each test runs the command in a child with text on its standard input. */
#include "model/dynamics.h"
#include "app/cli/commands.h"
#include "tests/unit/model/random_robot.h"
#include "tests/test.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#define COMAN HIL_SOURCE_DIR "/config/robots/coman.yaml"

enum { NUMBERS = 30 + 29 + 23, OUTPUT_SIZE = 1 << 20, WAIT_MS = 20000 };

/* The command in a child: its ends of the pipes. */
struct child {
    pid_t pid;
    int in, out, err;
};

static void start(struct child *child, const char *option)
{
    int in[2], out[2], err[2];

    assert_int_equal(pipe(in), 0);
    assert_int_equal(pipe(out), 0);
    assert_int_equal(pipe(err), 0);
    fflush(NULL);
    child->pid = fork();
    assert_true(child->pid >= 0);
    if (child->pid == 0) {
        char name[] = "accel", robot[] = COMAN, given[64];
        char *argv[] = {name, robot, option ? given : NULL, NULL};

        snprintf(given, sizeof given, "%s", option ? option : "");
        dup2(in[0], STDIN_FILENO);
        dup2(out[1], STDOUT_FILENO);
        dup2(err[1], STDERR_FILENO);
        close(in[1]); /* else the child would wait for its own end */
        _exit(cmd_accel(option ? 3 : 2, argv));
    }
    close(in[0]);
    close(out[1]);
    close(err[1]);
    child->in = in[1];
    child->out = out[0];
    child->err = err[0];
}

/* Reads until the end, or until a newline when line is set. */
static void receive(int fd, char *text, size_t size, bool line)
{
    size_t used = 0;

    while (used + 1 < size) {
        struct pollfd ready = {.fd = fd, .events = POLLIN};
        ssize_t n;

        assert_int_equal(poll(&ready, 1, WAIT_MS), 1);
        n = read(fd, text + used, line ? 1 : size - 1 - used);
        if (n <= 0) {
            break;
        }
        used += (size_t)n;
        if (line && text[used - 1] == '\n') {
            break;
        }
    }
    text[used] = '\0';
}

static void supply(const struct child *child, const char *text, size_t size)
{
    while (size > 0) {
        ssize_t n = write(child->in, text, size);

        if (n < 0 && errno == EPIPE) {
            return; /* the child has ended before it read everything, with its message */
        }
        assert_true(n > 0);
        text += n;
        size -= (size_t)n;
    }
}

/* Closes the input, collects the output and returns the exit status. */
static int finish(struct child *child, char *out, char *err)
{
    int status;

    close(child->in);
    receive(child->out, out, OUTPUT_SIZE, false);
    receive(child->err, err, OUTPUT_SIZE, false);
    assert_int_equal(waitpid(child->pid, &status, 0), child->pid);
    close(child->out);
    close(child->err);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

static char out[OUTPUT_SIZE], err[OUTPUT_SIZE];

static int run(const char *input, size_t size, const char *option)
{
    struct child child;

    start(&child, option);
    supply(&child, input, size);
    return finish(&child, out, err);
}

static void assert_refused(const char *input, const char *message)
{
    assert_int_equal(run(input, strlen(input), NULL), 2);
    if (!strstr(err, message)) {
        fail_msg("found \"%s\", expected \"%s\"", err, message);
    }
}

/* A line of zeros with an upright base; other stands for the count numbers that begin at from. */
static char *line_with(char *text, size_t from, size_t count, const char *other)
{
    char *at = text;

    for (size_t i = 0; i < NUMBERS; i++) {
        if (i == from) {
            at += sprintf(at, "%s%s", i ? " " : "", other);
        } else if (i < from || i >= from + count) {
            at += sprintf(at, "%s%d", i ? " " : "", i == 3);
        }
    }
    return text;
}

/* ---- tests ---- */

TEST(prints_what_the_dynamics_compute_to_the_last_bit)
{
    static char text[NUMBERS * 32 + 64];
    const struct robot *robot;
    struct random_state s;
    struct arena arena;
    struct dynamics d;
    uint64_t seed = 21;
    double vdot[29];
    char *at = text + sprintf(text, "# a comment\n\n   \t\n  # another\n");

    assert_int_equal(arena_init(&arena, 1 << 24, NULL), ERROR_NONE);
    assert_int_equal(robot_load(COMAN, NULL, &arena, &robot, NULL), ERROR_NONE);
    assert_int_equal(dynamics_generic(robot, &arena, &d, NULL), ERROR_NONE);
    random_state_make(&seed, robot, &s);
    memcpy(s.q + 3, (double[]){0.5, -0.5, 0.5, 0.5}, 4 * sizeof *s.q); /* exactly a unit one */
    d.ops->forward(&d, s.q, s.v, s.tau, NULL, vdot);
    for (size_t i = 0; i < NUMBERS; i++) {
        double value = i < 30 ? s.q[i] : i < 59 ? s.v[i - 30] : s.tau[i - 59];

        at += sprintf(at, "%s%.17g", i ? i % 2 ? " " : "\t  " : "", value);
    }

    /* the last line has no newline */
    assert_int_equal(run(text, (size_t)(at - text), NULL), 0);
    at = out;
    for (size_t i = 0; i < 29; i++) {
        assert_true(strtod(at, &at) == vdot[i]);
        assert_int_equal(*at++, i < 28 ? ' ' : '\n');
    }
    assert_int_equal(*at, '\0');
    assert_string_equal(err, "");
    arena_fini(&arena);
}

TEST(answers_each_line_before_the_next_one_is_written)
{
    static char text[1024];
    struct child child;

    line_with(text, 99, 0, "");
    start(&child, NULL);
    for (int i = 0; i < 3; i++) {
        supply(&child, text, strlen(text));
        supply(&child, "\n", 1);
        receive(child.out, out, sizeof out, true);
        assert_non_null(strstr(out, " -9.8"));
    }
    assert_int_equal(finish(&child, out, err), 0);
    assert_string_equal(out, "");
}

TEST(says_nothing_about_nothing)
{
    assert_int_equal(run("", 0, NULL), 0);
    assert_int_equal(run("\n\n#", 3, NULL), 0);
    assert_string_equal(out, "");
}

TEST(lists_the_numbers_of_a_line)
{
    size_t lines = 0;

    assert_int_equal(run("", 0, "--list"), 0);
    for (const char *at = out; *at; at++) {
        lines += *at == '\n';
    }
    assert_int_equal(lines, NUMBERS);
    assert_int_equal(strncmp(out, "base position x (m)\n", 20), 0);
    assert_non_null(strstr(out, "base quaternion z (1)\nRHipSag position (rad)\n"));
    assert_non_null(strstr(out, "LElbj position (rad)\nbase linear velocity x (m/s)\n"));
    assert_non_null(strstr(out, "base angular velocity z (rad/s)\nRHipSag rate (rad/s)\n"));
    assert_non_null(strstr(out, "LElbj rate (rad/s)\nRHipSag torque (N m)\n"));
}

TEST(refuses_lines_of_another_length)
{
    static char text[1024];

    assert_refused("1 2 3\n", "stdin:1:6: found the end of the line after 3 numbers, expected 82, "
                              "next base quaternion w (1)");
    assert_refused("# c\n1", "stdin:2:2: found the end of the line after 1 number, expected 82");
    strcat(line_with(text, 99, 0, ""), " 0");
    assert_refused(text, ": found one more number, expected the end of the line after 82");
}

TEST(refuses_what_is_not_a_finite_number)
{
    static const char *const bad[] = {"nan", "inf", "-inf", "1e999", "0x10",
                                      "1,5", "--1", "#",    "1e"};
    static char text[1024], message[128];

    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        line_with(text, 7, 1, bad[i]);
        snprintf(message, sizeof message,
                 "stdin:1:15: found \"%s\", expected a finite number: RHipSag position (rad)",
                 bad[i]);
        assert_refused(text, message);
    }
}

TEST(takes_a_quaternion_of_nearly_unit_length_only)
{
    static char text[1024], exact[OUTPUT_SIZE];

    assert_refused(line_with(text, 3, 4, "1.002 0 0 0"),
                   "stdin:1:7: found a quaternion of length 1.002, expected 1 within 0.001");
    assert_refused(line_with(text, 3, 4, "0 0 0 0"), "found a quaternion of length 0");

    line_with(text, 3, 4, "0.6 0 0.8 0");
    assert_int_equal(run(text, strlen(text), NULL), 0);
    memcpy(exact, out, sizeof exact);
    line_with(text, 3, 4, "0.6003 0 0.8004 0");
    assert_int_equal(run(text, strlen(text), NULL), 0);
    for (char *a = exact, *b = out; *a && *a != '\n'; a++, b++) {
        double x = strtod(a, &a), y = strtod(b, &b);

        assert_true(x - y < 1e-9 && y - x < 1e-9);
    }
}

TEST(survives_lines_and_words_of_any_length)
{
    enum { LONG = 3 << 20 };
    static char text[LONG];

    memset(text, '7', sizeof text);
    assert_int_equal(run(text, sizeof text, NULL), 2);
    assert_non_null(strstr(err, "stdin:1:1: found \"7777"));
    assert_true(strlen(err) < 300);
    for (size_t i = 0; i < sizeof text; i++) {
        text[i] = i % 2 ? ' ' : '1';
    }
    assert_int_equal(run(text, sizeof text, NULL), 2);
    assert_non_null(strstr(err, "stdin:1:165: found one more number"));
    memset(text, ' ', sizeof text);
    assert_int_equal(run(text, sizeof text, NULL), 0);
    memset(text, '\0', 100);
    assert_int_equal(run(text, 100, NULL), 2);
    assert_non_null(strstr(err, "found \"????"));
}

TEST(refuses_states_whose_accelerations_overflow)
{
    static char text[1024];

    assert_refused(line_with(text, 40, 1, "1e200"), "stdin:1:1: found numbers so large");
}

FIXTURE(ignore_broken_pipes)
{
    signal(SIGPIPE, SIG_IGN);
    return 0;
}

TEST_GROUP(ignore_broken_pipes, NULL)
