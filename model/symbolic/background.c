/* SPDX-License-Identifier: Apache-2.0 */
/* A build that nobody waits for: its process, and the note that it leaves when it fails. */
#include "model/symbolic/background.h"

#include "model/symbolic/build_private.h"

#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#define LIMIT_S 3600.0
#define CAUSE "\ncause: "

enum {
    OUTPUT_SIZE = 32768,       /* of the compiler's, in a note */
    COMPILER_SIZE = 640,       /* its path, size and time */
    FILE_SIZE_MAX = 256 << 20, /* of any file that the compiler writes */
    CLAIM = 3,                 /* descriptor in the process that builds */
};

/* ---- the compiler ---- */

/* One line that is another with another compiler; false when there is none. */
static bool compiler_identify(char text[COMPILER_SIZE])
{
    const char *at = getenv("PATH");

    for (at = at ? at : "/bin:/usr/bin"; at; at = strchr(at, ':') ? strchr(at, ':') + 1 : NULL) {
        int length = (int)strcspn(at, ":");
        char path[512];
        struct stat status;

        if (snprintf(path, sizeof path, "%.*s/cc", length ? length : 1, length ? at : ".") <
                (int)sizeof path &&
            !stat(path, &status) && S_ISREG(status.st_mode) && !access(path, X_OK)) {
            snprintf(text, COMPILER_SIZE, "compiler: %s, %lld bytes of %lld.%09ld", path,
                     (long long)status.st_size, (long long)status.st_mtim.tv_sec,
                     (long)status.st_mtim.tv_nsec);
            return true;
        }
    }
    return false;
}

/* ---- the note of a failure ---- */

/* The claim, which holds what the compiler said, becomes the note; not where the disk is full. */
static void note_failure(const struct build_files *files, const struct error *cause)
{
    char text[sizeof cause->text + 32];
    struct stat status;
    int length = snprintf(text, sizeof text, CAUSE "%s\n", cause->text);

    if (fstat(CLAIM, &status) || (status.st_size > OUTPUT_SIZE && ftruncate(CLAIM, OUTPUT_SIZE)) ||
        lseek(CLAIM, 0, SEEK_END) < 0 || write(CLAIM, text, (size_t)length) != length ||
        fsync(CLAIM) || rename(files->claim, files->failure)) {
        unlink(files->claim);
    }
}

/* The cause, its last line, when the note is one about this compiler. */
static bool read_failure(const struct build_files *files, const char *compiler,
                         struct error *reason)
{
    static const char cause[] = CAUSE;
    char text[OUTPUT_SIZE + sizeof reason->text + 64];
    char *line = NULL;
    size_t length;
    FILE *file = fopen(files->failure, "re");

    if (!file) {
        return false;
    }
    length = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[length] = '\0';
    if (strncmp(text, compiler, strlen(compiler)) || text[strlen(compiler)] != '\n') {
        return false;
    }
    for (char *at = text; (at = strstr(at, cause)); at++) {
        line = at + strlen(cause);
    }
    length = line ? strcspn(line, "\n") : 0;
    if (length == 0 || strcmp(line + length, "\n")) {
        return false;
    }
    line[length] = '\0';
    error_set(reason, ERROR_UNSUPPORTED,
              "compiling these failed the last time: %.300s (%s says more; without it the next "
              "start tries again)",
              line, files->failure);
    return true;
}

/* ---- the state ---- */

/* What builds have left; compiler: "" = none. */
static enum symbolic_state examine_results(const struct build_files *files, const char *compiler,
                                           struct error *reason)
{
    error_set(reason, ERROR_NONE, "%s", "");
    if (cache_is_whole(files->library)) {
        return SYMBOLIC_COMPILED;
    }
    if (!compiler[0]) {
        error_set(reason, ERROR_UNSUPPORTED, "no C compiler (cc)");
        return SYMBOLIC_MISSING;
    }
    return read_failure(files, compiler, reason) ? SYMBOLIC_FAILED : SYMBOLIC_MISSING;
}

static enum symbolic_state examine_build(const struct build_files *files, const char *compiler,
                                         struct error *reason)
{
    enum symbolic_state state = examine_results(files, compiler, reason);

    if (state == SYMBOLIC_COMPILED || !cache_is_claimed(files->claim)) {
        return state;
    }
    error_set(reason, ERROR_UNSUPPORTED, "another start is compiling these");
    return SYMBOLIC_COMPILING;
}

enum symbolic_state symbolic_state(const struct robot *robot,
                                   const struct symbolic_options *options, const char *folder,
                                   struct error *reason)
{
    char compiler[COMPILER_SIZE] = "";
    struct build_files files;

    if (build_name_files(robot, options, folder, &files, reason)) {
        return SYMBOLIC_MISSING;
    }
    compiler_identify(compiler);
    return examine_build(&files, compiler, reason);
}

/* ---- the process ---- */

