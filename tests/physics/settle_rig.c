/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The rigs' static equilibrium: what carries what at time zero, that nothing moves afterwards, that
 * it is where a run from the rig's own start comes to rest, and that the clamp keeps it until the
 * motors are on.
 */

#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

static const struct rig_scene_choice coman = {
    .file = "coman.yaml", .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};
static const struct rig_scene_choice creeping = {.file = "coman.yaml",
                                                 .integrator = PLANT_IMPLICIT,
                                                 .substep_ns = 1000000,
                                                 .regularized = true,
                                                 .transition_velocity_m_s = 0.1};
static const struct rig_scene_choice grasp = {
    .file = "grasp.yaml", .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};

static double weight_of(const struct rig_scene *scene)
{
    return -scene->robot->total_mass * scene->robot->gravity[2];
}

/* Largest deviation of the feet's force from the weight over some milliseconds of holding */
static double hold(struct rig_scene *scene, int milliseconds)
{
    double peak = 0.0;

    for (int k = 0; k < milliseconds; k++) {
        rig_scene_hold(scene);
        peak = fmax(peak, fabs(rig_scene_feet(scene) - weight_of(scene)));
    }
    return peak;
}

CLOSED_BENCH(rig_scene, struct rig_scene, rig_scene_fini)

TEST_ON(coman_stands_still_from_the_first_step, rig_scene, scene)
{
    struct settled settled;
    double before[7], peak, *values;
    size_t count;

    rig_scene_init(scene, &coman);
    settled = rig_scene_settle(scene);
    values = plant_state(scene->plant, &count);
    memcpy(before, values, sizeof before);
    print_message("# base %.3f mm lower and tilted by %.3f mrad after %zu iterations; feet carry "
                  "%.9f N of %.9f N\n",
                  -1e3 * settled.rise_m, 1e3 * settled.tilt_rad, settled.iterations,
                  rig_scene_feet(scene), weight_of(scene));
    assert_near(rig_scene_feet(scene), weight_of(scene), 1e-6);
    peak = hold(scene, 1000);
    print_message("# largest deviation in a second: %.1e N\n", peak);
    assert_true(peak < 1e-6);
    for (int i = 0; i < 7; i++) {
        assert_near(values[i], before[i], 1e-9);
    }
}

/* From the rig's start, links as they will be but springs relaxed and soles on the surface, the
 * same references lead into the same rest. What friction keeps of the landing creeps away
 * slowly. */
/* With the friction that lets feet creep to where nothing pulls at them sideways. */
TEST_ON(a_damped_run_from_the_rigs_start_ends_in_the_same_place, rig_scene, scene)
{
    double rest[7], feet[2], q[RIG_SCENE_JOINTS], worst = 0.0, *values;
    size_t count;

    rig_scene_init(scene, &creeping);
    rig_scene_settle(scene);
    values = plant_state(scene->plant, &count);
    memcpy(rest, values, sizeof rest);
    for (size_t c = 0; c < 2; c++) {
        feet[c] = plant_contact_wrenches(scene->plant)[c].force[2];
    }
    for (size_t j = 0; j < scene->robot->njoint; j++) {
        q[j] = plant_sensors(scene->plant)->motor[j].q;
    }
    rig_scene_reset(scene);
    hold(scene, 6000);
    for (size_t j = 0; j < scene->robot->njoint; j++) {
        worst = fmax(worst, fabs(plant_sensors(scene->plant)->motor[j].q - q[j]));
    }
    print_message("# base off by %.1e %.1e %.1e m, %.1e rad; worst joint %.1e rad; feet by %.3f "
                  "and %.3f N\n",
                  values[0] - rest[0], values[1] - rest[1], values[2] - rest[2],
                  2.0 * hypot(values[4] - rest[4], values[5] - rest[5]), worst,
                  plant_contact_wrenches(scene->plant)[0].force[2] - feet[0],
                  plant_contact_wrenches(scene->plant)[1].force[2] - feet[1]);
    assert_near(values[2], rest[2], 1e-5);
    assert_near(values[4], rest[4], 1e-4);
    assert_near(values[5], rest[5], 1e-4);
    assert_true(worst < 2e-4);
    for (size_t c = 0; c < 2; c++) {
        assert_near(plant_contact_wrenches(scene->plant)[c].force[2], feet[c],
                    1e-3 * weight_of(scene));
    }
}

/* Without it the robot falls into its springs and layers: the transient that is to be avoided. */
TEST_ON(the_rigs_own_start_has_a_transient, rig_scene, scene)
{
    double peak;

    rig_scene_init(scene, &coman);
    rig_scene_settle(scene);
    rig_scene_reset(scene);
    peak = hold(scene, 300);
    print_message("# largest deviation within 0.3 s of the rig's start: %.1f N\n", peak);
    assert_true(peak > 0.2 * weight_of(scene));
}

