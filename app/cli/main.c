/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil: the table of commands. */
#include "base/error.h"
#include "base/text.h"
#include "app/cli/commands.h"
#include "base/options.h"
#include "app/cli/topics.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int cmd_help(int argc, char **argv);
static int cmd_version(int argc, char **argv);

static const struct command {
    const char *name, *summary;
    int (*run)(int argc, char **argv);
} commands[] = {
    {"run", "run a rig: robot, boards and buses, in real time, lockstep or free run", cmd_run},
    {"test", "run scenarios: tests of a rig with a verdict", cmd_test},
    {"task", "run a controller alone, on the other side of the buses", cmd_task},
    {"ctl", "look at a running simulator and steer it", cmd_ctl},
    {"plot", "plot signals of a recording as SVG", cmd_plot},
    {"check", "check a rig or a robot file and print what is in it", cmd_check},
    {"dbc", "write DBC files of the messages on a rig's buses", cmd_dbc},
    {"doctor", "say what on this machine stands in the way of a rig's deadlines", cmd_doctor},
    {"generate", "write C code for the dynamics of a robot", cmd_generate},
    {"accel", "accelerations of a robot from states on standard input", cmd_accel},
    {"help", "print the manual of a command or a topic", cmd_help},
    {"version", "print the version", cmd_version},
};

/* what the manual has beside the commands */
static const struct topic {
    const char *name, *summary;
    void (*print)(FILE *out);
} topics[] = {
    {"rt", "real time: the phases of a tick, their budget, overruns, probes", topic_rt},
};

enum {
    NCOMMAND = sizeof commands / sizeof commands[0],
    NTOPIC = sizeof topics / sizeof topics[0],
};

static const char exit_manual[] =
    "Exit status: 0 ok; 1 the run itself failed (a task failed, or it stopped on an overrun); 2 "
    "wrong "
    "command line, file or value; 3 the system refused a call or memory ran out; 4 this machine or "
    "build cannot do it.";

static void print_usage(FILE *out)
{
    fprintf(out, "usage: coman-hil COMMAND [OPTIONS] [ARGUMENTS]\n\n"
                 "Hardware-in-the-loop simulator of the COMAN humanoid.\n\n");
    for (size_t i = 0; i < NCOMMAND; i++) {
        fprintf(out, "  %-10s%s\n", commands[i].name, commands[i].summary);
    }
    fprintf(out, "\ncoman-hil COMMAND --help prints the manual of a command, coman-hil help TOPIC\n"
                 "tells about\n\n");
    for (size_t i = 0; i < NTOPIC; i++) {
        fprintf(out, "  %-10s%s\n", topics[i].name, topics[i].summary);
    }
    fputc('\n', out);
    options_wrap(exit_manual, 0, 0, out);
}

static const struct command *find_command(const char *name)
{
    for (size_t i = 0; i < NCOMMAND; i++) {
        if (!strcmp(commands[i].name, name)) {
            return &commands[i];
        }
    }
    return NULL;
}

static const struct topic *find_topic(const char *name)
{
    for (size_t i = 0; i < NTOPIC; i++) {
        if (!strcmp(topics[i].name, name)) {
            return &topics[i];
        }
    }
    return NULL;
}

/* ntopic: 0 where a topic would do as little */
static int unknown_command(const char *name, size_t ntopic)
{
    const char *names[NCOMMAND + NTOPIC], *nearest;

    for (size_t i = 0; i < NCOMMAND; i++) {
        names[i] = commands[i].name;
    }
    for (size_t i = 0; i < ntopic; i++) {
        names[NCOMMAND + i] = topics[i].name;
    }
    nearest = text_nearest(name, names, NCOMMAND + ntopic);
    fprintf(stderr, "coman-hil: found unknown command \"%.100s\", expected %s%s%s\n", name,
            nearest ? "\"" : "one that is listed by --help", nearest ? nearest : "",
            nearest ? "\"" : "");
    return STATUS_INPUT;
}

static int cmd_help(int argc, char **argv)
{
    static const char *name;
    static const struct operand_spec operands[] = {
        {"COMMAND|TOPIC", "a command, or a topic of those that coman-hil --help lists", false,
         &name}};
    static const struct command_spec spec = {
        .name = "help",
        .summary = "Print the manual of a command or a topic, or the list of both.",
        .operand = operands,
        .noperand = 1,
    };
    static char help_option[] = "--help";
    const struct command *command;
    const struct topic *topic;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    if (!name) {
        print_usage(stdout);
        return STATUS_OK;
    }
    topic = find_topic(name);
    if (topic) {
        topic->print(stdout);
        return STATUS_OK;
    }
    command = find_command(name);
    return command ? command->run(2, (char *[]){argv[0], help_option, NULL})
                   : unknown_command(name, NTOPIC);
}

static int cmd_version(int argc, char **argv)
{
    static const struct command_spec spec = {.name = "version", .summary = "Print the version."};
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    printf("coman-hil %s\n", HIL_VERSION);
    return STATUS_OK;
}

int main(int argc, char **argv)
{
    const struct command *command;

    if (argc < 2) {
        print_usage(stderr);
        return STATUS_INPUT;
    }
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h")) {
        return options_flush_output(cmd_help(argc - 1, argv + 1));
    }
    if (!strcmp(argv[1], "--version")) {
        printf("coman-hil %s\n", HIL_VERSION);
        return options_flush_output(STATUS_OK);
    }
    command = find_command(argv[1]);
    return command ? options_flush_output(command->run(argc - 1, argv + 1)) : unknown_command(argv[1], 0);
}
