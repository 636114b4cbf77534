/* SPDX-License-Identifier: Apache-2.0 */
/* What the plant's sensors read, against closed answers and against another route to the force. */

#include "model/spatial.h"
#include "tests/physics/plant_rig.h"

static struct error error;

static void assert_vector(const double actual[3], double x, double y, double z, double tolerance)
{
    assert_near(actual[0], x, tolerance);
    assert_near(actual[1], y, tolerance);
    assert_near(actual[2], z, tolerance);
}

/* One body, mass 10 kg, center of mass at (0.02, 0, 0.3); force-torque and inertial sensor on it:
 * the first 0.05 m above the sole with 0.4 kg below it, the second at (0.1, 0.2, 0.3). */
struct block {
    struct toy toy;
    struct arena arena;
    struct dynamics dynamics;
    struct toy_ground ground;
    struct plant *plant;
    double *state;
};

static void block_init(struct block *block, bool floating)
{
    static const int body = 0;
    const double com[3] = {0.02, 0.0, 0.3}, I[6] = {0.3, 0.0, 0.0, 0.3, 0.0, 0.2};
    struct plant_config config = {.robot = &block->toy.robot,
                                  .dynamics = &block->dynamics,
                                  .contact = &block->ground.world,
                                  .contact_body = &body,
                                  .ncontact = 1,
                                  .integrator = PLANT_RK4,
                                  .substep_ns = 100000,
                                  .supply_v = 48.0};
    size_t count;

    toy_begin(&block->toy, floating, 10.0, com, I);
    block->toy.ft[0] = (struct robot_ft_sensor){
        .name = "ft",
        .frame = toy_add_frame(&block->toy, 0, (const double[3]){0.0, 0.0, 0.05}),
        .distal = {.mass = 0.4, .com = {0.01, 0.0, -0.03}, .I = {1e-3, 0, 0, 1e-3, 0, 1e-3}}};
    block->toy.robot.nft = 1;
    block->toy.robot.imu_frame = toy_add_frame(&block->toy, 0, (const double[3]){0.1, 0.2, 0.3});
    toy_finish(&block->toy);
    toy_ground_begin(&block->ground, 1);
    for (int corner = 0; corner < 4; corner++) {
        toy_ground_add(&block->ground, 0, corner & 1 ? 0.1 : -0.1, corner & 2 ? 0.1 : -0.1, 0.0);
    }
    block->ground.c = 30.0;
    assert_ok(arena_init(&block->arena, 1 << 20, &error));
    assert_ok(dynamics_generic(&block->toy.robot, &block->arena, &block->dynamics, &error));
    assert_ok(plant_create(&config, &block->arena, &block->plant, &error));
    block->state = plant_state(block->plant, &count);
}

static void block_reset(struct block *block, double height)
{
    const double position[3] = {0.0, 0.0, height}, upright[4] = {1.0, 0.0, 0.0, 0.0};
    const double joint[1] = {0.0};

    assert_ok(plant_reset(block->plant, position, upright, joint));
}

/* At rest the sensor carries all but what is below it; the ground carries all. What is above has
 * 9.6 kg with its center of mass where 10 c - 0.4 c_d says, and leans with the block, about y, as
 * the ground's springs give. */
TEST(standing_block_reads_the_carried_weight)
{
    static struct block block;
    const struct plant_sensors *sensors;
    const double weight = 9.6 * 9.81;
    double x = (10.0 * 0.02 - 0.4 * 0.01) / 9.6;
    double z = (10.0 * 0.3 - 0.4 * 0.02) / 9.6 - 0.05; /* from the sensor */
    double lean;

    block_init(&block, true);
    block_reset(&block, 0.0);
    assert_ok(plant_step(block.plant, 30000));
    assert_ok(plant_sample(block.plant));
    sensors = plant_sensors(block.plant);
    lean = 2.0 * asin(block.state[5]);
    print_message("# F/T %.6f N of %.6f N carried, leaning %.2e rad\n", sensors->ft[0].force_n[2],
                  weight, lean);
    assert_vector(sensors->ft[0].force_n, -weight * sin(lean), 0.0, weight * cos(lean), 1e-4);
    assert_vector(sensors->ft[0].torque_nm, 0.0, -weight * (x * cos(lean) + z * sin(lean)), 0.0,
                  1e-4);
    assert_near(lean, 2e-3, 1e-3);
    assert_vector(plant_contact_wrenches(block.plant)[0].force, 0.0, 0.0, 10.0 * 9.81, 1e-4);
    assert_vector(sensors->imu.accel_m_s2, -9.81 * sin(lean), 0.0, 9.81 * cos(lean), 1e-4);
    assert_vector(sensors->imu.gyro_rad_s, 0.0, 0.0, 0.0, 1e-6);
    assert_near(plant_motion(block.plant)[0].p[2], block.state[2], 0.0);
    assert_int_equal(sensors->time_ns, INT64_C(3000000000));
    arena_fini(&block.arena);
}

