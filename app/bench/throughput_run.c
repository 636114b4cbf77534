/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One round of the throughput of a rig. Everything runs in processes of its own, so that this one
 * stays small: what Linux tells of a process' memory counts what it was forked from.
 */
#include "app/bench/throughput.h"

#include "app/bench/output.h"
#include "app/bench/timing.h"
#include "base/json_text.h"
#include "base/vec3.h"
#include "contact/contact.h"
#include "model/plant.h"
#include "rig/rig.h"
#include "sim/robot_dynamics.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/perf_event.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#define ARENA_BYTES ((size_t)512 << 20) /* address space */

enum { WARM_UP_STEPS = 100 }; /* steps that fill the caches before a robot alone is timed */

/* Springs in the joints of a robot that stands, N m/rad: so many times its weight by the height of
 * its base that an ankle carries what is above it. And how long they take to return, s: so damped
 * they are stable in MuJoCo too, which takes springs explicitly and dampers implicitly. */
static const double STANDING_STIFFNESS = 10.0, STANDING_RETURN_S = 0.1;

/* How far the base of one that stands may move, m. */
static const double STANDING_NEAR_M = 0.05;

/* ---- answers of a forked process ---- */

/* What a forked process finds, sent through a pipe as it is. */
struct throughput_answer {
    enum error_code code;
    struct error error;
    double cpu_s;
    char task[32], version[32];
    size_t nbus, nboard, naxis, nv;
    double tick_s, step_s;
};

/* What a forked process is to find, by the function find. */
struct throughput_question {
    const char *rig, *peers;
    double seconds;
    enum throughput_way way;
    void (*find)(const struct throughput_question *question, struct throughput_answer *answer);
};

/* Forks a process that finds the answer, and reads it; an error is the answer's own, or that the
 * process died. */
static enum error_code throughput_ask(const struct throughput_question *question,
                                      struct throughput_answer *answer, struct error *error)
{
    int end[2], status;
    ssize_t got;
    pid_t child;

    if (pipe2(end, O_CLOEXEC)) {
        return error_set_errno(error, errno, "cannot make a pipe");
    }

    /* Unwritten output would be written by both processes */
    fflush(NULL);
    child = fork();
    if (child == 0) {
        memset(answer, 0, sizeof *answer);
        question->find(question, answer);
        got = write(end[1], answer, sizeof *answer);
        _exit(got != (ssize_t)sizeof *answer);
    }
    close(end[1]);
    got = child < 0 ? 0 : read(end[0], answer, sizeof *answer);
    close(end[0]);
    if (child < 0) {
        return error_set_errno(error, errno, "cannot fork");
    }
    waitpid(child, &status, 0);
    if (got != (ssize_t)sizeof *answer) {
        return error_set(error, ERROR_SYSTEM, "a process that was to measure %s has died",
                         question->rig ? question->rig : "other simulators");
    }
    if (answer->code) {
        *error = answer->error;
    }
    return answer->code;
}

/* Finds what a rig's file says; runs in the forked process. */
static void throughput_find_rig(const struct throughput_question *question,
                                struct throughput_answer *answer)
{
    const struct rig *rig;
    struct arena arena;

    if ((answer->code = arena_init(&arena, ARENA_BYTES, &answer->error)) ||
        (answer->code = rig_load(question->rig, &arena, &rig, &answer->error))) {
        return;
    }
    snprintf(answer->task, sizeof answer->task, "%s",
             rig->walk           ? "walk"
             : rig->grasp.nphase ? "grasp"
                                 : "hold");
    answer->nbus = rig->nbus;
    answer->nboard = rig->boards.nboard;
    answer->naxis = rig->naxis;
    answer->nv = rig->robot->nv;
    answer->tick_s = 1e-9 * (double)rig->tick_ns;
    answer->step_s = 1e-9 * (double)rig->substep_ns;
}

