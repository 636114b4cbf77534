/* SPDX-License-Identifier: Apache-2.0 */
/* A cache folder, a compiler of the test's own and a pendulum; after cmocka.h. */
#ifndef TESTS_CACHE_SCENE_H
#define TESTS_CACHE_SCENE_H

#include "model/symbolic/symbolic.h"
#include "tests/unit/model/symbolic/evaluate.h"

#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const struct symbolic_options options = {.lanes = 4, .fast_compile = true};
static char folder[64], tools[64], path_before[4096];
static struct random_tree tree;
static struct symbolic_library library;
static struct error error;

static inline int open_cache(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/hil-cache-XXXXXX");
    strcpy(tools, "/tmp/hil-tools-XXXXXX");
    snprintf(path_before, sizeof path_before, "%s", getenv("PATH"));
    return !mkdtemp(folder) || !mkdtemp(tools) || pendulum_make(&tree, &error);
}

static inline int close_cache(void **state)
{
    char command[160];

    (void)state;
    symbolic_close(&library);
    setenv("PATH", path_before, 1);
    snprintf(command, sizeof command, "rm -r '%s' '%s'", folder, tools);
    return system(command);
}

static inline void skip_without_compiler(void)
{
    if (system("cc --version >/dev/null 2>&1") != 0) {
        print_message("SKIP: no C compiler (cc)\n");
        skip();
    }
}

/* A compiler of our own is found first; it may call the real one. */
static inline void put_compiler(const char *script)
{
    char path[96], search[sizeof path_before + 64];
    FILE *file;

    snprintf(path, sizeof path, "%s/cc", tools);
    file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "#!/bin/sh\nPATH='%s'\n%s\n", path_before, script);
    fclose(file);
    assert_int_equal(chmod(path, 0700), 0);
    snprintf(search, sizeof search, "%s:%s", tools, path_before);
    setenv("PATH", search, 1);
}

/* How many entries the folder has; path: of the last one. */
static inline int list_cache(char path[384])
{
    DIR *listing = opendir(folder);
    const struct dirent *entry;
    int count = 0;

    while (listing && (entry = readdir(listing))) {
        if (entry->d_name[0] != '.') {
            snprintf(path, 384, "%s/%s", folder, entry->d_name);
            count++;
        }
    }
    closedir(listing);
    return count;
}

#endif
