/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil bench: runs the benchmark program, which is in the same folder as coman-hil. */
#include "app/cli/cli.h"

#include "base/config.h"
#include "manual/bench.h"

#include <errno.h>
#include <unistd.h>

/* Replaces this process by the benchmark program; returns only on an error. */
static enum error_code bench_become(char **argv, struct error *error)
{
    char path[PATH_MAX];

    config_program_folder(path);
    strcat(path, "/coman-hil-bench");
    fflush(stdout);
    execv(path, argv);
    return errno == ENOENT ? error_set(error, ERROR_UNSUPPORTED,
                                       "found no program %.200s, expected it beside this one", path)
                           : error_set_errno(error, errno, "cannot run %.200s", path);
}

int cmd_bench(int argc, char **argv)
{
    static const char *subject;
    static const struct operand_spec operands[] = {
        {"SUBJECT", "the benchmark; without it they are listed", false, .value = &subject},
    };
    static const struct command_spec spec = {
        .name = "bench",
        .summary = "Repeat the paper's measurements on this machine, beside its numbers.",
        OPERAND_TABLE(operands),
        .manual = MANUAL_BENCH,
    };
    static char name[] = "coman-hil-bench", help[] = "--help";
    static char *listing[] = {name, help, NULL};
    struct error error;
    int status;

    /* Options before the subject belong to this command; options after it belong to the
     * benchmark */
    if (!options_read(&spec, argc > 2 && argv[1][0] != '-' ? 2 : argc, argv, &status)) {
        return status;
    }
    argv[0] = name;
    bench_become(subject ? argv : listing, &error);
    return options_fail(&spec, &error);
}
