/* SPDX-License-Identifier: Apache-2.0 */
/* Runs scenarios in parallel. Each has its own process, with a limit of processor time. */
#include "app/scenario/jobs.h"

#include "base/whole_file.h"
#include "rt/clock.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

enum {
    PARALLEL_MAX = 256,
    LOOK_MS = 500, /* period of checks of processor times */
    STALL_S = 60,  /* without processor time for this long, a process has deadlocked */
};

/* A slot: a child process that runs a job. */
struct process {
    struct scenario_job *job; /* NULL = the slot is free */
    pid_t pid;
    int pipe;   /* read end of the pipe for the outcome */
    size_t got; /* received bytes of the outcome */
    struct scenario_outcome outcome;
    int64_t begin_ns;
    clockid_t cpu;                /* clock of the process's processor time */
    int64_t computed_ns, seen_ns; /* processor time at the last check; time of its last increase */
};

/* The slots of all running jobs. */
struct pool {
    const struct scenario_jobs_options *options;
    struct clock *time;
    struct process process[PARALLEL_MAX];
    size_t running;
};

/* ---- in the process ---- */

/* Runs a job in this process. A failed run is repeated with the recorder on. In virtual time, the
 * repeat is identical. If its hash differs, the outcome is invalid. If only the recording fails,
 * the outcome stays valid. */
static void job_run_here(const struct scenario_job *job, const struct scenario_jobs_options *jobs,
                         struct scenario_outcome *outcome)
{
    struct scenario_options options = {
        .mutation = job->mutation,
        .seed_given = job->seed_given,
        .seed = job->seed,
        .to_the_end = jobs->to_the_end,
        .program = jobs->program,
        .scratch = job->scratch,
    };
    struct scenario_outcome *again;
    struct error error;

    scenario_run(job->scenario, &options, outcome);
    if (scenario_passed(outcome) || !outcome->ran || !job->record[0]) {
        return;
    }

    /* Record only the repeat, because most runs pass and need no files */
    if (folder_make_all(job->record, &error)) {
        snprintf(outcome->unrecorded, sizeof outcome->unrecorded, "%.200s", error.text);
        return;
    }
    again = calloc(1, sizeof *again);
    if (!again) {
        return;
    }
    options.record = job->record;
    scenario_run(job->scenario, &options, again);

    /* The same input must give a bit-identical result */
    memcpy(outcome->unrecorded, again->unrecorded, sizeof outcome->unrecorded);
    if (again->ran ? again->state_hash != outcome->state_hash : !again->unrecorded[0]) {
        outcome->ran = false;
        snprintf(outcome->text, sizeof outcome->text, "the recorded repeat %.200s",
                 again->ran ? "differs: the run does not depend on its input alone" : again->text);
    }
    free(again);
}

/* ---- the pool ---- */

/* Starts a job in a process. */
static enum error_code job_start(struct pool *pool, struct scenario_job *job, struct error *error)
{
    struct process *process = pool->process;
    pid_t parent = getpid();
    int ends[2];

    /* Find a free slot; the caller has checked that one exists */
    while (process->job) {
        process++;
    }
    if (pipe(ends)) {
        return error_set_errno(error, errno, "cannot make a pipe for a scenario");
    }

    /* Flush first; otherwise both processes would write the buffered output */
    fflush(NULL);
    process->pid = fork();
    if (process->pid < 0) {
        int reason = errno;

        close(ends[0]);
        close(ends[1]);
        return error_set_errno(error, reason, "cannot make a process for a scenario");
    }
    if (process->pid == 0) {
        close(ends[0]);

        /* Run a job in a child process, send the outcome through the pipe, and end the
         * process */
        static struct scenario_outcome outcome;
        const char *from = (const char *)&outcome;
        size_t left = sizeof outcome;

        /* End this child when its parent ends, also if the parent died before this call */
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent) {
            _exit(EXIT_FAILURE);
        }
        job_run_here(job, pool->options, &outcome);
        while (left > 0) {
            ssize_t n = write(ends[1], from, left);

            if (n < 0 && errno != EINTR) {
                _exit(EXIT_FAILURE);
            }
            from += n > 0 ? n : 0;
            left -= n > 0 ? (size_t)n : 0;
        }
        _exit(EXIT_SUCCESS);
    }
    close(ends[1]);
    process->job = job;
    process->pipe = ends[0];
    process->got = 0;
    process->begin_ns = process->seen_ns = clock_now(pool->time);
    process->computed_ns = -1;
    if (clock_getcpuclockid(process->pid, &process->cpu)) {
        process->cpu = CLOCK_PROCESS_CPUTIME_ID; /* the process has already ended */
    }
    pool->running++;
    return ERROR_NONE;
}