enum error_code throughput_read_rig(struct throughput_rig *rig, struct error *error)
{
    static const char *const tasks[] = {"walk", "grasp", "hold"};
    const struct throughput_question question = {.rig = rig->rig, .find = throughput_find_rig};
    struct throughput_answer answer;
    enum error_code code = throughput_ask(&question, &answer, error);

    if (code) {
        return code;
    }
    for (size_t i = 0; !rig->task && i < 3; i++) {
        rig->task = strcmp(tasks[i], answer.task) == 0 ? tasks[i] : NULL;
    }
    rig->nbus = answer.nbus;
    rig->nboard = answer.nboard;
    rig->naxis = answer.naxis;
    rig->nv = answer.nv;
    rig->tick_s = answer.tick_s;
    rig->step_s = answer.step_s;
    return ERROR_NONE;
}

/* ---- the robot alone ---- */

/* A robot of which nothing is left but its bodies and joints, and where it stands, springs in these
 * and the pairs of its feet with the ground. */
struct throughput_alone {
    const struct rig *rig;
    struct robot *robot;
    struct contact_config contact;
    bool standing;
};

/* Keeps the pairs of a robot's surfaces with level ground. */
static enum error_code throughput_keep_feet(struct throughput_alone *alone, struct arena *arena,
                                            struct error *error)
{
    const struct contact_config *all = &alone->rig->contact;
    struct contact_pair *pair = arena_alloc(arena, all->npair + 1, sizeof *pair);

    if (!pair) {
        return error_set(error, ERROR_MEMORY, "no memory for the feet");
    }
    alone->contact = *all;
    alone->contact.pair = pair;
    alone->contact.npair = 0;
    for (size_t i = 0; i < all->npair; i++) {
        const struct contact_surface *a = &all->surface[all->pair[i].a];
        const struct contact_surface *b = &all->surface[all->pair[i].b];

        if ((a->shape == CONTACT_HALF_SPACE && b->body >= 0) ||
            (b->shape == CONTACT_HALF_SPACE && a->body >= 0)) {
            pair[alone->contact.npair++] = all->pair[i];
        }
    }
    return ERROR_NONE;
}

/* Returns the stiffness of the joints' springs where the robot stands. */
static double throughput_stiffness(const struct throughput_alone *alone)
{
    double mass = 0.0;

    for (size_t b = 0; b < alone->robot->nbody; b++) {
        mass += alone->robot->body[b].inertia.mass;
    }
    return STANDING_STIFFNESS * mass * vec3_norm(alone->robot->gravity) *
           fabs(alone->rig->base_position[2]);
}

/* Loads the rig and makes such a robot of its own; for one that is to stand, its pairs: none when
 * it is fixed, has no such feet, or other bodies are about. */
static enum error_code throughput_strip(const struct throughput_question *question,
                                        struct arena *arena, struct throughput_alone *alone,
                                        struct error *error)
{
    enum error_code code = rig_load(question->rig, arena, &alone->rig, error);
    double stiffness;

    (void)(code || (code = robot_copy(alone->rig->robot, arena, &alone->robot, error)));
    alone->standing = question->way == WAY_STANDING || question->way == WAY_STANDING_EULER;
    stiffness = code ? 0.0 : throughput_stiffness(alone);
    for (size_t j = 0; !code && j < alone->robot->njoint; j++) {
        struct robot_joint *joint = &alone->robot->joint[j];

        joint->sea = (struct robot_sea){0};
        joint->hydraulic = (struct robot_hydraulic){0};
        joint->spring = (struct robot_parallel_spring){0};
        joint->passive = (struct robot_passive){0};
        joint->stop = (struct robot_stop){0};
        if (alone->standing) {
            joint->passive = (struct robot_passive){stiffness, STANDING_RETURN_S * stiffness,
                                                    alone->rig->joint[j]};
        }
    }
    if (code) {
        return code;
    }
    alone->robot->ncoupling = 0;
    alone->robot->hydraulic_supply = (struct robot_hydraulic_supply){0};
    return alone->standing && alone->robot->floating && !alone->rig->nfree
               ? throughput_keep_feet(alone, arena, error)
               : ERROR_NONE;
}

