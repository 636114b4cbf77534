/* SPDX-License-Identifier: Apache-2.0 */
/* Command lines through the table of options. */

#include "base/array.h"

#include "tests/unit/base/try_command.h"
#include "tests/test.h"

static const char *file, *other;

static const struct operand_spec operands[] = {{"FILE", "a file", true, .value = &file},
                                               {"OTHER", "another", false, .value = &other}};
static const struct command_spec spec = {
    .name = "try",
    .summary = "Try the options.",
    .option = try_options,
    .noption = ARRAY_COUNT(try_options),
    .operand = operands,
    .noperand = 2,
    .manual =
        "A paragraph that is long enough to be wrapped, because it goes on and on until it has "
        "passed the eightieth column.\n\nAnother paragraph.\n"
        "  A line that begins with two spaces goes on four spaces from the left, so that it is "
        "seen",
};

FIXTURE(reset)
{
    given = try_defaults;
    file = other = NULL;
    return 0;
}

/* Parses words up to NULL; returns the message, "" when all was well, "help" for the manual. */
static const char *parse(const char *const *words)
{
    static char text[80][64]; /* values point into it */
    static struct error error;
    char *argv[81] = {(char[]){"try"}};
    int argc = 1;
    bool help;

    for (; words[argc - 1]; argc++) {
        assert_true(argc < 80 && strlen(words[argc - 1]) < sizeof text[0]);
        argv[argc] = strcpy(text[argc], words[argc - 1]);
    }
    if (options_parse(&spec, argc, argv, &help, &error)) {
        assert_int_equal(error.code, ERROR_INPUT);
        return error.text;
    }
    return help ? "help" : "";
}

#define PARSE(...) parse((const char *const[]){__VA_ARGS__, NULL})

TEST_WITH(reads_every_type, reset, NULL)
{
    assert_string_equal(PARSE("--quiet", "--record", "out", "--duration", "2.5", "f.yaml",
                              "--count", "0x10", "--clock", "free", "--bus", "a=can0", "--bus",
                              "b=can1", "more"),
                        "");
    assert_true(given.quiet);
    assert_string_equal(given.directory, "out");
    assert_true(given.duration == 2.5);
    assert_int_equal(given.count, 16);
    assert_int_equal(given.clock, 2);
    assert_int_equal(given.buses.count, 2);
    assert_string_equal(given.buses.item[1], "b=can1");
    assert_string_equal(file, "f.yaml");
    assert_string_equal(other, "more");
}

TEST_WITH(takes_a_value_behind_an_equals_sign, reset, NULL)
{
    assert_string_equal(PARSE("--duration=3", "--record=--odd", "--bus=a=can0", "f"), "");
    assert_true(given.duration == 3.0);
    assert_string_equal(given.directory, "--odd");
    assert_string_equal(given.buses.item[0], "a=can0");
}

TEST_WITH(an_option_may_have_a_letter_too, reset, NULL)
{
    assert_string_equal(PARSE("-r", "out", "f"), "");
    assert_string_equal(given.directory, "out");
    assert_string_equal(PARSE("-r=in", "f"), "");
    assert_string_equal(given.directory, "in");
    assert_string_equal(PARSE("-r", "out", "--record", "in", "f"),
                        "--record: found it again, expected it once");
    assert_string_equal(PARSE("f", "-r"), "--record: found nothing, expected DIR");
    assert_string_equal(PARSE("-re", "out", "f"),
                        "found unknown option -re, expected one that is listed by --help");
}

TEST_WITH(what_is_not_given_keeps_its_default, reset, NULL)
{
    assert_string_equal(PARSE("f"), "");
    assert_true(given.duration == 10.0);
    assert_int_equal(given.count, 7);
    assert_null(other);
}

TEST_WITH(negative_numbers_are_values, reset, NULL)
{
    assert_string_equal(PARSE("--count", "-5", "f"), "");
    assert_int_equal(given.count, -5);
}

TEST_WITH(two_dashes_end_the_options, reset, NULL)
{
    assert_string_equal(PARSE("--", "--quiet", "--help"), "");
    assert_false(given.quiet);
    assert_string_equal(file, "--quiet");
    assert_string_equal(other, "--help");
}

TEST_WITH(a_lone_dash_is_an_operand, reset, NULL)
{
    assert_string_equal(PARSE("-"), "");
    assert_string_equal(file, "-");
}

TEST_WITH(help_wins_over_what_comes_after_it, reset, NULL)
{
    assert_string_equal(PARSE("--help", "--nonsense"), "help");
    assert_string_equal(PARSE("-h"), "help");
}

TEST_WITH(names_the_option_and_what_it_expects, reset, NULL)
{
    assert_string_equal(
        PARSE("--duration", "abc", "f"),
        "--duration: found \"abc\", expected a number of seconds from 0 to 1000000");
    assert_string_equal(PARSE("--duration", "-1", "f"),
                        "--duration: found \"-1\", expected a number of seconds from 0 to 1000000");
    assert_string_equal(
        PARSE("--duration", "inf", "f"),
        "--duration: found \"inf\", expected a number of seconds from 0 to 1000000");
    assert_string_equal(
        PARSE("--count", "1.5", "f"),
        "--count: found \"1.5\", expected an integer from -5 to 9.00719925474099e+15");
    assert_string_equal(PARSE("--clock", "rael", "f"),
                        "--clock: found \"rael\", expected real or free");
    assert_string_equal(PARSE("--record", "", "f"), "--record: found \"\", expected DIR");
    assert_string_equal(PARSE("--bus", "", "f"), "--bus: found \"\", expected NAME=INTERFACE");
}

