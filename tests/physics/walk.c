/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN, and WALK-MAN, walk and stand by their tasks, which see frames only: steps, speed, turning
 * and stopping against where the plant's pelvis is; pushes that it must withstand, and one that it
 * cannot; what it estimates against the truth.
 */
#include "base/array.h"
#include "base/vec3.h"
#include "tests/rig_run.h"

enum { SIGNALS_MAX = 64, PELVIS = 0, STIFFEST_NM_RAD = 1000 /* stiffer ones are gears */ };

#define OMEGA_PER_S                                                                                \
    4.7 /* of the divergent component of motion: COMAN's center of mass 0.445 m high */

/* Columns of the task's signals. */
static const char *const wanted_signal[] = {
    "estimate.roll_rad",  "estimate.pitch_rad",  "estimate.com_x_m",    "estimate.com_y_m",
    "estimate.com_z_m",   "estimate.com_vx_m_s", "estimate.com_vy_m_s", "estimate.right_fz_n",
    "estimate.left_fz_n", "plan.steps",          "estimate.right_x_m",  "estimate.left_x_m",
};
enum { ROLL, PITCH, COM_X, COM_VX = 5, FORCE_RIGHT = 7, FORCE_LEFT, STEPS, RIGHT_X, LEFT_X };

struct walk {
    const char *rig_name, *task;
    double seconds;
    int64_t steps;
    double forward_m_s, left_m_s, turn_rad_s;
    double push_at_s, push_n[3]; /* 0.1 s long; not when push_at_s is 0 */
    double turned_rad;           /* inertial sensor, about the pelvis's y; the task knows nothing */
    double lean_per_s;
    double torso, spring; /* factors of the plant's, unknown to the task; 0: none */

    struct arena arena;
    struct rig rig;
    struct walk_config config;
    struct simulator *simulator;
    size_t column[ARRAY_COUNT(wanted_signal)];
    double before[3];                /* true center of mass, a tick ago */
    double lead[2];                  /* of the estimate's origin on the world's */
    double com, com_rate, dcm, tilt; /* sums of squares of what is off */
    double pitch_late;               /* mean of the pitch's error in the last 4 s */
    size_t count;
    double end[3], yaw, lowest, counted; /* of the pelvis; steps */
    double apart_m;                      /* the right foot ahead of the left one */
    struct task_runner_status status;
};

static void true_center_of_mass(const struct walk *w, double com[3])
{
    const struct robot *robot = w->rig.robot;
    struct body_motion place[RIG_JOINTS_MAX];
    size_t count;
    const double *q = plant_state(simulator_plant(w->simulator), &count);

    robot_place_bodies(robot, q, q + BASE_Q_QUATERNION, q + BASE_Q_COUNT, place);
    memset(com, 0, 3 * sizeof *com);
    for (size_t i = 0; i < robot->nbody; i++) {
        double arm[3];

        mat3_apply(place[i].R, robot->body[i].inertia.com, arm);
        vec3_add_scaled(arm, 1, place[i].p, arm);
        vec3_add_scaled(com, robot->body[i].inertia.mass / robot->total_mass, arm, com);
    }
}

/* The estimate beside the truth; once the steps begin its origin is that of the world but for a
 * constant, and for the drift of the odometry, which is not what is judged here. */
static void compare_estimate(struct walk *w, const double *value, double t)
{
    const struct body_motion *pelvis = plant_motion(simulator_plant(w->simulator));
    double com[3], rate;

    true_center_of_mass(w, com);
    for (int k = 0; k < 2 && t > 3; k++) {
        double apart = value[w->column[COM_X + k]] - com[k];

        w->lead[k] += w->count ? (apart - w->lead[k]) / 2000 : apart;
        rate = (com[k] - w->before[k]) / 1e-3;
        w->com += pow(apart - w->lead[k], 2);
        rate = value[w->column[COM_VX + k]] - rate;
        w->com_rate += pow(rate, 2);
        w->dcm += pow(apart - w->lead[k] + rate / OMEGA_PER_S, 2);
    }
    if (t > 3) {
        double pitch = value[w->column[PITCH]] - asin(-pelvis->R[6]);

        w->pitch_late += t > w->seconds - 4 ? pitch / 4000 : 0;
        w->tilt += pow(pitch, 2);
        w->tilt += pow(value[w->column[ROLL]] - atan2(pelvis->R[7], pelvis->R[8]), 2);
        w->count++;
    }
    memcpy(w->before, com, sizeof com);
}

