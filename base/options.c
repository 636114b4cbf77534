/* SPDX-License-Identifier: Apache-2.0 */
/* Parses command lines with a table of options, and prints --help from the same table. */
#include "base/options.h"

#include "base/completion.h"
#include "base/journal.h"
#include "base/text.h"

#include <string.h>

enum { MAX_NAMES = 64, WIDTH = 80, HELP_COLUMN = 24 };

/* ---- parsing ---- */

/* Checks whether an option has a name of `length` characters. */
static bool option_has_name(const char *option, const char *name, size_t length)
{
    return option && strlen(option) == length && strncmp(option, name, length) == 0;
}

/* Finds an option by either of its names; NULL = unknown. */
static const struct option_spec *options_find(const struct command_spec *spec, const char *name,
                                              size_t length)
{
    for (size_t i = 0; i < spec->noption; i++) {
        if (option_has_name(spec->option[i].name, name, length) ||
            option_has_name(spec->option[i].letter, name, length)) {
            return &spec->option[i];
        }
    }
    return NULL;
}

/* Describes the allowed values of an option: "a number of seconds from 0 to 1000000". */
static void option_describe_value(const struct option_spec *option, char *out, size_t size)
{
    size_t used = 0;

    if (option->type == OPTION_REAL || option->type == OPTION_INT) {
        snprintf(out, size, "%s%s%s %s %.15g %s %.15g",
                 option->type == OPTION_REAL ? "a number" : "an integer",
                 option->unit ? (option->type == OPTION_REAL ? " of " : " number of ") : "",
                 option->unit ? option->unit : "", option->above_min ? "more than" : "from",
                 option->min, option->above_min ? "and at most" : "to", option->max);
        return;
    }
    if (option->type != OPTION_ENUM) {
        snprintf(out, size, "%s", option->argument);
        return;
    }
    for (const struct word *w = option->words; w->word && used < size; w++) {
        const char *separator = w == option->words ? "" : w[1].word ? ", " : " or ";

        used += (size_t)snprintf(out + used, size - used, "%s%s", separator, w->word);
    }
}

/* Parses and stores the value of an option. Returns false if the value is invalid. */
static bool option_parse_value(const struct option_spec *option, const char *text)
{
    struct option_list *list = option->value;
    const struct word *word = option->words;
    double value;

    switch (option->type) {
    case OPTION_REAL:
        if (!text_to_double(text, &value) || value < option->min || value > option->max ||
            (option->above_min && !(value > option->min))) {
            return false;
        }
        *(double *)option->value = value;
        return true;
    case OPTION_INT:
        return text_to_int(text, (int64_t)option->min, (int64_t)option->max, option->value);
    case OPTION_ENUM:
        while (word->word && strcmp(word->word, text) != 0) {
            word++;
        }
        if (word->word) {
            *(int *)option->value = word->value;
        }
        return word->word != NULL;
    case OPTION_LIST:
        if (*text == '\0' || list->count == OPTION_LIST_MAX) {
            return false;
        }
        list->item[list->count++] = text;
        return true;
    default:
        *(const char **)option->value = text;
        return *text != '\0';
    }
}

