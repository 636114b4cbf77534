/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN walks though it is not what its controller takes it for: a heavier torso, softer springs.
 * The plant's robot is changed, the task keeps its own model of it.
 */
#include "base/array.h"
#include "sim/simulator.h"
#include "tests/test.h"

#include <math.h>
#include <string.h>

enum { JOINTS_MAX = 64, BODIES_MAX = 64, SECONDS = 14 };

#define SOFT_NM_RAD 1000 /* softer ones are springs, stiffer ones gears */

struct unlike {
    double torso, spring; /* factors */
    struct robot robot;
    struct robot_joint joint[JOINTS_MAX];
    struct robot_body body[BODIES_MAX];
    struct rig rig;
};

static void change_robot(struct unlike *u, const struct rig *rig)
{
    size_t changed = 0;

    u->rig = *rig;
    u->robot = *rig->robot;
    assert_true(u->robot.njoint <= JOINTS_MAX && u->robot.nbody <= BODIES_MAX);
    memcpy(u->joint, u->robot.joint, u->robot.njoint * sizeof *u->joint);
    memcpy(u->body, u->robot.body, u->robot.nbody * sizeof *u->body);
    for (size_t i = 0; i < u->robot.njoint; i++) {
        if (u->joint[i].sea.Ks < SOFT_NM_RAD) {
            u->joint[i].sea.Ks *= u->spring;
            changed++;
        }
    }
    assert_true(changed >= 6);
    for (size_t i = 0; i < u->robot.nbody; i++) {
        if (strcmp(u->body[i].name, "DWYTorso") == 0) {
            struct robot_inertia *inertia = &u->body[i].inertia;

            u->robot.total_mass += (u->torso - 1) * inertia->mass;
            inertia->mass *= u->torso;
            for (size_t k = 0; k < ARRAY_COUNT(inertia->I); k++) {
                inertia->I[k] *= u->torso;
            }
            changed = 0;
        }
    }
    assert_int_equal(changed, 0);
    u->robot.joint = u->joint;
    u->robot.body = u->body;
    u->rig.robot = &u->robot;

    /* The compiled equations are those of the file's masses; springs are none of theirs */
    if (u->torso != 1) {
        u->rig.dynamics = RIG_DYNAMICS_GENERIC;
    }
}

static void walks(double torso, double spring, bool on)
{
    static struct unlike u;
    struct simulator_config config = {
        .clock = LOOP_CLOCK_FREE,
        .transport = TRANSPORT_LOCAL,
        .ticks = SECONDS * 1000,
        .task = "walk",
    };
    struct task_runner_status status;
    struct simulator *simulator;
    struct realtime_report report;
    const struct body_motion *pelvis;
    const struct rig *rig;
    struct arena arena;
    struct error error;
    char notice[256];

    u = (struct unlike){.torso = torso, .spring = spring};
    assert_int_equal(arena_init(&arena, 1 << 28, &error), ERROR_NONE);
    assert_int_equal(rig_load(HIL_SOURCE_DIR "/config/rigs/walk-flat.yaml", &arena, &rig, &error),
                     ERROR_NONE);
    change_robot(&u, rig);
    config.rig = &u.rig;
    config.hold = rig->hold;
    assert_int_equal(simulator_create(&config, &arena, &simulator, notice, &error), ERROR_NONE);
    assert_int_equal(simulator_start(simulator, &report, &error), ERROR_NONE);
    simulator_run(simulator);
    task_runner_read(simulator_task_runner(simulator), &status);
    pelvis = plant_motion(simulator_plant(simulator));
    print_message("# torso %.2f, springs %.2f: %s; pelvis at %.2f %.2f %.2f m\n", torso, spring,
                  status.message, pelvis->p[0], pelvis->p[1], pelvis->p[2]);
    assert_int_equal(status.status == TASK_RUNNING, on);
    if (on) {
        assert_true(pelvis->p[2] > 0.42);
        assert_true(pelvis->p[0] > 0.8 && fabs(pelvis->p[1]) < 0.2);
    }
    simulator_destroy(simulator);
    arena_fini(&arena);
}

TEST(walks_with_a_heavier_torso)
{
    walks(1.1, 1, true);
}

TEST(walks_on_softer_springs)
{
    walks(1, 0.8, true);
}

TEST(but_not_on_springs_of_a_third)
{
    walks(1, 0.33, false);
}
