/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What sensors and recordings see of contact with sticking friction is what it can exert:
 * surfaces never pull, friction is within its cone, in every millisecond of a walk and of falls;
 * and the peak of an impact is seen, though it falls between two ticks.
 */

#include "sim/simulator.h"
#include "tests/unit/arena_fixture.h"
#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

enum { MS = 1000000, PATCHES = 256, BODIES = 64, FALLS = 12, FALL_MS = 1200 };

/* Rounding of sums of wrenches, N. */
#define ROUNDING_N 1e-6

/* What was seen of pairs of a surface of the world, a half-space, and another. */
struct seen {
    size_t loaded, beyond, pulls; /* milliseconds of pairs */
    double steepest, pull; /* the largest T/N over mu beyond rounding, the strongest pull, N */
};

static void look_at_patches(struct plant *plant, const struct contact_config *contact,
                            struct seen *seen)
{
    struct contact_patch patch[PATCHES];
    size_t count = plant_patches(plant, patch, PATCHES);

    for (size_t i = 0; i < count; i++) {
        const struct contact_pair *pair = &contact->pair[patch[i].pair];
        const struct contact_surface *a = &contact->surface[pair->a];
        const struct contact_surface *b = &contact->surface[pair->b];
        const struct contact_surface *ground = a->body < 0 ? a : b;
        const double n[3] = {ground->rotation[2], ground->rotation[5], ground->rotation[8]};
        const double us = 2.0 * a->material.static_friction * b->material.static_friction /
                          (a->material.static_friction + b->material.static_friction);
        const double *f = patch[i].force;
        double normal, friction;

        if (ground->body >= 0 || ground->shape != CONTACT_HALF_SPACE || vec3_dot(f, f) == 0.0) {
            continue;
        }
        normal = vec3_dot(f, n) * (ground == a ? 1.0 : -1.0);
        friction = sqrt(fmax(0.0, vec3_dot(f, f) - normal * normal));
        seen->loaded++;
        seen->pulls += normal < -ROUNDING_N;
        seen->pull = fmax(seen->pull, -normal);
        if (friction > us * normal + ROUNDING_N) {
            seen->beyond++;
            seen->steepest =
                fmax(seen->steepest, normal > 0.0 ? friction / normal : (double)INFINITY);
        }
    }
}

static void expect_admissible(const char *what, const struct seen *seen)
{
    print_message("# %s: %zu loaded ms, %zu beyond the cone (T/N to %.2f), %zu pull (%.2f N)\n",
                  what, seen->loaded, seen->beyond, seen->steepest, seen->pulls, seen->pull);
    assert_true(seen->loaded > 1000);
    assert_int_equal(seen->beyond, 0);
    assert_int_equal(seen->pulls, 0);
}

/* ---- walk ---- */

struct walk {
    struct simulator *simulator;
    struct rig rig;
    struct seen seen;
};

static void watch_walk(void *context, int64_t now_ns)
{
    struct walk *w = context;

    (void)now_ns;
    look_at_patches(simulator_plant(w->simulator), &w->rig.contact, &w->seen);
}

TEST_WITH(a_walk_is_within_the_cone, open_arena, close_arena)
{
    static struct walk w;
    struct simulator_observer observer = {&w, watch_walk};
    struct simulator_config config = {
        .rig = &w.rig,
        .clock = LOOP_CLOCK_FREE,
        .transport = TRANSPORT_LOCAL,
        .ticks = 15000,
        .task = "walk",
        .observer = &observer,
    };
    struct walk_config walk;
    const struct rig *rig;
    struct realtime_report report;
    struct error error;
    char notice[256];

    assert_ok(rig_load(HIL_SOURCE_DIR "/config/rigs/coman-compact-imu.yaml", &arena, &rig, &error));
    w.rig = *rig;
    walk = *rig->walk;
    walk.begin_s = 2.5;
    walk.forward_m_s = 0.3;
    w.rig.walk = &walk;
    config.hold = rig->hold;
    assert_ok(simulator_create(&config, &arena, &w.simulator, notice, &error));
    assert_ok(simulator_start(w.simulator, &report, &error));
    simulator_run(w.simulator);
    expect_admissible("walk", &w.seen);
    simulator_destroy(w.simulator);
}

/* ---- falls ---- */

static struct rig_scene scene;

static void find_momentum(double p[3])
{
    const struct robot *robot = scene.robot;
    size_t count;
    const double *q = plant_values(scene.plant, &count);
    struct body_motion motion[BODIES];

    assert_true(robot->nbody <= BODIES);
    memset(p, 0, 3 * sizeof *p);
    scene.dynamics.ops->kinematics(&scene.dynamics, q, q + robot->nq, motion);
    for (size_t b = 0; b < robot->nbody; b++) {
        double arm[3], v[3];

        mat3_apply(motion[b].R, robot->body[b].inertia.com, arm);
        memcpy(v, motion[b].v, sizeof v);
        vec3_add_cross(motion[b].w, arm, v);
        vec3_add_scaled(p, robot->body[b].inertia.mass, v, p);
    }
}