/* Finishes a job. If why is NULL, its process has ended. Otherwise kills the process, and reports
 * why. */
static void job_end(struct pool *pool, struct process *process, const char *why)
{
    struct scenario_job *job = process->job;
    int status = 0;

    if (why) {
        kill(process->pid, SIGKILL);
    }
    close(process->pipe);
    while (waitpid(process->pid, &status, 0) < 0 && errno == EINTR) {
    }
    if (!why && process->got == sizeof process->outcome) {
        job->outcome = process->outcome;
    } else if (why) {
        snprintf(job->outcome.text, sizeof job->outcome.text, "%s", why);
    } else {
        snprintf(job->outcome.text, sizeof job->outcome.text, "the process died%s%s",
                 WIFSIGNALED(status) ? " of: " : "",
                 WIFSIGNALED(status) ? strsignal(WTERMSIG(status)) : "");
    }
    job->seconds = (double)(clock_now(pool->time) - process->begin_ns) * 1e-9;
    job->ended = true;
    process->job = NULL;
    pool->running--;
}

/* Ends a process that has exceeded its scenario's processor time. Also ends a process that has used
 * none for STALL_S, because it must have deadlocked. */
static void job_check_time(struct pool *pool, struct process *process)
{
    const double limit_s = process->job->scenario->cpu_limit_s;
    int64_t now_ns = clock_now(pool->time), computed_ns;
    struct timespec cpu;
    char why[64];

    if (clock_gettime(process->cpu, &cpu)) {
        return; /* it has just ended */
    }
    computed_ns = (int64_t)cpu.tv_sec * 1000000000 + cpu.tv_nsec;
    if (computed_ns > process->computed_ns) {
        process->computed_ns = computed_ns;
        process->seen_ns = now_ns;
    }
    if ((double)computed_ns > limit_s * 1e9) {
        snprintf(why, sizeof why, "no end after %g s of processor time", limit_s);
        job_end(pool, process, why);
    } else if (now_ns - process->seen_ns > STALL_S * CLOCK_SECOND) {
        snprintf(why, sizeof why, "it has computed nothing for %d s", STALL_S);
        job_end(pool, process, why);
    }
}

/* Waits for data from the processes, at most LOOK_MS, and checks the processes' times. */
static void jobs_attend(struct pool *pool)
{
    struct pollfd fd[PARALLEL_MAX];
    size_t count = 0;

    for (size_t i = 0; i < pool->options->parallel; i++) {
        struct process *process = &pool->process[i];

        fd[count++] = (struct pollfd){.fd = process->job ? process->pipe : -1, .events = POLLIN};
    }
    poll(fd, count, LOOK_MS);
    for (size_t i = 0; i < count; i++) {
        struct process *process = &pool->process[i];

        if (process->job && fd[i].revents) {
            unsigned char *to = (unsigned char *)&process->outcome;
            ssize_t n =
                read(process->pipe, to + process->got, sizeof process->outcome - process->got);

            /* Read available bytes of a process's outcome. Finish the job when the outcome is
             * complete or the pipe is closed. */
            if (n > 0) {
                process->got += (size_t)n;
            }
            if (n == 0 || (n < 0 && errno != EINTR) || process->got == sizeof process->outcome) {
                job_end(pool, process, NULL);
            }
        } else if (process->job) {
            job_check_time(pool, process);
        }
    }
}

enum error_code scenario_jobs_run(struct scenario_job *job, size_t count,
                                  const struct scenario_jobs_options *given, struct error *error)
{
    struct scenario_jobs_options options = *given;
    struct pool *pool = calloc(1, sizeof *pool);
    enum error_code code = ERROR_NONE;
    size_t started = 0, told = 0;

    if (!pool) {
        return error_set(error, ERROR_MEMORY, "no memory left for running scenarios");
    }
    options.parallel = options.parallel < 1 ? 1 : options.parallel;
    options.parallel = options.parallel > PARALLEL_MAX ? PARALLEL_MAX : options.parallel;
    pool->options = &options;
    pool->time = clock_monotonic();

    /* Keep all slots busy. Report in array order, although jobs end in any order */
    while (!code && told < count) {
        while (!code && started < count && pool->running < options.parallel) {
            code = job_start(pool, &job[started], error);
            started += !code;
        }
        if (!code) {
            jobs_attend(pool);
        }
        for (; told < started && job[told].ended; told++) {
            options.ended(options.context, &job[told]);
        }
    }

    /* After an error, end the jobs that still run */
    for (size_t i = 0; i < options.parallel; i++) {
        if (pool->process[i].job) {
            job_end(pool, &pool->process[i], "not finished");
        }
    }
    free(pool);
    return code;
}
