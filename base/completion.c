/* SPDX-License-Identifier: Apache-2.0 */
/* Completion of command lines in bash and zsh, from the same tables as --help. */
#include "base/completion.h"

#include "base/options.h"
#include "base/program.h"

#include <ctype.h>
#include <string.h>

/* ---- what an argument may be ---- */

/* What the scripts know: "none", "files", "folders", "noun" (names of one) or "words". */
static const char *completion_kind(const struct option_spec *option)
{
    static const char *const folders[] = {"DIR", NULL};
    static const char *const files[] = {"FILE", "PATH", NULL};

    if (option->noun) {
        return "noun";
    }
    if (option->type == OPTION_ENUM) {
        return "words";
    }
    for (int i = 0; folders[i]; i++) {
        if (!strcmp(option->argument, folders[i])) {
            return "folders";
        }
    }
    for (int i = 0; files[i]; i++) {
        if (!strcmp(option->argument, files[i])) {
            return "files";
        }
    }
    return "none";
}

static void completion_put_words(const struct option_spec *option, FILE *out)
{
    for (const struct option_word *w = option->words; w && w->word; w++) {
        fprintf(out, " %s", w->word);
    }
}

/* A name that may be a shell function's: "coman-hil" becomes "_coman_hil". */
static void completion_put_function(const char *name, FILE *out)
{
    putc('_', out);
    for (; *name; name++) {
        putc(isalnum((unsigned char)*name) ? *name : '_', out);
    }
}

/* ---- bash ---- */

static void bash_put_operand(const struct operand_spec *operand, FILE *out)
{
    fputs(" '", out);
    if (operand->noun) {
        fprintf(out, "noun %s", operand->noun);
    } else if (operand->words) {
        fputs("words", out);
        for (const char *const *word = operand->words; *word; word++) {
            fprintf(out, " %s", *word);
        }
    } else {
        fputs("files", out);
    }
    putc('\'', out);
}

/* The branch of a command: options, those with a value, and what values and operands are. */
static void bash_put_command(const struct command_spec *spec, FILE *out)
{
    fprintf(out, "    %s)\n        options='--help", spec->name);
    for (size_t i = 0; i < spec->noption; i++) {
        fprintf(out, " %s", spec->option[i].name);
        if (spec->option[i].letter) {
            fprintf(out, " %s", spec->option[i].letter);
        }
    }
    fputs("' valued=' ", out);
    for (size_t i = 0; i < spec->noption; i++) {
        if (spec->option[i].type != OPTION_FLAG) {
            fprintf(out, "%s ", spec->option[i].name);
            if (spec->option[i].letter) {
                fprintf(out, "%s ", spec->option[i].letter);
            }
        }
    }
    fputs("'\n        operands=(", out);
    for (size_t i = 0; i < spec->noperand; i++) {
        bash_put_operand(&spec->operand[i], out);
    }
    fprintf(out, ") many=%d\n        case $previous in\n", spec->many);
    for (size_t i = 0; i < spec->noption; i++) {
        const struct option_spec *option = &spec->option[i];

        if (option->type != OPTION_FLAG) {
            fprintf(out, "        %s%s%s) value='%s%s%s", option->letter ? option->letter : "",
                    option->letter ? " | " : "", option->name, completion_kind(option),
                    option->noun ? " " : "", option->noun ? option->noun : "");
            completion_put_words(option, out);
            fputs("' ;;\n", out);
        }
    }
    fputs("        esac\n        ;;\n", out);
}

static const char bash_begin[] =
    "() {\n"
    "    local word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}\n"
    "    local command=${COMP_WORDS[1]} options='' valued='' value='' many=0 operands=() at "
    "count=0\n"
    "    # bash makes words of their own of --name, = and what follows\n"
    "    if [[ $word == '=' ]]; then\n"
    "        word=''\n"
    "    elif [[ $previous == '=' ]]; then\n"
    "        previous=${COMP_WORDS[COMP_CWORD - 2]}\n"
    "    fi\n"
    "    COMPREPLY=()\n"
    "    if ((COMP_CWORD == 1)); then\n"
    "        COMPREPLY=($(compgen -W '";

