/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Compiled modules that are known to be whole. A truncated library crashes the process that loads
 * it (SIGBUS, in the dynamic linker); so a module ends in a seal, its size and a hash of its bytes,
 * which the linker does not look at. Private to build.c. Not RT-safe.
 */
#ifndef MODEL_SYMBOLIC_SEAL_H
#define MODEL_SYMBOLIC_SEAL_H

#include "base/error.h"

#include <stdbool.h>

/* Appends the seal to a library and writes both to the disk. */
enum error_code seal_write(const char *path, struct error *error);

/* Returns whether the file is there and is what was sealed. */
bool seal_is_whole(const char *path);

#endif