static void watch_walk(void *context, int64_t now_ns)
{
    struct walk *w = context;
    struct plant *plant = simulator_plant(w->simulator);
    const struct body_motion *pelvis = plant_motion(plant);
    const double none[3] = {0};
    double value[SIGNALS_MAX], t = (double)now_ns * 1e-9;
    bool pushed = w->push_at_s > 0 && t >= w->push_at_s && t < w->push_at_s + 0.1;

    plant_set_push(plant, PELVIS, pushed ? w->push_n : none, none);
    task_read_signals(simulator_task_runner(w->simulator)->task, value);
    compare_estimate(w, value, t);
    memcpy(w->end, pelvis->p, sizeof w->end);
    w->yaw = atan2(pelvis->R[3], pelvis->R[0]);
    w->counted = value[w->column[STEPS]];
    w->apart_m = value[w->column[RIGHT_X]] - value[w->column[LEFT_X]];
    w->lowest = t > 1 ? fmin(w->lowest, pelvis->p[2]) : 1;
    if (w->lowest < 0.3) {
        simulator_stop(w->simulator);
    }
}

/* Changes the plant's robot; the task's model stays as it was. */
static void change_robot(struct walk *w)
{
    const double axis[3] = {0, 1, 0};
    struct robot *robot;
    struct robot_frame *frame;
    struct robot_inertia *torso;
    struct error error;
    double turn[9], old[9];

    assert_ok(robot_copy(w->rig.robot, &w->arena, &robot, &error));
    frame = &robot->frame[robot->imu_frame];
    memcpy(old, frame->rotation, sizeof old);
    mat3_about_axis(axis, w->turned_rad, turn);
    mat3_mul(turn, old, frame->rotation);
    for (size_t i = 0; i < robot->njoint && w->spring != 0; i++) {
        robot->joint[i].sea.Ks *= robot->joint[i].sea.Ks < STIFFEST_NM_RAD ? w->spring : 1;
    }
    if (w->torso != 0) {
        torso = &robot->body[robot_find_body(robot, "DWYTorso")].inertia;
        robot->total_mass += (w->torso - 1) * torso->mass;
        torso->mass *= w->torso;
        for (size_t k = 0; k < ARRAY_COUNT(torso->I); k++) {
            torso->I[k] *= w->torso;
        }
        /* The compiled equations are those of the file's masses */
        w->rig.dynamics = RIG_DYNAMICS_GENERIC;
    }
    w->rig.robot = robot;
}

static void find_columns(struct walk *w)
{
    const char *const *name;
    size_t count = task_signals(simulator_task_runner(w->simulator)->task, &name);

    assert_true(count > 0 && count <= SIGNALS_MAX);
    for (size_t i = 0; i < ARRAY_COUNT(wanted_signal); i++) {
        for (w->column[i] = 0; strcmp(name[w->column[i]], wanted_signal[i]) != 0; w->column[i]++) {
            assert_true(w->column[i] + 1 < count);
        }
    }
}