TEST_WITH(a_number_above_the_least_is_said_to_be_more, reset, NULL)
{
    double length_m = 1.0;
    const struct option_spec length = {"--length",        OPTION_REAL, "M",
                                       "a length",        &length_m,   .min = 0.0,
                                       .above_min = true, .max = 2.0,  .unit = "meters"};
    const struct command_spec one = {.name = "try", .option = &length, .noption = 1};
    char *argv[] = {(char[]){"try"}, (char[]){"--length"}, (char[]){"1e-9"}};
    struct error error;
    bool help;

    assert_ok(options_parse(&one, 3, argv, &help, &error));
    assert_true(length_m == 1e-9);
    argv[2] = (char[]){"0"};
    assert_int_equal(options_parse(&one, 3, argv, &help, &error), ERROR_INPUT);
    assert_string_equal(error.text,
                        "--length: found \"0\", expected a number of meters more than 0 "
                        "and at most 2");
}

TEST_WITH(says_that_a_value_is_missing, reset, NULL)
{
    assert_string_equal(PARSE("f", "--record"), "--record: found nothing, expected DIR");
    assert_string_equal(
        PARSE("--duration", "--quiet", "f"),
        "--duration: found --quiet, expected a number of seconds from 0 to 1000000");
}

TEST_WITH(refuses_a_value_where_none_belongs, reset, NULL)
{
    assert_string_equal(PARSE("--quiet=yes", "f"), "--quiet: found \"yes\", expected no value");
}

TEST_WITH(refuses_an_option_that_stands_twice, reset, NULL)
{
    assert_string_equal(PARSE("--count", "1", "--count", "2", "f"),
                        "--count: found it again, expected it once");
}

TEST_WITH(rejects_unknown_option_and_names_the_nearest, reset, NULL)
{
    assert_string_equal(PARSE("--duraton", "1", "f"),
                        "found unknown option --duraton, expected --duration or another that is "
                        "listed by --help");
    assert_string_equal(PARSE("--duraton=1", "f"),
                        "found unknown option --duraton, expected --duration or another that is "
                        "listed by --help");
    assert_string_equal(PARSE("-x", "f"),
                        "found unknown option -x, expected one that is listed by --help");
}

TEST_WITH(the_last_operand_may_stand_more_than_once, reset, NULL)
{
    static const char *const *files;
    static const struct operand_spec several[] = {{"FILE", "files", true, .list = &files}};
    static const struct command_spec many = {
        .name = "try", .summary = "Try.", .operand = several, .noperand = 1, .many = true};
    char word[5][4] = {"try", "a", "b", "--", "--c"};
    char *some[] = {word[0], word[1], word[2], word[3], word[4], NULL};
    struct error error;
    bool help;

    assert_ok(options_parse(&many, 5, some, &help, &error));
    assert_string_equal(files[0], "a");
    assert_string_equal(files[1], "b");
    assert_string_equal(files[2], "--c");
    assert_null(files[3]);
    assert_int_equal(options_parse(&many, 1, some, &help, &error), ERROR_INPUT);
}

TEST_WITH(asks_for_the_operands_that_it_needs_and_takes_no_more, reset, NULL)
{
    assert_string_equal(PARSE("--quiet"), "found no FILE, expected a file");
    assert_string_equal(PARSE(""), "found an empty argument, expected FILE");
    assert_string_equal(PARSE("a", "b", "c"), "found \"c\", expected nothing more");
}

TEST_WITH(a_list_has_an_end, reset, NULL)
{
    const char *words[2 * OPTION_LIST_MAX + 4];
    size_t n = 0;

    for (int i = 0; i <= OPTION_LIST_MAX; i++) {
        words[n++] = "--bus";
        words[n++] = "x=y";
    }
    words[n] = NULL;
    assert_string_equal(parse(words), "--bus: found it more than 32 times, expected fewer");
}

TEST_WITH(the_manual_lists_everything_within_eighty_columns, reset, NULL)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);

    assert_non_null(out);
    options_help(&spec, out);
    assert_int_equal(fclose(out), 0);
    assert_non_null(
        strstr(text, "usage: coman-hil try [OPTIONS] FILE [OTHER]\n\nTry the options.\n"));
    for (size_t i = 0; i < spec.noption; i++) {
        assert_non_null(strstr(text, spec.option[i].name));
        assert_non_null(strstr(text, spec.option[i].help));
    }
    assert_non_null(strstr(text, "\n  -r, --record DIR"));
    assert_non_null(strstr(
        text, "column.\n\nAnother paragraph.\n"
              "  A line that begins with two spaces goes on four spaces from the left, so that\n"
              "    it is seen\n"));
    for (const char *line = text; *line; line += strcspn(line, "\n") + 1) {
        assert_true(strcspn(line, "\n") <= 80);
    }
    free(text);
}

TEST_WITH(exit_statuses_follow_the_error, reset, NULL)
{
    assert_int_equal(exit_status_of(ERROR_NONE), 0);
    assert_int_equal(exit_status_of(ERROR_INPUT), 2);
    assert_int_equal(exit_status_of(ERROR_SYSTEM), 3);
    assert_int_equal(exit_status_of(ERROR_MEMORY), 3);
    assert_int_equal(exit_status_of(ERROR_UNSUPPORTED), 4);
}
