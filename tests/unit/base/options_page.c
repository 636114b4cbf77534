/* SPDX-License-Identifier: Apache-2.0 */
/* Manual pages made from the table of a command. */
#include "base/options.h"

#include "base/array.h"
#include "tests/test.h"

static const struct option_spec options[] = {
    {"--seed", OPTION_INT, "N", "seed of the_noise", NULL, .min = 0.0, .max = 9.0},
    {"--quiet", OPTION_FLAG, NULL, "no status line", NULL, .min = 0.0},
};

static const char *rig, *files[4];

static const struct operand_spec operands[] = {
    {"RIG", "the rig file", true, .value = &rig},
    {"FILE", "more files", false, .value = files},
};

static const struct command_spec full = {
    .name = "run",
    .summary = "runs a *rig*",
    .option = options,
    .noption = ARRAY_COUNT(options),
    .operand = operands,
    .noperand = ARRAY_COUNT(operands),
    .many = true,
    .manual = "First paragraph.\nSecond one:\n  an item\n  another\nThe end.",
};

static char *page_of(const struct command_spec *spec)
{
    char *text = NULL;
    size_t size;
    FILE *file = open_memstream(&text, &size);

    assert_non_null(file);
    options_page(spec, file);
    assert_int_equal(fclose(file), 0);
    return text;
}

TEST(a_page_has_every_part_of_the_table)
{
    static const char expected[] = "coman-hil-run(1) \"coman-hil " HIL_VERSION "\"\n"
                                   "\n"
                                   "# NAME\n"
                                   "\n"
                                   "coman-hil-run - runs a \\*rig\\*\n"
                                   "\n"
                                   "# SYNOPSIS\n"
                                   "\n"
                                   "*coman-hil run* [OPTIONS] _RIG_ [_FILE_]...\n"
                                   "\n"
                                   "# OPTIONS\n"
                                   "\n"
                                   "*RIG*\n"
                                   "\tthe rig file\n"
                                   "\n"
                                   "*FILE*\n"
                                   "\tmore files\n"
                                   "\n"
                                   "*\\-\\-seed* _N_\n"
                                   "\tseed of the\\_noise\n"
                                   "\n"
                                   "*\\-\\-quiet*\n"
                                   "\tno status line\n"
                                   "\n"
                                   "*\\-\\-help*\n"
                                   "\tprint the manual and exit\n"
                                   "\n"
                                   "# DESCRIPTION\n"
                                   "\n"
                                   "First paragraph\\.\n"
                                   "\n"
                                   "Second one\\:\n"
                                   "\n"
                                   "- an item\n"
                                   "- another\n"
                                   "\n"
                                   "The end\\.\n"
                                   "\n"
                                   "# SEE ALSO\n"
                                   "\n"
                                   "*coman-hil*(1), *coman-hil-rig*(5), *coman-hil-robot*(5), "
                                   "*coman-hil-scenario*(5)\n";
    char *text = page_of(&full);

    assert_string_equal(text, expected);
    free(text);
}

TEST(a_command_of_another_program_has_its_name)
{
    const struct command_spec spec = {
        .name = "paper", .summary = "s", .program = "coman-hil-bench"};
    char *text = page_of(&spec);

    assert_ptr_equal(strstr(text, "coman-hil-bench-paper(1)"), text);
    assert_non_null(strstr(text, "\n*coman-hil-bench paper*\n"));
    assert_null(strstr(text, "DESCRIPTION"));
    free(text);
}
