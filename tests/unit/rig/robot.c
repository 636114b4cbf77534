/* SPDX-License-Identifier: Apache-2.0 */
/* Rigs that extend others, change springs, and hold the base. */
#include "rig/rig.h"

#include "base/vec3.h"
#include "model/dynamics.h"
#include "tests/physics/near.h"
#include "tests/unit/rig/rig_files.h"
#include "tests/test.h"

static struct arena arena;
static char extended[64]; /* the rig that extends the toy */

FIXTURE(set_up)
{
    if (arena_init(&arena, (size_t)256 << 20, NULL) || make_tree() ||
        write_file("config/rigs/toy.yaml", toy_rig, sizeof toy_rig - 1)) {
        return -1;
    }
    snprintf(extended, sizeof extended, "%s/config/rigs/more.yaml", tree);
    return 0;
}

FIXTURE(tear_down)
{
    unlink(extended);
    remove_tree();
    arena_fini(&arena);
    return 0;
}

static enum error_code try_load(const char *text, const struct rig **rig, struct error *error)
{
    assert_int_equal(write_file("config/rigs/more.yaml", text, strlen(text)), 0);
    return rig_load(extended, &arena, rig, error);
}

static const struct rig *load(const char *text)
{
    const struct rig *rig = NULL;
    struct error error = {0};

    assert_no_error(try_load(text, &rig, &error), error.text);
    return rig;
}

static void refused(const char *text, const char *expected)
{
    const struct rig *rig = NULL;
    struct error error = {0};

    assert_int_equal(try_load(text, &rig, &error), ERROR_INPUT);
    if (!strstr(error.text, expected)) {
        fail_msg("found \"%s\", expected \"%s\"", error.text, expected);
    }
}

/* ---- extends ---- */

TEST(takes_what_it_does_not_give_from_the_other_file)
{
    const struct rig *rig = load("extends: toy.yaml\nname: more\n");

    assert_string_equal(rig->name, "more");
    assert_string_equal(rig->robot->name, "toy");
    assert_int_equal(rig->tick_ns, 2000000);
    assert_int_equal(rig->contact.npair, 2);
    assert_true(rig->contact.transition_velocity_m_s == 0.02);
}

TEST(merges_mappings_and_replaces_lists)
{
    const struct rig *rig = load("extends: toy.yaml\n"
                                 "scene:\n"
                                 "  materials: {rubber: {young_pa: 2e5}}\n"
                                 "  pairs:\n"
                                 "    - between: [ground, ball]\n");

    assert_int_equal(rig->contact.npair, 1);
    assert_int_equal(rig->contact.nsurface, 4);
    assert_true(rig->contact.surface[0].material.young_pa == 2e5);
    assert_true(rig->contact.surface[0].material.thickness_m == 0.01);
    assert_true(rig->contact.transition_velocity_m_s == 0.02);
}

TEST(names_the_file_in_which_a_value_stands)
{
    refused("extends: toy.yaml\nscene: {pairs: [{between: [ground, bal]}]}\n", "more.yaml:2:");
    refused("extends: toy.yaml\nname: more\ninitial: {pose: crooked}\n", "more.yaml:3:");
    refused("extends: toy.yaml\nsubstep_s: 0.003\n", "more.yaml:2:");
    refused("extends: toy.yaml\ntick_s: 0.0003\n", "toy.yaml:");
    /* What stands in another file names the one that was asked for, too */
    refused("extends: toy.yaml\ntick_s: 0.0003\n", "more.yaml)");
    refused("extends: toy.yaml\nrobot: {file: none.yaml}\n", "more.yaml:2:15: ");
    refused("extends: toy.yaml\nrobot: {file: none.yaml}\n", "none.yaml: cannot be read");
}

TEST(refuses_files_that_cannot_be_extended)
{
    refused("extends: missing.yaml\n", "more.yaml:1:10: ");
    refused("extends: ../../../etc/passwd\n", "leaves the configuration tree");
    refused("extends: [toy.yaml]\n", "found a list, expected the file that this one extends");
    refused("extends: more.yaml\n", "more.yaml:1:10: ");
    refused("extends: more.yaml\n", "which extends this file itself");
    refused("extends: ../rigs/./more.yaml\n", "which extends this file itself");
}