static void perform(struct walk *w)
{
    struct simulator_observer observer = {w, watch_walk};
    struct simulator_config config = {
        .rig = &w->rig,
        .clock = LOOP_CLOCK_FREE,
        .transport = TRANSPORT_LOCAL,
        .ticks = (uint64_t)(w->seconds * 1000),
        .task = w->task,
        .observer = &observer,
    };

    /* The rig, with what is asked for here */
    rig_run_load(w->rig_name, &w->arena, &w->rig);
    w->config = *w->rig.walk;
    w->config.steps = w->steps;
    w->config.begin_s = 2.5;
    w->config.forward_m_s = w->forward_m_s;
    w->config.left_m_s = w->left_m_s;
    w->config.turn_rad_s = w->turn_rad_s;
    w->config.balance.estimate.lean_per_s = w->lean_per_s;
    w->rig.walk = &w->config;
    if (w->turned_rad != 0 || w->torso != 0 || w->spring != 0) {
        change_robot(w);
    }
    config.hold = w->rig.hold;

    w->simulator = rig_run_open(&config, &w->arena, NULL);
    find_columns(w);
    simulator_run(w->simulator);
    task_runner_read(simulator_task_runner(w->simulator), &w->status);
    w->com = sqrt(w->com / (double)w->count);
    w->com_rate = sqrt(w->com_rate / (double)w->count);
    w->dcm = sqrt(w->dcm / (double)w->count);
    w->tilt = sqrt(w->tilt / (double)w->count);
    print_message("# %s, %s: pelvis at %.3f %.3f %.3f m, yaw %.2f rad, %.0f steps; off by %.1f mm, "
                  "%.3f m/s, DCM %.1f mm, %.2f mrad\n",
                  w->rig_name, w->status.message, w->end[0], w->end[1], w->end[2], w->yaw,
                  w->counted, 1e3 * w->com, w->com_rate, 1e3 * w->dcm, 1e3 * w->tilt);
    rig_run_close(w->simulator, &w->arena, NULL);
}

static void expect_upright(const struct walk *w)
{
    assert_int_equal(w->status.status, TASK_RUNNING);
    assert_true(w->lowest > 0.42);
}

static void expect_estimate(const struct walk *w)
{
    assert_true(w->com < 0.005);
    assert_true(w->com_rate < 0.03);
    /* The wanted zero-moment point is off by 1.33 times this: a quarter of the 30 mm that the
     * plan's has beside it in a sole, less its margin */
    assert_true(w->dcm < 0.0055);
    assert_true(w->tilt < 0.003);
}

TEST(walks_forward_and_stops)
{
    struct walk w = {"coman-compact-imu", "walk", 16, .steps = 12, .forward_m_s = 0.15};

    perform(&w);
    expect_upright(&w);
    expect_estimate(&w);
    assert_true(w.counted == 13); /* one to stand side by side */
    /* Ten steps of 0.0675 m, less what it lacks until it is up to speed, 0.11 m; feet come down up
     * to 1 cm further than planned */
    assert_true(w.end[0] > 0.5 && w.end[0] < 0.7);
    assert_true(fabs(w.end[1]) < 0.1 && fabs(w.yaw) < 0.1);
}

/* A board whose attitude pitches 2 degrees too little: the forces of the feet tell, with a time
 * constant of 1 / lean_per_s; what is left is what the mean force is off the vertical by. */
TEST(finds_the_vertical_by_the_forces_of_the_feet)
{
    const double wrong = 0.035;
    struct walk believes = {"coman-compact-imu", "walk", 14, .forward_m_s = 0.15,
                            .turned_rad = wrong};
    struct walk finds = believes;

    perform(&believes);
    assert_true(fabs(fabs(believes.pitch_late) - wrong) < 0.002);
    finds.lean_per_s = 0.4;
    perform(&finds);
    expect_upright(&finds);
    assert_true(fabs(finds.pitch_late) < 0.15 * wrong);
}

/* At twice the speed and faster, as fast as it is asked to and straight on. */
TEST(walks_faster)
{
    struct walk twice = {"coman-compact-imu", "walk", 16, .forward_m_s = 0.3};
    struct walk fast = {"walk-flat", "walk", 40, .forward_m_s = 0.36};

    perform(&twice);
    expect_upright(&twice);
    assert_true(twice.end[0] > 2.8 && twice.end[0] < 3.3 && fabs(twice.end[1]) < 0.1);
    perform(&fast);
    expect_upright(&fast);
    assert_true(fast.end[0] > 10 && fabs(fast.end[1]) < 0.1);
}