TEST(falling_block_feels_nothing)
{
    static struct block block;
    const struct plant_sensors *sensors;

    block_init(&block, true);
    block_reset(&block, 10.0);
    assert_ok(plant_step(block.plant, 1000));
    assert_ok(plant_sample(block.plant));
    sensors = plant_sensors(block.plant);
    assert_vector(sensors->ft[0].force_n, 0.0, 0.0, 0.0, 1e-12);
    assert_vector(sensors->ft[0].torque_nm, 0.0, 0.0, 0.0, 1e-12);
    assert_vector(sensors->imu.accel_m_s2, 0.0, 0.0, 0.0, 1e-12);
    arena_fini(&block.arena);
}

/* The block is turned by an angle about an axis, and the sensor on it by a right angle about the
 * block's x: its attitude is the product of the two quaternions, and what it sees of gravity and of
 * the Earth's field are these vectors, turned back twice by Rodrigues' formula. */
TEST(a_turned_block_reads_its_attitude)
{
    static struct block block;
    const double axis[3] = {0.6, 0.0, 0.8}, x_axis[3] = {1.0, 0.0, 0.0}, angle = 2.5;
    const double c = cos(0.5 * angle), s = sin(0.5 * angle), r = sqrt(0.5);
    const double turned[4] = {c, 0.6 * s, 0.0, 0.8 * s}, position[3] = {0.0, 0.0, 10.0};
    const double joint[1] = {0.0}, field[3] = {22.8e-6, 0.0, -41.1e-6};
    const double expected[4] = {r * (c - 0.6 * s), r * (c + 0.6 * s), r * 0.8 * s, r * 0.8 * s};
    const struct imu_sense *imu;
    double back[9], mount_back[9], of_block[3], of_sensor[3];

    block_init(&block, true);
    mat3_about_axis(x_axis, 0.5 * M_PI, block.toy.frame[block.toy.robot.imu_frame].rotation);
    assert_ok(plant_reset(block.plant, position, turned, joint));
    assert_ok(plant_sample(block.plant));
    imu = &plant_sensors(block.plant)->imu;
    for (int i = 0; i < 4; i++) {
        assert_near(imu->quaternion[i], (expected[0] < 0.0 ? -1.0 : 1.0) * expected[i], 1e-15);
    }
    mat3_about_axis(axis, -angle, back);
    mat3_about_axis(x_axis, -0.5 * M_PI, mount_back);
    mat3_apply(back, field, of_block);
    mat3_apply(mount_back, of_block, of_sensor);
    assert_vector(imu->magnetic_t, of_sensor[0], of_sensor[1], of_sensor[2], 1e-18);
    assert_near(vec3_norm(imu->magnetic_t), 47.0e-6, 0.01e-6);
    arena_fini(&block.arena);
}

/* Falling and turning at rate w about the vertical through its center of mass (a principal axis):
 * a point at offset r from there is pulled inward by w^2 r, and the mass below pulls outward. */
TEST(spinning_block_feels_the_centripetal_acceleration)
{
    static struct block block;
    const struct plant_sensors *sensors;
    const double w = 3.0;

    block_init(&block, true);
    block_reset(&block, 10.0);
    block.state[7 + 5] = w;
    block.state[7 + 1] = -w * 0.02; /* the origin circles, the center of mass does not */
    assert_ok(plant_sample(block.plant));
    sensors = plant_sensors(block.plant);
    assert_vector(sensors->imu.gyro_rad_s, 0.0, 0.0, w, 1e-15);
    assert_vector(sensors->imu.accel_m_s2, -w * w * (0.1 - 0.02), -w * w * 0.2, 0.0, 1e-12);
    assert_vector(sensors->ft[0].force_n, 0.4 * w * w * (0.01 - 0.02), 0.0, 0.0, 1e-12);
    assert_vector(sensors->ft[0].torque_nm, 0.0, -0.03 * 0.4 * w * w * (0.01 - 0.02), 0.0, 1e-12);
    arena_fini(&block.arena);
}

