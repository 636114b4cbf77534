/* SPDX-License-Identifier: Apache-2.0 */
/* Starts, watches and ends the program that acts as the host of a scenario. */
#include "app/scenario/program.h"

#include "base/whole_file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* Time between SIGTERM and SIGKILL. */
enum { PATIENCE_MS = 1000 };

enum error_code scenario_program_start(struct scenario_program *program, const char *command,
                                       uint16_t port, const char *record, const char *scratch,
                                       struct error *error)
{
    char path[PATH_MAX] = "/dev/null";
    pid_t parent = getpid();
    enum error_code code;
    int output, reason;

    if (record || scratch) {
        snprintf(path, sizeof path, "%s/" SCENARIO_PROGRAM_LOG, record ? record : scratch);
    }
    code = growing_file_open(path, &output, error);
    if (code) {
        return code;
    }
    program->pid = fork();
    if (program->pid == 0) {
        int input = open("/dev/null", O_RDONLY);
        char place[32];

        /* Execute the program in the new process. The program ends when its parent ends. */
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        setpgid(0, 0);
        snprintf(place, sizeof place, "127.0.0.1:%u", port);

        /* Pass the gateway's address in the environment, and redirect the output to the log */
        if (getppid() != parent || input < 0 || dup2(input, STDIN_FILENO) < 0 ||
            dup2(output, STDOUT_FILENO) < 0 || dup2(output, STDERR_FILENO) < 0 ||
            setenv(SCENARIO_PROGRAM_GATEWAY, place, 1) ||
            (scratch && setenv(SCENARIO_PROGRAM_SCRATCH, scratch, 1))) {
            _exit(127);
        }
        execl("/bin/sh", "sh", "-c", command, (char *)NULL);
        _exit(127);
    }
    reason = errno;
    close(output);
    if (program->pid < 0) {
        program->pid = 0;
        return error_set_errno(error, reason, "cannot make a process for a scenario's program");
    }
    /* parent and child both call setpgid, so that the group exists for both */
    setpgid(program->pid, program->pid);
    return ERROR_NONE;
}

bool scenario_program_ended(struct scenario_program *program, char *text, size_t size)
{
    int status;

    if (!program->pid || waitpid(program->pid, &status, WNOHANG) != program->pid) {
        return false;
    }
    kill(-program->pid, SIGKILL); /* remaining processes of the group */
    program->pid = 0;
    if (WIFSIGNALED(status)) {
        snprintf(text, size, "the program died of: %s", strsignal(WTERMSIG(status)));
    } else {
        snprintf(text, size, "the program ended before the run, with status %d",
                 WEXITSTATUS(status));
    }
    return true;
}

void scenario_program_stop(struct scenario_program *program)
{
    const struct timespec pause = {.tv_nsec = 1000000};
    char unused[64];

    if (!program->pid) {
        return;
    }
    kill(-program->pid, SIGTERM);
    for (int ms = 0; ms < PATIENCE_MS; ms++) {
        if (scenario_program_ended(program, unused, sizeof unused)) {
            return;
        }
        nanosleep(&pause, NULL);
    }
    kill(-program->pid, SIGKILL);
    while (waitpid(program->pid, NULL, 0) < 0 && errno == EINTR) {
    }
    program->pid = 0;
}
