/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the manual page of a command in scdoc(5), from the table that also gives its --help. */
#include "base/options.h"

#include <ctype.h>
#include <string.h>

/* Writes text and escapes all punctuation, because scdoc reads some of it as markup. */
static void manpage_put_text(const char *text, size_t length, FILE *out)
{
    for (size_t i = 0; i < length; i++) {
        if (ispunct((unsigned char)text[i])) {
            putc('\\', out);
        }
        putc(text[i], out);
    }
}

/* Writes an option or operand with its help. `letter` is its second name; NULL = none. */
static void manpage_put_term(const char *letter, const char *name, const char *argument,
                             const char *help, FILE *out)
{
    fputs("\n*", out);
    if (letter) {
        manpage_put_text(letter, strlen(letter), out);
        fputs("*, *", out);
    }
    manpage_put_text(name, strlen(name), out);
    fputs("*", out);
    if (argument) {
        fputs(" _", out);
        manpage_put_text(argument, strlen(argument), out);
        fputs("_", out);
    }
    fputs("\n\t", out);
    manpage_put_text(help, strlen(help), out);
    fputs("\n", out);
}

/* Writes the name of the page: "coman-hil-bench-paper". */
static void manpage_put_name(const struct command_spec *spec, FILE *out)
{
    fprintf(out, "%s-%s", spec->program ? spec->program : "coman-hil", spec->name);
}

void options_page(const struct command_spec *spec, FILE *out)
{
    manpage_put_name(spec, out);
    fprintf(out, "(1) \"coman-hil %s\"\n\n# NAME\n\n", HIL_VERSION);
    manpage_put_name(spec, out);
    fputs(" - ", out);
    manpage_put_text(spec->summary, strlen(spec->summary), out);
    putc('\n', out);

    /* Write the usage line */
    fprintf(out, "\n# SYNOPSIS\n\n*%s %s*%s", spec->program ? spec->program : "coman-hil",
            spec->name, spec->noption ? " [OPTIONS]" : "");
    for (size_t i = 0; i < spec->noperand; i++) {
        const struct operand_spec *operand = &spec->operand[i];

        fprintf(out, operand->required ? " _%s_" : " [_%s_]", operand->name);
        fputs(spec->many && i + 1 == spec->noperand ? "..." : "", out);
    }
    putc('\n', out);
    fputs("\n# OPTIONS\n", out);
    for (size_t i = 0; i < spec->noperand; i++) {
        manpage_put_term(NULL, spec->operand[i].name, NULL, spec->operand[i].help, out);
    }
    for (size_t i = 0; i < spec->noption; i++) {
        const struct option_spec *option = &spec->option[i];

        manpage_put_term(option->letter, option->name, option->argument, option->help, out);
    }
    manpage_put_term(NULL, "--help", NULL, "print the manual and exit", out);
    if (spec->manual) {
        fputs("\n# DESCRIPTION\n", out);

        /* Write paragraphs. Blank lines separate them. A line that begins with two spaces is a
         * list item. */
        const char *text = spec->manual;

        while (*text) {
            size_t length = strcspn(text, "\n");
            bool item = length > 2 && text[0] == ' ' && text[1] == ' ';

            if (length > 0) {
                fputs(item ? "- " : "\n", out);
                manpage_put_text(item ? text + 2 : text, item ? length - 2 : length, out);
                putc('\n', out);
            }
            text += length;
            text += *text == '\n';
            if (!item && *text == ' ') {
                putc('\n', out);
            }
        }
    }
    fputs("\n# SEE ALSO\n\n*coman-hil*(1), *coman-hil-rig*(5), *coman-hil-robot*(5), "
          "*coman-hil-scenario*(5)\n",
          out);
}
