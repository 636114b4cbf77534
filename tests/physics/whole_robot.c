/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The laws of mechanics on runs of the whole robot with its scene, paper settings (rk4, 1e-4 s) on
 * native contact: COMAN settled, standing and bending its knees; and with a box that it takes
 * between its wrists and lifts.
 *
 * What is checked against is made here: momenta, their rates and the accelerations at the sensors
 * come from the positions and velocities of all bodies by differences in time, not from the plant's
 * accelerations; the rates at a step are central differences of fourth order, exact to 1e-9 or so.
 */

#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

enum { BODIES = 40, SUBSTEPS = 10, WINDOW = 5, MIDDLE = 2, PATCHES = 64, SENSORS = 8 };

static const double h = 1e-4;

/* ---- bodies in motion, by the test's own sums ---- */

/* The robot's dynamics with every body's motion wanted. */
struct all_bodies {
    struct robot robot;
    struct robot_body body[BODIES];
    struct dynamics dynamics;
};

static void observe_all(struct all_bodies *all, struct rig_scene *scene)
{
    struct error error = {0};

    assert_true(scene->robot->nbody <= BODIES);
    all->robot = *scene->robot;
    memcpy(all->body, scene->robot->body, scene->robot->nbody * sizeof *all->body);
    for (size_t b = 0; b < scene->robot->nbody; b++) {
        all->body[b].observed = true;
    }
    all->robot.body = all->body;
    assert_ok(dynamics_generic(&all->robot, &scene->arena, &all->dynamics, &error));
}

/* Linear momentum, angular momentum about the world's origin, moment of the weight about it. */
struct momentum {
    double p[3], L[3], weight[3];
};

static void add_body(const struct robot_inertia *inertia, const struct body_motion *motion,
                     const double gravity[3], struct momentum *sum)
{
    double arm[3], v[3], c[3], w[3], spin[3], own[3], part[3];

    mat3_apply(motion->R, inertia->com, arm);
    memcpy(v, motion->v, sizeof v);
    vec3_add_cross(motion->w, arm, v);
    mat3_apply_transposed(motion->R, motion->w, w);
    sym3_apply(inertia->I, w, own);
    mat3_apply(motion->R, own, spin);
    for (int i = 0; i < 3; i++) {
        c[i] = motion->p[i] + arm[i];
        part[i] = inertia->mass * v[i];
        sum->p[i] += part[i];
        sum->L[i] += spin[i];
        own[i] = inertia->mass * gravity[i];
    }
    vec3_add_cross(c, part, sum->L);
    vec3_add_cross(c, own, sum->weight);
}

/* ---- what a step is remembered by ---- */

/* A sensor's mass below it: where it is, how it turns, and what the plant reads. */
struct sensed {
    double R[9], p[3];          /* sensor frame */
    double v[3], L[3];          /* of the distal part's center of mass; spin, world frame */
    double force[3], moment[3]; /* of the contact on the sensor's body, about the sensor, world */
    struct ft_sense read;
};

struct instant {
    struct momentum robot, box;
    double robot_force[3], robot_moment[3]; /* of the contacts, about the world's origin */
    double box_force[3], box_moment[3];
    struct sensed sensor[SENSORS];
};

struct run {
    struct rig_scene scene;
    struct all_bodies all;
    struct body_motion motion[BODIES];
    struct instant window[WINDOW];
    double arm_reference[RIG_SCENE_JOINTS]; /* what is added to the settled references */
    long step;
};

/* Contact wrench moved to the world's origin */
static void add_contact(const struct contact_wrench *wrench, const double p[3], double force[3],
                        double moment[3])
{
    for (int i = 0; i < 3; i++) {
        force[i] += wrench->force[i];
        moment[i] += wrench->moment[i];
    }
    vec3_add_cross(p, wrench->force, moment);
}

