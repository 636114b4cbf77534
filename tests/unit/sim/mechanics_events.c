/* SPDX-License-Identifier: Apache-2.0 */
/* What is told of a robot's mechanics, and how often: a walker that is put where it is seen. */
#include "sim/mechanics_events.h"

#include "model/spatial.h"

#include "tests/physics/toy.h"
#include "tests/test.h"

#define MS INT64_C(1000000)

enum { RIGHT_SHANK = 2, RIGHT_HIP = 0, RIGHT_KNEE = 1, LEFT_HIP = 3, LEFT_KNEE = 4, WRIST = 7 };

/* Heights of the trunk with straight legs: its feet touch the floor, its knees do. */
#define ON_FEET 0.499
#define ON_KNEES 0.299

/* A walker with a ball on its right shank and one on its right foot, above a floor. */
struct bench {
    struct toy toy;
    struct arena arena;
    struct dynamics dynamics;
    struct contact_surface surface[3];
    struct contact_pair pair[2];
    int contact_body[2];
    struct rig rig;
    struct contact_world *contact;
    struct plant *plant;
    struct watch *watch;
    double *state;
    int64_t now_ns;
    char text[256];
};

static void add_ball(struct bench *bench, size_t i, const char *name, int body)
{
    bench->contact_body[i] = body;
    bench->surface[i + 1] = (struct contact_surface){
        .name = name,
        .body = (int)i,
        .shape = CONTACT_SPHERE,
        .radius_m = 0.05,
        .material = bench->surface[0].material,
    };
    mat3_identity(bench->surface[i + 1].rotation);
    bench->pair[i] = (struct contact_pair){.a = 0, .b = (int)i + 1};
}

/* Straight and upright with its feet on the floor, at rest. */
static void bench_init(struct bench *bench, bool floating)
{
    static const double position[3] = {0.0, 0.0, ON_FEET}, upright[4] = {1.0, 0.0, 0.0, 0.0};
    static const double straight[8] = {0.0};
    struct plant_config config = {
        .integrator = PLANT_IMPLICIT, .substep_ns = MS, .supply_v = 48.0, .ncontact = 2};
    struct error error;
    size_t count;

    memset(bench, 0, sizeof *bench);
    assert_ok(arena_init(&bench->arena, 1 << 22, &error));
    toy_walker(&bench->toy);
    bench->toy.body[RIGHT_SHANK].observed = true;
    if (!floating) {
        assert_ok(robot_fix_base(&bench->toy.robot, position, upright, &error));
    }
    for (size_t j = 0; j < bench->toy.robot.njoint; j++) {
        bench->toy.joint[j].stop = (struct robot_stop){.stiffness = 1e5, .damping = 100.0};
    }
    bench->toy.joint[RIGHT_KNEE].sea.deflection = 0.14;
    bench->toy.joint[RIGHT_KNEE].sea.stop = (struct robot_stop){.stiffness = 8e3, .damping = 4.0};

    bench->surface[0] = (struct contact_surface){
        .name = "floor",
        .body = -1,
        .shape = CONTACT_HALF_SPACE,
        .material = {.young_pa = 1e5, .thickness_m = 1e-3, .dissipation_s_per_m = 1.0},
    };
    mat3_identity(bench->surface[0].rotation);
    add_ball(bench, 0, "right_shin", RIGHT_SHANK);
    add_ball(bench, 1, "right_sole", TOY_RIGHT_FOOT);
    bench->rig.robot = &bench->toy.robot;
    bench->rig.contact = (struct contact_config){.nbody = 2,
                                                 .nsurface = 3,
                                                 .surface = bench->surface,
                                                 .npair = 2,
                                                 .pair = bench->pair,
                                                 .transition_velocity_m_s = 0.1};
    bench->rig.contact_body = bench->contact_body;
    assert_ok(contact_native_create(&bench->rig.contact, &bench->arena, &bench->contact, &error));
    assert_ok(dynamics_generic(&bench->toy.robot, &bench->arena, &bench->dynamics, &error));
    config.robot = &bench->toy.robot;
    config.dynamics = &bench->dynamics;
    config.contact = bench->contact;
    config.contact_body = bench->contact_body;
    assert_ok(plant_create(&config, &bench->arena, &bench->plant, &error));
    assert_ok(plant_reset(bench->plant, position, upright, straight));
    bench->state = plant_state(bench->plant, &count);
    assert_ok(watch_create(&bench->rig, bench->plant, &bench->arena, &bench->watch, &error));
}