TEST(walks_backward_on_buses_with_flexible_data_rate)
{
    struct walk w = {"coman-fd-imu", "walk", 13, .forward_m_s = -0.12};

    perform(&w);
    expect_upright(&w);
    expect_estimate(&w);
    assert_true(w.end[0] < -0.6 && w.end[0] > -1.2);
}

TEST(walks_sideways_and_turns)
{
    struct walk sideways = {"coman-compact-imu", "walk", 13, .left_m_s = 0.05};
    struct walk turn = {"coman-compact-imu", "walk", 13, .turn_rad_s = 0.2};

    perform(&sideways);
    expect_upright(&sideways);
    assert_true(sideways.end[1] > 0.25 && sideways.end[1] < 0.6);
    perform(&turn);
    expect_upright(&turn);
    assert_true(turn.yaw > 1.1 && turn.yaw < 2.2);
}

/* iCub sends every 4 ms, 2FOC and CANopen drives every millisecond; voltages every millisecond. */
TEST(walks_through_boards_of_every_family)
{
    static const char *const rigs[] = {"coman-imu", "coman-foc-imu", "coman-cia402-imu"};

    for (size_t i = 0; i < ARRAY_COUNT(rigs); i++) {
        struct walk w = {rigs[i], "walk", 13, .forward_m_s = 0.15};

        perform(&w);
        expect_upright(&w);
        assert_true(w.end[0] > 0.8);
    }
}

/* 5 degrees up, level, 5 degrees down; a rough bump of 9 cm with side slopes; a mat that yields;
 * hips that bend. Feet that land by time fall at the first edge. */
TEST(walks_over_uneven_ground_and_on_hips_that_bend)
{
    static const struct {
        const char *rig;
        double seconds, ahead_m;
    } ground[] = {{"walk-slope", 29, 3.3},
                  {"walk-bump-9cm", 23, 2.3},
                  {"walk-soft", 14, 1.2},
                  {"walk-hips", 14, 1.2}};

    for (size_t i = 0; i < ARRAY_COUNT(ground); i++) {
        struct walk w = {ground[i].rig, "walk", ground[i].seconds, .forward_m_s = 0.15};

        perform(&w);
        expect_upright(&w);
        expect_estimate(&w);
        assert_true(w.end[0] > ground[i].ahead_m && fabs(w.end[1]) < 0.4);
    }
}

/* A heavier torso and softer springs than its controller takes them for. */
TEST(walks_though_it_is_another_robot_than_its_model)
{
    struct walk heavy = {"walk-flat", "walk", 14, .forward_m_s = 0.15, .torso = 1.1};
    struct walk soft = {"walk-flat", "walk", 14, .forward_m_s = 0.15, .spring = 0.8};
    struct walk slack = {"walk-flat", "walk", 14, .forward_m_s = 0.15, .spring = 0.33};

    perform(&heavy);
    expect_upright(&heavy);
    assert_true(heavy.end[0] > 0.8 && fabs(heavy.end[1]) < 0.2);
    perform(&soft);
    expect_upright(&soft);
    assert_true(soft.end[0] > 0.8 && fabs(soft.end[1]) < 0.2);
    perform(&slack);
    assert_int_equal(slack.status.status, TASK_FAILED);
}

