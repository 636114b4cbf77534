/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil: the table of commands. */
#include "app/cli/cli.h"
#include "manual/bus.h"
#include "manual/rig.h"
#include "manual/rig_page.h"
#include "manual/robot.h"
#include "manual/robot_page.h"
#include "manual/scenario.h"
#include "manual/scenario_page.h"

#include "base/array.h"
#include "base/instruction_set.h"
#include "base/program.h"

#include <stdlib.h>

static int cmd_help(int argc, char **argv);
static int cmd_version(int argc, char **argv);
static void print_topics_and_statuses(FILE *out);

static const struct program_command commands[] = {
    {"run", "run a rig: robot, boards and buses, in real time, lockstep or free run", cmd_run},
    {"test", "run scenarios: tests of a rig with a verdict", cmd_test},
    {"task", "run a task alone, on the other side of the buses", cmd_task},
    {"replay", "send the frames of a recording onto live buses", cmd_replay},
    {"ctl", "observe and control a running simulator", cmd_ctl},
    {"import", "make a robot and a rig of a URDF or MJCF file", cmd_import},
    {"identify", "fit a drive's numbers to recordings of it", cmd_identify},
    {"validate", "compare simulated drives with measured ones", cmd_validate},
    {"list", "list the rigs, robots, scenarios and tasks that are there", cmd_list},
    {"plot", "plot signals of a recording as SVG", cmd_plot},
    {"check", "check a rig or a robot file and print its contents", cmd_check},
    {"dbc", "write DBC files of the messages on a rig's buses", cmd_dbc},
    {"eds", "write EDS files of the CANopen nodes on a rig's buses", cmd_eds},
    {"protocol", "print every frame of a protocol of boards", cmd_protocol},
    {"doctor", "say what keeps this machine from meeting a rig's deadlines", cmd_doctor},
    {"generate", "write C code for the dynamics of a robot", cmd_generate},
    {"bench", "repeat the paper's measurements on this machine", cmd_bench},
    {"accel", "compute accelerations of a robot from states on standard input", cmd_accel},
    {"help", "print the manual of a command or a topic", cmd_help},
    {"version", "print the version", cmd_version},
};

static const struct program coman_hil = {
    .name = "coman-hil",
    .noun = "command",
    .about = "Real-time hardware-in-the-loop simulator over SocketCAN.",
    .command = commands,
    .ncommand = ARRAY_COUNT(commands),
    .print_more = print_topics_and_statuses,
};

/* What the manual has beside the commands. */
static const struct topic {
    const char *name, *summary;
    const char *manual; /* NULL: print does it */
    void (*print)(FILE *out);
    const char *keys; /* all keys of such a file, as Markdown; NULL: it is no file */
} topics[] = {
    {"rig", "a robot, its scene, buses and boards, its clock", MANUAL_RIG, NULL, MANUAL_RIG_PAGE},
    {"robot", "a robot's file", MANUAL_ROBOT, NULL, MANUAL_ROBOT_PAGE},
    {"scenario", "a test with a verdict", MANUAL_SCENARIO, NULL, MANUAL_SCENARIO_PAGE},
    {"bus", "the CAN buses of a rig, and how programs join them", MANUAL_BUS, NULL, NULL},
    {"board", "what controllers talk to, and its protocols", NULL, topic_board, NULL},
    {"fault", "what can break, as a line of text", NULL, topic_fault, NULL},
    {"signal", "the numbers that scenarios judge", NULL, topic_signal, NULL},
    {"rt", "real time: the phases of a tick, their budget, overruns, probes", NULL, topic_rt, NULL},
};

static const char exit_manual[] =
    "Exit status: 0 ok; 1 the run itself failed (a task failed, or it stopped on an overrun); 2 "
    "wrong command line, file or value; 3 the system refused a call or memory ran out; 4 this "
    "machine or build cannot do it.";

static void print_topics_and_statuses(FILE *out)
{
    fprintf(out, "coman-hil help TOPIC explains\n\n");
    for (size_t i = 0; i < ARRAY_COUNT(topics); i++) {
        fprintf(out, "  %-12s%s\n", topics[i].name, topics[i].summary);
    }
    fputc('\n', out);
    options_wrap(exit_manual, 0, 0, out);
}

/* Also by its plural. */
static const struct topic *find_topic(const char *name)
{
    for (size_t i = 0; i < ARRAY_COUNT(topics); i++) {
        size_t length = strlen(topics[i].name);

        if (!strncmp(topics[i].name, name, length) &&
            (!name[length] || !strcmp(name + length, "s") || !strcmp(name + length, "es"))) {
            return &topics[i];
        }
    }
    return NULL;
}

static int cmd_help(int argc, char **argv)
{
    static const char *name;
    static const char *words[ARRAY_COUNT(commands) + ARRAY_COUNT(topics) + 1];
    static const struct operand_spec operands[] = {
        {"COMMAND|TOPIC", "a command or a topic that coman-hil --help lists", false, .value = &name,
         .words = words}};
    static bool markdown;
    static const struct option_spec options[] = {
        {"--markdown", OPTION_FLAG, NULL,
         "all keys of a rig, robot or scenario file, as the page of docs/reference",
         .value = &markdown}};
    static const struct command_spec spec = {
        .name = "help",
        .summary = "Print the manual of a command or a topic, or the list of both.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
    };
    static char help_option[] = "--help";
    const char *topic_names[ARRAY_COUNT(topics)];
    const struct program_command *command;
    const struct topic *topic;
    int status;

    for (size_t i = 0; i < ARRAY_COUNT(commands); i++) {
        words[i] = commands[i].name;
    }
    for (size_t i = 0; i < ARRAY_COUNT(topics); i++) {
        words[ARRAY_COUNT(commands) + i] = topics[i].name;
    }
    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    if (!name) {
        program_print_usage(&coman_hil, stdout);
        return STATUS_OK;
    }

    /* A topic, or a command with --help */
    topic = find_topic(name);
    if (markdown && !(topic && topic->keys)) {
        struct error error;

        error_set(&error, ERROR_INPUT, "--markdown: expected the topic rig, robot or scenario");
        return options_fail(&spec, &error);
    }
    if (topic) {
        if (markdown) {
            puts(topic->keys);
        } else if (topic->manual) {
            options_wrap(topic->manual, 0, 0, stdout);
        } else {
            topic->print(stdout);
        }
        return STATUS_OK;
    }
    command = program_find(&coman_hil, name);
    if (command) {
        return command->run(2, (char *[]){argv[0], help_option, NULL});
    }

    /* Neither */
    for (size_t i = 0; i < ARRAY_COUNT(topics); i++) {
        topic_names[i] = topics[i].name;
    }
    return program_refuse(&coman_hil, name, topic_names, ARRAY_COUNT(topics));
}

static int cmd_version(int argc, char **argv)
{
    static const struct command_spec spec = {.name = "version", .summary = "Print the version."};
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    program_print_version(&coman_hil);
    return STATUS_OK;
}

int main(int argc, char **argv)
{
    const char *instructions = getenv("COMAN_HIL_INSTRUCTIONS");
    struct error error;

    if (instructions && instruction_set_hold(instructions, &error)) {
        fprintf(stderr, "coman-hil: COMAN_HIL_INSTRUCTIONS: %s\n", error.text);
        return STATUS_INPUT;
    }
    return program_main(&coman_hil, argc, argv);
}