static const char bash_middle[] = "' -- \"$word\"))\n"
                                  "        return\n"
                                  "    fi\n"
                                  "    case $command in\n";

static const char bash_end[] =
    "    esac\n"
    "    if [[ $value == '' && $word == -* ]]; then\n"
    "        COMPREPLY=($(compgen -W \"$options\" -- \"$word\"))\n"
    "        return\n"
    "    fi\n"
    "    # neither the value of an option nor an option: the operand after those that stand there\n"
    "    if [[ $value == '' ]]; then\n"
    "        for ((at = 2; at < COMP_CWORD; at++)); do\n"
    "            if [[ ${COMP_WORDS[at]} == -?* ]]; then\n"
    "                if [[ ${COMP_WORDS[at + 1]} == '=' ]]; then\n"
    "                    ((at += 2))\n"
    "                elif [[ $valued == *\" ${COMP_WORDS[at]} \"* ]]; then\n"
    "                    ((at++))\n"
    "                fi\n"
    "            else\n"
    "                ((count++))\n"
    "            fi\n"
    "        done\n"
    "        if ((many && count >= ${#operands[@]})); then\n"
    "            count=$((${#operands[@]} - 1))\n"
    "        fi\n"
    "        value=${operands[count]:-none}\n"
    "    fi\n"
    "    case $value in\n"
    "    words*) COMPREPLY=($(compgen -W \"${value#words}\" -- \"$word\")) ;;\n"
    "    noun*)\n"
    "        local program=${COMP_WORDS[0]%-bench}\n"
    "        COMPREPLY=($(compgen -W \"$(\"${program/#~\\//$HOME/}\" list ${value#noun} --names "
    "2>/dev/null)\" \\\n"
    "            -- \"$word\"))\n"
    "        ;;\n"
    "    folders)\n"
    "        compopt -o filenames 2>/dev/null\n"
    "        mapfile -t COMPREPLY < <(compgen -d -- \"$word\")\n"
    "        ;;\n"
    "    esac\n"
    "    # a file goes wherever a name does\n"
    "    if [[ $value == files || ($value == noun* && ${#COMPREPLY[@]} -eq 0) ]]; then\n"
    "        compopt -o filenames 2>/dev/null\n"
    "        mapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
    "    fi\n"
    "}\n"
    "complete -F ";

static void bash_put_program(const struct program *program, FILE *out)
{
    completion_put_function(program->name, out);
    fputs(bash_begin, out);
    for (size_t i = 0; i < program->ncommand; i++) {
        fprintf(out, "%s ", program->command[i].name);
    }
    fputs("--help --version", out);
    fputs(bash_middle, out);
    program_print_completions(program, COMPLETION_BASH);
    fputs(bash_end, out);
    completion_put_function(program->name, out);
    fprintf(out, " %s\n", program->name);
}

/* ---- zsh ---- */

/* Text within single quotes and an _arguments specification: what stands before the first ; of it,
 * which is enough for a line of a menu. */
static void zsh_put_text(const char *text, FILE *out)
{
    for (; *text && *text != ';' && *text != '\n'; text++) {
        if (*text == '\'') {
            fputs("'\\''", out);
        } else {
            if (strchr("[]:\\", *text)) {
                putc('\\', out);
            }
            putc(*text, out);
        }
    }
}