/* So many milliseconds in the state as it is. */
static void stay(struct bench *bench, int ms)
{
    assert_ok(plant_sample(bench->plant));
    for (int k = 0; k < ms; k++) {
        watch_step(bench->watch, bench->now_ns);
        bench->now_ns += MS;
    }
}

/* Turns the motor of a joint away from its link; the hand has none. */
static void wind(struct bench *bench, size_t joint, double twist)
{
    const struct robot *robot = bench->rig.robot;
    size_t drive = robot->nq + robot->nv + PLANT_DRIVE_STATE * joint;

    if (robot->joint[joint].sea.present) {
        bench->state[drive + DRIVE_MOTOR_POSITION] =
            bench->state[robot->nq - robot->njoint + joint] + twist;
    }
}

/* Puts a joint there, with its spring relaxed. */
static void bend(struct bench *bench, size_t joint, double q)
{
    bench->state[bench->rig.robot->nq - bench->rig.robot->njoint + joint] = q;
    wind(bench, joint, 0.0);
}

/* Tilts the trunk about y. */
static void tilt(struct bench *bench, double angle)
{
    bench->state[BASE_Q_QUATERNION] = cos(0.5 * angle);
    bench->state[BASE_Q_QUATERNION + 2] = sin(0.5 * angle);
}

/* The next event is this one, and the only one; NULL = there is none. */
static void assert_told(struct bench *bench, const char *text)
{
    struct watch_event event;

    if (text) {
        assert_true(watch_next_event(bench->watch, &event));
        watch_event_format(bench->watch, &event, bench->text, sizeof bench->text);
        assert_string_equal(bench->text, text);
    }
    if (watch_next_event(bench->watch, &event)) {
        watch_event_format(bench->watch, &event, bench->text, sizeof bench->text);
        fail_msg("found another event: %s", bench->text);
    }
}

/* ---- joints ---- */

TEST(a_joint_past_its_limit_is_told_once_with_its_greatest_depth)
{
    struct bench bench;

    bench_init(&bench, true);
    bench.toy.joint[LEFT_KNEE].lower = -0.1;
    bench.toy.joint[LEFT_KNEE].upper = 0.5;
    bend(&bench, LEFT_KNEE, 0.50005); /* less than what counts */
    stay(&bench, 5);
    assert_told(&bench, NULL);
    bend(&bench, LEFT_KNEE, 0.501);
    stay(&bench, 1);
    bend(&bench, LEFT_KNEE, 0.5031);
    stay(&bench, 1);
    assert_told(&bench, NULL); /* it may get further */
    bend(&bench, LEFT_KNEE, 0.5012);
    stay(&bench, 1);
    assert_told(&bench, "0.005000 s: joint j4 past its limit of 0.5 rad by 0.0031 rad");

    /* On and off the stop, without being away for long enough */
    for (int k = 0; k < 20; k++) {
        bend(&bench, LEFT_KNEE, k & 1 ? 0.502 : 0.4);
        stay(&bench, 90);
    }
    assert_told(&bench, NULL);

    /* Away for long, then at the other limit */
    bend(&bench, LEFT_KNEE, 0.4);
    stay(&bench, 110);
    bend(&bench, LEFT_KNEE, -0.112);
    stay(&bench, 30);
    assert_told(&bench, "1.918000 s: joint j4 past its limit of -0.1 rad by 0.0120 rad");
    arena_fini(&bench.arena);
}

TEST(a_joint_that_goes_on_is_told_after_a_while)
{
    struct bench bench;

    bench_init(&bench, false);
    bench.toy.joint[WRIST].lower = -0.02;
    for (int k = 1; k <= 30; k++) {
        bend(&bench, WRIST, -0.02 - 1e-3 * k);
        stay(&bench, 1);
    }
    assert_told(&bench, "0.000000 s: joint j7 past its limit of -0.02 m by 0.0110 m");
    arena_fini(&bench.arena);
}

/* ---- springs ---- */

