/* SPDX-License-Identifier: Apache-2.0 */
/* Writes completion scripts for bash and zsh, from the same tables as --help. */
#include "base/completion_private.h"

#include <ctype.h>
#include <string.h>

const char *const completion_shell_names[COMPLETION_SHELLS] = {"bash", "zsh", "fish"};

/* ---- what an argument may be ---- */

const char *completion_kind(const struct option_spec *option)
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

void completion_put_words(const struct option_spec *option, FILE *out)
{
    for (const struct word *w = option->words; w && w->word; w++) {
        fprintf(out, " %s", w->word);
    }
}

void completion_put_function(const char *name, FILE *out)
{
    putc('_', out);
    for (; *name; name++) {
        putc(isalnum((unsigned char)*name) ? *name : '_', out);
    }
}

/* ---- bash ---- */

/* Writes what an operand is completed to, as a quoted word. */
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

/* Writes the case branch of a command: its options, those with a value, and what values and
 * operands are completed to. */
static void bash_put_command(const struct command_spec *spec, FILE *out)
{
    /* All names of options */
    fprintf(out, "    %s)\n        options='--help", spec->name);
    for (size_t i = 0; i < spec->noption; i++) {
        fprintf(out, " %s", spec->option[i].name);
        if (spec->option[i].letter) {
            fprintf(out, " %s", spec->option[i].letter);
        }
    }
    /* Options that take the next word */
    fputs("' valued=' ", out);
    for (size_t i = 0; i < spec->noption; i++) {
        if (spec->option[i].type != OPTION_FLAG) {
            fprintf(out, "%s ", spec->option[i].name);
            if (spec->option[i].letter) {
                fprintf(out, "%s ", spec->option[i].letter);
            }
        }
    }
    /* Operands */
    fputs("'\n        operands=(", out);
    for (size_t i = 0; i < spec->noperand; i++) {
        bash_put_operand(&spec->operand[i], out);
    }
    /* What the value of the option before the cursor may be */
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
    "    local rig='' rigs='' names='' mark=''\n"
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
    "        program=${program/#~\\//$HOME/} value=${value#noun }\n"
    "        # what a rig has: of the rig that stands on the line\n"
    "        if [[ $value == joints || $value == faults ]]; then\n"
    "            rigs=$'\\n'$(\"$program\" list rigs --names 2>/dev/null)$'\\n'\n"
    "            for at in \"${COMP_WORDS[@]:2}\"; do\n"
    "                if [[ $rigs == *$'\\n'\"$at\"$'\\n'* || ($at == *.yaml && -f $at) ]]; then\n"
    "                    rig=$at\n"
    "                fi\n"
    "            done\n"
    "        fi\n"
    "        mapfile -t names < <(\"$program\" list \"$value\" ${rig:+\"$rig\"} --names "
    "2>/dev/null)\n"
    "        # a name with spaces is one word: in the quotes that stand there, or by backslashes\n"
    "        if [[ $word == [\\'\\\"]* ]]; then\n"
    "            mark=${word:0:1} word=${word:1}\n"
    "        else\n"
    "            word=${word//\\\\/}\n"
    "        fi\n"
    "        for at in \"${names[@]}\"; do\n"
    "            if [[ $at == \"$word\"* ]]; then\n"
    "                [[ $mark ]] || printf -v at %q \"$at\"\n"
    "                COMPREPLY+=(\"$at\")\n"
    "            fi\n"
    "        done\n"
    "        if [[ $value == settings ]]; then\n"
    "            COMPREPLY=(\"${COMPREPLY[@]/%/=}\")\n"
    "            compopt -o nospace 2>/dev/null\n"
    "        fi\n"
    "        value=noun\n"
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

/* Writes the completion function of a program, and registers it. */
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

/* Writes text within single quotes and an _arguments specification: the part before its first ;,
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

/* Writes an option by one of its two names. */
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

/* Writes an operand and what it is completed to; the last one may repeat. */
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

/* Writes the case branch of a command. */
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

/* Writes the completion functions of a program. */
static void zsh_put_program(const struct program *program, FILE *out)
{
    /* The function that asks the program for names */
    fprintf(out, "_coman_hil_names() {\n"
                 "    local -a names rigs rig suffix\n"
                 "    local program=${service%%-bench} word expl\n"
                 "    # what a rig has: of the rig that stands on the line\n"
                 "    if [[ $1 == joints || $1 == faults ]]; then\n"
                 "        rigs=(${(f)\"$(_call_program names ${(q)program} list rigs --names "
                 "2>/dev/null)\"})\n"
                 "        for word in $words; do\n"
                 "            if (($rigs[(Ie)$word])) || [[ $word == *.yaml && -f $word ]]; then\n"
                 "                rig=($word)\n"
                 "            fi\n"
                 "        done\n"
                 "    fi\n"
                 "    if [[ $1 == settings ]]; then\n"
                 "        suffix=(-S =)\n"
                 "    fi\n"
                 "    names=(${(f)\"$(_call_program names ${(q)program} list $1 ${(q)rig} --names "
                 "2>/dev/null)\"})\n"
                 "    _wanted names expl $1 compadd $suffix -a names\n"
                 "    [[ $1 == (joints|faults|settings) ]] || _files\n"
                 "}\n\n");
    /* The function that completes the command, then its arguments */
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

/* ---- all ---- */

void options_completion(const struct command_spec *spec, enum completion_shell shell, FILE *out)
{
    static void (*const put[COMPLETION_SHELLS])(const struct command_spec *spec, FILE *out) = {
        [COMPLETION_BASH] = bash_put_command,
        [COMPLETION_ZSH] = zsh_put_command,
        [COMPLETION_FISH] = completion_put_fish_command,
    };

    put[shell](spec, out);
}

void completion_print(const struct program *program, enum completion_shell shell)
{
    static void (*const put[COMPLETION_SHELLS])(const struct program *program, FILE *out) = {
        [COMPLETION_BASH] = bash_put_program,
        [COMPLETION_ZSH] = zsh_put_program,
        [COMPLETION_FISH] = completion_put_fish_program,
    };

    if (shell == COMPLETION_ZSH) {
        printf("#compdef %s\n", program->name);
    }
    printf("# Completion of %s in %s, made by %s --completion=%s\n", program->name,
           completion_shell_names[shell], program->name, completion_shell_names[shell]);
    put[shell](program, stdout);
}