/* A chain of files, each of which extends the next; the last extends `last`. */
static void write_chain(int length, const char *last)
{
    char name[64], text[64];

    for (int i = 1; i <= length; i++) {
        snprintf(name, sizeof name, "config/rigs/chain%d.yaml", i);
        snprintf(text, sizeof text, "extends: chain%d.yaml\nname: more\n", i + 1);
        if (i == length) {
            snprintf(text, sizeof text, "extends: %s\n", last);
        }
        assert_int_equal(write_file(name, text, strlen(text)), 0);
    }
}

static void remove_chain(int length)
{
    char path[128];

    for (int i = 1; i <= length; i++) {
        snprintf(path, sizeof path, "%s/config/rigs/chain%d.yaml", tree, i);
        assert_int_equal(unlink(path), 0);
    }
}

TEST(follows_a_long_chain_but_no_circle)
{
    write_chain(20, "toy.yaml");
    assert_string_equal(load("extends: chain1.yaml\n")->robot->name, "toy");
    write_chain(20, "chain7.yaml");
    refused("extends: chain1.yaml\n", "chain20.yaml:1:10: found ");
    remove_chain(20);
    write_chain(300, "toy.yaml");
    refused("extends: chain1.yaml\n", "a chain of more than 256 files");
    remove_chain(300);
}

/* ---- springs ---- */

TEST(replaces_springs_by_name)
{
    const struct rig *rig =
        load("extends: toy.yaml\nrobot: {springs: {knee: {Ks_nm_rad: 1.5, Ds_nm_s_rad: 0.25}}}\n");

    assert_true(rig->robot->joint[0].sea.Ks == 400.0);
    assert_true(rig->robot->joint[1].sea.Ks == 1.5);
    assert_true(rig->robot->joint[1].sea.Ds == 0.25);
    assert_true(rig->robot->joint[1].sea.J == 0.1);
}

/* A point at the center of mass: the mass is more, the inertia about it the same. */
TEST(adds_masses_to_bodies)
{
    const struct rig *plain = load("extends: toy.yaml\n");
    const struct robot_body *body = plain->robot->body;
    const double mass = body[0].inertia.mass, inertia = body[0].inertia.I[0];
    const uint64_t hash = plain->robot->hash;
    char text[200];
    const struct rig *rig;

    snprintf(text, sizeof text, "extends: toy.yaml\nrobot: {added_mass_kg: {%s: 1.5}}\n",
             body[0].name);
    rig = load(text);
    assert_true(rig->robot->body[0].inertia.mass == mass + 1.5);
    assert_true(rig->robot->body[0].inertia.I[0] == inertia);
    assert_true(rig->robot->hash != hash);
}

/* Second moments of a mass about the origin of its frame: xx, yy, zz. */
static void moments_about_origin(const struct robot_inertia *inertia, double moment[3])
{
    const double *c = inertia->com;

    moment[0] = inertia->I[0] + inertia->mass * (c[1] * c[1] + c[2] * c[2]);
    moment[1] = inertia->I[3] + inertia->mass * (c[0] * c[0] + c[2] * c[2]);
    moment[2] = inertia->I[5] + inertia->mass * (c[0] * c[0] + c[1] * c[1]);
}

