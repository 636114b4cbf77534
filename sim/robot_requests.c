/* SPDX-License-Identifier: Apache-2.0 */
/* Executes requests on the parts of a robot: faults, tunables, pushes, checkpoints. */
#include "sim/robot_requests.h"

#include "base/ring.h"
#include "canbus/wire/wire.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { NAME_SIZE = 160 };

/* Largest noise factor, and pretension (m). */
#define NOISE_SCALE_MAX 1000.0
#define PRETENSION_MAX_M 1.0

/* Largest component of a push, N and N m. */
#define PUSH_MAX_N 1e6

enum tunable_kind { TUNE_SETTING, TUNE_PRETENSION, TUNE_SUPPLY, TUNE_NOISE, TUNE_TASK };

/* The parameter that a tunable sets. */
struct meaning {
    enum tunable_kind kind;
    size_t joint;              /* for TUNE_PRETENSION */
    size_t board, axis, index; /* for TUNE_SETTING; index also for TUNE_TASK */
};

struct robot_requests {
    struct robot_requests_config config;
    struct request_machine machine;
    struct checkpoint *checkpoint;
    struct tunable *tunable;
    struct meaning *meaning;
    size_t ntunable;
    unsigned char *bus_moment[CHECKPOINT_SLOTS][RIG_BUSES_MAX]; /* NULL = not a local bus */

    /* State that changes in virtual time */
    struct {
        uint64_t changes; /* changes of tunables that are not board settings */
        bool winding;     /* a winch is moving */
        bool pushing;     /* a push with a duration acts */
    } moving;
    int64_t *push_until; /* end of each body's push; 0 = until changed */
    double *pretension;  /* target of each joint's winch, m */
};

/* ---- pushes ---- */

/* Returns the number of bodies: the robot's, then free ones. */
static size_t robot_body_count(const struct robot_requests *s)
{
    return s->config.rig->robot->nbody + s->config.rig->nfree;
}

/* Checks that each component of a push is finite and within PUSH_MAX_N. */
static bool push_is_bounded(const double vector[3])
{
    for (int i = 0; i < 3; i++) {
        if (!(fabs(vector[i]) <= PUSH_MAX_N)) {
            return false;
        }
    }
    return true;
}

/* Pushes a body with force and moment (world frame). Without a duration, the push lasts until
 * changed. The shortest duration is a tick. */
static enum request_verdict robot_push_body(void *context, const struct loop_request *request,
                                            int64_t now_ns, double ended[2])
{
    struct robot_requests *s = context;
    int64_t tick_ns = s->config.rig->tick_ns, duration_ns = request->duration_ns;

    if (request->index >= robot_body_count(s) || duration_ns < 0 ||
        duration_ns > INT64_MAX - now_ns || !push_is_bounded(request->force_n) ||
        !push_is_bounded(request->moment_nm)) {
        return REQUEST_RANGE;
    }
    plant_push(s->config.plant, (int)request->index, ended);
    plant_set_push(s->config.plant, (int)request->index, request->force_n, request->moment_nm);
    s->moving.pushing = s->moving.pushing || duration_ns > 0;
    s->push_until[request->index] =
        duration_ns == 0 ? 0 : now_ns + (duration_ns > tick_ns ? duration_ns : tick_ns);
    return REQUEST_OK;
}

/* Returns the name of a body: the robot's first, then free ones. */
static const char *robot_body_name(void *context, size_t index)
{
    const struct robot_requests *s = context;
    const struct robot *robot = s->config.rig->robot;

    return index < robot->nbody ? robot->body[index].name
                                : s->config.rig->free[index - robot->nbody].name;
}

/* ---- checkpoints ---- */

/* Excludes a ring from checkpoints, because its reader, another thread, writes it too. */
static void hole_add_ring(struct span *hole, size_t *count, const struct ring *ring)
{
    hole[(*count)++] = (struct span){(void *)(uintptr_t)ring, sizeof *ring};
    hole[(*count)++] = (struct span){ring->slots, ring->slot_size * ((size_t)ring->mask + 1)};
}

/* Creates the checkpoint slots for all memory that changes in virtual time, except memory that
 * other threads write. */
static enum error_code robot_checkpoint_create(struct robot_requests *s, struct arena *arena,
                                               struct error *error)
{
    const struct robot_requests_config *config = &s->config;
    enum { OWN_SPANS = 3, OWN_HOLES = 5 };
    struct span *moving =
        arena_alloc(arena, config->nmoving + RIG_BUSES_MAX + OWN_SPANS, sizeof *moving);
    struct span *hole = arena_alloc(arena, config->nhole + OWN_HOLES, sizeof *hole);
    size_t nmoving = config->nmoving, nhole = config->nhole;

