/* SPDX-License-Identifier: Apache-2.0 */
/* Progress of a compilation. */
#include "app/cli/compiling.h"

#include "base/journal.h"

enum {
    PATIENCE_S = 60, /* that a manager is asked for */
    NOTICE_S = 2,    /* how often: the watchdog of the service is fed as well */
    HOPELESS_S = 600,
};

/* A short one needs no line in a log. */
#define FIRST_LINE_S 2.0
#define LINE_S 30.0

static void compiling_tell(void *context, const char *robot, double elapsed_s)
{
    struct compiling *compiling = context;
    char text[256];

    snprintf(text, sizeof text,
             "compiling the dynamics of %.63s: %.0f s; the next start finds them", robot,
             elapsed_s);
    if (compiling->terminal) {
        fprintf(compiling->out, "\r\033[K%s", text);
        compiling->shown = true;
    } else if (elapsed_s >= compiling->next_line_s) {
        fprintf(compiling->out, "%s%s\n", journal_prefix(JOURNAL_NOTICE), text);
        compiling->next_line_s = elapsed_s + LINE_S;
    }
    fflush(compiling->out);
    if (compiling->manager && elapsed_s >= compiling->next_notice_s && elapsed_s < HOPELESS_S) {
        notify_busy(compiling->manager, PATIENCE_S, text);
        compiling->next_notice_s = elapsed_s + NOTICE_S;
    }
}

struct symbolic_progress compiling_begin(struct compiling *compiling, const struct notify *manager,
                                         FILE *out, bool terminal)
{
    *compiling = (struct compiling){
        .manager = manager, .out = out, .terminal = terminal, .next_line_s = FIRST_LINE_S};
    return (struct symbolic_progress){compiling_tell, compiling};
}

void compiling_end(struct compiling *compiling)
{
    if (compiling->shown) {
        fprintf(compiling->out, "\r\033[K");
        fflush(compiling->out);
        compiling->shown = false;
    }
}