/* Creates our plant of such a robot in the rig's pose. */
static enum error_code throughput_make_plant(const struct throughput_alone *alone,
                                             struct arena *arena, struct plant **plant,
                                             struct error *error)
{
    const struct rig *rig = alone->rig;
    struct symbolic_library library;
    struct dynamics *dynamics = arena_alloc(arena, 1, sizeof *dynamics);
    struct plant_config config = {.robot = alone->robot,
                                  .dynamics = dynamics,
                                  .integrator = PLANT_IMPLICIT,
                                  .substep_ns = rig->substep_ns,
                                  .supply_v = rig->supply_v};
    struct error notice;
    enum error_code code;

    if (!dynamics) {
        return error_set(error, ERROR_MEMORY, "no memory for the dynamics");
    }
    code = robot_dynamics_fastest(alone->robot, arena, dynamics, &library, &notice, error);
    if (!code && alone->contact.npair) {
        config.contact_body = rig->contact_body;
        config.ncontact = rig->contact.nbody;
        code = contact_native_create(&alone->contact, arena, &config.contact, error);
    }
    (void)(code || (code = plant_create(&config, arena, plant, error)));
    if (!code && plant_reset(*plant, rig->base_position, rig->base_quaternion, rig->joint)) {
        code = error_set(error, ERROR_UNSUPPORTED, "%s: no start", rig->file);
    }
    return code;
}

/* Returns whether a robot that stands has its base near where the rig has it. */
static bool throughput_stood(const struct throughput_alone *alone, const struct plant *plant)
{
    size_t count;
    const double *position = plant_values(plant, &count) + BASE_Q_POSITION;
    bool near = true;

    for (int k = 0; alone->standing && k < 3; k++) {
        near = near && fabs(position[k] - alone->rig->base_position[k]) < STANDING_NEAR_M;
    }
    return near;
}

/* Times our plant of such a robot, as throughput_time_mujoco does MuJoCo. */
static void throughput_time_ours(const struct throughput_question *question,
                                 struct throughput_answer *answer)
{
    struct throughput_alone alone = {0};
    struct plant *plant;
    struct arena arena;
    double begin;

    answer->cpu_s = NAN;
    if ((answer->code = arena_init(&arena, ARENA_BYTES, &answer->error)) ||
        (answer->code = throughput_strip(question, &arena, &alone, &answer->error)) ||
        (alone.standing && !alone.contact.npair) ||
        (answer->code = throughput_make_plant(&alone, &arena, &plant, &answer->error))) {
        return;
    }

    /* Fill the caches, begin again, and time the steps that count */
    plant_step(plant, WARM_UP_STEPS);
    plant_reset(plant, alone.rig->base_position, alone.rig->base_quaternion, alone.rig->joint);
    begin = bench_cpu_s();
    if (!plant_step(plant,
                    (size_t)llround(question->seconds * 1e9 / (double)alone.rig->substep_ns)) &&
        throughput_stood(&alone, plant)) {
        answer->cpu_s = bench_cpu_s() - begin;
    }
}

/* ---- MuJoCo ---- */

/* Returns the engine of the module that can step, which is MuJoCo; NULL when there is none. */
static const struct peer_dynamics *throughput_stepper(const struct peers *peers)
{
    for (size_t i = 0; peers && i < peers->ndynamics; i++) {
        if (peers->dynamics[i].step) {
            return &peers->dynamics[i];
        }
    }
    return NULL;
}

/* Finds the version of MuJoCo; runs in the forked process. */
static void throughput_ask_mujoco(const struct throughput_question *question,
                                  struct throughput_answer *answer)
{
    const struct peer_dynamics *peer;
    struct peers_library library;

