/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Static equilibrium of simple things, against statics: blocks on the native engine's beds of
 * springs, a pendulum on its drive. And what is refused, with the reason.
 */
#include "model/drives/actuator.h"
#include "model/settle.h"

#include "model/spatial.h"
#include "tests/physics/near.h"
#include "tests/physics/toy.h"

enum { BLOCKS = 3 };

static const double gravity = 9.81, mass = 1.5, half = 0.075; /* of a block, kg and m */
static const double stiffness = 2.5e6; /* of a pair of the blocks' surfaces, N/m3 */

/* Blocks that are joined to nothing over the ground, and a robot that hangs from the world: a
 * horizontal arm on one axis. */
struct yard {
    struct toy toy;
    struct arena arena;
    struct dynamics dynamics;
    struct contact_world *contact;
    struct plant *plant;
    struct plant_free_body block[BLOCKS];
    size_t nblock, walls; /* walls: surfaces behind the blocks', and their pairs */
    struct contact_surface surface[1 + BLOCKS];
    struct contact_pair pair[BLOCKS];
    double supply_v, young_pa, friction, joint;
    enum contact_friction law;
    struct settled settled;
    struct error error;
};

/* A block that stands just on the ground, or on the block below it. */
static void yard_begin(struct yard *yard, size_t nblock)
{
    static const double axis[3] = {0.0, 1.0, 0.0}, origin[3] = {0.0, 5.0, 2.0};
    static const double none[6], still[3], com[3] = {0.4, 0.0, 0.0};
    static const double I[6] = {0.01, 0.0, 0.0, 0.02, 0.0, 0.02};

    *yard = (struct yard){.nblock = nblock, .supply_v = 48.0, .young_pa = 5e3, .friction = 1.0};
    toy_begin(&yard->toy, false, 0.0, still, none);
    toy_add(&yard->toy, 0, JOINT_REVOLUTE, axis, origin, 3.0, com, I);
    yard->toy.joint[0].sea = toy_drive(395.46);
    mat3_identity(yard->surface[0].rotation);
    yard->surface[0].name = "ground";
    yard->surface[0].body = -1;
    for (size_t b = 0; b < nblock; b++) {
        const double i = mass * half * half * 2.0 / 3.0;

        yard->block[b] = (struct plant_free_body){.name = b ? "upper block" : "block",
                                                  .quaternion = {1.0, 0.0, 0.0, 0.0}};
        yard->block[b].inertia =
            (struct robot_inertia){.mass = mass, .I = {i, 0.0, 0.0, i, 0.0, i}};
        yard->block[b].position[2] = half * (double)(2 * b + 1);
        yard->surface[1 + b] = (struct contact_surface){
            .name = "side", .body = (int)b, .shape = CONTACT_BOX, .cells_per_edge = 2};
        mat3_identity(yard->surface[1 + b].rotation);
        for (int k = 0; k < 3; k++) {
            yard->surface[1 + b].half_extent_m[k] = half;
        }
        yard->pair[b] = (struct contact_pair){.a = (int)b, .b = 1 + (int)b};
    }
}

/* Makes the plant and asks it to settle. */
static enum error_code yard_settle(struct yard *yard)
{
    int body[BLOCKS];
    struct contact_config contact = {.nbody = yard->nblock,
                                     .nsurface = 1 + yard->nblock + yard->walls,
                                     .surface = yard->surface,
                                     .npair = yard->nblock + yard->walls,
                                     .pair = yard->pair,
                                     .transition_velocity_m_s = 0.01,
                                     .friction = yard->law};
    struct plant_config config = {.robot = &yard->toy.robot,
                                  .dynamics = &yard->dynamics,
                                  .free = yard->block,
                                  .nfree = yard->nblock,
                                  .contact_body = body,
                                  .ncontact = yard->nblock,
                                  .substep_ns = 1000000,
                                  .integrator = PLANT_IMPLICIT,
                                  .supply_v = yard->supply_v};