/* On a fixed base nothing moves: + g along up, and the part below hangs on the sensor. */
TEST(hanging_part_pulls_the_sensor_down)
{
    static struct block block;
    const struct plant_sensors *sensors;

    block_init(&block, false);
    block_reset(&block, 0.0);
    sensors = plant_sensors(block.plant);
    assert_vector(sensors->imu.accel_m_s2, 0.0, 0.0, 9.81, 1e-12);
    assert_vector(sensors->ft[0].force_n, 0.0, 0.0, -0.4 * 9.81, 1e-12);
    assert_vector(sensors->ft[0].torque_nm, 0.0, 0.01 * 0.4 * 9.81, 0.0, 1e-12);
    arena_fini(&block.arena);
}

/* A push on the sensor's body counts as acting below the sensor. */
TEST(push_on_the_foot_is_felt_in_full)
{
    static struct block block;
    const struct plant_sensors *sensors;
    const double force[3] = {7.0, -3.0, 5.0}, moment[3] = {0.3, 0.2, -0.1};

    block_init(&block, false);
    block_reset(&block, 0.0);
    plant_set_push(block.plant, 0, force, moment);
    assert_ok(plant_sample(block.plant));
    sensors = plant_sensors(block.plant);
    assert_vector(sensors->ft[0].force_n, 7.0, -3.0, 5.0 - 0.4 * 9.81, 1e-12);
    /* About the sensor, 0.05 above the origin: moment - (0, 0, 0.05) x force */
    assert_vector(sensors->ft[0].torque_nm, 0.3 + 0.05 * -3.0, 0.2 - 0.05 * 7.0 + 0.01 * 0.4 * 9.81,
                  -0.1, 1e-12);
    arena_fini(&block.arena);
}

/* The walker with the part below its right sensor cut off as a body of its own, on a joint that
 * inverse dynamics keeps still: the force or torque of that joint is what the sensor must read,
 * negated. type and axis choose which of the six components that is. */
static double force_across_the_cut(const struct plant_rig *rig, const double *vdot,
                                   const struct wrench *push, enum joint_type type, int axis)
{
    struct toy cut = rig->toy;
    const struct robot_frame *frame = &cut.frame[cut.ft[0].frame];
    const struct robot_inertia *distal = &cut.ft[0].distal;
    struct robot_inertia *foot = &cut.body[TOY_RIGHT_FOOT].inertia;
    const double unit[3] = {axis == 0, axis == 1, axis == 2};
    double com[3], I[6], arm[3], q[16] = {0}, v[15] = {0}, a[15] = {0}, f[15] = {0};
    struct wrench ext[TOY_BODIES] = {0};
    struct spatial_inertia whole, part, point;
    struct dynamics dynamics;
    struct arena arena;
    size_t j;

    cut.robot.body = cut.body;
    cut.robot.joint = cut.joint;
    cut.robot.frame = cut.frame;
    cut.robot.ft = cut.ft;

    /* What is left of the foot: inertias about its origin subtract */
    mat3_apply(frame->rotation, distal->com, com);
    for (int i = 0; i < 3; i++) {
        com[i] += frame->position[i];
    }
    memcpy(I, distal->I, sizeof I);
    sym3_rotate(frame->rotation, I);
    spatial_inertia_rigid(foot->mass, foot->com, foot->I, &whole);
    spatial_inertia_rigid(distal->mass, com, I, &part);
    for (int i = 0; i < 3; i++) {
        foot->com[i] =
            (foot->mass * foot->com[i] - distal->mass * com[i]) / (foot->mass - distal->mass);
    }
    foot->mass -= distal->mass;
    spatial_inertia_rigid(foot->mass, foot->com, (const double[6]){0}, &point);
    for (int i = 0; i < 6; i++) {
        foot->I[i] = whole.J[i] - part.J[i] - point.J[i];
    }
    j = toy_add(&cut, TOY_RIGHT_FOOT, type, unit, frame->position, distal->mass, distal->com,
                distal->I);
    memcpy(cut.joint[j].rotation, frame->rotation, sizeof frame->rotation);
    toy_finish(&cut);

    /* The same motion, the new joint still; the push acts below the cut, about the new origin */
    memcpy(q, rig->state, 15 * sizeof *q);
    memcpy(v, rig->state + 15, 14 * sizeof *v);
    memcpy(a, vdot, 14 * sizeof *a);
    mat3_apply_transposed(frame->rotation, push->force, ext[j + 1].force);
    memcpy(arm, push->moment, sizeof arm);
    vec3_add_cross(push->force, frame->position, arm);
    mat3_apply_transposed(frame->rotation, arm, ext[j + 1].moment);
    assert_ok(arena_init(&arena, 1 << 20, &error));
    assert_ok(dynamics_generic(&cut.robot, &arena, &dynamics, &error));
    dynamics.ops->inverse(&dynamics, q, v, a, ext, f);
    arena_fini(&arena);
    return -f[6 + j];
}