    answer->code = bench_peers(question->peers, "MuJoCo is left out", &library, &answer->error);
    peer = answer->code ? NULL : throughput_stepper(library.peers);
    if (peer) {
        snprintf(answer->version, sizeof answer->version, "%s", peer->version);
    }
}

enum error_code throughput_find_mujoco(const char *path, char version[32], struct error *error)
{
    const struct throughput_question question = {.peers = path, .find = throughput_ask_mujoco};
    struct throughput_answer answer;
    enum error_code code = throughput_ask(&question, &answer, error);

    snprintf(version, 32, "%s", code ? "" : answer.version);
    return code;
}

/* Times MuJoCo with the robot alone in the rig's pose: bodies alone fall where they float, and
 * swing where they are fixed. Runs in the forked process. */
static void throughput_time_mujoco(const struct throughput_question *question,
                                   struct throughput_answer *answer)
{
    struct throughput_alone alone = {0};
    const struct peer_dynamics *peer;
    struct peers_library library;
    const struct rig *rig;
    struct arena arena;
    char message[256];
    double *q, *v, *tau, begin, dt;
    void *engine = NULL;
    size_t base;
    bool good;

    answer->cpu_s = NAN;
    if ((answer->code = arena_init(&arena, ARENA_BYTES, &answer->error)) ||
        (answer->code = throughput_strip(question, &arena, &alone, &answer->error)) ||
        (alone.standing && !alone.contact.npair) ||
        (answer->code = peers_open(question->peers, &library, &answer->error))) {
        return;
    }
    rig = alone.rig;
    peer = throughput_stepper(library.peers);
    q = arena_alloc(&arena, rig->robot->nq, sizeof *q);
    v = arena_alloc(&arena, rig->robot->nv, sizeof *v);
    tau = arena_alloc(&arena, rig->robot->nv, sizeof *tau);
    if (peer && q && v && tau) {
        engine = alone.standing ? peer->create_standing(alone.robot, &alone.contact,
                                                        rig->contact_body, message, sizeof message)
                                : peer->create(alone.robot, message, sizeof message);
    }
    if (!engine) {
        answer->code = error_set(&answer->error, ERROR_UNSUPPORTED, "MuJoCo: %s: %s", question->rig,
                                 peer ? message : "no longer there");
        return;
    }

    /* Set the pose, step some times to fill the caches, then time the steps that count */
    base = rig->robot->nq - rig->robot->njoint;
    if (rig->robot->floating) {
        memcpy(q + BASE_Q_POSITION, rig->base_position, sizeof rig->base_position);
        memcpy(q + BASE_Q_QUATERNION, rig->base_quaternion, sizeof rig->base_quaternion);
    }
    memcpy(q + base, rig->joint, rig->robot->njoint * sizeof *q);
    dt = 1e-9 * (double)rig->substep_ns;
    peer->put(engine, 0, q, v, tau);
    peer->step(engine, 0, question->way == WAY_BODIES_IMPLICIT, dt, WARM_UP_STEPS);
    begin = bench_cpu_s();
    good = peer->step(engine, 0, question->way == WAY_BODIES_IMPLICIT, dt,
                      (size_t)llround(question->seconds / dt));
    answer->cpu_s = good ? bench_cpu_s() - begin : (double)NAN;
}

/* ---- cases ---- */

/* Opens a counter of user instructions of this process and its children; -1 where nothing counts
 * them. */
static int throughput_open_counter(void)
{
    struct perf_event_attr wanted = {
        .type = PERF_TYPE_HARDWARE,
        .size = sizeof wanted,
        .config = PERF_COUNT_HW_INSTRUCTIONS,
        .inherit = 1,
        .exclude_kernel = 1,
        .exclude_hv = 1,
    };

    return (int)syscall(SYS_perf_event_open, &wanted, 0, -1, -1, PERF_FLAG_FD_CLOEXEC);
}

/* Reports that a command failed, with the first line of its output. */
static enum error_code throughput_command_failed(const char *folder, const char *rig,
                                                 struct error *error)
{
    char path[PATH_MAX], line[256] = "";
    FILE *file;