    for (size_t s = 0; s < 1 + yard->nblock + yard->walls; s++) {
        yard->surface[s].material = (struct contact_material){.young_pa = yard->young_pa,
                                                              .thickness_m = 1e-3,
                                                              .dissipation_s_per_m = 1.0,
                                                              .static_friction = yard->friction,
                                                              .dynamic_friction = yard->friction};
    }
    for (size_t b = 0; b < yard->nblock; b++) {
        body[b] = 2 + (int)b;
    }
    toy_finish(&yard->toy);
    assert_ok(arena_init(&yard->arena, 16 << 20, &yard->error));
    assert_ok(dynamics_generic(&yard->toy.robot, &yard->arena, &yard->dynamics, &yard->error));
    assert_no_error(yard->nblock > 0 &&
                        contact_native_create(&contact, &yard->arena, &yard->contact, &yard->error),
                    yard->error.text);
    config.contact = yard->contact;
    assert_no_error(plant_create(&config, &yard->arena, &yard->plant, &yard->error),
                    yard->error.text);
    assert_ok(plant_reset(yard->plant, NULL, NULL, &yard->joint));
    return plant_settle(yard->plant, &yard->arena, &yard->settled, &yard->error);
}

static void yard_settle_well(struct yard *yard)
{
    assert_no_error(yard_settle(yard), yard->error.text);
}

static void yard_fini(struct yard *yard)
{
    arena_fini(&yard->arena);
}

/* What stays after some time on its own */
static void assert_stays(struct yard *yard, double tolerance)
{
    double before[7], after[7];

    for (size_t b = 0; b < yard->nblock; b++) {
        plant_free_pose(yard->plant, b, before);
        assert_ok(plant_step(yard->plant, 300));
        plant_free_pose(yard->plant, b, after);
        for (int i = 0; i < 7; i++) {
            assert_near(after[i], before[i], tolerance);
        }
    }
}

/* ---- statics ---- */

CLOSED_BENCH(yard, struct yard, yard_fini)

TEST_ON(block_sinks_into_the_ground_by_its_weight_over_the_stiffness, yard, yard)
{
    const double depth = mass * gravity / (stiffness * 4.0 * half * half);
    double pose[7];

    yard_begin(yard, 1);
    yard_settle_well(yard);
    plant_free_pose(yard->plant, 0, pose);
    print_message("# %.6f mm deep of %.6f mm after %zu iterations, %.1g of the weight left over\n",
                  1e3 * (half - pose[2]), 1e3 * depth, yard->settled.iterations,
                  yard->settled.residual);
    assert_near(half - pose[2], depth, 1e-9 * depth);
    assert_near(plant_contact_wrenches(yard->plant)[0].force[2], mass * gravity, 1e-9);
    assert_int_equal(plant_time_ns(yard->plant), 0);
    assert_stays(yard, 1e-9);
}

/* The bed's pressure is linear: its moment about the middle, k theta a^4/12, is the weight's, at
 * the lever c cos theta + h sin theta with the center of mass h above the sole. */
TEST_ON(block_with_its_mass_off_the_middle_tilts_as_the_bed_gives_way, yard, yard)
{
    const double a = 2.0 * half, c = 0.1 * a, weight = mass * gravity;
    double pose[7], R[9], tilt;

    yard_begin(yard, 1);
    yard->block[0].inertia.com[0] = c;
    yard_settle_well(yard);
    plant_free_pose(yard->plant, 0, pose);
    mat3_from_quaternion(pose + 3, R);
    tilt = atan2(R[2], R[8]);
    print_message("# tilted by %.6f mrad\n", 1e3 * tilt);
    assert_near(stiffness * tilt * a * a * a * a / 12.0, weight * (c + half * tilt),
                2e-3 * weight * c);
    assert_near(pose[4], 0.0, 1e-12);
}

/* As soon as it has lifted an edge the pressure is a triangle below the center of mass: it is
 * 3 (a/2 - c) wide and its peak k depth makes up the weight with that width. */
TEST_ON(block_near_tipping_stands_on_a_part_of_its_sole, yard, yard)
{
    const double a = 2.0 * half, c = 0.3 * a, weight = mass * gravity;
    const double width = 3.0 * (0.5 * a - c), depth = 2.0 * weight / (stiffness * a * width);
    double pose[7], R[9];

    yard_begin(yard, 1);
    yard->block[0].inertia.com[0] = c;
    yard->block[0].inertia.com[2] = -half; /* in the sole: no lever of the tilt */
    yard_settle_well(yard);
    plant_free_pose(yard->plant, 0, pose);
    mat3_from_quaternion(pose + 3, R);
    assert_near(tan(atan2(R[2], R[8])), depth / width, 5e-3 * depth / width);
}

