/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil help NOUN: explains the things that other manuals speak of. */
#include "app/cli/topics.h"
#include "app/scenario/scenario.h"
#include "base/options.h"
#include "boards/protocol_list.h"
#include "faults/faults.h"
#include "manual/board.h"
#include "manual/bus.h"
#include "manual/fault.h"
#include "manual/rig.h"
#include "manual/robot.h"
#include "manual/scenario.h"
#include "manual/signal.h"

void topic_rig(FILE *out)
{
    options_wrap(MANUAL_RIG, 0, 0, out);
}

void topic_robot(FILE *out)
{
    options_wrap(MANUAL_ROBOT, 0, 0, out);
}

void topic_scenario(FILE *out)
{
    options_wrap(MANUAL_SCENARIO, 0, 0, out);
}

void topic_bus(FILE *out)
{
    options_wrap(MANUAL_BUS, 0, 0, out);
}

void topic_board(FILE *out)
{
    const struct protocol *protocol;

    options_wrap(MANUAL_BOARD, 0, 0, out);
    putc('\n', out);
    for (size_t i = 0; (protocol = protocol_at(i)); i++) {
        fprintf(out, "  %-10s ", protocol->name);
        options_wrap(protocol->summary, 13, 13, out);
    }
}

void topic_fault(FILE *out)
{
    size_t count = faults_help(0, NULL, 0);
    char line[256];

    options_wrap(MANUAL_FAULT, 0, 0, out);
    for (size_t i = 0; i < count; i++) {
        faults_help(i, line, sizeof line);
        fputs("  ", out);
        options_wrap(line, 2, 6, out);
    }
}

void topic_signal(FILE *out)
{
    options_wrap(MANUAL_SIGNAL, 0, 0, out);
    for (const char *const *line = scenario_signal_help(); *line; line++) {
        fputs("  ", out);
        options_wrap(*line, 2, 6, out);
    }
}
