/* SPDX-License-Identifier: Apache-2.0 */
/* Writes completion scripts for fish, from the same tables as --help. */
#include "base/completion_private.h"

#include <string.h>

/* Writes a text within single quotes: what stands before the first ; of it, which is enough for a
 * line of a menu. */
static void fish_put_text(const char *text, FILE *out)
{
    putc('\'', out);
    for (; *text && *text != ';' && *text != '\n'; text++) {
        if (*text == '\'' || *text == '\\') {
            putc('\\', out);
        }
        putc(*text, out);
    }
    putc('\'', out);
}

/* Returns the program whose command it is. */
static const char *fish_program(const struct command_spec *spec)
{
    return spec->program ? spec->program : "coman-hil";
}

/* Writes the name of something of the script's own: "__coman_hil_PART". */
static void fish_put_name(const char *program, const char *part, FILE *out)
{
    putc('_', out);
    completion_put_function(program, out);
    fprintf(out, "_%s", part);
}

/* Writes the beginning of a line: offered when the place on the line matches the expression. */
static void fish_put_condition(const char *program, const char *expression, FILE *out)
{
    fprintf(out, "complete -c %s -n 'string match -qr \"^%s\\$\" (", program, expression);
    fish_put_name(program, "place", out);
    fputs(")'", out);
}

/* Writes the names of a noun as what is offered. */
static void fish_put_noun(const char *program, const char *noun, FILE *out)
{
    fputs(" -a '(", out);
    fish_put_name(program, "names", out);
    fprintf(out, " %s)'", noun);
}

/* Writes the line that offers an option of a command. */
static void fish_put_option(const struct command_spec *spec, const struct option_spec *option,
                            FILE *out)
{
    const char *kind = option->type == OPTION_FLAG ? "flag" : completion_kind(option);
    char expression[80];

    snprintf(expression, sizeof expression, "%s .*", spec->name);
    fish_put_condition(fish_program(spec), expression, out);
    fprintf(out, " -l %s", option->name + 2);
    if (option->letter) {
        fprintf(out, " -s %s", option->letter + 1);
    }
    if (!strcmp(kind, "files")) {
        fputs(" -rF", out);
    } else if (strcmp(kind, "flag") != 0) {
        fputs(" -x", out);
    }
    if (!strcmp(kind, "words")) {
        fputs(" -a '", out);
        completion_put_words(option, out);
        putc('\'', out);
    } else if (!strcmp(kind, "noun")) {
        fish_put_noun(fish_program(spec), option->noun, out);
    } else if (!strcmp(kind, "folders")) {
        fputs(" -a '(__fish_complete_directories)'", out);
    }
    fputs(" -d ", out);
    fish_put_text(option->help, out);
    putc('\n', out);
}

/* Writes the line that offers an operand of a command; the last one may repeat. */
static void fish_put_operand(const struct command_spec *spec, size_t i, FILE *out)
{
    const struct operand_spec *operand = &spec->operand[i];
    bool more = spec->many && i + 1 == spec->noperand;
    char expression[80];

    snprintf(expression, sizeof expression, more ? "%s [0-9]+" : "%s %zu", spec->name, i + 1);
    fish_put_condition(fish_program(spec), expression, out);
    fputs(operand->words ? "" : " -F", out);
    if (operand->noun) {
        fish_put_noun(fish_program(spec), operand->noun, out);
    }
    fputs(operand->words ? " -a '" : "", out);
    for (const char *const *word = operand->words; word && *word; word++) {
        fprintf(out, "%s%s", word == operand->words ? "" : " ", *word);
    }
    fputs(operand->words ? "'\n" : "\n", out);
}

void completion_put_fish_command(const struct command_spec *spec, FILE *out)
{
    const char *program = fish_program(spec);

    /* Which options take the next word */
    fputs("set -g ", out);
    fish_put_name(program, "valued_", out);
    fputs(spec->name, out);
    for (size_t i = 0; i < spec->noption; i++) {
        const struct option_spec *option = &spec->option[i];

        if (option->type != OPTION_FLAG) {
            fprintf(out, " %s%s%s", option->name, option->letter ? " " : "",
                    option->letter ? option->letter : "");
        }
    }
    putc('\n', out);

    fish_put_condition(program, "1", out);
    fprintf(out, " -a %s -d ", spec->name);
    fish_put_text(spec->summary, out);
    putc('\n', out);
    for (size_t i = 0; i < spec->noption; i++) {
        fish_put_option(spec, &spec->option[i], out);
    }
    for (size_t i = 0; i < spec->noperand; i++) {
        fish_put_operand(spec, i, out);
    }
}

/* A fish function that prints where on the line the cursor is: "1" for the command, else
 * "COMMAND N" for its N-th operand. */
static const char fish_place[] = "    set -l words (commandline -opc)\n"
                                 "    if test (count $words) -lt 2\n"
                                 "        echo 1\n"
                                 "        return\n"
                                 "    end\n"
                                 "    set -l command $words[2]\n"
                                 "    string match -qr '^[a-z]+$' $command\n"
                                 "    or return\n"
                                 "    set valued $valued$command\n"
                                 "    set -e words[1..2]\n"
                                 "    set -l place 1\n"
                                 "    set -l skip 0\n"
                                 "    for word in $words\n"
                                 "        if test $skip = 1\n"
                                 "            set skip 0\n"
                                 "        else if string match -q -- '-?*' $word\n"
                                 "            contains -- $word $$valued\n"
                                 "            and set skip 1\n"
                                 "        else\n"
                                 "            set place (math $place + 1)\n"
                                 "        end\n"
                                 "    end\n"
                                 "    echo $command $place\n"
                                 "end\n\n";

/* A fish function that prints the names of a noun; what a rig has, of the rig that stands on the
 * line. */
static const char fish_names[] =
    "    set -l program (string replace -r -- '-bench$' '' (commandline -opc)[1])\n"
    "    set -l rig\n"
    "    if contains $argv[1] joints faults\n"
    "        set -l rigs ($program list rigs --names 2>/dev/null)\n"
    "        for word in (commandline -op)\n"
    "            if contains -- $word $rigs\n"
    "                or begin\n"
    "                    string match -q -- '*.yaml' $word\n"
    "                    and test -f $word\n"
    "                end\n"
    "                set rig $word\n"
    "            end\n"
    "        end\n"
    "    end\n"
    "    set -l names ($program list $argv[1] $rig --names 2>/dev/null)\n"
    "    if test $argv[1] = settings\n"
    "        set names $names=\n"
    "    end\n"
    "    printf '%s\\n' $names\n"
    "end\n\n";

void completion_put_fish_program(const struct program *program, FILE *out)
{
    fputs("function ", out);
    fish_put_name(program->name, "place", out);
    fputs("\n    set -l valued ", out);
    fish_put_name(program->name, "valued_", out);
    putc('\n', out);
    fputs(fish_place, out);
    fputs("function ", out);
    fish_put_name(program->name, "names", out);
    putc('\n', out);
    fputs(fish_names, out);

    /* Files are offered only where the tables say so */
    fprintf(out, "complete -c %s -f\n", program->name);
    fish_put_condition(program->name, "1", out);
    fputs(" -l version -d 'Print the version'\n", out);
    fprintf(out, "complete -c %s -l help -d 'Print the manual and exit'\n", program->name);
    program_print_completions(program, COMPLETION_FISH);
}
