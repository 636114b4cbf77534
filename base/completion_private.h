/* SPDX-License-Identifier: Apache-2.0 */
/* What the completion scripts of all shells are made with. Not RT-safe. */
#ifndef BASE_COMPLETION_PRIVATE_H
#define BASE_COMPLETION_PRIVATE_H

#include "base/completion.h"
#include "base/options.h"
#include "base/program.h"

/* Returns what the value of an option may be: "none", "files", "folders", "noun" (names of one) or
 * "words". */
const char *completion_kind(const struct option_spec *option);

/* Writes the words of an OPTION_ENUM, each after a space. */
void completion_put_words(const struct option_spec *option, FILE *out);

/* Writes a name that may be a shell function's: "coman-hil" becomes "_coman_hil". */
void completion_put_function(const char *name, FILE *out);

/* Write the parts of a fish script: of a command, and of the program. */
void completion_put_fish_command(const struct command_spec *spec, FILE *out);
void completion_put_fish_program(const struct program *program, FILE *out);

#endif