static void remember_sensor(const struct run *run, size_t f, struct sensed *out)
{
    const struct robot *robot = run->scene.robot;
    const struct robot_ft_sensor *sensor = &robot->ft[f];
    const struct robot_frame *frame = &robot->frame[sensor->frame];
    const struct body_motion *motion = &run->motion[frame->body];
    const struct rig *rig = run->scene.rig;
    double arm[3], w[3], own[3], below[3];

    mat3_mul(motion->R, frame->rotation, out->R);
    mat3_apply(motion->R, frame->position, arm);
    mat3_apply(out->R, sensor->distal.com, below);
    memcpy(out->v, motion->v, sizeof out->v);
    for (int i = 0; i < 3; i++) {
        out->p[i] = motion->p[i] + arm[i];
        arm[i] += below[i];
    }
    vec3_add_cross(motion->w, arm, out->v);
    mat3_apply_transposed(out->R, motion->w, w);
    sym3_apply(sensor->distal.I, w, own);
    mat3_apply(out->R, own, out->L);
    memset(out->force, 0, sizeof out->force);
    memset(out->moment, 0, sizeof out->moment);
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        if (rig->contact_body[c] == frame->body) {
            double lever[3];

            for (int i = 0; i < 3; i++) {
                lever[i] = motion->p[i] - out->p[i];
            }
            add_contact(&plant_contact_wrenches(run->scene.plant)[c], lever, out->force,
                        out->moment);
        }
    }
    out->read = plant_sensors(run->scene.plant)->ft[f];
}

static void remember(struct run *run, struct instant *now)
{
    const struct rig *rig = run->scene.rig;
    const struct robot *robot = run->scene.robot;
    size_t count;
    const double *state = plant_state(run->scene.plant, &count);

    *now = (struct instant){0};
    run->all.dynamics.ops->kinematics(&run->all.dynamics, state, state + robot->nq, run->motion);
    for (size_t b = 0; b < robot->nbody; b++) {
        add_body(&robot->body[b].inertia, &run->motion[b], robot->gravity, &now->robot);
    }
    for (size_t b = 0; b < rig->nfree; b++) {
        add_body(&rig->free[b].inertia, &plant_motion(run->scene.plant)[robot->nbody + b],
                 robot->gravity, &now->box);
    }
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        const struct contact_wrench *wrench = &plant_contact_wrenches(run->scene.plant)[c];
        size_t body = (size_t)rig->contact_body[c];

        if (body < robot->nbody) {
            add_contact(wrench, run->motion[body].p, now->robot_force, now->robot_moment);
        } else {
            add_contact(wrench, plant_motion(run->scene.plant)[body].p, now->box_force,
                        now->box_moment);
        }
    }
    assert_true(robot->nft <= SENSORS);
    for (size_t f = 0; f < robot->nft; f++) {
        remember_sensor(run, f, &now->sensor[f]);
    }
}

/* ---- running ---- */

/* Friction that steps of 1e-4 s resolve. */
static const double transition_velocity_m_s = 0.02;

static void run_begin(struct run *run, const char *file, const double *joint)
{
    static const struct robot_inertia foot = {
        .mass = 0.6, .com = {0.02, -0.01, -0.05}, .I = {1e-3, 1e-4, 2e-4, 2e-3, -1e-4, 2e-3}};
    const struct rig_scene_choice choice = {.file = file,
                                            .integrator = PLANT_RK4,
                                            .substep_ns = 100000,
                                            .transition_velocity_m_s = transition_velocity_m_s,
                                            .below = &foot};
    const struct rig *rig;

    memset(run, 0, sizeof *run);
    rig_scene_init(&run->scene, &choice);
    rig = run->scene.rig;
    if (joint) {
        assert_ok(plant_reset(run->scene.plant, rig->base_position, rig->base_quaternion, joint));
    }
    rig_scene_settle(&run->scene);
    observe_all(&run->all, &run->scene);
}

/* One substep; at each millisecond voltages are set for the references. The window moves on. */
static void advance(struct run *run)
{
    struct plant *plant = run->scene.plant;
    const struct motor_sense *motor = plant_sensors(plant)->motor;

    if (run->step++ % SUBSTEPS == 0) {
        for (size_t j = 0; j < run->scene.robot->njoint; j++) {
            plant_command(plant)->motor[j].voltage_v =
                run->scene.holding[j] +
                200.0 * (run->scene.reference[j] + run->arm_reference[j] - motor[j].qm);
        }
    }
    assert_ok(plant_step(plant, 1));
    assert_ok(plant_sample(plant));
    memmove(run->window, run->window + 1, (WINDOW - 1) * sizeof *run->window);
    remember(run, &run->window[WINDOW - 1]);
}