    snprintf(path, sizeof path, "%s/said", folder);
    file = fopen(path, "r");
    if (file) {
        line[fread(line, 1, sizeof line - 1, file)] = '\0';
        line[strcspn(line, "\n")] = '\0';
        fclose(file);
    }
    return error_set(error, ERROR_INPUT, "%s: %s", rig, line);
}

/* Runs coman-hil test with its arguments in folder, waits for it, and measures its cost. */
static enum error_code throughput_run_test(const char *program, const char *folder, const char *rig,
                                           const char *const argument[4],
                                           struct throughput_cost *cost, struct error *error)
{
    int counter = throughput_open_counter(), status = 0, said;
    uint64_t count = 0;
    struct rusage used;
    pid_t child;

    fflush(NULL);
    child = fork();
    if (child == 0) {
        if (!chdir(folder) &&
            (said = open("said", O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600)) >= 0 &&
            dup2(said, STDOUT_FILENO) >= 0 && dup2(said, STDERR_FILENO) >= 0) {
            execl(program, "coman-hil", "test", argument[0], argument[1], argument[2], argument[3],
                  (char *)NULL);
        }
        _exit(127);
    }
    if (child > 0) {
        wait4(child, &status, 0, &used);
    }
    cost->instructions = counter >= 0 && read(counter, &count, sizeof count) == sizeof count
                             ? (double)count
                             : (double)NAN;
    if (counter >= 0) {
        close(counter);
    }
    if (child < 0 || (WIFEXITED(status) && WEXITSTATUS(status) == 127)) {
        return error_set(error, ERROR_SYSTEM, "cannot run %s", program);
    }
    if (!WIFEXITED(status) || WEXITSTATUS(status)) {
        return throughput_command_failed(folder, rig, error);
    }

