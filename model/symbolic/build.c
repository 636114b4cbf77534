/* SPDX-License-Identifier: Apache-2.0 */
/* A generated module as a shared library: written, compiled and kept in a cache folder. */
#include "model/symbolic/build_private.h"

#include "base/count.h"
#include "base/instruction_set.h"
#include "model/symbolic/cache.h"

#include <dlfcn.h>
#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

extern char **environ;

enum {
    POLL_NS = 20000000,
    TELL_NS = 250000000,
};

/* The files of one build; everything but the library is made in a folder of its own, so that two
 * runs at once do not meet. */
struct build {
    struct build_files files;
    char source[CACHE_PATH + 32], fresh[CACHE_PATH + 32];
    struct cache_workshop workshop;
    struct symbolic_report report;
};

/* Machines of several architectures may share a home folder. */
static enum error_code name_files(const struct robot *robot, const struct symbolic_options *options,
                                  const char *folder, struct build_files *files,
                                  struct error *error)
{
    char symbol[SYMBOLIC_SYMBOL], stem[CACHE_PATH - 64];
    int used;

    symbolic_symbol(robot, symbol);
    used =
        snprintf(stem, sizeof stem, "%s/%s-%016" PRIx64 "-g%d-l%d%s-%s%s%s", folder, symbol,
                 robot->hash, SYMBOLIC_VERSION, options->lanes, options->inertia_inputs ? "-m" : "",
                 instruction_set_architecture, options->this_cpu ? "-" : "",
                 options->this_cpu ? instruction_set_names[instruction_set_used()] : "");
    if (used < 0 || (size_t)used >= sizeof stem) {
        return error_set(error, ERROR_INPUT, "the folder name %s is too long", folder);
    }
    snprintf(files->library, sizeof files->library, "%s.so", stem);
    snprintf(files->claim, sizeof files->claim, "%s" CACHE_CLAIM, stem);
    snprintf(files->failure, sizeof files->failure, "%s.failed", stem);
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

enum error_code build_name_files(const struct robot *robot, const struct symbolic_options *options,
                                 const char *folder, struct build_files *files, struct error *error)
{
    enum error_code code = name_files(robot, options, folder, files, error);

    return code ? code : check_folder(folder, error);
}

static enum error_code write_source(const struct robot *robot,
                                    const struct symbolic_options *options, const char *path,
                                    struct symbolic_report *report, struct error *error)
{
    FILE *file = fopen(path, "wx");
    enum error_code code;

    if (!file) {
        return error_set_errno(error, errno, "%s", path);
    }
    code = symbolic_generate(robot, options, file, report, error);
    if (fclose(file) && !code) {
        code = error_set_errno(error, errno, "%s", path);
    }
    return code;
}

/* ---- the compiler ---- */

static int64_t build_clock_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

/* Our environment but for TMPDIR, which is the build's folder: what a compiler that is killed
 * leaves goes with it. The array and its first string are the caller's; NULL without memory. */
static char **compiler_environment(const struct build *build)
{
    static const char name[] = "TMPDIR=";
    size_t count = 0, kept = 1, size = sizeof name + strlen(build->workshop.path);
    char **made;

    while (environ[count]) {
        count++;
    }
    made = calloc(count + 2, sizeof *made);
    if (!made || !(made[0] = malloc(size))) {
        free(made);
        return NULL;
    }
    snprintf(made[0], size, "%s%s", name, build->workshop.path);
    for (size_t i = 0; i < count; i++) {
        if (strncmp(environ[i], name, strlen(name))) {
            made[kept++] = environ[i];
        }
    }
    return made;
}

/* Starts it, with a limit in a process group of its own, to be killed with all that it has started.
 * Returns 0 or an errno. */
static int start_compiler(const struct symbolic_options *options, char *const argv[],
                          char **environment, pid_t *pid)
{
    posix_spawnattr_t attributes;
    int problem = posix_spawnattr_init(&attributes);

    if (problem) {
        return problem;
    }
    if (options->limit_s > 0.0) {
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    }
    problem = posix_spawnp(pid, argv[0], NULL, &attributes, argv, environment);
    posix_spawnattr_destroy(&attributes);
    return problem;
}

/* Waits for the compiler, and says a few times a second for how long. */
static enum error_code wait_for_compiler(pid_t pid, const struct robot *robot,
                                         const struct symbolic_options *options, int *status,
                                         struct error *error)
{
    const struct symbolic_progress *progress = &options->progress;
    int64_t start = build_clock_ns(), told = start;
    pid_t ended;