    if (!moving || !hole) {
        return error_set(error, ERROR_MEMORY, "no memory left for the requests");
    }

    /* Memory that changes: of the caller, of this executor, and of the wires */
    memcpy(moving, config->moving, nmoving * sizeof *moving);
    memcpy(hole, config->hole, nhole * sizeof *hole);
    moving[nmoving++] = (struct span){&s->moving, sizeof s->moving};
    moving[nmoving++] = (struct span){s->push_until, robot_body_count(s) * sizeof *s->push_until};
    moving[nmoving++] =
        (struct span){s->pretension, config->rig->robot->njoint * sizeof *s->pretension};
    for (size_t b = 0; b < config->rig->nbus; b++) {
        if (config->buses->wire[b]) {
            struct span *wire = &moving[nmoving++];

            wire->memory = wire_memory(config->buses->wire[b], &wire->size);
        }
    }

    /* Holes: memory that other threads write */
    hole_add_ring(hole, &nhole, boards_event_ring(config->boards));
    hole_add_ring(hole, &nhole, faults_event_ring(config->faults));

    /* The plant's memory of the last contact evaluation stays valid in any restored state, so it is
     * a hole */
    hole[nhole].memory = plant_contact_memory(config->plant, &hole[nhole].size);
    nhole++;
    return checkpoint_create(moving, nmoving, hole, nhole, CHECKPOINT_SLOTS, arena, &s->checkpoint,
                             error);
}

/* Allocates memory for the frames on local buses in each slot; returns false without memory. */
static bool robot_checkpoint_create_buses(struct robot_requests *s, struct arena *arena)
{
    for (size_t b = 0; b < s->config.rig->nbus; b++) {
        struct local_bus *bus = s->config.buses->bus[b];

        for (size_t slot = 0; bus && slot < CHECKPOINT_SLOTS; slot++) {
            s->bus_moment[slot][b] = arena_alloc(arena, 1, local_bus_save_size(bus));
            if (!s->bus_moment[slot][b]) {
                return false;
            }
        }
    }
    return true;
}

/* Saves the state to a slot: frames on local buses, then memory. */
static enum request_verdict robot_save(void *context, size_t slot)
{
    struct robot_requests *s = context;

    for (size_t b = 0; b < s->config.rig->nbus; b++) {
        if (s->bus_moment[slot][b] &&
            !local_bus_save(s->config.buses->bus[b], s->config.own, s->bus_moment[slot][b])) {
            return REQUEST_UNAVAILABLE;
        }
    }
    checkpoint_save(s->checkpoint, slot);
    return REQUEST_OK;
}

/* Restores the state of a slot: memory, frames on local buses, then the state of the ports. */
static void robot_restore(void *context, size_t slot)
{
    struct robot_requests *s = context;

    checkpoint_restore(s->checkpoint, slot);
    for (size_t b = 0; b < s->config.rig->nbus; b++) {
        if (s->bus_moment[slot][b]) {
            local_bus_restore(s->config.buses->bus[b], s->config.own, s->bus_moment[slot][b]);
        }
    }
    fault_injection_restored(s->config.injection);
}

/* ---- faults ---- */

/* Switches a fault; it acts from the coming tick on. */
static enum request_verdict robot_switch_fault(void *context, size_t index, bool on, int64_t now_ns)
{
    struct robot_requests *s = context;

    if (!faults_set(s->config.faults, now_ns, index, on)) {
        return REQUEST_RANGE;
    }
    fault_injection_step(s->config.injection, now_ns); /* takes effect in the coming tick */
    return REQUEST_OK;
}

/* ---- tunables ---- */

/* Returns the present value of a tunable. */
static double tunable_get(void *context, size_t index)
{
    const struct robot_requests *s = context;
    const struct meaning *meaning = &s->meaning[index];

    switch (meaning->kind) {
    case TUNE_SETTING:
        return boards_get(s->config.boards, meaning->board, meaning->axis, meaning->index);
    case TUNE_PRETENSION:
        return s->pretension[meaning->joint];
    case TUNE_SUPPLY:
        return plant_source(s->config.plant);
    case TUNE_NOISE:
        return sensing_noise_scale(s->config.sensing);
    case TUNE_TASK:
        return task_get(s->config.task, meaning->index);
    }
    return 0.0;
}

/* Sets a tunable; a pretension moves by its winch over several ticks. */
static enum request_verdict tunable_set(void *context, size_t index, double value)
{
    struct robot_requests *s = context;
    const struct meaning *meaning = &s->meaning[index];