static double rate_of(const double at[WINDOW])
{
    return (8.0 * (at[3] - at[1]) - (at[4] - at[0])) / (12.0 * h);
}

#define RATE(window, member)                                                                       \
    rate_of((const double[WINDOW]){(window)[0].member, (window)[1].member, (window)[2].member,     \
                                   (window)[3].member, (window)[4].member})

/* Bends hips, knees and ankles down by up to 0.1 rad and back, feet flat, within the period. */
static void bend(struct run *run, double t, double period)
{
    static const char *const names[] = {"RHipSag", "RKneeSag", "RAnkSag",
                                        "LHipSag", "LKneeSag", "LAnkSag"};
    static const double share[] = {-0.1, 0.2, -0.1, -0.1, 0.2, -0.1};

    for (int n = 0; n < 6; n++) {
        int j = robot_find_joint(run->scene.robot, names[n]);

        assert_true(j >= 0);
        run->arm_reference[j] = 0.5 * share[n] * (1.0 - cos(2.0 * M_PI * t / period));
    }
}

/* Right arm: shoulder pitch, roll, yaw, elbow at the box and 5 cm higher (the data's inverse
 * kinematics). The left one mirrors roll and yaw. */
static const double touching[4] = {0.0216, 0.1044, 0.1494, -1.0912};
static const double lifted[4] = {0.1438, 0.1305, 0.1839, -1.4505};

static void set_arms(const struct robot *robot, const double right[4], double *joint)
{
    static const char *const arms[2][4] = {{"RShSag", "RShLat", "RShYaw", "RElbj"},
                                           {"LShSag", "LShLat", "LShYaw", "LElbj"}};

    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 4; k++) {
            int j = robot_find_joint(robot, arms[side][k]);

            assert_true(j >= 0);
            joint[j] = side == 1 && (k == 1 || k == 2) ? -right[k] : right[k];
        }
    }
}

/* Squeezes within 0.15 s, then lifts. */
static void take(struct run *run, double t)
{
    double squeeze = fmin(1.0, t / 0.15), up = fmax(0.0, (t - 0.15) / 0.45), right[4];

    for (int k = 0; k < 4; k++) {
        right[k] = up * (lifted[k] - touching[k]) + (k == 1 ? 0.05 * squeeze : 0.0);
    }
    set_arms(run->scene.robot, right, run->arm_reference);
}

static void run_begin_at_the_box(struct run *run)
{
    static struct rig_scene scene;
    const struct rig_scene_choice choice = {
        .file = "grasp.yaml", .integrator = PLANT_RK4, .substep_ns = 100000};
    double joint[RIG_SCENE_JOINTS];

    rig_scene_init(&scene, &choice);
    memcpy(joint, scene.rig->joint, scene.robot->njoint * sizeof *joint);
    set_arms(scene.robot, touching, joint);
    rig_scene_fini(&scene);
    run_begin(run, "grasp.yaml", joint);
}

static void run_end(struct run *run)
{
    rig_scene_fini(&run->scene);
}

/* ---- checks ---- */

static double turnover(const struct plant_energy *e)
{
    return fabs(e->electrical_in) + fabs(e->push_work) + e->joule_heat + e->motor_friction +
           e->spring_damping + fabs(e->contact_dissipation);
}

static double dissipated(struct rig_scene *scene)
{
    struct contact_patch patch[PATCHES];
    size_t count = scene->contact->ops->patches(scene->contact, patch, PATCHES);
    double sum = 0.0;

    assert_true(count <= PATCHES);
    for (size_t i = 0; i < count; i++) {
        sum += patch[i].dissipation_w;
    }
    return sum;
}

/* Volts times amperes in; heat, friction, springs' and contacts' dampers and what is stored out.
 * What the contacts take by the work of their wrenches is what they say that they dissipate. */
