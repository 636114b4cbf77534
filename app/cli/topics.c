/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil help TOPIC: explains topics that belong to several commands, and real time. */
#include "app/cli/cli.h"
#include "app/scenario/scenario.h"
#include "boards/protocol_list.h"
#include "manual/board.h"
#include "manual/fault.h"
#include "manual/rt.h"
#include "manual/signal.h"

#include <inttypes.h>

/* Instructions in a tick of 1 ms at 1 ns per instruction, the reference for the phases' shares;
 * column of the text after a name. */
enum { TICK_INSTRUCTIONS = 1000000, NAME_COLUMN = 12 };

/* Prints the manual's text up to the line "  @MARK@"; returns the text after that line. */
static const char *print_until_mark(const char *text, const char *mark, FILE *out)
{
    const char *at = strstr(text, mark), *end = at;
    char part[sizeof MANUAL_RT];

    while (end > text && (end[-1] == ' ' || end[-1] == '\n')) {
        end--;
    }
    snprintf(part, sizeof part, "%.*s", (int)(end - text), text);
    options_wrap(part, 0, 0, out);
    return at + strlen(mark) + strlen("\n");
}

void topic_rt(FILE *out)
{
    const char *text = print_until_mark(MANUAL_RT, "@PHASES@", out);

    /* Print the work of each phase of the loop */
    for (int p = 0; p < PHASE_COUNT; p++) {
        fprintf(out, "  %-10s", loop_phase_name((enum loop_phase)p));
        options_wrap(phase_budgets[p].does, NAME_COLUMN, NAME_COLUMN, out);
    }
    text = print_until_mark(text, "@BUDGET@", out);

    /* Print each phase's budget in instructions, and its measured time */
    uint32_t sum = 0;

    fprintf(out, "  %-10s%14s%9s%12s%9s%9s\n", "phase", "instructions", "share", "measured", "99 %",
            "share");
    for (int p = PHASE_RECEIVE; p <= PHASE_PUBLISH; p++) {
        const struct phase_budget *budget = &phase_budgets[p];

        fprintf(out, "  %-10s%14" PRIu32 "%7.2f %%%12.1f%9.1f%7.2f %%\n",
                loop_phase_name((enum loop_phase)p), budget->instructions,
                100.0 * budget->instructions / TICK_INSTRUCTIONS, budget->typical_us,
                budget->worst_us, 0.1 * budget->worst_us);
        sum += budget->instructions;
    }
    fprintf(out, "  %-10s%14" PRIu32 "%7.2f %%\n", "sum", sum, 100.0 * sum / TICK_INSTRUCTIONS);
    options_wrap(text, 0, 0, out);
}

void topic_board(FILE *out)
{
    const struct protocol *protocol;

    options_wrap(MANUAL_BOARD, 0, 0, out);
    putc('\n', out);
    for (size_t i = 0; (protocol = protocol_at(i)); i++) {
        fprintf(out, "  %-10s ", protocol->needs_file ? "FILE" : protocol->name);
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