/* Lets it fall, tilted and thrown by number; adds to seen, and to off by how much the impulses of
 * the forces at ticks and of their means are off that which it has received, N s. */
static void fall(int number, struct seen *seen, double off[2])
{
    const struct rig *rig = scene.rig;
    const double tilt = 0.25 * number, turn[4] = {cos(tilt / 2), sin(tilt / 2), 0.0, 0.0};
    const double position[3] = {0.0, 0.0, rig->base_position[2] + 0.2 + 0.01 * number};
    double before[3], after[3], impulse[2][3] = {{0.0}}, *rates;
    size_t count;

    assert_ok(plant_reset(scene.plant, position, turn, rig->joint));
    rates = plant_state(scene.plant, &count) + scene.robot->nq;
    rates[BASE_V_LINEAR + number % 2] = 2.0;
    rates[BASE_V_ANGULAR + number % 3] = 6.0;
    find_momentum(before);
    for (int k = 0; k < FALL_MS; k++) {
        assert_ok(plant_step(scene.plant, scene.steps));
        assert_ok(plant_sample(scene.plant));
        look_at_patches(scene.plant, &rig->contact, seen);
        for (size_t c = 0; c < rig->contact.nbody; c++) {
            const double *force = plant_contact_wrenches(scene.plant)[c].force;

            struct contact_wrench mean;

            plant_contact_mean(scene.plant, c, &mean);
            vec3_add_scaled(impulse[0], 1e-3, force, impulse[0]);
            vec3_add_scaled(impulse[1], 1e-3, mean.force, impulse[1]);
            assert_true(plant_contact_peaks(scene.plant)[c] >= vec3_norm(force) * (1 - 1e-12));
        }
    }
    find_momentum(after);
    for (int kind = 0; kind < 2; kind++) {
        for (int i = 0; i < 3; i++) {
            impulse[kind][i] += before[i] - after[i] +
                                scene.robot->total_mass * scene.robot->gravity[i] * 1e-3 * FALL_MS;
        }
        off[kind] += vec3_norm(impulse[kind]);
    }
}

TEST(falls_are_within_the_cone)
{
    const struct rig_scene_choice choice = {
        .file = "coman.yaml", .integrator = PLANT_IMPLICIT, .substep_ns = MS};
    struct seen seen = {0};
    double off[2] = {0.0, 0.0}, received;

    rig_scene_init(&scene, &choice);
    for (int number = 0; number < FALLS; number++) {
        fall(number, &seen, off);
    }
    received = scene.robot->total_mass * 9.81 * 1e-3 * FALL_MS;
    print_message("# falls: of impulses of %.0f N s the forces at ticks miss %.3f N s, the means "
                  "%.1e N s\n",
                  received, off[0] / FALLS, off[1] / FALLS);
    assert_true(off[1] / FALLS <= 1e-3 * received);
    expect_admissible("falls", &seen);
    rig_scene_fini(&scene);
}

/* ---- peak ---- */

/* The largest force on the right foot that comes down flat from 0.1 m, N; and the largest of those
 * at whole milliseconds. */
static double drop_peak(enum plant_integrator integrator, int64_t substep_ns, double *at_ticks)
{
    const struct rig_scene_choice choice = {.file = "coman.yaml",
                                            .integrator = integrator,
                                            .substep_ns = substep_ns,
                                            .tolerance = 1e-8};
    double position[3], peak = 0.0;
    int body;

    rig_scene_init(&scene, &choice);
    body = robot_find_body(scene.robot, "RFoot");
    memcpy(position, scene.rig->base_position, sizeof position);
    position[2] += 0.1;
    assert_ok(plant_reset(scene.plant, position, scene.rig->base_quaternion, scene.rig->joint));
    *at_ticks = 0.0;
    for (int k = 0; k < 200; k++) {
        for (size_t n = 0; n < scene.steps; n++) {
            assert_ok(plant_step(scene.plant, 1));
            assert_ok(plant_sample(scene.plant));
            for (size_t c = 0; c < scene.rig->contact.nbody; c++) {
                if (scene.rig->contact_body[c] == body) {
                    peak = fmax(peak, plant_contact_peaks(scene.plant)[c]);
                }
            }
        }
        *at_ticks = fmax(*at_ticks, vec3_norm(rig_scene_wrench(&scene, body)->force));
    }
    rig_scene_fini(&scene);
    return peak;
}

TEST(the_peak_of_an_impact_is_seen)
{
    double ticks, exact_ticks;
    const double exact = drop_peak(PLANT_DOPRI5, MS / 50, &exact_ticks);
    const double peak = drop_peak(PLANT_IMPLICIT, MS, &ticks);

    print_message("# drop: peak %.0f N, exact %.0f N; at ticks %.0f N, exact %.0f N\n", peak, exact,
                  ticks, exact_ticks);
    assert_near(peak / exact, 1.0, 0.02);
    assert_true(peak > 1.1 * ticks);
}