    while ((ended = waitpid(pid, status, WNOHANG)) != pid) {
        int64_t now = build_clock_ns();

        if (ended < 0 && errno != EINTR) {
            return error_set_errno(error, errno, "the compiler cannot be waited for");
        }
        if (options->limit_s > 0.0 && (double)(now - start) * 1e-9 > options->limit_s) {
            kill(-pid, SIGKILL);
            waitpid(pid, status, 0);
            return error_set(error, ERROR_UNSUPPORTED,
                             "the compiler (cc) was ended: it ran for more than %.0f s",
                             options->limit_s);
        }
        if (progress->tell && now - told >= TELL_NS) {
            told = now;
            progress->tell(progress->context, robot->name, (double)(now - start) * 1e-9);
        }
        nanosleep(&(struct timespec){.tv_nsec = POLL_NS}, NULL);
    }
    return ERROR_NONE;
}

static enum error_code compile_module(const struct robot *robot,
                                      const struct symbolic_options *options,
                                      const struct build *build, struct error *error)
{
    const char *level = options->fast_compile || build->report.large ? "-O1" : "-O2";
    const char *const arguments[] = {
        "cc",    "-std=gnu11", level, "-fno-math-errno", "-ffp-contract=off",
        "-fPIC", "-shared",    "-o",  build->fresh,      build->source,
        "-lm",   NULL};
    char *argv[ARRAY_COUNT(arguments)];
    char **environment = compiler_environment(build);
    enum error_code code;
    pid_t pid;
    int status, problem;

    if (!environment) {
        return error_set(error, ERROR_MEMORY, "no memory to start the compiler");
    }
    /* posix_spawnp takes char * but does not write to them */
    memcpy(argv, arguments, sizeof arguments);
    problem = start_compiler(options, argv, environment, &pid);
    free(environment[0]);
    free(environment);
    if (problem) {
        return error_set(error, ERROR_UNSUPPORTED, "no C compiler (cc): %s", strerror(problem));
    }

    /* Its status: not started, killed, or not content */
    code = wait_for_compiler(pid, robot, options, &status, error);
    if (code) {
        return code;
    }
    if (WIFSIGNALED(status)) {
        return error_set(error, ERROR_UNSUPPORTED, "the compiler (cc) was killed by signal %d",
                         WTERMSIG(status));
    }
    if (WEXITSTATUS(status) == 127) {
        return error_set(error, ERROR_UNSUPPORTED, "no C compiler (cc) could be run");
    }
    if (WEXITSTATUS(status) != 0) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "the compiler (cc) failed with status %d on the generated code",
                         WEXITSTATUS(status));
    }
    return ERROR_NONE;
}

/* ---- the module ---- */

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
    library->module = dynamics_module_used(entry());
    return ERROR_NONE;
}

/* Makes the library; it appears under its name when it is complete. */
static enum error_code make_library(const struct robot *robot,
                                    const struct symbolic_options *options, const char *folder,
                                    struct build *build, struct error *error)
{
    enum error_code code = cache_open_workshop(&build->workshop, folder, error);

    if (code) {
        return code;
    }
    snprintf(build->source, sizeof build->source, "%s/module.c", build->workshop.path);
    snprintf(build->fresh, sizeof build->fresh, "%s/module.so", build->workshop.path);
    if (!(code = write_source(robot, options, build->source, &build->report, error)) &&
        !(code = compile_module(robot, options, build, error)) &&
        !(code = cache_seal(build->fresh, error))) {
        code = cache_publish(build->fresh, folder, build->files.library, error);
    }
    if (!code) {
        unlink(build->files.failure);
    }
    unlink(build->source);
    unlink(build->fresh);
    cache_close_workshop(&build->workshop);
    return code;
}

/* library->cached: whether it was there and could be loaded. */
static void load_cached(const struct robot *robot, const struct build_files *files,
                        struct symbolic_library *library)
{
    library->cached =
        cache_is_whole(files->library) && !load_module(robot, files->library, library, NULL);
}

enum error_code symbolic_find(const struct robot *robot, const struct symbolic_options *options,
                              const char *folder, struct symbolic_library *library,
                              struct error *error)
{
    struct build_files files;
    enum error_code code;

    memset(library, 0, sizeof *library);
    if ((code = build_name_files(robot, options, folder, &files, error))) {
        return code;
    }
    load_cached(robot, &files, library);
    return library->cached
               ? ERROR_NONE
               : error_set(error, ERROR_UNSUPPORTED, "there is no compiled module in %s", folder);
}

enum error_code symbolic_build(const struct robot *robot, const struct symbolic_options *options,
                               const char *folder, struct symbolic_library *library,
                               struct error *error)
{
    struct build build;
    enum error_code code;

    memset(library, 0, sizeof *library);
    if ((code = build_name_files(robot, options, folder, &build.files, error))) {
        return code;
    }
    load_cached(robot, &build.files, library);
    if (library->cached) {
        return ERROR_NONE;
    }
    code = make_library(robot, options, folder, &build, error);
    return code ? code : load_module(robot, build.files.library, library, error);
}

void symbolic_close(struct symbolic_library *library)
{
    if (library->handle) {
        dlclose(library->handle);
    }
    memset(library, 0, sizeof *library);
}