TEST_ON(block_dropped_from_a_hand_above_and_askew_lands_flat, yard, yard)
{
    const double depth = mass * gravity / (stiffness * 4.0 * half * half);
    double pose[7];

    yard_begin(yard, 1);
    yard->block[0].position[0] = 0.3;
    yard->block[0].position[2] = half + 0.08;
    yard->block[0].quaternion[1] = 0.05;
    yard->block[0].quaternion[2] = -0.08;
    yard_settle_well(yard);
    plant_free_pose(yard->plant, 0, pose);
    print_message("# %zu iterations\n", yard->settled.iterations);
    assert_near(half - pose[2], depth, 1e-6 * depth);
    assert_near(hypot(pose[4], pose[5]), 0.0, 1e-8);
    assert_near(pose[0], 0.3, 1e-12);
}

TEST_ON(block_that_starts_deep_in_the_ground_rises, yard, yard)
{
    const double depth = mass * gravity / (stiffness * 4.0 * half * half);
    double pose[7];

    yard_begin(yard, 1);
    yard->block[0].position[2] = half - 0.03;
    yard_settle_well(yard);
    plant_free_pose(yard->plant, 0, pose);
    assert_near(half - pose[2], depth, 1e-6 * depth);
}

TEST_ON(each_block_of_a_pile_carries_those_above, yard, yard)
{
    yard_begin(yard, BLOCKS);
    yard_settle_well(yard);
    for (size_t b = 0; b < BLOCKS; b++) {
        double below = b ? 0.0 : half, pose[7], load, depth;

        if (b > 0) {
            plant_free_pose(yard->plant, b - 1, pose);
            below = pose[2] + 2.0 * half;
        }
        plant_free_pose(yard->plant, b, pose);
        load = (double)(BLOCKS - b) * mass * gravity;
        depth = b ? (half - cbrt(half * half * half - 0.75 * load / stiffness))
                  : load / (stiffness * 4.0 * half * half);
        assert_near(below - pose[2], depth, 1e-6 * depth);
        assert_near(plant_contact_wrenches(yard->plant)[b].force[2], mass * gravity, 1e-6);
    }
    assert_stays(yard, 1e-6);
}

/* m g r = Ks (qm - q) = Kt I, and V = R I holds it. */
TEST_ON(arm_hangs_on_its_spring_and_current, yard, yard)
{
    const double torque = -3.0 * gravity * 0.4 * cos(0.3);
    const struct motor_sense *motor;
    const struct robot_sea *sea;

    yard_begin(yard, 0);
    yard->joint = 0.3;
    yard_settle_well(yard);
    motor = plant_sensors(yard->plant)->motor;
    sea = &yard->toy.joint[0].sea;
    assert_near(motor->q, 0.3, 0.0);
    assert_near(motor->torque_nm, torque, 1e-9);
    assert_near(motor->qm - motor->q, torque / sea->Ks, 1e-12);
    assert_near(motor->current_a, torque / sea->Kt, 1e-12);
    assert_near(plant_command(yard->plant)->motor[0].voltage_v, sea->R * torque / sea->Kt, 1e-12);
    assert_ok(plant_step(yard->plant, 500));
    assert_ok(plant_sample(yard->plant));
    assert_near(motor->q, 0.3, 1e-9);
}

/* The rope takes a part of the torque, the drive the rest. */
TEST_ON(parallel_spring_takes_its_share, yard, yard)
{
    const double torque = -3.0 * gravity * 0.4 * cos(0.3);
    double share;

    yard_begin(yard, 0);
    yard->joint = 0.3;
    yard->toy.joint[0].spring = (struct robot_parallel_spring){
        .present = true, .enabled = true, .k_p = 2000.0, .d_p = 10.0, .r = 0.05, .s = 1.0};
    share = parallel_spring_torque(&yard->toy.joint[0].spring, 0.0, 0.0, 0.3, 0.0);
    yard_settle_well(yard);
    assert_true(fabs(share) > 1.0);
    assert_near(plant_sensors(yard->plant)->motor[0].torque_nm, torque - share, 1e-9);
}