static void check_energy(struct run *run, void (*act)(struct run *run, double t), int steps)
{
    struct plant_energy e;
    double contact = 0.0, last = dissipated(&run->scene);

    for (int k = 0; k < steps; k++) {
        double now;

        act(run, h * k);
        advance(run);
        now = dissipated(&run->scene);
        contact += 0.5 * h * (last + now);
        last = now;
    }
    assert_ok(plant_energy(run->scene.plant, &e));
    print_message("# electrical %.4f J, windings %.4f, friction %.4f, springs %.5f, contact %.6f "
                  "(by the patches %.6f); balance %.2e J, %.1e of the turnover\n",
                  e.electrical_in, e.joule_heat, e.motor_friction, e.spring_damping,
                  e.contact_dissipation, contact, e.balance, fabs(e.balance) / turnover(&e));
    assert_true(e.electrical_in > 1.0);
    assert_true(fabs(e.balance) < 1e-6 * turnover(&e));
    assert_near(contact, e.contact_dissipation, 1e-3 * e.contact_dissipation);
}

static void squat_briefly(struct run *run, double t)
{
    bend(run, t, 0.8);
}

CLOSED_BENCH(run, struct run, run_end)

TEST_ON(power_balances_while_coman_stands_and_squats, run, run)
{
    run_begin(run, "coman.yaml", NULL);
    check_energy(run, squat_briefly, 10000);
}

BENCH(run_begin_at_the_box, struct run, run_end)

TEST_ON(power_balances_while_a_box_is_lifted, run_begin_at_the_box, run)
{
    check_energy(run, take, 5000);
}

/* Largest violations of Newton's and Euler's laws, N and N m */
struct violation {
    double force, moment, box_force, box_moment, sensor_force, sensor_moment;
    int instants, bends; /* where they were checked, and where a force on the box bent */
};

#define BENT_N 2e-3

static void check_laws(const struct run *run, struct violation *worst)
{
    const struct instant *w = run->window, *now = &w[MIDDLE];
    const double *gravity = run->scene.robot->gravity;
    double box_mass = run->scene.rig->nfree ? run->scene.rig->free[0].inertia.mass : 0.0;
    double off = 0.0;

    for (int i = 0; i < 3; i++) {
        double force = now->robot_force[i] + run->scene.robot->total_mass * gravity[i];
        double moment = now->robot_moment[i] + now->robot.weight[i];

        worst->force = fmax(worst->force, fabs(RATE(w, robot.p[i]) - force));
        worst->moment = fmax(worst->moment, fabs(RATE(w, robot.L[i]) - moment));
        force = now->box_force[i] + box_mass * gravity[i];
        moment = now->box_moment[i] + now->box.weight[i];
        off = fmax(off, fabs(RATE(w, box.p[i]) - force));
        worst->box_moment = fmax(worst->box_moment, fabs(RATE(w, box.L[i]) - moment));
    }
    worst->box_force = fmax(worst->box_force, off);
    worst->instants++;
    worst->bends += off > BENT_N;
}

/* The part below a sensor: what acts on it from outside, less the rate of its momentum, is what it
 * passes on through the sensor. Moments are taken about its center of mass, then moved. */
static void check_sensor(const struct run *run, size_t f, struct violation *worst)
{
    const struct instant *w = run->window;
    const struct sensed *now = &w[MIDDLE].sensor[f];
    const struct robot_inertia *distal = &run->scene.robot->ft[f].distal;
    double force[3], moment[3], inertial[3], arm[3], expected[3];

    mat3_apply(now->R, distal->com, arm);
    for (int i = 0; i < 3; i++) {
        inertial[i] = distal->mass * (run->scene.robot->gravity[i] - RATE(w, sensor[f].v[i]));
        force[i] = now->force[i] + inertial[i];
        moment[i] = now->moment[i] - RATE(w, sensor[f].L[i]);
    }
    vec3_add_cross(arm, inertial, moment);
    mat3_apply_transposed(now->R, force, expected);
    for (int i = 0; i < 3; i++) {
        worst->sensor_force = fmax(worst->sensor_force, fabs(now->read.force_n[i] - expected[i]));
    }
    mat3_apply_transposed(now->R, moment, expected);
    for (int i = 0; i < 3; i++) {
        worst->sensor_moment =
            fmax(worst->sensor_moment, fabs(now->read.torque_nm[i] - expected[i]));
    }
}

/* Voltages jump at each millisecond, and the currents' slopes with them: differences are taken
 * where no jump is within the window. */