/* What is added to a body hangs below its sensor: mass, first and second moments add up. */
TEST(masses_hang_below_force_torque_sensors)
{
    static const char heavy[] = "{name: foot_ft, frame: sole, distal: {mass_kg: 2, com_m: [0.1, "
                                "0.2, -0.3], inertia_kg_m2: [0.02, 0.001, 0, 0.03, 0, 0.025]}}";
    const double p[3] = {0.0, 0.5, 0.2}; /* of the body's center, in the frame of the sensor */
    char *plain = strstr(toy_robot, "{name: foot_ft"), *after = strchr(plain, '}') + 1;
    char text[sizeof toy_robot + sizeof heavy];
    const struct robot_ft_sensor *ft;
    struct robot_inertia before;
    double old[3], new[3];

    ft = load("extends: toy.yaml\nrobot: {added_mass_kg: {lower: 1.5}}\n")->robot->ft;
    assert_true(ft[0].distal.mass == 1.5 && ft[1].distal.mass == 0.0);
    for (int i = 0; i < 3; i++) {
        assert_near(ft[0].distal.com[i], p[i], 1e-15);
    }

    snprintf(text, sizeof text, "%.*s%s%s", (int)(plain - toy_robot), toy_robot, heavy, after);
    assert_int_equal(write_file("config/robots/heavy.yaml", text, strlen(text)), 0);
    before = load("extends: toy.yaml\nrobot: {file: ../robots/heavy.yaml}\n")->robot->ft->distal;
    ft = load("extends: toy.yaml\n"
              "robot: {file: ../robots/heavy.yaml, added_mass_kg: {lower: 1.5}}\n")
             ->robot->ft;
    moments_about_origin(&before, old);
    moments_about_origin(&ft->distal, new);
    assert_near(ft->distal.mass, before.mass + 1.5, 1e-15);
    for (int i = 0; i < 3; i++) {
        assert_near(ft->distal.mass * ft->distal.com[i], before.mass * before.com[i] + 1.5 * p[i],
                    1e-15);
        assert_near(new[i], old[i] + 1.5 * (vec3_dot(p, p) - p[i] * p[i]), 1e-15);
    }
    refused("extends: toy.yaml\nrobot: {added_mass_kg: {lower: -0.5}}\n",
            "more.yaml:2:25: found -0.5 kg on body \"lower\", expected more than 0 kg, all "
            "that its sensor \"foot_ft\" carries");
    refused("extends: toy.yaml\nrobot: {added_mass_kg: {upper: -1}}\n",
            "found -1 kg on body \"upper\", expected more than -1 kg, all that it has");
}

/* A tool takes the place of what the robot file hangs there; the dynamics stay those of the
 * file. */
TEST(tools_hang_below_force_torque_sensors)
{
    const struct robot *plain = load("extends: toy.yaml\n")->robot, *robot;

    robot = load("extends: toy.yaml\n"
                 "sensors:\n"
                 "  every_ft: {tool: {mass_kg: 2, com_m: [0.1, 0, 0]}}\n"
                 "  fts: {foot_ft: {tool: {mass_kg: 0.3, com_m: [0, 0, -0.1],\n"
                 "                         inertia_kg_m2: [2e-4, 0, 0, 9e-4, 0, 1e-3]}}}\n")
                ->robot;
    assert_true(robot->ft[0].distal.mass == 0.3 && robot->ft[0].distal.com[2] == -0.1);
    assert_true(robot->ft[0].distal.I[3] == 9e-4 && robot->ft[1].distal.mass == 2.0);
    assert_true(robot->ft[1].distal.com[0] == 0.1 && robot->ft[1].distal.I[0] == 0.0);
    assert_true(robot->hash == plain->hash);

    /* What is added to the body hangs below the sensor as well */
    robot = load("extends: toy.yaml\n"
                 "robot: {added_mass_kg: {lower: 1.5}}\n"
                 "sensors: {fts: {foot_ft: {tool: {mass_kg: 0.3, com_m: [0, 0, -0.1]}}}}\n")
                ->robot;
    assert_near(robot->ft[0].distal.mass, 1.8, 1e-15);
    refused("extends: toy.yaml\n"
            "sensors: {fts: {foot_ft: {tool: {mass_kg: 1, com_m: [0, 0, 0],\n"
            "  inertia_kg_m2: [1, 0, 0, 0.1, 0, 0.1]}}}}\n",
            "the largest exceeds the sum of the others");
    refused("extends: toy.yaml\nsensors: {fts: {fot_ft: {tool: {mass_kg: 1, com_m: [0, 0, 0]}}}}\n",
            "\"foot_ft\"");
}

TEST(refuses_springs_of_joints_that_have_none)
{
    refused("extends: toy.yaml\nrobot: {springs: {kne: {Ks_nm_rad: 1, Ds_nm_s_rad: 1}}}\n",
            "found unknown joint \"kne\", expected \"knee\"");
    refused("extends: toy.yaml\nrobot: {springs: {wag: {Ks_nm_rad: 1, Ds_nm_s_rad: 1}}}\n",
            "found a spring for joint \"wag\", expected a joint with a drive");
    refused("extends: toy.yaml\nrobot: {springs: {knee: {Ks_nm_rad: -1, Ds_nm_s_rad: 1}}}\n",
            "found -1");
}

/* ---- held bases ---- */

enum { BODIES = 32, SPEEDS = 40 };

static struct dynamics dynamics_of(const struct robot *robot)
{
    struct dynamics dynamics;
    struct error error = {0};

    assert_ok(dynamics_generic(robot, &arena, &dynamics, &error));
    return dynamics;
}

