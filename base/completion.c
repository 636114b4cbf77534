/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the table of commands and options for completion scripts. */
#include "base/completion.h"

#include "base/options.h"
#include "base/program.h"
#include "manual/complete_bash.h"
#include "manual/complete_fish.h"
#include "manual/complete_zsh.h"

#include <ctype.h>
#include <string.h>

static const struct completion_script {
    const char *shell, *text;
} scripts[] = {
    {"bash", MANUAL_COMPLETE_BASH},
    {"zsh", MANUAL_COMPLETE_ZSH},
    {"fish", MANUAL_COMPLETE_FISH},
};

/* Ends a row with the part of `text` before its first semicolon, which is enough for a menu line.
 * Replaces apostrophes by typographic ones, because the scripts put the table in single quotes. */
static void completion_put_text(const char *text, FILE *out)
{
    putc(';', out);
    for (; *text && *text != ';' && *text != '\n'; text++) {
        if (*text == '\'') {
            fputs("\u2019", out);
        } else {
            putc(*text, out);
        }
    }
    putc('\n', out);
}

void completion_put_rows(const struct command_spec *spec, FILE *out)
{
    fprintf(out, "%s;command;;;;;;", spec->name);
    completion_put_text(spec->summary, out);
    for (size_t i = 0; i < spec->noption; i++) {
        const struct option_spec *option = &spec->option[i];

        fprintf(out, "%s;option;%s;%s;%s;%s", spec->name, option->name,
                option->letter ? option->letter : "",
                option->type == OPTION_FLAG            ? "flag"
                : option->type == OPTION_ENUM          ? "words"
                : option->noun                         ? "noun"
                : strcmp(option->argument, "DIR") == 0 ? "folders"
                : strcmp(option->argument, "FILE") == 0 || strcmp(option->argument, "PATH") == 0
                    ? "files"
                    : "",
                option->noun ? option->noun : "");
        for (const struct word *w = option->words; w && w->word; w++) {
            fprintf(out, "%s ", w->word);
        }
        fprintf(out, ";%s;%s", option->argument ? option->argument : "",
                option->type == OPTION_LIST ? "*" : "");
        completion_put_text(option->help, out);
    }
    for (size_t i = 0; i < spec->noperand; i++) {
        const struct operand_spec *operand = &spec->operand[i];

        fprintf(out, "%s;operand;%s;;%s;%s", spec->name, operand->name,
                operand->noun    ? "noun"
                : operand->words ? "words"
                                 : "files",
                operand->noun ? operand->noun : "");
        for (const char *const *word = operand->words; word && *word; word++) {
            fprintf(out, "%s ", *word);
        }
        fprintf(out, ";%s;", operand->required ? "" : "optional");
        if (spec->many && i + 1 == spec->noperand) {
            fputs("*;\n", out);
        } else {
            fprintf(out, "%zu;\n", i + 1);
        }
    }
}

bool completion_print(const struct program *program, const char *shell)
{
    const char *text = NULL, *mark;

    for (size_t i = 0; i < sizeof scripts / sizeof *scripts; i++) {
        text = strcmp(shell, scripts[i].shell) == 0 ? scripts[i].text : text;
    }

    /* Replace @@N by the program's name, @@F by the prefix of its functions, and @@T by the
     * table */
    for (; text && (mark = strstr(text, "@@")); text = mark + 3) {
        printf("%.*s", (int)(mark - text), text);
        if (mark[2] == 'N') {
            fputs(program->name, stdout);
        } else if (mark[2] == 'F') {
            putchar('_');
            for (const char *c = program->name; *c; c++) {
                putchar(isalnum((unsigned char)*c) ? *c : '_');
            }
        }
        for (size_t i = 0; mark[2] == 'T' && i < program->ncommand; i++) {
            char name[64], option[] = "--help=table";

            snprintf(name, sizeof name, "%s", program->command[i].name);
            program->command[i].run(2, (char *[]){name, option, NULL});
        }
    }
    if (text) {
        puts(text);
    }
    return text != NULL;
}