/* Parses the option at argv[*at] with its value. Moves *at to the last word that it used. */
static enum error_code options_parse_option(const struct command_spec *spec, int argc, char **argv,
                                            int *at, uint64_t *seen, struct error *error)
{
    const char *word = argv[*at], *equals = strchr(word, '=');
    size_t length = equals ? (size_t)(equals - word) : strlen(word);
    const struct option_spec *option = options_find(spec, word, length);
    char expected[256];
    const char *text;
    uint64_t bit;

    if (!option) {
        const char *names[MAX_NAMES], *nearest;
        size_t count = 0;
        char copy[64];

        /* Refuse an unknown option. The error suggests the nearest known option. */
        names[count++] = "--help";
        for (size_t i = 0; i < spec->noption && count < MAX_NAMES; i++) {
            names[count++] = spec->option[i].name;
        }
        snprintf(copy, sizeof copy, "%.*s", length < 60 ? (int)length : 60, word);
        nearest = text_nearest(copy, names, count);
        return error_set(error, ERROR_INPUT, "found unknown option %s, expected %s%s", copy,
                         nearest ? nearest : "one that is listed by --help",
                         nearest ? " or another that is listed by --help" : "");
    }

    /* Only a list may be given more than once */
    bit = UINT64_C(1) << (option - spec->option);
    if (*seen & bit && option->type != OPTION_LIST) {
        return error_set(error, ERROR_INPUT, "%s: found it again, expected it once", option->name);
    }
    *seen |= bit;

    /* A flag has no value */
    if (option->type == OPTION_FLAG) {
        *(bool *)option->value = true;
        return equals ? error_set(error, ERROR_INPUT, "%s: found \"%.100s\", expected no value",
                                  option->name, equals + 1)
                      : ERROR_NONE;
    }

    /* The value follows '=', or it is the next word. If the next word is an option, the value is
     * missing. --name=--value is valid */
    text = equals ? equals + 1 : *at + 1 < argc ? argv[*at + 1] : NULL;
    if (!text || (!equals && !strncmp(text, "--", 2))) {
        option_describe_value(option, expected, sizeof expected);
        return error_set(error, ERROR_INPUT, "%s: found %.100s, expected %s", option->name,
                         text ? text : "nothing", expected);
    }
    *at += !equals;
    if (option_parse_value(option, text)) {
        return ERROR_NONE;
    }
    if (option->type == OPTION_LIST && *text) {
        return error_set(error, ERROR_INPUT, "%s: found it more than %d times, expected fewer",
                         option->name, OPTION_LIST_MAX);
    }
    option_describe_value(option, expected, sizeof expected);
    return error_set(error, ERROR_INPUT, "%s: found \"%.100s\", expected %s", option->name, text,
                     expected);
}

/* Stores the next operand. *count is the number of earlier operands. Operands of a list move to the
 * beginning of argv, over words that are already parsed. */
static enum error_code options_parse_operand(const struct command_spec *spec, char **argv,
                                             char *word, size_t *count, struct error *error)
{
    size_t last = spec->noperand ? spec->noperand - 1 : 0;
    bool many = spec->many && *count >= last;

    if (!many && *count == spec->noperand) {
        return error_set(error, ERROR_INPUT, "found \"%.100s\", expected %s", word,
                         spec->noperand ? "nothing more" : "options only");
    }
    if (*word == '\0') {
        return error_set(error, ERROR_INPUT, "found an empty argument, expected %s",
                         spec->operand[many ? last : *count].name);
    }
    if (many) {
        argv[1 + *count - last] = word;
    } else {
        *spec->operand[*count].value = word;
    }
    ++*count;
    return ERROR_NONE;
}

enum error_code options_parse(const struct command_spec *spec, int argc, char **argv, bool *help,
                              struct error *error)
{
    bool only_operands = false;
    size_t noperand = 0;
    uint64_t seen = 0;

    *help = false;
    for (int i = 1; i < argc; i++) {
        const char *word = argv[i];
        enum error_code code;

        /* --help stops the parsing, before any later error */
        if (!only_operands && (!strcmp(word, "--help") || !strcmp(word, "-h"))) {
            *help = true;
            return ERROR_NONE;
        }
        if (!only_operands && !strcmp(word, "--")) {
            only_operands = true;
            continue;
        }
        /* A single dash is an operand: by convention it means standard input */
        code = !only_operands && word[0] == '-' && word[1]
                   ? options_parse_option(spec, argc, argv, &i, &seen, error)
                   : options_parse_operand(spec, argv, argv[i], &noperand, error);
        if (code) {
            return code;
        }
    }

    if (spec->many) {
        const size_t first = noperand < spec->noperand ? noperand : spec->noperand - 1;

        argv[1 + noperand - first] = NULL;
        *spec->operand[spec->noperand - 1].list = (const char *const *)(argv + 1);
    }

    /* Required operands come first, so only the next operand needs a check */
    if (noperand < spec->noperand && spec->operand[noperand].required) {
        return error_set(error, ERROR_INPUT, "found no %s, expected %s",
                         spec->operand[noperand].name, spec->operand[noperand].help);
    }
    return ERROR_NONE;
}

/* ---- manual ---- */

void options_wrap(const char *text, int used, int indent, FILE *out)
{
    int column = used, hang = indent; /* `hang`: indentation of a continued line */
    bool start = true;

    while (*text) {
        int n = (int)strcspn(text, " \n"), inset = start ? (int)strspn(text, " ") : 0;

        hang = start ? indent + inset + (inset > 0 ? 2 : 0) : hang;
        if (!start && column + 1 + n > WIDTH) {
            fprintf(out, "\n%*s", hang, "");
            column = hang;
        } else if (!start) {
            putc(' ', out);
            column++;
        }
        fprintf(out, "%.*s", n, text);
        column += n;
        start = false;
        text += n;
        if (*text == '\n') {
            fprintf(out, "\n%*s", indent, "");
            column = indent;
            start = true;
        }
        text += *text != '\0';
    }
    putc('\n', out);
}

