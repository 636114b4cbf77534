/* SPDX-License-Identifier: Apache-2.0 */
/* What symbolic_build (build.c) and its use in the background (background.c) share. Not RT-safe. */
#ifndef MODEL_SYMBOLIC_BUILD_PRIVATE_H
#define MODEL_SYMBOLIC_BUILD_PRIVATE_H

#include "model/symbolic/cache.h"
#include "model/symbolic/symbolic.h"

/* Of one module in the cache folder. */
struct build_files {
    char library[CACHE_PATH];
    char claim[CACHE_PATH];   /* locked while it is made in the background */
    char failure[CACHE_PATH]; /* why that failed the last time */
};

/* Names them; refuses a folder from which no code may be run. */
enum error_code build_name_files(const struct robot *robot, const struct symbolic_options *options,
                                 const char *folder, struct build_files *files,
                                 struct error *error);

#endif