/* Four times as heavy and twice as tall, with legs whose joints come in another order. */
TEST(walks_as_the_larger_robot)
{
    struct walk w = {"walk-walkman", "walk", 15, .forward_m_s = 0.2};
    struct walk stands = {"walk-walkman", "stand", 7, .push_at_s = 4, .push_n = {300, 0, 0}};
    struct walk steps = {"walk-walkman", "stand", 8, .push_at_s = 3.5, .push_n = {-650, 0, 0}};

    perform(&w);
    assert_int_equal(w.status.status, TASK_RUNNING);
    assert_true(w.lowest > 0.9 && w.end[0] > 1 && fabs(w.end[1]) < 0.3);
    perform(&stands);
    assert_int_equal(stands.status.status, TASK_RUNNING);
    assert_true(stands.lowest > 0.9 && stands.counted == 0);
    perform(&steps);
    assert_int_equal(steps.status.status, TASK_RUNNING);
    assert_true(steps.lowest > 0.9 && steps.counted >= 2 && steps.end[0] < -0.1);
}

TEST(walks_on_when_it_is_pushed)
{
    static const double force[][2] = {{80, 0}, {-80, 0}, {0, 40}, {0, -40}};

    for (size_t i = 0; i < ARRAY_COUNT(force); i++) {
        struct walk w = {"coman-compact-imu", "walk", 12, .forward_m_s = 0.15, .push_at_s = 8};

        w.push_n[0] = force[i][0];
        w.push_n[1] = force[i][1];
        perform(&w);
        expect_upright(&w);
        assert_true(w.end[0] > 0.8);
    }
}

TEST(stands_when_it_is_pushed)
{
    static const double force[][2] = {{80, 0}, {-80, 0}, {0, 80}};

    for (size_t i = 0; i < ARRAY_COUNT(force); i++) {
        struct walk w = {"coman-compact-imu", "stand", 6, .push_at_s = 3};

        w.push_n[0] = force[i][0];
        w.push_n[1] = force[i][1];
        perform(&w);
        expect_upright(&w);
        assert_true(fabs(w.yaw) < 0.05);
    }
}

/* Too hard for the ankles: it steps where it falls, comes to rest and stands side by side. Whether
 * it trips over its own feet is chaotic in the push: 6 of 84 pushes end so (4 of 86 with another
 * law of friction), and up to a quarter with a foot 30 mm or more ahead. With that rate 4 of 19
 * fall once in 25 times. */
TEST(steps_when_it_is_pushed_harder)
{
    static const double force[] = {150, 155,  160,  165,  170,  175,  180,  185,  190, 195,
                                   200, -150, -155, -160, -165, -170, -175, -180, -185};
    int fallen = 0, astride = 0;

    for (size_t i = 0; i < ARRAY_COUNT(force); i++) {
        struct walk w = {"walk-flat", "stand", 9, .push_at_s = 3};

        w.push_n[0] = force[i];
        perform(&w);
        if (w.status.status != TASK_RUNNING || w.lowest < 0.4) {
            fallen++;
            continue;
        }
        assert_true(w.counted >= 2 && w.counted <= 6);
        assert_true(w.end[2] > 0.455);
        assert_true(force[i] * w.end[0] > 0 && fabs(w.end[0]) < 0.5);
        astride += fabs(w.apart_m) >= 0.03;
    }
    print_message("# %d fell, %d stand astride\n", fallen, astride);
    assert_true(fallen <= 3 && astride <= 4);
}

TEST(stands_when_it_is_pushed_hard_to_a_side)
{
    static const double force[][2] = {{0, 160}, {0, -160}, {110, 110}};

    for (size_t i = 0; i < ARRAY_COUNT(force); i++) {
        struct walk w = {"walk-flat", "stand", 6, .push_at_s = 3};

        w.push_n[0] = force[i][0];
        w.push_n[1] = force[i][1];
        perform(&w);
        expect_upright(&w);
        assert_true(w.counted == 0 && fabs(w.end[1]) < 0.05);
    }
}

TEST(falls_and_says_so_when_it_is_pushed_too_hard)
{
    struct walk w = {"coman-compact-imu", "stand", 6, .push_at_s = 3};

    w.push_n[0] = 400;
    perform(&w);
    assert_true(w.lowest < 0.3);
    assert_int_equal(w.status.status, TASK_FAILED);
}