    s->moving.changes++;
    switch (meaning->kind) {
    case TUNE_SETTING:
        return boards_set(s->config.boards, meaning->board, meaning->axis, meaning->index, value)
                   ? REQUEST_OK
                   : REQUEST_RANGE;
    case TUNE_PRETENSION:
        s->pretension[meaning->joint] = value;
        s->moving.winding = true;
        break;
    case TUNE_SUPPLY:
        plant_set_source(s->config.plant, value);
        break;
    case TUNE_NOISE:
        sensing_scale_noise(s->config.sensing, value);
        break;
    case TUNE_TASK:
        return task_set(s->config.task, meaning->index, value) ? REQUEST_OK : REQUEST_RANGE;
    }
    return REQUEST_OK;
}

/* Returns a count that changes whenever a tunable may have changed. */
static uint64_t tunable_changes(void *context)
{
    const struct robot_requests *s = context;

    return s->moving.changes + boards_settings_changes(s->config.boards) +
           (s->config.task ? task_changes(s->config.task) : 0);
}

/* Advances pushes and winches by a tick. */
static void robot_advance_requests(void *context, int64_t now_ns)
{
    struct robot_requests *s = context;

    if (s->moving.pushing) {
        /* Ends the pushes whose duration has passed */
        const double none[3] = {0.0, 0.0, 0.0};

        s->moving.pushing = false;
        for (size_t b = 0; b < robot_body_count(s); b++) {
            if (s->push_until[b] > 0 && now_ns >= s->push_until[b]) {
                s->push_until[b] = 0;
                plant_set_push(s->config.plant, (int)b, none, none);
            }
            s->moving.pushing = s->moving.pushing || s->push_until[b] > 0;
        }
    }
    if (s->moving.winding) {
        /* Moves each winch by at most its speed times a tick, so that the rope does not jerk */
        struct plant_command *command = plant_command(s->config.plant);
        double most = ROBOT_REQUESTS_WINCH_M_S * 1e-9 * (double)s->config.rig->tick_ns;

        s->moving.winding = false;
        for (size_t j = 0; j < command->njoint; j++) {
            double *is = &command->motor[j].pretension_m, left = s->pretension[j] - *is;

            if (fabs(left) > most) {
                *is += copysign(most, left);
                s->moving.winding = true;
            } else {
                *is = s->pretension[j];
            }
        }
    }
}

/* ---- functions that the loop calls ---- */

static uint64_t robot_hash_state(void *context)
{
    const struct robot_requests *s = context;

    return plant_hash(s->config.plant);
}

static void robot_publish(void *context, int64_t now_ns, const struct loop_stats *stats)
{
    const struct robot_requests *s = context;

    s->config.publish(s->config.context, now_ns, stats);
}

static void robot_pace(void *context, double speed, bool paused)
{
    const struct robot_requests *s = context;

    s->config.pace(s->config.context, speed, paused);
}

/* ---- creation ---- */

/* Adds a tunable and returns it; returns NULL in the counting pass, which has no memory yet. */
static struct tunable *tunable_add(struct robot_requests *s, struct meaning meaning)
{
    size_t index = s->ntunable++;

    if (!s->tunable) {
        return NULL;
    }
    s->meaning[index] = meaning;
    return &s->tunable[index];
}

/* Names a tunable "joint.JOINT.WHAT"; false = no memory. */
static bool tunable_name(struct tunable *tunable, struct arena *arena, const char *joint,
                         const char *what)
{
    char name[NAME_SIZE];

    snprintf(name, sizeof name, "joint.%s.%s", joint, what);
    tunable->name = arena_strdup(arena, name);
    return tunable->name != NULL;
}

/* Lists the settings of an axis's board; false = no memory. */
static bool tunable_list_axis(struct robot_requests *s, size_t board, size_t axis,
                              struct arena *arena)
{
    const struct board_config *config = &s->config.rig->boards.board[board];
    size_t count = boards_settings(s->config.boards, board, axis);

    for (size_t i = 0; i < count; i++) {
        struct meaning meaning = {.kind = TUNE_SETTING, .board = board, .axis = axis, .index = i};
        const char *joint = s->config.rig->robot->joint[config->axis[axis].joint].name;
        struct tunable *to = tunable_add(s, meaning);
        struct board_setting setting;

        if (to) {
            boards_setting(s->config.boards, board, axis, i, &setting);
            *to = (struct tunable){NULL, setting.unit, setting.min, setting.max, setting.whole};
            if (!tunable_name(to, arena, joint, setting.name)) {
                return false;
            }
        }
    }
    return true;
}

