/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Completion of command lines in bash, zsh and fish: the scripts of base/completion/ with a table
 * of all commands and options. For names such as rigs the scripts ask the program: "PROGRAM list
 * NOUN [RIG] --names". For names within a rig (joints, faults) they pass the RIG of the line. Not
 * RT-safe.
 *
 * A row of the table is a line with parts separated by semicolons:
 *
 *     COMMAND;command;;;;;;;SUMMARY
 *     COMMAND;option;--NAME;-LETTER;KIND;VALUES;ARGUMENT;*, if it may be repeated;HELP
 *     COMMAND;operand;NAME;;KIND;VALUES;"optional" or nothing;its number, or * from there on;
 *
 * KIND of a value: flag (none), words (one of VALUES), noun (names of VALUES), files, folders, or
 * none of these.
 */
#ifndef BASE_COMPLETION_H
#define BASE_COMPLETION_H

#include <stdbool.h>
#include <stdio.h>

struct command_spec;
struct program;

/* Prints a program's script for a shell on standard output; false = unknown shell. */
bool completion_print(const struct program *program, const char *shell);

/* Writes the rows of a command. options_read prints them for --help=table. */
void completion_put_rows(const struct command_spec *spec, FILE *out);

#endif
