/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Couplings and passive springs that import makes of an MJCF file: the robot moves as MuJoCo's does
 * over 300 ms. tests/physics/generated compares everything else of an import with MuJoCo 3.
 */
#include "app/import/import.h"
#include "base/arena.h"
#include "model/plant.h"
#include "tests/test.h"

#include <mujoco/mujoco.h>

static struct arena arena;
static char folder[64];

FIXTURE(open_folder)
{
    strcpy(folder, "/tmp/hil-import-mujoco-XXXXXX");
    return arena_init(&arena, (size_t)1 << 30, NULL) == ERROR_NONE && mkdtemp(folder) ? 0 : -1;
}

FIXTURE(close_folder)
{
    char command[96];

    arena_fini(&arena);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

static const char *path_of(const char *name)
{
    static char path[160];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void write_text(const char *name, const char *text)
{
    FILE *out = fopen(path_of(name), "w");

    assert_non_null(out);
    fputs(text, out);
    assert_int_equal(fclose(out), 0);
}

/* Returns what becomes of a file of the folder. */
static struct robot *import_file(const char *name, struct import_options options,
                                 const char *protocol)
{
    const struct import_request request = {.file = path_of(name),
                                           .folder = folder,
                                           .options = options,
                                           .protocol = protocol,
                                           .force = true};
    struct import_result result;
    struct robot *robot;
    struct error error;

    if (import_run(&request, &arena, &result, &error) ||
        robot_copy(result.loaded, &arena, &robot, &error)) {
        fail_msg("%s: %s", name, error.text);
    }
    return robot;
}

/* ---- couplings ---- */

/* A finger whose tip follows its root, and a slide that does; to MuJoCo they are tendons, whose
 * springs it has, as equalities it would make them as stiff as its solver likes. */
static const char hand[] =
    "<mujoco model='hand'><compiler angle='radian'/>\n<option integrator='RK4' timestep='4e-6'>"
    "<flag constraint='disable' contact='disable'/></option>\n<worldbody>\n"
    "<body name='palm' pos='0 0 1'><inertial pos='0.02 0.01 0.1' mass='0.9' "
    "diaginertia='0.004 0.005 0.003'/><joint name='wrist' axis='0 1 0.2'/>\n"
    "<body name='root' pos='0 0.05 0.1'><inertial pos='0 0.01 0.08' mass='0.3' "
    "diaginertia='6e-4 5e-4 2e-4'/><joint name='root' axis='1 0 0'/>\n"
    "<body name='tip' pos='0 0 0.15'><inertial pos='0.01 0 0.04' mass='0.2' "
    "diaginertia='2e-4 2e-4 5e-5'/><joint name='tip' axis='1 0.1 0'/></body></body>\n"
    "<body name='slide' pos='0 -0.05 0.1'><inertial pos='0 0 0.05' mass='0.25' "
    "diaginertia='3e-4 2e-4 2e-4'/><joint name='slide' type='slide' axis='0 1 0' "
    "range='-1 1' limited='true'/></body>\n"
    "</body></worldbody>\n<tendon><fixed name='tip' springlength='0.1'><joint joint='tip' "
    "coef='1'/><joint joint='root' coef='-0.7'/></fixed>\n<fixed name='slide' "
    "springlength='0.02'><joint joint='slide' coef='1'/><joint joint='root' coef='-0.05'/></fixed>"
    "</tendon>\n<equality><joint joint1='tip' joint2='root' polycoef='0.1 0.7 0 0 0'/>"
    "<joint joint1='slide' joint2='root' polycoef='0.02 0.05 0 0 0'/></equality></mujoco>\n";

enum { HAND_JOINTS = 4, HAND_MS = 300 };

/* Where MuJoCo's joints of those names are after so long, its tendons those couplings. */
static void mujoco_move_hand(const char *path, const struct robot *robot, const double *q,
                             const double *v, double *end)
{
    char why[512] = "";
    mjModel *m = mj_loadXML(path, NULL, why, sizeof why);
    mjData *data;

    if (!m) {
        fail_msg("MuJoCo: %s", why);
    }
    data = mj_makeData(m);
    for (size_t i = 0; i < robot->ncoupling; i++) {
        int id = mj_name2id(m, mjOBJ_TENDON, robot->joint[robot->coupling[i].follower].name);

        assert_true(id >= 0);
        m->tendon_stiffness[id] = robot->coupling[i].stiffness;
        m->tendon_damping[id] = robot->coupling[i].damping;
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        int id = mj_name2id(m, mjOBJ_JOINT, robot->joint[j].name);

        data->qpos[m->jnt_qposadr[id]] = q[j];
        data->qvel[m->jnt_dofadr[id]] = v[j];
    }
    for (int k = 0; k < HAND_MS * 250; k++) {
        mj_step(m, data);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        end[j] = data->qpos[m->jnt_qposadr[mj_name2id(m, mjOBJ_JOINT, robot->joint[j].name)]];
    }
    mj_deleteData(data);
    mj_deleteModel(m);
}

/* The same of our plant. */
static void plant_move_hand(const struct robot *robot, enum plant_integrator integrator,
                            const double *q, const double *v, double *end)
{
    struct plant_config config = {.robot = robot,
                                  .integrator = integrator,
                                  .rtol = 1e-10,
                                  .atol = 1e-12,
                                  .substep_ns = 1000000,
                                  .supply_v = 1.0};
    struct dynamics dynamics;
    struct plant *plant;
    struct error error;
    double *state;
    size_t count;

    config.dynamics = &dynamics;
    assert_ok(dynamics_generic(robot, &arena, &dynamics, &error));
    assert_ok(plant_create(&config, &arena, &plant, &error));
    assert_ok(plant_reset(plant, NULL, NULL, q));
    state = plant_state(plant, &count);
    memcpy(state + robot->nq, v, robot->nv * sizeof *v);
    assert_ok(plant_step(plant, HAND_MS));
    memcpy(end, state, robot->njoint * sizeof *end);
}

/* Without its drives and stops the robot moves as MuJoCo's joints do, whose first one counts from
 * an angle. */
static void compare_motion(const char *name, struct robot *robot, const double *q, const double *v,
                           double from, double exactly, double implicitly)
{
    double start[HAND_JOINTS], exact[HAND_JOINTS], end[HAND_JOINTS];

    for (size_t j = 0; j < robot->njoint; j++) {
        robot->joint[j].sea.present = false;
        robot->joint[j].stop = (struct robot_stop){0};
        start[j] = q[j] + (j == 0 ? from : 0.0);
    }
    mujoco_move_hand(path_of(name), robot, start, v, exact);
    exact[0] -= from;
    for (int i = 0; i < 2; i++) {
        double worst = 0.0;

        plant_move_hand(robot, i ? PLANT_IMPLICIT : PLANT_DOPRI5, q, v, end);
        for (size_t j = 0; j < robot->njoint; j++) {
            worst = fmax(worst, fabs(end[j] - exact[j]));
        }
        print_message("# %s: %.1e rad or m from MuJoCo after %d ms\n", name, worst, HAND_MS);
        assert_true(worst <= (i ? implicitly : exactly));
    }
}

/* From a state in which nothing follows quite. */
TEST_WITH(couplings_move_joints_as_tendons_of_mujoco_do, open_folder, close_folder)
{
    const double q[HAND_JOINTS] = {0.3, 0.4, 0.3802, 0.0401};
    const double v[HAND_JOINTS] = {1.0, -2.0, -1.41, -0.1};
    struct robot *robot;

    write_text("hand.xml", hand);
    robot = import_file("hand.xml", (struct import_options){.mimic = IMPORT_MIMIC_COUPLE}, "icub");
    assert_int_equal(robot->njoint, HAND_JOINTS);
    assert_int_equal(robot->ncoupling, 2);
    compare_motion("hand.xml", robot, q, v, 0.0, 1e-10, 5e-5);
}

/* ---- springs ---- */

/* A leg whose joints spring back, as two without an actuator and one with; angles in degrees, of
 * which one counts from elsewhere. The last has no damping, which would be its motor's. */
static const char spring_leg[] =
    "<mujoco model='leg'>\n<option integrator='RK4' timestep='4e-6'>"
    "<flag constraint='disable' contact='disable'/></option>\n<worldbody>\n"
    "<body name='thigh' pos='0 0 1'><inertial pos='0.02 0.01 -0.1' mass='0.9' "
    "diaginertia='0.004 0.005 0.003'/><joint name='hip' axis='0 1 0.2' stiffness='20' ref='10' "
    "springref='35' damping='0.3'/>\n"
    "<body name='shin' pos='0 0.05 -0.2'><inertial pos='0 0.01 -0.08' mass='0.3' "
    "diaginertia='6e-4 5e-4 2e-4'/><joint name='knee' axis='0 1 0' stiffness='4' damping='0.05'/>\n"
    "<body name='toe' pos='0 0 -0.15'><inertial pos='0.04 0 0' mass='0.2' "
    "diaginertia='2e-4 2e-4 5e-5'/><joint name='toe' axis='0.1 1 0' stiffness='1.5' "
    "springref='-20'/></body></body></body></worldbody>\n"
    "<actuator><motor joint='toe'/></actuator></mujoco>\n";

enum { LEG_JOINTS = 3 };

TEST_WITH(springs_move_joints_as_those_of_mujoco, open_folder, close_folder)
{
    const double q[LEG_JOINTS] = {0.3, -0.4, 0.5}, v[LEG_JOINTS] = {1.0, -2.0, 3.0};
    struct robot *robot;

    write_text("leg.xml", spring_leg);
    robot = import_file("leg.xml", (struct import_options){0}, "icub");
    assert_int_equal(robot->njoint, LEG_JOINTS);
    for (size_t j = 0; j < robot->njoint; j++) {
        assert_int_equal(robot->joint[j].sea.present, j == 2);
    }
    compare_motion("leg.xml", robot, q, v, 10.0 * M_PI / 180.0, 1e-9, 1e-3);
}
