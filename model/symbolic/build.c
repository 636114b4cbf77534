/* SPDX-License-Identifier: Apache-2.0 */
/* Builds a generated module as a shared library: written, compiled, sealed and found again in a
 * folder. */
#include "model/symbolic/symbolic.h"

#include "base/array.h"
#include "base/instruction_set.h"
#include "model/symbolic/seal.h"

#include <dlfcn.h>
#include <errno.h>
#include <inttypes.h>
#include <spawn.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

enum { BUILD_PATH = 576 };

/* Writes the path of the library; machines of several architectures may share a home folder. */
static enum error_code build_name(const struct robot *robot, const struct symbolic_options *options,
                                  const char *folder, char path[BUILD_PATH], struct error *error)
{
    const uint64_t hash = options->inertia_inputs ? robot->massless_hash : robot->hash;
    char symbol[SYMBOLIC_SYMBOL];
    int used;

    symbolic_symbol(robot, symbol);
    used = snprintf(path, BUILD_PATH, "%s/%s-%016" PRIx64 "-g%d-l%d%s-%s.so", folder, symbol, hash,
                    SYMBOLIC_VERSION, options->lanes, options->inertia_inputs ? "-m" : "",
                    instruction_set_architecture);
    return used > 0 && used < BUILD_PATH
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT, "the folder name %s is too long", folder);
}

/* Checks that nobody but this user and root may write to the folder, since code is run from it. */
static enum error_code build_check_folder(const char *folder, struct error *error)
{
    struct stat status;

    if (stat(folder, &status)) {
        return error_set_errno(error, errno, "%s", folder);
    }
    if (!S_ISDIR(status.st_mode)) {
        return error_set(error, ERROR_INPUT, "%s is not a folder", folder);
    }
    if ((status.st_uid != geteuid() && status.st_uid != 0) ||
        (status.st_mode & (S_IWGRP | S_IWOTH))) {
        return error_set(error, ERROR_INPUT,
                         "%s: others may write there, so code from it is not run; it must belong "
                         "to this user or root alone (chmod go-w)",
                         folder);
    }
    return ERROR_NONE;
}

/* ---- the compiler ---- */

/* Starts the compiler with the source as its standard input, by a name under which the source
 * can include itself. Returns 0 or an errno. */
static int build_start_compiler(const char *level, int source, const char *output, pid_t *pid)
{
    const char *const arguments[] = {"cc",
                                     "-std=gnu11",
                                     level,
                                     "-fno-math-errno",
                                     "-ffp-contract=off",
                                     "-fPIC",
                                     "-shared",
                                     "-o",
                                     output,
                                     "-xc",
                                     "/proc/self/fd/0",
                                     "-lm",
                                     NULL};
    char *argv[ARRAY_COUNT(arguments)];
    posix_spawn_file_actions_t actions;
    int problem = posix_spawn_file_actions_init(&actions);

    if (problem) {
        return problem;
    }
    /* posix_spawnp takes char * but does not write to them */
    memcpy(argv, arguments, sizeof arguments);
    problem = posix_spawn_file_actions_adddup2(&actions, source, STDIN_FILENO);
    if (!problem) {
        problem = posix_spawnp(pid, argv[0], &actions, NULL, argv, environ);
    }
    posix_spawn_file_actions_destroy(&actions);
    return problem;
}

/* Compiles an open source into a library and waits for the end of it. */
static enum error_code build_compile(const char *level, int source, const char *output,
                                     struct error *error)
{
    int status, problem;
    pid_t pid;

    problem = build_start_compiler(level, source, output, &pid);
    if (problem) {
        return error_set(error, ERROR_UNSUPPORTED, "no C compiler (cc): %s", strerror(problem));
    }
    while (waitpid(pid, &status, 0) < 0) {
        if (errno != EINTR) {
            return error_set_errno(error, errno, "the compiler cannot be waited for");
        }
    }
    if (WIFSIGNALED(status)) {
        return error_set(error, ERROR_UNSUPPORTED, "the compiler (cc) was killed by signal %d",
                         WTERMSIG(status));
    }
    if (WEXITSTATUS(status) == 127) {
        return error_set(error, ERROR_UNSUPPORTED, "no C compiler (cc) could be run");
    }
    return WEXITSTATUS(status) == 0
               ? ERROR_NONE
               : error_set(error, ERROR_UNSUPPORTED,
                           "the compiler (cc) failed with status %d on the generated code",
                           WEXITSTATUS(status));
}

/* ---- the module ---- */

/* Loads a library and finds its module, in the variant for this CPU. */
static enum error_code build_load(const struct robot *robot, const char *path,
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
    library->module = dynamics_module_used(entry());
    return ERROR_NONE;
}

/* Generates the source, a file without a name, and compiles it. */
static enum error_code build_make(const struct robot *robot, const struct symbolic_options *options,
                                  const char *output, struct error *error)
{
    struct symbolic_report report;
    FILE *source = tmpfile();
    enum error_code code;

    if (!source) {
        return error_set_errno(error, errno, "cannot make a temporary file");
    }
    code = symbolic_generate(robot, options, source, &report, error);
    if (!code && (fflush(source) || fseek(source, 0, SEEK_SET))) {
        code = error_set_errno(error, errno, "cannot write a temporary file");
    }
    if (!code) {
        code = build_compile(options->fast_compile || report.large ? "-O1" : "-O2", fileno(source),
                             output, error);
    }
    fclose(source);
    return code;
}

enum error_code symbolic_find(const struct robot *robot, const struct symbolic_options *options,
                              const char *folder, struct symbolic_library *library,
                              struct error *error)
{
    char path[BUILD_PATH];
    enum error_code code;

    memset(library, 0, sizeof *library);
    code = build_name(robot, options, folder, path, error);
    if (code) {
        return code;
    }
    /* It has to exist, in a folder that is safe, and to be as it was left */
    if (access(path, F_OK)) {
        return error_set(error, ERROR_UNSUPPORTED, "there is no module of %s in %s", robot->name,
                         folder);
    }
    code = build_check_folder(folder, error);
    if (code) {
        return code;
    }
    if (!seal_is_whole(path)) {
        return error_set(error, ERROR_UNSUPPORTED, "%s is damaged", path);
    }
    return build_load(robot, path, library, error);
}

enum error_code symbolic_build(const struct robot *robot, const struct symbolic_options *options,
                               const char *folder, struct symbolic_library *library,
                               struct error *error)
{
    char path[BUILD_PATH], fresh[BUILD_PATH + 32];
    enum error_code code;

    memset(library, 0, sizeof *library);
    if ((code = build_name(robot, options, folder, path, error)) ||
        (code = build_check_folder(folder, error))) {
        return code;
    }

    /* It gets its name when it and its seal are on the disk */
    snprintf(fresh, sizeof fresh, "%s.%ld.part", path, (long)getpid());
    if (!(code = build_make(robot, options, fresh, error)) && !(code = seal_write(fresh, error)) &&
        rename(fresh, path)) {
        code = error_set_errno(error, errno, "%s", path);
    }
    if (code) {
        unlink(fresh);
        return code;
    }
    return build_load(robot, path, library, error);
}

void symbolic_close(struct symbolic_library *library)
{
    if (library->handle) {
        dlclose(library->handle);
    }
    memset(library, 0, sizeof *library);
}