/* Prints an option or operand of --help. `letter` is its second name; NULL = none. */
static void options_put_help_line(const char *letter, const char *name, const char *argument,
                                  const char *help, FILE *out)
{
    int used = fprintf(out, "  %s%s%s%s%s", letter ? letter : "", letter ? ", " : "", name,
                       argument ? " " : "", argument ? argument : "");

    if (used >= HELP_COLUMN) {
        putc('\n', out);
        used = 0;
    }
    fprintf(out, "%*s", HELP_COLUMN - used, "");
    options_wrap(help, HELP_COLUMN, HELP_COLUMN, out);
}

static const char *options_program(const struct command_spec *spec)
{
    return spec->program ? spec->program : "coman-hil";
}

void options_help(const struct command_spec *spec, FILE *out)
{
    fprintf(out, "usage: %s %s%s", options_program(spec), spec->name,
            spec->noption ? " [OPTIONS]" : "");
    for (size_t i = 0; i < spec->noperand; i++) {
        const struct operand_spec *operand = &spec->operand[i];

        fprintf(out, operand->required ? " %s" : " [%s]", operand->name);
        fputs(spec->many && i + 1 == spec->noperand ? "..." : "", out);
    }
    fprintf(out, "\n\n");
    options_wrap(spec->summary, 0, 0, out);
    putc('\n', out);
    for (size_t i = 0; i < spec->noperand; i++) {
        options_put_help_line(NULL, spec->operand[i].name, NULL, spec->operand[i].help, out);
    }
    for (size_t i = 0; i < spec->noption; i++) {
        const struct option_spec *option = &spec->option[i];

        options_put_help_line(option->letter, option->name, option->argument, option->help, out);
    }
    options_put_help_line(NULL, "--help", NULL, "print this and exit", out);
    if (spec->manual) {
        putc('\n', out);
        options_wrap(spec->manual, 0, 0, out);
    }
}

void options_insert(char *out, size_t size, const char *text, const char *mark, const char *list)
{
    const char *at = strstr(text, mark), *line = at, *rest = at + strlen(mark);
    size_t length = strlen(list);

    /* Remove the line of the mark with its indentation and line end; `list` has its own line end */
    while (line > text && line[-1] == ' ') {
        line--;
    }
    length -= length > 0 && list[length - 1] == '\n';
    snprintf(out, size, "%.*s%.*s%s", (int)(line - text), text, (int)length, list, rest);
}

/* ---- exit ---- */

bool options_read(const struct command_spec *spec, int argc, char **argv, int *status)
{
    struct error error;
    bool help;

    if (argc == 2 && (!strcmp(argv[1], "--help=scdoc") || !strcmp(argv[1], "--help=table"))) {
        (strstr(argv[1], "scdoc") ? options_page : completion_put_rows)(spec, stdout);
        *status = STATUS_OK;
        return false;
    }
    if (options_parse(spec, argc, argv, &help, &error)) {
        *status = options_fail(spec, &error);
        return false;
    }
    if (help) {
        options_help(spec, stdout);
        *status = STATUS_OK;
        return false;
    }
    return true;
}

enum exit_status exit_status_of(enum error_code code)
{
    switch (code) {
    case ERROR_NONE:
        return STATUS_OK;
    case ERROR_INPUT:
        return STATUS_INPUT;
    case ERROR_UNSUPPORTED:
        return STATUS_UNSUPPORTED;
    default:
        return STATUS_SYSTEM;
    }
}

int command_fail(const char *command, const struct error *error)
{
    return options_fail(&(struct command_spec){.name = command}, error);
}

int options_fail(const struct command_spec *spec, const struct error *error)
{
    fprintf(stderr, "%s%s %s: %s\n", journal_prefix(JOURNAL_ERROR), options_program(spec),
            spec->name, error->text);
    return exit_status_of(error->code);
}

int options_end(const struct command_spec *spec, enum error_code code, const struct error *error)
{
    return code ? options_fail(spec, error) : STATUS_OK;
}

int options_flush_output(int status)
{
    if (fflush(stdout) || ferror(stdout)) {
        fprintf(stderr, "coman-hil: standard output could not be written\n");
        return status ? status : STATUS_SYSTEM;
    }
    return status;
}
