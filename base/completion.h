/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Completion of command lines in bash, zsh and fish: scripts that are made from the tables of
 * commands and options, so that they know every one of them. Names of rigs and the like are asked
 * from the program when they are needed ("PROGRAM list NOUN [RIG] --names", with the rig that
 * stands on the line for what a rig has: joints, faults). Not RT-safe.
 */
#ifndef BASE_COMPLETION_H
#define BASE_COMPLETION_H

#include <stdio.h>

struct command_spec;
struct program;

enum completion_shell { COMPLETION_BASH, COMPLETION_ZSH, COMPLETION_FISH, COMPLETION_SHELLS };

/* "bash", "zsh" or "fish". */
extern const char *const completion_shell_names[COMPLETION_SHELLS];

/* Prints the script of a program on standard output. */
void completion_print(const struct program *program, enum completion_shell shell);

/* Writes the part of one command, which options_read prints for --help=bash, =zsh and =fish. */
void options_completion(const struct command_spec *spec, enum completion_shell shell, FILE *out);

#endif
