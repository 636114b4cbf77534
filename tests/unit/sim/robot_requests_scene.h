/* SPDX-License-Identifier: Apache-2.0 */
/* A whole robot that takes requests from within its own thread, and a guest on its buses who notes
 * what is sent: for tests of rt/requests.h. */
#ifndef TESTS_UNIT_SIM_ROBOT_REQUESTS_SCENE_H
#define TESTS_UNIT_SIM_ROBOT_REQUESTS_SCENE_H

#include "base/hash.h"
#include "rt/requests.h"
#include "tests/rig_run.h"

enum { TICKS_MAX = 4000, FAULTS = 8 };

struct scene {
    const char *rig, *task;
    enum loop_clock clock;
    bool timed;      /* wires */
    bool generic;    /* numeric dynamics */
    bool simbody;    /* contact engine, with the integrator it can serve */
    bool no_contact; /* for scenes that are about something else */
    const char *fault[FAULTS];
    uint64_t at, span; /* the checkpoint, 0 = the start; how many ticks are compared */
    bool falls;        /* held by nothing */
    bool springs;      /* the robot has its parallel springs */
    const char *record;
};

/* What one pass through a tick gave. */
struct pass {
    uint64_t frames, count, plant, measured;
};

struct witness {
    const struct scene *scene;
    struct simulator *simulator;
    struct bus_ports ports;
    int64_t tick_ns;
    int64_t tick; /* that runs next; -1 = none has yet */
    struct pass first[TICKS_MAX], again[TICKS_MAX];
    struct pass *pass;
    int goes; /* how often it went back */
    uint64_t tickets;
    struct request_answer checkpoint;
    bool asked;
};

static inline void ask(struct witness *w, enum request_kind kind, size_t index)
{
    struct loop_request request = {.ticket = ++w->tickets, .kind = kind, .index = index};

    assert_true(requests_ask(simulator_requests(w->simulator), &request));
}

static inline uint64_t hash_measured(const struct plant_sensors *sensors)
{
    uint64_t hash =
        hash_bytes(HASH_START, sensors->motor, sensors->njoint * sizeof *sensors->motor);

    hash = hash_bytes(hash, sensors->ft, sensors->nft * sizeof *sensors->ft);
    return hash_bytes(hash, &sensors->imu, sizeof sensors->imu);
}

/* Everything that the tick before has sent */
static inline void note(struct witness *w, struct pass *pass)
{
    const struct rig *rig = simulator_configuration(w->simulator)->rig;

    *pass = (struct pass){.frames = HASH_START};
    for (size_t b = 0; b < rig->nbus; b++) {
        struct bus_frame frame[64];
        size_t count;

        while ((count = can_receive(w->ports.port[b], frame, 64)) > 0) {
            for (size_t i = 0; i < count; i++) {
                pass->frames = hash_bytes(pass->frames, &b, sizeof b);
                pass->frames = hash_bytes(pass->frames, &frame[i].id, sizeof frame[i].id);
                pass->frames = hash_bytes(pass->frames, frame[i].data, frame[i].len);
                pass->frames = hash_bytes(pass->frames, &frame[i].time_ns, sizeof(int64_t));
            }
            pass->count += count;
        }
    }
    pass->plant = plant_hash(simulator_plant(w->simulator));
    pass->measured = hash_measured(simulator_measured(w->simulator));
}

static inline void enable_springs(struct rig *rig)
{
    static struct robot robot;
    static struct robot_joint joint[64];

    assert_true(rig->robot->njoint <= 64);
    robot = *rig->robot;
    memcpy(joint, robot.joint, robot.njoint * sizeof *joint);
    robot.joint = joint;
    for (size_t j = 0; j < robot.njoint; j++) {
        joint[j].spring.enabled = joint[j].spring.present;
    }
    rig->robot = &robot;
}

static inline void open_scene(const struct scene *scene, struct witness *w, struct arena *arena,
                              struct rig *rig, const struct simulator_observer *observer,
                              uint64_t ticks, bool asked)
{
    struct simulator_config config = {
        .clock = scene->clock,
        .transport = TRANSPORT_LOCAL,
        .ticks = ticks,
        .task = scene->task,
        .observer = observer,
        .guests = 1,
        .requests = asked,
        .fault = scene->fault,
        .record = scene->record,
        .overwrite = true,
        .row_period_ns = 1000000,
    };

    memset(w, 0, sizeof *w);
    rig_run_load(scene->rig, arena, rig);
    rig->wire.timed = scene->timed;
    rig->dynamics = scene->generic ? RIG_DYNAMICS_GENERIC : rig->dynamics;
    if (scene->simbody) {
        rig->contact_engine = RIG_CONTACT_SIMBODY;
        rig->contact.friction = CONTACT_FRICTION_REGULARIZED;
        rig->integrator = PLANT_RK4;

        /* Without the robot's own surfaces, which follow those of the file: it has no capsules */
        rig->contact.npair = rig->nlisted_pair;
        while (rig->contact.surface[rig->contact.nsurface - 1].shape == CONTACT_CAPSULE) {
            rig->contact.nsurface--;
        }
    } else if (scene->no_contact) {
        rig_run_without_contact(rig);
    }
    if (scene->springs) {
        enable_springs(rig);
    }
    config.rig = rig;
    config.hold = scene->falls ? RIG_HOLD_NONE : rig->hold;
    config.settle = !scene->no_contact && !scene->simbody && rig->settle;
    while (config.nfault < FAULTS && scene->fault[config.nfault]) {
        config.nfault++;
    }
    w->scene = scene;
    w->tick_ns = rig->tick_ns;
    w->tick = -1;
    w->pass = w->first;
    w->simulator = rig_run_open(&config, arena, &w->ports);
}

static inline void close_scene(struct witness *w, struct arena *arena)
{
    rig_run_close(w->simulator, arena, &w->ports);
}

#endif