TEST_ON(the_box_of_the_grasp_rests_on_the_table_at_time_zero, rig_scene, scene)
{
    double box, peak;

    rig_scene_init(scene, &grasp);
    rig_scene_settle(scene);
    box = rig_scene_wrench(scene, (int)scene->robot->nbody)->force[2];
    print_message("# table carries %.9f N, feet %.9f N\n", box, rig_scene_feet(scene));
    assert_int_equal(plant_time_ns(scene->plant), 0);
    assert_near(box, 14.715, 1e-6);
    assert_near(rig_scene_feet(scene), weight_of(scene), 1e-6);
    peak = hold(scene, 300);
    assert_true(peak < 1e-5);
    assert_near(rig_scene_wrench(scene, (int)scene->robot->nbody)->force[2], 14.715, 1e-5);
}

/* Motors off of a clamped robot: rotors, springs and contacts stay as they are, to the last bit;
 * once let go with the holding voltages the weight stays on the feet. */
TEST(a_jig_keeps_the_springs_loaded_until_it_lets_go)
{
    static const enum plant_integrator integrators[] = {PLANT_IMPLICIT, PLANT_RK4};

    for (int n = 0; n < 2; n++) {
        struct rig_scene_choice choice = coman;
        static struct rig_scene scene;
        struct motor_sense before[RIG_SCENE_JOINTS];
        const struct motor_sense *motor;
        struct plant_energy energy;
        double peak;

        choice.integrator = integrators[n];
        choice.substep_ns = n ? 250000 : 1000000;
        rig_scene_init(&scene, &choice);
        plant_clamp(scene.plant, true);
        rig_scene_settle(&scene);
        motor = plant_sensors(scene.plant)->motor;
        memcpy(before, motor, scene.robot->njoint * sizeof *before);
        for (size_t j = 0; j < scene.robot->njoint; j++) {
            plant_command(scene.plant)->motor[j].bridge_on = false;
        }
        assert_ok(plant_step(scene.plant, 50 * scene.steps));
        assert_ok(plant_sample(scene.plant));
        assert_near(rig_scene_feet(&scene), weight_of(&scene), 1e-6);
        for (size_t j = 0; j < scene.robot->njoint; j++) {
            assert_true(motor[j].q == before[j].q && motor[j].qm == before[j].qm);
            assert_near(motor[j].torque_nm, before[j].torque_nm, 1e-12);
            assert_near(motor[j].current_a, 0.0, 0.0);
        }
        assert_ok(plant_energy(scene.plant, &energy));
        assert_near(energy.balance, 0.0, 1e-12);
        hold(&scene, 20); /* the currents come back while the clamp still holds */
        plant_clamp(scene.plant, false);
        peak = hold(&scene, 300);
        print_message("# largest deviation after the clamp: %.1e N\n", peak);
        assert_true(peak < 1e-3);
        rig_scene_fini(&scene);
    }
}

/* A reset robot that is clamped is as ever: motors move behind their springs, feet feel nothing. */
TEST_ON(resetting_takes_the_jig_off_the_rotors, rig_scene, scene)
{
    rig_scene_init(scene, &coman);
    plant_clamp(scene->plant, true);
    rig_scene_settle(scene);
    rig_scene_reset(scene);
    assert_true(plant_is_clamped(scene->plant));
    plant_command(scene->plant)->motor[0] =
        (struct motor_command){.bridge_on = true, .voltage_v = 1.0};
    assert_ok(plant_step(scene->plant, 100 * scene->steps));
    assert_ok(plant_sample(scene->plant));
    assert_true(plant_sensors(scene->plant)->motor[0].qm - scene->rig->joint[0] > 1e-3);
    assert_near(rig_scene_feet(scene), 0.0, 0.0);
}

/* The paper's Table 2 under bare feet: 1e4 Pa on layers of 1 cm. The robot rocks itself over. */
TEST_ON(refuses_feet_too_soft_to_stand_on, rig_scene, scene)
{
    struct contact_surface surface[64];
    struct contact_config contact;
    struct plant_config config;
    struct settled settled;
    struct error error = {0};

    rig_scene_init(scene, &coman);
    contact = scene->rig->contact;
    assert_true(contact.nsurface <= 64);
    memcpy(surface, contact.surface, contact.nsurface * sizeof *surface);
    for (size_t s = 0; s < contact.nsurface; s++) {
        surface[s].material.young_pa = 1e4;
        surface[s].material.thickness_m = 1e-2;
    }
    contact.surface = surface;
    assert_ok(contact_native_create(&contact, &scene->arena, &scene->contact, &error));
    config = (struct plant_config){.robot = scene->robot,
                                   .dynamics = &scene->dynamics,
                                   .contact = scene->contact,
                                   .contact_body = scene->rig->contact_body,
                                   .ncontact = contact.nbody,
                                   .substep_ns = 1000000,
                                   .supply_v = 48.0};
    assert_ok(plant_create(&config, &scene->arena, &scene->plant, &error));
    rig_scene_reset(scene);
    assert_int_equal(plant_settle(scene->plant, &scene->arena, &settled, &error), ERROR_INPUT);
    print_message("# %s\n", error.text);
    assert_non_null(strstr(error.text, scene->robot->name));
    assert_true(strstr(error.text, "topple") || strstr(error.text, "tips over"));
}