/* The same bodies are in the same places, and the joints accelerate as on a base that is too heavy
 * to be moved. */
TEST(a_held_base_is_one_of_infinite_mass)
{
    static const double p[3] = {0.3, -0.2, 0.9}, quaternion[4] = {0.8, 0.4, -0.4, 0.2};
    double q[SPEEDS] = {0}, v[SPEEDS] = {0}, tau[SPEEDS] = {0}, free_a[SPEEDS], held_a[SPEEDS];
    struct wrench ext[BODIES] = {0};
    struct body_motion free_at[BODIES], held_at[BODIES];
    const struct robot *robot;
    struct robot *heavy, *held;
    struct dynamics a, b;
    struct error error = {0};

    if (robot_load(HIL_SOURCE_DIR "/config/robots/coman.yaml", "forearms", &arena, &robot,
                   &error) ||
        robot_copy(robot, &arena, &heavy, &error) || robot_copy(robot, &arena, &held, &error)) {
        fail_msg("%s", error.text);
    }
    heavy->body[0].inertia.mass = 1e9;
    memcpy(heavy->body[0].inertia.I, (double[6]){1e9, 0, 0, 1e9, 0, 1e9}, sizeof(double[6]));
    memset(heavy->body[0].inertia.com, 0, sizeof heavy->body[0].inertia.com);
    memset(heavy->gravity, 0, sizeof heavy->gravity);
    memset(held->gravity, 0, sizeof held->gravity);
    assert_ok(robot_finish(heavy, &error));
    assert_ok(robot_fix_base(held, p, quaternion, &error));
    assert_int_equal(held->nv, held->njoint);
    assert_true(held->hash != robot->hash);
    a = dynamics_of(heavy);
    b = dynamics_of(held);
    memcpy(q, p, sizeof p);
    memcpy(q + 3, quaternion, sizeof quaternion);
    for (size_t j = 0; j < held->njoint; j++) {
        q[7 + j] = 0.3 * sin(1.0 + (double)j);
        v[6 + j] = cos(2.0 * (double)j);
        tau[j] = 3.0 * sin(3.0 * (double)j);
    }
    a.ops->kinematics(&a, q, v, free_at);
    b.ops->kinematics(&b, q + 7, v + 6, held_at);
    for (size_t k = 1; k < held->nbody; k++) {
        for (int i = 0; i < 3 && held->body[k].observed; i++) {
            assert_near(held_at[k].p[i], free_at[k].p[i], 1e-12);
            assert_near(held_at[k].v[i], free_at[k].v[i], 1e-12);
        }
    }
    a.ops->forward(&a, q, v, tau, ext, free_a);
    b.ops->forward(&b, q + 7, v + 6, tau, ext, held_a);
    for (size_t j = 0; j < held->njoint; j++) {
        assert_near(held_a[j], free_a[6 + j], 1e-6 * (1.0 + fabs(held_a[j])));
    }
}

TEST(surfaces_and_frames_of_a_held_base_stay_where_they_were)
{
    const struct robot *robot;
    struct robot *held;
    struct error error = {0};
    int frame;

    assert_ok(robot_load(HIL_SOURCE_DIR "/config/robots/coman.yaml", NULL, &arena, &robot, &error));
    assert_ok(robot_copy(robot, &arena, &held, &error));
    /* A quarter turn about z, half a meter up */
    assert_ok(robot_fix_base(held, (double[3]){0, 0, 0.5}, (double[4]){sqrt(0.5), 0, 0, sqrt(0.5)},
                             &error));
    assert_near(held->body[0].inertia.com[0], -robot->body[0].inertia.com[1], 1e-15);
    assert_near(held->body[0].inertia.com[1], robot->body[0].inertia.com[0], 1e-15);
    assert_near(held->body[0].inertia.com[2], robot->body[0].inertia.com[2] + 0.5, 1e-15);
    assert_near(held->body[0].inertia.I[0], robot->body[0].inertia.I[3], 1e-15);
    for (frame = 0; frame < (int)robot->nframe; frame++) {
        if (robot->frame[frame].body == 0) {
            assert_near(held->frame[frame].position[2], robot->frame[frame].position[2] + 0.5,
                        1e-15);
        }
    }
    assert_true(robot->floating); /* the original is as it was */
}