static void follow_laws(struct run *run, void (*act)(struct run *run, double t), int steps,
                        struct violation *worst)
{
    *worst = (struct violation){0};
    for (int k = 0; k < steps; k++) {
        act(run, h * k);
        advance(run);
        if (k >= WINDOW && k % SUBSTEPS >= WINDOW - 1) {
            check_laws(run, worst);
            for (size_t f = 0; f < run->scene.robot->nft; f++) {
                check_sensor(run, f, worst);
            }
        }
    }
    print_message("# worst: robot %.1e N, %.1e N m; box %.1e N, %.1e N m; sensors %.1e N, %.1e N "
                  "m; %d of %d instants bend\n",
                  worst->force, worst->moment, worst->box_force, worst->box_moment,
                  worst->sensor_force, worst->sensor_moment, worst->bends, worst->instants);
}

TEST_ON(contact_forces_are_the_rates_of_momentum_while_coman_squats, run, run)
{
    struct violation worst;

    run_begin(run, "coman.yaml", NULL);
    follow_laws(run, squat_briefly, 4000, &worst);
    assert_true(worst.force < 1e-4);
    assert_true(worst.moment < 1e-4);
    assert_true(worst.sensor_force < 1e-4);
    assert_true(worst.sensor_moment < 1e-4);
}

/* Where friction begins to yield, or the area that touches begins to drag its anchor along, the
 * force bends: there, and nowhere else, a difference over steps of h is off by a part of the
 * slope's jump times h: 24 mN, and 8.5 mN at half the step. */
TEST_ON(contact_forces_are_the_rates_of_momentum_while_a_box_is_lifted, run_begin_at_the_box, run)
{
    struct violation worst;

    follow_laws(run, take, 4000, &worst);
    assert_true(worst.force < 2e-3);
    assert_true(worst.moment < 1e-3);
    assert_true(worst.box_force < 4e-2);
    assert_true(worst.box_moment < 2e-2);
    assert_true(worst.bends < 0.01 * worst.instants);
    assert_true(worst.sensor_force < 2e-3);
    assert_true(worst.sensor_moment < 1e-3);
}

/* The box's momentum is what table, wrists and its weight have given it, pair by pair. */
TEST_ON(momentum_of_the_box_is_the_sum_of_its_impulses, run_begin_at_the_box, run)
{
    const struct contact_config *contact;
    double table[3] = {0.0}, wrists[3] = {0.0}, last[2][3] = {{0.0}}, mass, gravity, T = 0.0;
    int box = -1;

    contact = &run->scene.rig->contact;
    mass = run->scene.rig->free[0].inertia.mass;
    gravity = run->scene.robot->gravity[2];
    for (int k = 0; k <= 5000; k++) {
        struct contact_patch patch[PATCHES];
        size_t count = run->scene.contact->ops->patches(run->scene.contact, patch, PATCHES);
        double now[2][3] = {{0.0}};

        for (size_t i = 0; i < count; i++) {
            const struct contact_surface *a = &contact->surface[contact->pair[patch[i].pair].a];
            const struct contact_surface *b = &contact->surface[contact->pair[patch[i].pair].b];
            bool first = strcmp(a->name, "box") == 0, second = strcmp(b->name, "box") == 0;
            int other = (first ? b : a)->body >= 0;

            box += first || second;
            for (int x = 0; (first || second) && x < 3; x++) {
                now[other][x] += second ? patch[i].force[x] : -patch[i].force[x];
            }
        }
        for (int x = 0; k > 0 && x < 3; x++) {
            table[x] += 0.5 * h * (last[0][x] + now[0][x]);
            wrists[x] += 0.5 * h * (last[1][x] + now[1][x]);
        }
        memcpy(last, now, sizeof last);
        if (k < 5000) {
            take(run, h * k);
            advance(run);
            T += h;
        }
    }
    assert_true(box > 0);
    print_message("# impulses on the box in %.1f s: table %.5f, wrists %.5f, weight %.5f N s; "
                  "momentum %.5f N s, which leaves %.1e\n",
                  T, table[2], wrists[2], mass * gravity * T, run->window[WINDOW - 1].box.p[2],
                  table[2] + wrists[2] + mass * gravity * T - run->window[WINDOW - 1].box.p[2]);
    assert_true(wrists[2] > 1.0); /* they carry it at the end */
    for (int x = 0; x < 3; x++) {
        double given = table[x] + wrists[x] + (x == 2 ? mass * gravity * T : 0.0);

        assert_near(run->window[WINDOW - 1].box.p[x], given, 1e-5);
    }
}