/* Lists the pretensions of the parallel springs; false = no memory. */
static bool tunable_list_springs(struct robot_requests *s, struct arena *arena)
{
    const struct robot *robot = s->config.rig->robot;
    bool good = true;

    for (size_t j = 0; good && j < robot->njoint; j++) {
        if (robot->joint[j].spring.present && robot->joint[j].spring.enabled) {
            struct tunable *to =
                tunable_add(s, (struct meaning){.kind = TUNE_PRETENSION, .joint = j});

            if (to) {
                *to = (struct tunable){NULL, "m", -PRETENSION_MAX_M, PRETENSION_MAX_M, false};
                good = tunable_name(to, arena, robot->joint[j].name, "pretension_m");
            }
        }
    }
    return good;
}

/* Lists the settings of the task. */
static void tunable_list_task(struct robot_requests *s)
{
    const struct task_setting *setting;
    size_t count = s->config.task ? task_settings(s->config.task, &setting) : 0;

    for (size_t i = 0; i < count; i++) {
        struct tunable *to = tunable_add(s, (struct meaning){.kind = TUNE_TASK, .index = i});

        if (to) {
            *to = (struct tunable){setting[i].name, setting[i].unit, setting[i].min, setting[i].max,
                                   setting[i].whole};
        }
    }
}

/* Lists all tunables; called once to count and once to fill them. Returns false without memory. */
static bool tunable_list_all(struct robot_requests *s, struct arena *arena)
{
    struct tunable *to;
    bool good = true;

    s->ntunable = 0;
    for (size_t b = 0; good && b < s->config.rig->boards.nboard; b++) {
        for (size_t axis = 0; good && axis < BOARD_AXES_MAX; axis++) {
            good = tunable_list_axis(s, b, axis, arena);
        }
    }
    good = good && tunable_list_springs(s, arena);
    to = tunable_add(s, (struct meaning){.kind = TUNE_SUPPLY});
    if (to) {
        *to = (struct tunable){"supply_v", "V", 0.0, 2.0 * s->config.rig->supply_v, false};
    }
    if (sensing_has_noise(s->config.sensing)) {
        to = tunable_add(s, (struct meaning){.kind = TUNE_NOISE});
        if (to) {
            *to = (struct tunable){"sensing.noise_scale", "", 0.0, NOISE_SCALE_MAX, false};
        }
    }
    tunable_list_task(s);
    return good;
}

/* Counts, allocates and lists the tunables; false = no memory. */
static bool robot_requests_create_tunables(struct robot_requests *s, struct arena *arena)
{
    tunable_list_all(s, arena);
    s->meaning = arena_alloc(arena, s->ntunable, sizeof *s->meaning);
    s->tunable = arena_alloc(arena, s->ntunable, sizeof *s->tunable);
    return s->meaning && s->tunable && tunable_list_all(s, arena);
}

enum error_code robot_requests_create(const struct robot_requests_config *config,
                                      struct arena *arena, struct robot_requests **out,
                                      struct requests **requests, struct error *error)
{
    struct robot_requests *s = arena_alloc(arena, 1, sizeof *s);
    enum error_code code;

    /* Initializes the state of the executor */
    if (s) {
        s->config = *config;
        s->push_until = arena_alloc(arena, robot_body_count(s), sizeof *s->push_until);
        s->pretension = arena_alloc(arena, config->rig->robot->njoint, sizeof *s->pretension);
    }
    if (!s || !s->push_until || !s->pretension || !robot_requests_create_tunables(s, arena) ||
        !robot_checkpoint_create_buses(s, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the requests");
    }

    /* The functions that the loop calls, then the rings for requests of other threads */
    s->machine = (struct request_machine){
        .context = s,
        .fault = robot_switch_fault,
        .push = robot_push_body,
        .set = tunable_set,
        .get = tunable_get,
        .changes = tunable_changes,
        .save = config->one_way ? NULL : robot_save,
        .restore = config->one_way ? NULL : robot_restore,
        .hash = robot_hash_state,
        .publish = robot_publish,
        .pace = config->pace ? robot_pace : NULL,
        .advance = robot_advance_requests,
        .body = robot_body_name,
        .nfault = faults_count(config->faults),
        .ntunable = s->ntunable,
        .tunable = s->tunable,
    };
    if (!config->one_way) {
        code = robot_checkpoint_create(s, arena, error);
        if (code) {
            return code;
        }
    }
    code = requests_create(&s->machine, arena, requests, error);
    if (code) {
        return code;
    }
    *out = s;
    return ERROR_NONE;
}