    /* The child's usage includes the processes that it has waited for */
    cost->cpu_s = (double)(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                  1e-6 * (double)(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
    cost->resident_mb = 1024e-6 * (double)used.ru_maxrss;
    return ERROR_NONE;
}

/* Creates a file in a folder; NULL when it cannot. */
static FILE *throughput_create_file(const char *folder, const char *name)
{
    char path[PATH_MAX];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    return fopen(path, "w");
}

/* Writes a rig's name as a scenario in folder may state it. A file has to be below that folder, and
 * may name others beside its own: so the tree that it is in is linked there. */
static void throughput_name_rig(const char *rig, const char *folder, char name[PATH_MAX])
{
    char file[PATH_MAX], link[PATH_MAX], *parts[2] = {NULL, NULL};

    snprintf(name, PATH_MAX, "%s", rig);
    if (!realpath(rig, file)) {
        return;
    }

    /* The last two parts of the path, its folder and its name, and the tree before them */
    for (int k = 0; k < 2 && (parts[k] = strrchr(file, '/')); k++) {
        *parts[k]++ = '\0';
    }
    if (parts[1]) {
        snprintf(link, sizeof link, "%.4000s/tree", folder);
        (void)!symlink(file[0] ? file : "/", link);
        snprintf(name, PATH_MAX, "tree/%.2000s/%.2000s", parts[1], parts[0]);
    }
}

/* Writes the scenario, and a sweep over it: first THROUGHPUT_RANGE cases of one tick, then whole
 * ones. */
static enum error_code throughput_write_sweep(const struct throughput *all,
                                              const struct throughput_rig *rig, const char *folder,
                                              struct error *error)
{
    char name[PATH_MAX];
    FILE *scenario = throughput_create_file(folder, "case.yaml");
    FILE *sweep = throughput_create_file(folder, "sweep.yaml");
    int failed = !scenario || !sweep;

    throughput_name_rig(rig->rig, folder, name);
    if (scenario) {
        fputs("name: throughput\ndescription: A rig with its task.\nrig: ", scenario);
        json_text_put(name, scenario);
        fprintf(scenario,
                "\ntask: %s\nduration_s: ${duration_s}\nparameters:\n"
                "  duration_s: {values: [1]}\n  number: {values: [0]}\nexpectations:\n"
                "  - {name: the task goes on, signal: task.status, between: [0, 1]}\n",
                rig->task);
        failed |= fclose(scenario);
    }

    /* A number that changes nothing makes the samples of each duration */
    if (sweep) {
        fprintf(sweep,
                "name: throughput\nscenarios: [case.yaml]\nsamples: %d\nparameters:\n"
                "  duration_s: {grid: [%.9g, %.9g]}\n  number: {uniform: [0, 1]}\n",
                THROUGHPUT_RANGE, rig->tick_s, all->seconds);
        failed |= fclose(sweep);
    }
    return failed ? error_set(error, ERROR_SYSTEM, "%s: cannot be written", folder) : ERROR_NONE;
}

/* Removes the results, so that the cases run again. */
static void throughput_forget_results(const char *folder)
{
    char path[PATH_MAX];

    for (int number = 1; number <= THROUGHPUT_RANGE + 1; number++) {
        snprintf(path, sizeof path, "%s/cases.results/%d.json", folder, number);
        unlink(path);
    }
}

/* Checks that a case has passed: a robot that falls costs something else. */
static enum error_code throughput_check_case(const char *folder, const char *rig,
                                             struct error *error)
{
    char path[PATH_MAX], line[256] = "";
    FILE *file;

    snprintf(path, sizeof path, "%s/said", folder);
    file = fopen(path, "r");
    if (file) {
        line[fread(line, 1, sizeof line - 1, file)] = '\0';
        fclose(file);
    }
    return strstr(line, " passed") ? ERROR_NONE : throughput_command_failed(folder, rig, error);
}

enum error_code throughput_measure(const struct throughput *all, const struct throughput_rig *rig,
                                   const char *program, const char *folder, const char *peers,
                                   struct throughput_sample *sample, struct error *error)
{
    struct throughput_question question = {
        .rig = rig->rig, .peers = peers, .seconds = all->seconds};
    struct throughput_answer answer;
    struct throughput_cost planning;
    char whole[16], range[16];
    enum error_code code;

    /* The first cases are those of one tick; the next one is the first whole case */
    snprintf(whole, sizeof whole, "--case=%d", THROUGHPUT_RANGE + 1);
    snprintf(range, sizeof range, "--case=1-%d", THROUGHPUT_RANGE);
    throughput_forget_results(folder);
    (void)((code = throughput_write_sweep(all, rig, folder, error)) ||
           (code =
                throughput_run_test(program, folder, rig->rig,
                                    (const char *[4]){"--plan", "sweep.yaml", "--output", "cases"},
                                    &planning, error)) ||
           (code = throughput_run_test(program, folder, rig->rig,
                                       (const char *[4]){"--case=1", "cases"}, &sample->start,
                                       error)));
    if (code) {
        return code;
    }

    /* The first case ran alone; in the range it has to run again */
    throughput_forget_results(folder);
    (void)((code = throughput_run_test(program, folder, rig->rig,
                                       (const char *[4]){range, "cases", "--jobs=1"},
                                       &sample->range, error)) ||
           (code = throughput_run_test(program, folder, rig->rig, (const char *[4]){whole, "cases"},
                                       &sample->whole, error)) ||
           (code = throughput_check_case(folder, rig->rig, error)));

    /* The robot alone in all ways, MuJoCo's where there is one */
    for (int way = 0; !code && way < THROUGHPUT_WAYS; way++) {
        question.way = (enum throughput_way)way;
        question.find = way == WAY_BODIES || way == WAY_STANDING ? throughput_time_ours
                                                                 : throughput_time_mujoco;
        sample->way_s[way] = NAN;
        if (question.find == throughput_time_ours || all->mujoco) {
            code = throughput_ask(&question, &answer, error);
            sample->way_s[way] = answer.cpu_s;
        }
    }
    return code;
}
