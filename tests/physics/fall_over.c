/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Falls that have a cause: COMAN stands and is pushed over on level ground, or is dropped on the
 * bump of walk-bump-9cm, which is a mesh. Without power it comes to lie with nothing in the ground,
 * its joints within their stops; what it has stored never grows, and that it fell is told once.
 */
#include <math.h>
#include <stdio.h>

#include "model/stop.h"
#include "sim/watch.h"
#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"
#include "tests/test.h"

enum { MS = 1000000, STAND_MS = 300, PUSH_MS = 100, FALL_MS = 3000, REST_MS = 200 };

#define PUSH_N 300.0

/* What a fall was like. */
struct tumble {
    double resting;   /* deepest of any surface in the world at the end, m */
    const char *what; /* was */
    double growth;    /* of what is stored, within a millisecond, J */
    double past;      /* of any joint past its limit, rad */
    int fell;         /* how often it was told */
};

static void note_depth(const struct rig_scene *scene, struct tumble *tumble)
{
    const struct contact_config *contact = &scene->rig->contact;
    struct contact_patch patch[64];
    size_t count = plant_patches(scene->plant, patch, 64);

    assert_in_range(count, 1, 64);
    for (size_t i = 0; i < count; i++) {
        const struct contact_pair *pair = &contact->pair[patch[i].pair];
        const struct contact_surface *a = &contact->surface[pair->a];
        const struct contact_surface *b = &contact->surface[pair->b];

        if ((a->body < 0 || b->body < 0) && patch[i].penetration_m > tumble->resting) {
            tumble->resting = patch[i].penetration_m;
            tumble->what = a->body < 0 ? b->name : a->name;
        }
    }
}

static void note_joints(const struct rig_scene *scene, struct tumble *tumble)
{
    size_t count;
    const struct robot *robot = scene->robot;
    const double *q = plant_state(scene->plant, &count) + robot->nq - robot->njoint;

    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];

        tumble->past = fmax(tumble->past, fabs(stop_depth(joint->lower, joint->upper, q[j])));
    }
}

static void note_falls(struct watch *watch, int64_t now_ns, struct tumble *tumble)
{
    struct watch_event event;

    watch_step(watch, now_ns);
    while (watch_next_event(watch, &event)) {
        tumble->fell += event.kind >= WATCH_TILT;
    }
}

static void step_one_ms(const struct rig_scene *scene)
{
    if (plant_step(scene->plant, scene->steps)) {
        fail_msg("%s", plant_failure(scene->plant));
    }
    assert_int_equal(plant_sample(scene->plant), ERROR_NONE);
}

/* Lets go of the robot, which the watch has seen until now. */
static void let_fall(struct rig_scene *scene, struct watch *watch, int64_t now_ns,
                     struct tumble *tumble)
{
    struct plant_command *command = plant_command(scene->plant);
    struct plant_energy energy;
    double before = INFINITY;

    for (size_t j = 0; j < scene->robot->njoint; j++) {
        command->motor[j].bridge_on = false;
        command->motor[j].voltage_v = 0.0;
    }
    for (int ms = 0; ms < FALL_MS; ms++) {
        step_one_ms(scene);
        now_ns += MS;
        assert_int_equal(plant_energy(scene->plant, &energy), ERROR_NONE);
        tumble->growth = fmax(tumble->growth, energy.stored - before);
        before = energy.stored;
        note_joints(scene, tumble);
        note_falls(watch, now_ns, tumble);
        if (ms >= FALL_MS - REST_MS) {
            note_depth(scene, tumble);
        }
    }
}

static void assert_lies(const char *how, const struct tumble *tumble)
{
    print_message("# %s: %.2f mm deep at rest (%s), stored grew by %.1e J in a millisecond at "
                  "most, %.4f rad past a limit\n",
                  how, 1e3 * tumble->resting, tumble->what, tumble->growth, tumble->past);
    assert_true(tumble->resting > 0.0 && tumble->resting < 5e-3);
    assert_true(tumble->growth < 1e-3);
    assert_true(tumble->past < 0.02);
    assert_int_equal(tumble->fell, 1);
}

static struct watch *open_scene(struct rig_scene *scene, const char *file)
{
    const struct rig_scene_choice choice = {
        .file = file, .integrator = PLANT_IMPLICIT, .substep_ns = MS};
    struct watch *watch;
    struct error error = {0};

    rig_scene_init(scene, &choice);
    assert_int_equal(plant_sample(scene->plant), ERROR_NONE);
    assert_int_equal(watch_create(scene->rig, scene->plant, &scene->arena, &watch, &error),
                     ERROR_NONE);
    return watch;
}

/* It stands by its motors, is pushed at the trunk from each side, and its motors go off. */
TEST(a_robot_that_is_pushed_over_comes_to_lie)
{
    static const double way[4][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0.6, -0.8, 0}};
    static const char *const how[4] = {"forward", "backward", "to the left", "to the right"};

    for (int k = 0; k < 4; k++) {
        static struct rig_scene scene;
        struct watch *watch = open_scene(&scene, "coman.yaml");
        struct tumble tumble = {.what = "nothing"};
        double force[3] = {PUSH_N * way[k][0], PUSH_N * way[k][1], 0}, none[3] = {0, 0, 0};
        int body = robot_find_body(scene.robot, "DWYTorso");
        int64_t now_ns = 0;

        assert_true(body >= 0);
        rig_scene_settle(&scene);
        for (int ms = 0; ms < STAND_MS + PUSH_MS; ms++) {
            plant_set_push(scene.plant, body, ms < STAND_MS ? none : force, none);
            rig_scene_hold(&scene);
            now_ns += MS;
            note_falls(watch, now_ns, &tumble);
        }
        plant_set_push(scene.plant, body, none, none);
        let_fall(&scene, watch, now_ns, &tumble);
        assert_lies(how[k], &tumble);
        rig_scene_fini(&scene);
    }
}

/* Onto the rough slopes of the bump, from 5 cm above it, turned about the vertical. */
TEST(a_robot_that_falls_on_a_bump_comes_to_lie_on_it)
{
    static const double place[2][3] = {{0.8, 0.0, 0.0}, {1.7, -0.4, -1.5}};

    for (int k = 0; k < 2; k++) {
        static struct rig_scene scene;
        struct watch *watch = open_scene(&scene, "walk-bump-9cm.yaml");
        struct tumble tumble = {.what = "nothing"};
        const double *base = scene.rig->base_position;
        const double position[3] = {place[k][0], place[k][1], base[2] + 0.15};
        const double quaternion[4] = {cos(place[k][2] / 2), 0, 0, sin(place[k][2] / 2)};

        assert_int_equal(plant_reset(scene.plant, position, quaternion, scene.rig->joint),
                         ERROR_NONE);
        assert_int_equal(plant_restart_energy(scene.plant), ERROR_NONE);
        let_fall(&scene, watch, 0, &tumble);
        assert_lies("on the bump", &tumble);
        rig_scene_fini(&scene);
    }
}