TEST_ON(thrown_body_is_left_alone, yard, yard)
{
    double pose[7];

    yard_begin(yard, 1);
    yard->block[0].position[2] = 2.0;
    yard->block[0].v[0] = 1.0;
    yard_settle_well(yard);
    plant_free_pose(yard->plant, 0, pose);
    assert_near(pose[2], 2.0, 0.0);
    assert_near(plant_motion(yard->plant)[yard->toy.robot.nbody].v[0], 1.0, 0.0);
}

/* ---- held by friction ---- */

/* Ground that slopes down to +x by slope rad, blocks on it in a pile, gravity upright. */
static void yard_slope(struct yard *yard, size_t nblock, double slope)
{
    const double rpy[3] = {0.0, slope, 0.0}, half_turn = 0.5 * slope;

    yard_begin(yard, nblock);
    yard->law = CONTACT_FRICTION_STICKING;
    mat3_from_rpy(rpy, yard->surface[0].rotation);
    for (size_t b = 0; b < nblock; b++) {
        const double along = half * (double)(2 * b + 1);

        yard->block[b].position[0] = along * sin(slope);
        yard->block[b].position[2] = along * cos(slope);
        yard->block[b].quaternion[0] = cos(half_turn);
        yard->block[b].quaternion[2] = sin(half_turn);
    }
}

/* Blocks on a slope of 5 degrees are held from the first step on, without a jerk: what the table
 * gives is their weight, and after a second they are where they were. */
TEST(blocks_on_a_slope_settle_with_their_bristles_bent)
{
    const double slope = 5.0 * 3.14159265358979323846 / 180.0;

    for (size_t nblock = 1; nblock <= BLOCKS; nblock++) {
        struct yard yard CLOSED_BY(yard_fini);
        double pose[7], jerk = 0.0;

        yard_slope(&yard, nblock, slope);
        yard_settle_well(&yard);
        plant_free_pose(yard.plant, 0, pose);
        for (int k = 0; k < 100; k++) {
            assert_ok(plant_step(yard.plant, 1));
            for (size_t b = 0; b < nblock; b++) {
                const double *force = plant_contact_wrenches(yard.plant)[b].force;
                const double *v = plant_motion(yard.plant)[yard.toy.robot.nbody + b].v;

                jerk = fmax(jerk, hypot(hypot(force[0], force[1]), force[2] - mass * gravity));
                assert_true(vec3_norm(v) < 1e-8);
            }
        }
        print_message(
            "# %zu: %zu iterations, %.1g of the weight left over, base block moved by "
            "%.2e m; forces off by %.1e N at most\n",
            nblock, yard.settled.iterations, yard.settled.residual,
            hypot(pose[0] - yard.block[0].position[0], pose[2] - yard.block[0].position[2]), jerk);
        assert_true(jerk < 1e-5 * mass * gravity);
        assert_stays(&yard, 1e-9);
    }
}

/* A block whose friction is just enough, and one whose friction is not. */
TEST(friction_decides_whether_a_block_on_a_slope_settles)
{
    struct yard yard;

    yard_slope(&yard, 1, 0.2);
    yard.friction = 1.02 * tan(0.2);
    yard_settle_well(&yard);
    assert_stays(&yard, 1e-8);
    yard_fini(&yard);

    yard_slope(&yard, 1, 0.2);
    yard.friction = 0.98 * tan(0.2);
    assert_int_equal(yard_settle(&yard), ERROR_INPUT);
    print_message("# %s\n", yard.error.text);
    assert_non_null(strstr(yard.error.text, "slide"));
    yard_fini(&yard);
}

/* However the search ended: the angle of the slope, and that of the cone of friction. */
TEST(a_block_that_slides_is_told_its_slope_and_its_friction)
{
    static const double slope[] = {0.1, 0.2, 0.35, 0.5}, part[] = {0.1, 0.5, 0.95};
    char expected[128];
    struct yard yard;

    for (size_t i = 0; i < sizeof slope / sizeof *slope; i++) {
        for (size_t k = 0; k < sizeof part / sizeof *part; k++) {
            yard_slope(&yard, 1, slope[i]);
            yard.friction = part[k] * tan(slope[i]);
            assert_int_equal(yard_settle(&yard), ERROR_INPUT);
            print_message("# %s\n", yard.error.text);
            snprintf(expected, sizeof expected,
                     "block would slide: it stands on a slope of %.3g rad, where %.3g N push it",
                     slope[i], mass * gravity * tan(slope[i]));
            assert_memory_equal(yard.error.text, expected, strlen(expected));
            assert_near(strtod(strstr(yard.error.text, "up to ") + 6, NULL), atan(yard.friction),
                        0.005 * slope[i]);
            yard_fini(&yard);
        }
    }
}

