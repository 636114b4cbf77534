/* SPDX-License-Identifier: Apache-2.0 */
/* A generated module as a shared library: written, compiled and kept in a cache folder. */
#include "model/symbolic/symbolic.h"

#include "base/count.h"

#include <dlfcn.h>
#include <errno.h>
#include <inttypes.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

enum { PATH_SIZE = 512 };

/* The files of one build; everything but the library is made under a name of this process, so that
 * two runs at once do not meet. */
struct build {
    char source[PATH_SIZE + 32], fresh[PATH_SIZE + 32], library[PATH_SIZE + 32];
};

static enum error_code name_files(const struct robot *robot, const char *folder,
                                  const struct symbolic_options *options, struct build *build,
                                  struct error *error)
{
    char symbol[SYMBOLIC_SYMBOL], stem[PATH_SIZE];
    int used;

    symbolic_symbol(robot, symbol);
    used = snprintf(stem, sizeof stem, "%s/%s-%016" PRIx64 "-g%d-l%d", folder, symbol, robot->hash,
                    SYMBOLIC_VERSION, options->lanes);
    if (used < 0 || (size_t)used >= sizeof stem) {
        return error_set(error, ERROR_INPUT, "the folder name %s is too long", folder);
    }
    snprintf(build->library, sizeof build->library, "%s.so", stem);
    snprintf(build->source, sizeof build->source, "%s.%ld.c", stem, (long)getpid());
    snprintf(build->fresh, sizeof build->fresh, "%s.%ld.so", stem, (long)getpid());
    return ERROR_NONE;
}

/* Code is run from the folder: nobody else may write there. */
static enum error_code check_folder(const char *folder, struct error *error)
{
    struct stat status;

    if (stat(folder, &status)) {
        return error_set_errno(error, errno, "%s", folder);
    }
    if (!S_ISDIR(status.st_mode)) {
        return error_set(error, ERROR_INPUT, "%s is not a folder", folder);
    }
    if (status.st_uid != geteuid() || (status.st_mode & (S_IWGRP | S_IWOTH))) {
        return error_set(error, ERROR_INPUT,
                         "%s: others may write there, so code from it is not run; it must belong "
                         "to this user alone (chmod go-w)",
                         folder);
    }
    return ERROR_NONE;
}

static enum error_code write_source(const struct robot *robot,
                                    const struct symbolic_options *options, const char *path,
                                    struct error *error)
{
    FILE *file = fopen(path, "wx");
    enum error_code code;

    if (!file) {
        return error_set_errno(error, errno, "%s", path);
    }
    code = symbolic_generate(robot, options, file, NULL, error);
    if (fclose(file) && !code) {
        code = error_set_errno(error, errno, "%s", path);
    }
    return code;
}

static enum error_code compile_module(const struct symbolic_options *options,
                                      const struct build *build, struct error *error)
{
    const char *level = options->fast_compile ? "-O1" : "-O2";
    const char *const arguments[] = {"cc",          "-std=gnu11", level, "-fno-math-errno",
                                     "-fPIC",       "-shared",    "-o",  build->fresh,
                                     build->source, "-lm",        NULL};
    char *argv[ARRAY_COUNT(arguments)];
    pid_t pid;
    int status, problem;

    /* posix_spawnp takes char * but does not write to them */
    memcpy(argv, arguments, sizeof arguments);
    problem = posix_spawnp(&pid, argv[0], NULL, NULL, argv, environ);
    if (problem) {
        return error_set(error, ERROR_UNSUPPORTED, "no C compiler (cc): %s", strerror(problem));
    }

    /* Its status: not started, or not content */
    while (waitpid(pid, &status, 0) < 0) {
        if (errno != EINTR) {
            return error_set_errno(error, errno, "the compiler cannot be waited for");
        }
    }
    if (!WIFEXITED(status) || WEXITSTATUS(status) == 127) {
        return error_set(error, ERROR_UNSUPPORTED, "no C compiler (cc) could be run");
    }
    if (WEXITSTATUS(status) != 0) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "the compiler (cc) failed with status %d on the generated code",
                         WEXITSTATUS(status));
    }
    return ERROR_NONE;
}

static enum error_code load_module(const struct robot *robot, const char *path,
                                   struct symbolic_library *library, struct error *error)
{
    const struct dynamics_module *(*entry)(void);
    char symbol[SYMBOLIC_SYMBOL];
    void *found;

    symbolic_symbol(robot, symbol);
    library->handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library->handle) {
        return error_set(error, ERROR_SYSTEM, "%s", dlerror());
    }
    found = dlsym(library->handle, symbol);
    if (!found) {
        symbolic_close(library);
        return error_set(error, ERROR_INPUT, "%s has no %s", path, symbol);
    }
    memcpy(&entry, &found, sizeof entry);
    library->module = entry();
    return ERROR_NONE;
}

enum error_code symbolic_build(const struct robot *robot, const struct symbolic_options *options,
                               const char *folder, struct symbolic_library *library,
                               struct error *error)
{
    struct build build;
    enum error_code code;

    memset(library, 0, sizeof *library);
    if ((code = name_files(robot, folder, options, &build, error)) ||
        (code = check_folder(folder, error))) {
        return code;
    }
    if (access(build.library, R_OK) == 0 && !load_module(robot, build.library, library, NULL)) {
        library->cached = true;
        return ERROR_NONE;
    }

    /* The library appears under its name when it is complete */
    if ((code = write_source(robot, options, build.source, error)) ||
        (code = compile_module(options, &build, error))) {
        goto done;
    }
    if (rename(build.fresh, build.library)) {
        code = error_set_errno(error, errno, "%s", build.library);
    }

done:
    unlink(build.source);
    unlink(build.fresh);
    return code ? code : load_module(robot, build.library, library, error);
}

void symbolic_close(struct symbolic_library *library)
{
    if (library->handle) {
        dlclose(library->handle);
    }
    memset(library, 0, sizeof *library);
}