/* A variant or a file that does not exist is refused at its place in the rig. */
TEST(what_a_rig_names_in_vain_is_refused_with_its_line)
{
    static const struct {
        const char *text, *expected;
    } rows[] = {
        {"extends: toy.yaml\nrobot: {variant: x}\n",
         "more.yaml:2:18: found variant \"x\" of a robot without variants, expected none"},
        {"extends: toy.yaml\nrobot:\n  variant: x\n", "more.yaml:3:12: found variant"},
        {"extends: toy.yaml\nrobot: {file: ../robots/none.yaml}\n", "more.yaml:2:15: "},
        {"extends: toy.yaml\nscene:\n  surfaces:\n    - {name: a, body: world, shape: mesh,\n"
         "       mesh: ../meshes/none.obj, material: rubber}\n",
         "more.yaml:5:14: "},
    };
    static const char coman[] = "extends: coman.yaml\nname: x\nrobot:\n  variant: real_driwes\n";
    const struct rig *rig;
    struct error error = {0};

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        refused(rows[i].text, rows[i].expected);
    }
    assert_int_equal(rig_load_text(HIL_SOURCE_DIR "/config/rigs/x.yaml", coman, sizeof coman - 1,
                                   &arena, &rig, &error),
                     ERROR_INPUT);
    assert_string_equal(error.text, HIL_SOURCE_DIR
                        "/config/rigs/x.yaml:4:12: found unknown variant \"real_driwes\", "
                        "expected \"real_drives\"");
}

/* A scenario puts its parameters into the text of a rig, perhaps in quotes; a file has no such. */
TEST(numbers_in_quotes_are_of_texts_alone)
{
    static const char text[] = "extends: coman.yaml\nname: x\nsupply_v: \"40\"\n"
                               "initial: {settle: 'true', base_rpy_rad: ['0', \"0.1\", 0]}\n";
    const struct rig *rig = NULL;
    struct error error = {0};

    assert_no_error(rig_load_text(HIL_SOURCE_DIR "/config/rigs/x.yaml", text, sizeof text - 1,
                                  &arena, &rig, &error),
                    error.text);
    assert_true(rig->supply_v == 40.0 && rig->settle);
    refused("extends: toy.yaml\nsupply_v: \"40\"\n",
            "more.yaml:2:11: found quoted text \"40\", expected a number");
}

/* Surfaces on the base of a robot that the rig holds are where the rig places the base: 0.1 m along
 * x of a base that is turned by 90 degrees about z is 0.1 m along the world's y. */
TEST(surfaces_of_a_base_that_a_rig_holds_are_in_the_world)
{
    static const char text[] =
        "extends: coman.yaml\nname: held\n"
        "robot: {file: ../robots/coman.yaml, fixed_base: true}\n"
        "initial: {base_xyz_m: [1, 2, 3], base_rpy_rad: [0, 0, 1.5707963267948966]}\n"
        "scene:\n"
        "  surfaces:\n"
        "    - {name: ground, body: world, shape: half_space, material: ground}\n"
        "    - {name: plate, body: Waist, shape: sphere, radius_m: 0.01, material: ground,\n"
        "       xyz_m: [0.1, 0, 0.5]}\n"
        "  pairs: []\n  robot_surfaces: {exclude: []}\n";
    const struct contact_surface *plate;
    const struct rig *rig = NULL;
    struct error error = {0};

    assert_no_error(rig_load_text(HIL_SOURCE_DIR "/config/rigs/held.yaml", text, sizeof text - 1,
                                  &arena, &rig, &error),
                    error.text);
    plate = &rig->contact.surface[1];
    assert_string_equal(plate->name, "plate");
    assert_near(plate->position[0], 1.0, 1e-15);
    assert_near(plate->position[1], 2.1, 1e-15);
    assert_near(plate->position[2], 3.5, 1e-15);
    assert_near(plate->rotation[1], -1.0, 1e-15);
    assert_near(plate->rotation[3], 1.0, 1e-15);
    assert_near(plate->rotation[8], 1.0, 1e-15);
    assert_near(plate->rotation[0], 0.0, 1e-15);
}

TEST(a_base_that_is_fixed_already_stays_so)
{
    const struct rig *rig = load("extends: toy.yaml\nrobot: {fixed_base: true}\n");

    assert_false(rig->robot->floating);
    assert_int_equal(rig->robot->nq, 3);
}

TEST_GROUP(set_up, tear_down)