TEST(a_spring_at_its_stop_is_told_once)
{
    struct bench bench;

    bench_init(&bench, true);
    for (int k = 0; k < 10; k++) {
        wind(&bench, RIGHT_KNEE, k & 1 ? -0.13 : -0.15); /* less than a tenth off the stop */
        stay(&bench, 200);
    }
    assert_told(&bench, "0.000000 s: spring of j1 at its stop, 0.14 rad");
    wind(&bench, RIGHT_KNEE, 0.12);
    stay(&bench, 150);
    wind(&bench, RIGHT_KNEE, 0.141);
    stay(&bench, 1);
    assert_told(&bench, "2.150000 s: spring of j1 at its stop, 0.14 rad");

    /* One that is broken has no stop */
    wind(&bench, RIGHT_KNEE, 0.0);
    stay(&bench, 150);
    plant_command(bench.plant)->motor[RIGHT_KNEE].condition = DRIVE_SPRING_BREAK;
    wind(&bench, RIGHT_KNEE, 3.0);
    stay(&bench, 10);
    assert_told(&bench, NULL);
    arena_fini(&bench.arena);
}

/* ---- falls ---- */

TEST(a_robot_on_its_feet_has_not_fallen)
{
    struct bench bench;

    bench_init(&bench, true);
    stay(&bench, 500);
    tilt(&bench, 1.0);
    stay(&bench, 500);
    tilt(&bench, 0.0);
    bend(&bench, RIGHT_HIP, -1.5); /* a deep squat */
    bend(&bench, LEFT_HIP, -1.5);
    bend(&bench, RIGHT_KNEE, 1.5);
    bend(&bench, LEFT_KNEE, 1.5);
    bench.state[2] = 3.0; /* and a jump */
    stay(&bench, 500);
    assert_told(&bench, NULL);
    arena_fini(&bench.arena);
}

TEST(a_fall_is_told_by_contact)
{
    struct bench bench;

    bench_init(&bench, true);
    stay(&bench, 200);
    bench.state[2] = ON_KNEES;
    stay(&bench, 50);
    assert_told(&bench, "0.200000 s: fell: body j1 touched floor");

    /* On its feet again for a second, then down once more */
    bench.state[2] = ON_FEET;
    stay(&bench, 900);
    bench.state[2] = ON_KNEES;
    stay(&bench, 50);
    assert_told(&bench, NULL);
    bench.state[2] = ON_FEET;
    stay(&bench, 1100);
    bench.state[2] = ON_KNEES;
    stay(&bench, 50);
    assert_told(&bench, "2.300000 s: fell: body j1 touched floor");
    arena_fini(&bench.arena);
}

TEST(who_kneels_at_the_start_has_not_fallen)
{
    struct bench bench;

    bench_init(&bench, true);
    bench.state[2] = ON_KNEES;
    stay(&bench, 500);
    assert_told(&bench, NULL);
    arena_fini(&bench.arena);
}

TEST(a_fall_is_told_by_tilt_and_by_height)
{
    struct bench bench;

    bench_init(&bench, true);
    stay(&bench, 10);
    bench.state[2] = 3.0;
    tilt(&bench, -1.06);
    stay(&bench, 100);
    assert_told(&bench, "0.010000 s: fell: base base tilted by 61 degrees");
    arena_fini(&bench.arena);

    bench_init(&bench, true);
    stay(&bench, 10);
    bench.state[2] = 3.0;
    bend(&bench, RIGHT_HIP, -2.0);
    bend(&bench, LEFT_HIP, -2.0);
    bend(&bench, RIGHT_KNEE, 2.0);
    bend(&bench, LEFT_KNEE, 2.0);
    stay(&bench, 100);
    assert_told(&bench, "0.010000 s: fell: base base 0.167 m above the lowest body, at the start "
                        "0.450 m");
    arena_fini(&bench.arena);
}

/* Clamped it may hang any way, and stands that way from there on. */
TEST(a_clamped_robot_does_not_fall)
{
    struct bench bench;

    bench_init(&bench, true);
    plant_clamp(bench.plant, true);
    bench.state[2] = 3.0;
    tilt(&bench, 1.5);
    stay(&bench, 100);
    plant_clamp(bench.plant, false);
    stay(&bench, 100);
    assert_told(&bench, NULL);
    tilt(&bench, 0.4);
    stay(&bench, 100);
    assert_told(&bench, "0.200000 s: fell: base base tilted by 63 degrees");
    arena_fini(&bench.arena);
}