TEST(foot_sensor_reads_the_force_across_the_cut)
{
    static struct plant_rig rig;
    const double force[3] = {20.0, -35.0, 90.0}, moment[3] = {2.0, 1.0, -3.0};
    const struct ft_sense *ft;
    struct wrench ext[TOY_BODIES] = {0};
    double tau[8], vdot[14];

    plant_rig_walker(&rig, false, 100000);
    plant_rig_reset(&rig, 1.0);
    for (size_t j = 0; j < 8; j++) {
        plant_command(rig.plant)->motor[j].pretension_m = 1.0; /* ropes slack */
    }
    plant_set_push(rig.plant, TOY_RIGHT_FOOT, force, moment);
    plant_rig_random_voltages(&rig, 20.0);
    for (size_t i = 0; i < 6; i++) {
        rig.state[15 + i] = 0.5 + 0.3 * (double)i;
    }
    assert_ok(plant_step(rig.plant, 500));
    assert_ok(plant_sample(rig.plant));
    ft = &plant_sensors(rig.plant)->ft[0];

    /* The accelerations by the drives' torques and the push */
    for (size_t j = 0; j < 8; j++) {
        tau[j] = plant_sensors(rig.plant)->motor[j].torque_nm;
    }
    mat3_apply_transposed(plant_motion(rig.plant)[TOY_RIGHT_FOOT].R, force,
                          ext[TOY_RIGHT_FOOT].force);
    mat3_apply_transposed(plant_motion(rig.plant)[TOY_RIGHT_FOOT].R, moment,
                          ext[TOY_RIGHT_FOOT].moment);
    rig.dynamics.ops->forward(&rig.dynamics, rig.state, rig.state + 15, tau, ext, vdot);

    for (int i = 0; i < 3; i++) {
        double across = force_across_the_cut(&rig, vdot, &ext[TOY_RIGHT_FOOT], JOINT_PRISMATIC, i);
        double twist = force_across_the_cut(&rig, vdot, &ext[TOY_RIGHT_FOOT], JOINT_REVOLUTE, i);

        print_message("# axis %d: %.9f N of %.9f, %.9f N m of %.9f\n", i, ft->force_n[i], across,
                      ft->torque_nm[i], twist);
        assert_near(ft->force_n[i], across, 1e-9 * 100.0);
        assert_near(ft->torque_nm[i], twist, 1e-9 * 10.0);
    }
    plant_rig_fini(&rig);
}

/* The inertial sensor's specific force against second differences of its place along the motion,
 * whose own error is about (w h)^2/12 of what the ankle springs (w = 600 rad/s) shake: 3e-4. */
TEST(inertial_sensor_agrees_with_the_path_that_it_takes)
{
    static struct plant_rig rig;
    const struct robot_frame *frame;
    double place[3][3], expected[3], R[9], accel[3] = {0}, w[3], wR[3], h = 1e-4;

    plant_rig_walker(&rig, false, 10000);
    plant_rig_reset(&rig, 1.0);
    for (size_t i = 0; i < 6; i++) {
        rig.state[15 + i] = 0.5 + 0.3 * (double)i;
    }
    frame = &rig.toy.frame[rig.toy.robot.imu_frame];
    for (int k = 0; k < 3; k++) {
        const struct body_motion *motion = plant_motion(rig.plant);
        double arm[3];

        assert_ok(plant_sample(rig.plant));
        mat3_apply(motion[0].R, frame->position, arm);
        for (int i = 0; i < 3; i++) {
            place[k][i] = motion[0].p[i] + arm[i];
        }
        if (k == 1) {
            mat3_mul(motion[0].R, frame->rotation, R);
            memcpy(accel, plant_sensors(rig.plant)->imu.accel_m_s2, sizeof accel);
            memcpy(w, motion[0].w, sizeof w);
            mat3_apply_transposed(R, w, wR);
            assert_vector(plant_sensors(rig.plant)->imu.gyro_rad_s, wR[0], wR[1], wR[2], 1e-12);
        }
        assert_ok(plant_step(rig.plant, 10));
    }
    for (int i = 0; i < 3; i++) {
        expected[i] =
            (place[0][i] - 2.0 * place[1][i] + place[2][i]) / (h * h) - rig.toy.robot.gravity[i];
    }
    mat3_apply(R, accel, w);
    assert_vector(w, expected[0], expected[1], expected[2], 5e-4);
    plant_rig_fini(&rig);
}