/* A loop that is being replaced may have left us on its CPU alone: then to all others. */
static void leave_processor(int cpu)
{
    cpu_set_t set;

    if (cpu < 0 || cpu >= CPU_SETSIZE || sched_getaffinity(0, sizeof set, &set)) {
        return;
    }
    CPU_CLR((size_t)cpu, &set);
    if (CPU_COUNT(&set) == 0) {
        memset(&set, 0xff, sizeof set);
        CPU_CLR((size_t)cpu, &set);
    }
    sched_setaffinity(0, sizeof set, &set); /* refused where there is no other */
}

static void take_lowest_priority(int avoided_cpu)
{
    const struct sched_param none = {0};
    const struct rlimit file_size = {FILE_SIZE_MAX, FILE_SIZE_MAX};
    int score;

    leave_processor(avoided_cpu);
    sched_setscheduler(0, SCHED_IDLE, &none);
    setpriority(PRIO_PROCESS, 0, 19);
    setrlimit(RLIMIT_FSIZE, &file_size);
    score = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
    if (score >= 0) {
        (void)!write(score, "1000", 4);
        close(score);
    }
}

/* Keeps the claim; what is said goes into its file. */
static void leave_files(const struct build_files *files, int claim)
{
    int null, output;

    if (claim != CLAIM) {
        dup2(claim, CLAIM);
    }
    fcntl(CLAIM, F_SETFD, FD_CLOEXEC);
    closefrom(CLAIM + 1);

    /* The compiler inherits these three; what else is open of them goes */
    null = open("/dev/null", O_RDWR);
    output = open(files->claim, O_WRONLY | O_APPEND);
    dup2(null, STDIN_FILENO);
    dup2(output >= 0 ? output : null, STDOUT_FILENO);
    dup2(output >= 0 ? output : null, STDERR_FILENO);
    closefrom(CLAIM + 1);
}

static void leave_signals(void)
{
    sigset_t none;

    for (int number = 1; number < NSIG; number++) {
        signal(number, SIG_DFL);
    }
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
}

__attribute__((noreturn)) static void build_alone(const struct robot *robot,
                                                  const struct symbolic_options *options,
                                                  const char *folder,
                                                  const struct build_files *files)
{
    struct symbolic_options alone = *options;
    struct symbolic_library library;
    struct error error;

    alone.progress = (struct symbolic_progress){0};
    alone.limit_s = options->limit_s > 0.0 ? options->limit_s : LIMIT_S;
    if (symbolic_build(robot, &alone, folder, &library, &error)) {
        note_failure(files, &error);
    } else {
        unlink(files->claim);
    }
    _exit(0);
}

/* Begins a grandchild that init will wait for; false with errno. */
static bool begin_process(const struct robot *robot, const struct symbolic_options *options,
                          const char *folder, const struct build_files *files, int claim,
                          int avoided_cpu)
{
    pid_t child = fork(), grandchild;
    int status = 0;

    if (child < 0) {
        return false;
    }
    if (child > 0) {
        while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
        }
        errno = EAGAIN;
        return status == 0;
    }
    leave_signals();
    setsid();
    grandchild = fork();
    if (grandchild != 0) {
        _exit(grandchild < 0);
    }
    prctl(PR_SET_NAME, "hil-compile");
    leave_files(files, claim);
    take_lowest_priority(avoided_cpu);
    build_alone(robot, options, folder, files);
}

/* With the claim. */
static enum symbolic_state begin_build(const struct robot *robot,
                                       const struct symbolic_options *options, const char *folder,
                                       const struct build_files *files, const char *compiler,
                                       int claim, int avoided_cpu, struct error *reason)
{
    enum symbolic_state state = SYMBOLIC_COMPILING;

    if (dprintf(claim, "%s\n", compiler) < 0 ||
        !begin_process(robot, options, folder, files, claim, avoided_cpu)) {
        error_set_errno(reason, errno, "these cannot be compiled in the background");
        unlink(files->claim);
        state = SYMBOLIC_MISSING;
    }
    close(claim);
    return state;
}

enum symbolic_state symbolic_build_in_background(const struct robot *robot,
                                                 const struct symbolic_options *options,
                                                 const char *folder, int avoided_cpu,
                                                 struct error *reason)
{
    char compiler[COMPILER_SIZE] = "";
    struct build_files files;
    enum symbolic_state state;
    int claim;

    if (build_name_files(robot, options, folder, &files, reason)) {
        return SYMBOLIC_MISSING;
    }
    compiler_identify(compiler);
    state = examine_build(&files, compiler, reason);
    if (state != SYMBOLIC_MISSING || !compiler[0]) {
        return state;
    }
    if (cache_claim(files.claim, &claim, reason)) {
        return SYMBOLIC_MISSING;
    }
    if (claim < 0) {
        error_set(reason, ERROR_UNSUPPORTED, "another start is compiling these");
        return SYMBOLIC_COMPILING;
    }

    /* Another start may have made it since */
    state = examine_results(&files, compiler, reason);
    if (state == SYMBOLIC_MISSING) {
        return begin_build(robot, options, folder, &files, compiler, claim, avoided_cpu, reason);
    }
    unlink(files.claim);
    close(claim);
    return state;
}