/* name: one of the option's two. */
static void zsh_put_option(const struct option_spec *option, const char *name, FILE *out)
{
    const char *kind;

    fprintf(out, " \\\n            '%s%s", option->type == OPTION_LIST ? "*" : "", name);
    if (option->type == OPTION_FLAG) {
        putc('[', out);
        zsh_put_text(option->help, out);
        fputs("]'", out);
        return;
    }
    fputs(name[1] == '-' ? "=[" : "[", out);
    zsh_put_text(option->help, out);
    fputs("]:", out);
    zsh_put_text(option->argument, out);
    kind = completion_kind(option);
    if (!strcmp(kind, "words")) {
        fputs(":(", out);
        completion_put_words(option, out);
        putc(')', out);
    } else if (!strcmp(kind, "noun")) {
        fprintf(out, ": _coman_hil_names %s", option->noun);
    } else {
        fputs(!strcmp(kind, "files")     ? ":_files"
              : !strcmp(kind, "folders") ? ":_files -/"
                                         : ":",
              out);
    }
    putc('\'', out);
}

static void zsh_put_operand(const struct command_spec *spec, size_t i, FILE *out)
{
    const struct operand_spec *operand = &spec->operand[i];

    if (spec->many && i + 1 == spec->noperand) {
        fputs(" \\\n            '*", out);
    } else {
        fprintf(out, " \\\n            '%zu", i + 1);
    }
    fputs(operand->required ? ":" : "::", out);
    zsh_put_text(operand->name, out);
    if (operand->noun) {
        fprintf(out, ": _coman_hil_names %s'", operand->noun);
        return;
    }
    fputs(operand->words ? ":(" : ":_files", out);
    for (const char *const *word = operand->words; word && *word; word++) {
        fprintf(out, " %s", *word);
    }
    fputs(operand->words ? ")'" : "'", out);
}

static void zsh_put_command(const struct command_spec *spec, FILE *out)
{
    fprintf(out, "    %s)\n        _arguments '--help[print the manual and exit]'", spec->name);
    for (size_t i = 0; i < spec->noption; i++) {
        zsh_put_option(&spec->option[i], spec->option[i].name, out);
        if (spec->option[i].letter) {
            zsh_put_option(&spec->option[i], spec->option[i].letter, out);
        }
    }
    for (size_t i = 0; i < spec->noperand; i++) {
        zsh_put_operand(spec, i, out);
    }
    fputs("\n        ;;\n", out);
}

static void zsh_put_program(const struct program *program, FILE *out)
{
    fprintf(out, "_coman_hil_names() {\n"
                 "    local -a names\n"
                 "    names=(${(f)\"$(_call_program names ${(q)service%%-bench} list $1 --names "
                 "2>/dev/null)\"})\n"
                 "    _alternative \"names:$1:($names)\" 'files:file:_files'\n"
                 "}\n\n");
    completion_put_function(program->name, out);
    fputs("() {\n"
          "    local -a commands\n"
          "    commands=(",
          out);
    for (size_t i = 0; i < program->ncommand; i++) {
        fprintf(out, "\n        '%s:", program->command[i].name);
        zsh_put_text(program->command[i].summary, out);
        putc('\'', out);
    }
    fputs(")\n"
          "    if ((CURRENT == 2)); then\n"
          "        _describe command commands\n"
          "        return\n"
          "    fi\n"
          "    shift words\n"
          "    ((CURRENT--))\n"
          "    case $words[1] in\n",
          out);
    program_print_completions(program, COMPLETION_ZSH);
    fputs("    esac\n}\n\n", out);
    completion_put_function(program->name, out);
    fputs(" \"$@\"\n", out);
}

/* ---- both ---- */

void options_completion(const struct command_spec *spec, enum completion_shell shell, FILE *out)
{
    if (shell == COMPLETION_BASH) {
        bash_put_command(spec, out);
    } else {
        zsh_put_command(spec, out);
    }
}

void completion_print(const struct program *program, enum completion_shell shell)
{
    if (shell == COMPLETION_BASH) {
        printf("# Completion of %s in bash, made by %s --completion=bash\n", program->name,
               program->name);
        bash_put_program(program, stdout);
    } else {
        printf("#compdef %s\n# Made by %s --completion=zsh\n\n", program->name, program->name);
        zsh_put_program(program, stdout);
    }
}
