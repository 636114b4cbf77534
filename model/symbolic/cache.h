/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to symbolic_build (build.c) and what calls it in the background (background.c): compiled
 * modules that are known to be whole, folders in which they are made, and who makes which.
 *
 * A truncated library crashes the process that loads it (SIGBUS, in the dynamic linker). So a
 * module ends in a seal, its size and a hash of its bytes, which the linker does not look at; it
 * gets its name when it and its seal are on the disk.
 *
 * What a build leaves behind when it is killed, the compiler's temporary files too, lies in a
 * folder of its own that is locked as long as the build lives: the next build removes those that
 * nobody locks. Not RT-safe.
 */
#ifndef MODEL_SYMBOLIC_CACHE_H
#define MODEL_SYMBOLIC_CACHE_H

#include "base/error.h"

#include <stdbool.h>

enum { CACHE_PATH = 576 };

/* Appends the seal to a library and writes both to the disk. */
enum error_code cache_seal(const char *path, struct error *error);

/* Whether the file is there and is what was sealed. */
bool cache_is_whole(const char *path);

/* Gives a sealed library its name in folder, on the disk too. */
enum error_code cache_publish(const char *fresh, const char *folder, const char *library,
                              struct error *error);

/* A folder for one build; descriptor -1 = none. */
struct cache_workshop {
    char path[CACHE_PATH];
    int descriptor; /* locked */
};

/* Makes one in folder, after those that dead builds have left are removed. */
enum error_code cache_open_workshop(struct cache_workshop *workshop, const char *folder,
                                    struct error *error);

/* Removes it with all that is in it. */
void cache_close_workshop(struct cache_workshop *workshop);

/* How the name of a claim ends: a file that is locked as long as somebody makes the module. One
 * that is left behind is removed by the next build. */
#define CACHE_CLAIM ".building"

/* The locked file, empty, in *descriptor, or -1 where somebody else has it. The lock passes to a
 * child with the descriptor. */
enum error_code cache_claim(const char *path, int *descriptor, struct error *error);

/* Whether somebody has it. */
bool cache_is_claimed(const char *path);

#endif