/* Between two walls that press it, with nothing under it. */
TEST_ON(a_block_between_two_walls_is_held_by_them, yard, yard)
{
    static const double into[2][3] = {{0.0, 1.5707963267948966, 0.0},
                                      {0.0, -1.5707963267948966, 0.0}};
    const double depth = 2e-4; /* 11 N */

    yard_begin(yard, 1);
    yard->law = CONTACT_FRICTION_STICKING;
    yard->surface[2] = yard->surface[0];
    yard->surface[2].name = "wall";
    for (int w = 0; w < 2; w++) {
        struct contact_surface *wall = &yard->surface[2 * w];

        mat3_from_rpy(into[w], wall->rotation);
        wall->position[0] = (w ? 1.0 : -1.0) * (half - depth);
    }
    yard->pair[1] = (struct contact_pair){.a = 1, .b = 2};
    yard->walls = 1;
    yard_settle_well(yard);
    assert_near(plant_contact_wrenches(yard->plant)[0].force[2], mass * gravity, 1e-6);
    assert_stays(yard, 1e-8);
}

/* ---- refusals ---- */

/* The message has these words, and the plant is as it was reset */
static void assert_refused(struct yard *yard, const char *name, const char *reason)
{
    uint64_t before, after;

    assert_int_equal(yard_settle(yard), ERROR_INPUT);
    print_message("# %s\n", yard->error.text);
    assert_non_null(strstr(yard->error.text, name));
    assert_non_null(strstr(yard->error.text, reason));
    after = plant_hash(yard->plant);
    assert_ok(plant_reset(yard->plant, NULL, NULL, &yard->joint));
    before = plant_hash(yard->plant);
    assert_true(before == after);
    assert_false(plant_command(yard->plant)->motor[0].bridge_on);
    yard_fini(yard);
}

TEST(refuses_a_body_that_nothing_supports)
{
    struct yard yard;

    yard_begin(&yard, 1);
    yard.block[0].position[2] = 1.0;
    assert_refused(&yard, "block", "not supported");
}

TEST(refuses_a_body_that_tips_over)
{
    struct yard yard;

    yard_begin(&yard, 2);
    yard.block[1].position[0] = 1.1 * half; /* over the edge of the one below */
    assert_refused(&yard, "upper block", "tips over");
}

TEST(refuses_a_body_that_would_slide)
{
    static const double rpy[3] = {0.0, 0.2, 0.0};
    struct yard yard;

    yard_begin(&yard, 1);
    mat3_from_rpy(rpy, yard.surface[0].rotation);
    assert_refused(&yard, "block", "slide");
}

/* Softer than the weight topples: k a^4/12 < m g h. It stands upright like a pencil, and rounding
 * decides whether it is found upright and about to topple or already tipping over. */
TEST(refuses_a_rest_that_is_not_stable)
{
    struct yard yard;

    yard_begin(&yard, 1);
    yard.young_pa = 2.0 * 0.5 * mass * gravity * half * 12.0 / pow(2.0 * half, 4.0) * 1e-3;
    yard.block[0].inertia.com[2] = half;
    assert_refused(&yard, "block", "t"); /* topple, tips */
}

TEST(refuses_a_joint_without_a_drive_under_load)
{
    struct yard yard;

    yard_begin(&yard, 0);
    yard.toy.joint[0].sea.present = false;
    assert_refused(&yard, "j0", "no drive");
}

TEST(refuses_a_load_beyond_the_supply)
{
    struct yard yard;

    yard_begin(&yard, 0);
    yard.supply_v = 0.1;
    assert_refused(&yard, "j0", "0.1 V");
}

TEST(refuses_a_world_without_gravity)
{
    struct yard yard;

    yard_begin(&yard, 1);
    yard.toy.robot.gravity[2] = 0.0;
    assert_refused(&yard, "gravity", "");
}
