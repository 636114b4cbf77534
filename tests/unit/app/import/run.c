/* SPDX-License-Identifier: Apache-2.0 */
/* Whole imports into a folder: what is written loads, and no bus is loaded beyond the plan's share,
 * whatever the number of joints and what the boards speak. */
#include "app/import/import.h"
#include "app/import/write.h"
#include "base/array.h"
#include "rig/rig.h"
#include "tests/physics/near.h"
#include "tests/unit/app/put_file.h"

#include <unistd.h>

static struct arena arena;
static char folder[] = "/tmp/hil-import-run-XXXXXX";
static char file[64];

FIXTURE(open_folder)
{
    strcpy(folder + sizeof folder - 7, "XXXXXX");
    if (!mkdtemp(folder) || arena_init(&arena, (size_t)512 << 20, NULL)) {
        return -1;
    }
    snprintf(file, sizeof file, "%s/r.urdf", folder);
    return 0;
}

FIXTURE(remove_folder)
{
    char command[96];

    arena_fini(&arena);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

/* Limbs of so many joints on a base, each with a sensor at its end, one with an inertial sensor. */
static void write_limbs(int limbs, int joints)
{
    static const char body[] = "<inertial><origin xyz='0 0 -0.1'/><mass value='1'/><inertia "
                               "ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/>"
                               "</inertial><collision><origin xyz='0 0 -0.1'/><geometry><sphere "
                               "radius='0.05'/></geometry></collision></link>\n";
    FILE *out = fopen(file, "w");

    assert_non_null(out);
    fprintf(out, "<robot name='r'><link name='base'>%s", body);
    for (int l = 0; l < limbs; l++) {
        for (int j = 0; j < joints; j++) {
            char parent[32] = "base";

            if (j > 0) {
                snprintf(parent, sizeof parent, "l%d_%d", l, j - 1);
            }
            fprintf(out,
                    "<link name='l%d_%d'>%s<joint name='j%d_%d' type='revolute'><parent "
                    "link='%s'/><child link='l%d_%d'/><origin xyz='%g 0 -0.2'/><axis xyz='%d %d "
                    "0'/><limit lower='-2' upper='2' effort='60' velocity='4'/></joint>\n",
                    l, j, body, l, j, parent, l, j, j ? 0.0 : 0.3 * l, j % 2, (j + 1) % 2);
        }
        fprintf(out, "<sensor name='s%d' type='force_torque'><parent joint='j%d_%d'/></sensor>\n",
                l, l, joints - 1);
    }
    fputs("<gazebo reference='base'><sensor name='imu' type='imu'/></gazebo></robot>\n", out);
    assert_int_equal(fclose(out), 0);
}

static void import_limbs(const char *protocol, struct import_result *result)
{
    const struct import_request request = {
        .file = file, .folder = folder, .protocol = protocol, .force = true};
    struct error error;

    assert_no_error(import_run(&request, &arena, result, &error), error.text);
}

TEST_WITH(no_bus_is_loaded_beyond_the_share, open_folder, remove_folder)
{
    static const struct {
        int limbs, joints;
    } robots[] = {{1, 1}, {1, 6}, {1, 7}, {4, 3}, {5, 6}, {3, 13}};
    static const char *const benches[] = {"icub",       "foc",    "compact",
                                          "compact-fd", "moteus", "cia402"};

    for (size_t i = 0; i < sizeof robots / sizeof *robots; i++) {
        write_limbs(robots[i].limbs, robots[i].joints);
        for (size_t p = 0; p < ARRAY_COUNT(benches); p++) {
            struct import_result result;

            import_limbs(benches[p], &result);
            assert_true(result.worst_load > 0.0 && result.worst_load <= IMPORT_BUS_LOAD);
            assert_int_equal(result.loaded->njoint, robots[i].limbs * robots[i].joints);
            assert_int_equal(result.loaded->nft, robots[i].limbs);
            assert_true(result.loaded->imu_frame >= 0);
            assert_true(result.loaded->total_mass == 1.0 + robots[i].limbs * robots[i].joints);
        }
    }
}

TEST_WITH(too_many_joints_name_the_way_out, open_folder, remove_folder)
{
    const struct import_request request = {.file = file, .folder = folder, .protocol = "foc"};
    struct import_result result;
    struct error error;

    write_limbs(11, 6);
    assert_int_equal(import_run(&request, &arena, &result, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "--protocol compact-fd"));
    assert_int_not_equal(access(result.robot, F_OK), 0);
    import_limbs("compact-fd", &result);
}

/* What was edited after the first import is there after the second. */
TEST_WITH(a_second_import_asks_before_it_writes_over_the_first, open_folder, remove_folder)
{
    struct import_request request = {.file = file, .folder = folder, .protocol = "icub"};
    struct import_result first, again;
    struct error error;
    char line[64] = "";
    FILE *edited;

    write_limbs(1, 3);
    assert_ok(import_run(&request, &arena, &first, &error));
    put_file(first.rig, "mine\n");
    assert_int_equal(import_run(&request, &arena, &again, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "/rigs/r.yaml: found it there already"));
    assert_non_null(strstr(error.text, "--force"));
    assert_non_null(edited = fopen(first.rig, "r"));
    assert_non_null(fgets(line, sizeof line, edited));
    fclose(edited);
    assert_string_equal(line, "mine\n");
    assert_int_equal(access(first.robot, F_OK), 0);

    /* The robot file has the drives, which are the user's to correct */
    assert_int_equal(unlink(first.rig), 0);
    assert_int_equal(import_run(&request, &arena, &again, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "/robots/r.yaml: found it there already"));
    request.force = true;
    assert_ok(import_run(&request, &arena, &again, &error));
    assert_int_equal(access(again.rig, F_OK), 0);
}

TEST_WITH(same_file_gives_the_same_bytes, open_folder, remove_folder)
{
    struct import_result result;
    char first[65536], second[65536];
    size_t size[2];
    FILE *in;

    write_limbs(2, 3);
    for (int i = 0; i < 2; i++) {
        import_limbs("icub", &result);
        assert_non_null(in = fopen(result.rig, "r"));
        size[i] = fread(i ? second : first, 1, sizeof first, in);
        fclose(in);
    }
    assert_true(size[0] == size[1] && size[0] > 0);
    assert_memory_equal(first, second, size[0]);
}

TEST_WITH(a_box_stays_a_box, open_folder, remove_folder)
{
    static const char text[] =
        "<robot name='r'><link name='base'>%1$s</link><link name='box'>%1$s<collision><origin "
        "xyz='0.01 0.02 0.03'/><geometry><box size='0.06 0.8 0.08'/></geometry></collision></link>"
        "<joint name='j' type='revolute'><parent link='base'/><child link='box'/><axis xyz='1 0 "
        "0'/><limit lower='-2' upper='2' effort='60' velocity='4'/></joint></robot>\n";
    static const char inertial[] = "<inertial><origin xyz='0 0 -0.1'/><mass value='1'/><inertia "
                                   "ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/>"
                                   "</inertial>";
    const struct robot_capsule *capsule;
    struct import_result result;
    FILE *out = fopen(file, "w");

    assert_non_null(out);
    fprintf(out, text, inertial);
    assert_int_equal(fclose(out), 0);
    import_limbs("icub", &result);
    assert_int_equal(result.loaded->ncapsule, 1);
    capsule = &result.loaded->capsule[0];
    assert_true(capsule->radius == 0.0);
    assert_true(capsule->half[0] == 0.03 && capsule->half[1] == 0.4 && capsule->half[2] == 0.04);
    assert_true(fabs(capsule->position[0] - 0.01) < 1e-6);
    assert_true(fabs(capsule->position[1] - 0.02) < 1e-6);
    assert_true(fabs(capsule->position[2] - 0.03) < 1e-6);
}

#define VISUAL_INERTIAL                                                                            \
    "<inertial><origin xyz='0 0 -0.1'/><mass value='1'/><inertia ixx='0.01' iyy='0.01' "           \
    "izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial>"
#define VISUAL_JOINT(name, parent, child)                                                          \
    "<joint name='" name "' type='revolute'><parent link='" parent "'/><child link='" child        \
    "'/><axis xyz='1 0 0'/><limit lower='-2' upper='2' effort='60' velocity='4'/></joint>"

/* Writes a text into the folder. */
static void write_file(const char *name, const char *text)
{
    char path[96];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    put_file(path, text);
}

/* Returns the number that a shell command prints, which is run in the folder. */
static unsigned count_by(const char *command)
{
    char line[192];
    unsigned count = 0;
    FILE *in;

    snprintf(line, sizeof line, "cd '%s' && %s", folder, command);
    assert_non_null(in = popen(line, "r"));
    assert_int_equal(fscanf(in, "%u", &count), 1);
    pclose(in);
    return count;
}

/* A link on a fixed joint brings its shape along; the same mesh is written once; materials count by
 * name from wherever they are; what is missing or damaged is named; nothing of it moves a body. */
TEST_WITH(visuals_come_with_their_places_and_colors, open_folder, remove_folder)
{
    static const char begin[] = "<robot name='r'><link name='base'>" VISUAL_INERTIAL;
    static const char looks[] =
        "<visual><geometry><box size='0.2 0.4 0.6'/></geometry><material name='sea'/></visual>";
    static const char middle[] = "</link><link name='tip'>";
    static const char more[] =
        "<visual><origin xyz='0 0 0.5' rpy='0 0 1.5707963267948966'/><geometry>"
        "<mesh filename='a.obj' scale='2 2 2'/></geometry><material name='sea'><color rgba='0.1 "
        "0.2 "
        "0.3 0.5'/></material></visual>"
        "<visual><geometry><mesh filename='a.obj' scale='2 2 2'/></geometry></visual>"
        "<visual><geometry><mesh filename='none.stl'/></geometry></visual>"
        "<visual><geometry><mesh filename='bad.obj'/></geometry></visual>"
        "<visual><geometry><cylinder radius='0.1' length='0.3'/></geometry><material name='x'>"
        "<color rgba='1 0'/></material></visual>";
    static const char end[] = "</link><link name='arm'>" VISUAL_INERTIAL "</link>"
                              "<joint name='weld' type='fixed'><parent link='arm'/><child "
                              "link='tip'/><origin xyz='1 0 0'/>"
                              "</joint>" VISUAL_JOINT("j", "base", "arm") "</robot>\n";
    char text[4096];
    struct import_result plain, result;
    const struct robot_visual *visual;

    write_file("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_file("bad.obj", "v 0 0 0\nv 1 zero 0\n");
    snprintf(text, sizeof text, "%s%s%s", begin, middle, end);
    write_file("r.urdf", text);
    import_limbs("icub", &plain);
    snprintf(text, sizeof text, "%s%s%s%s%s", begin, looks, middle, more, end);
    write_file("r.urdf", text);
    import_limbs("icub", &result);
    assert_int_equal(result.loaded->nvisual, 6);
    assert_true(result.loaded->hash == plain.loaded->hash);
    assert_int_equal(import_count_notes(&result.notes, IMPORT_MISSING), 2);

    /* The box, in the color that a later link gives the name */
    visual = result.loaded->visual;
    assert_int_equal(visual[0].shape, VISUAL_BOX);
    assert_int_equal(visual[0].body, 0);
    assert_true(visual[0].half[1] == 0.2 && visual[0].colored && visual[0].color[3] == 0.5);

    /* The meshes, on the body that carries their link */
    assert_int_equal(visual[1].body, 1);
    assert_true(visual[1].position[0] == 1.0 && visual[1].position[2] == 0.5);
    assert_true(fabs(visual[1].rotation[3] - 1.0) < 1e-12);
    assert_true(visual[1].color[2] == 0.3);
    assert_string_equal(visual[1].file, visual[2].file);
    assert_false(visual[2].colored);
    assert_int_equal(count_by("ls meshes/*.stl | wc -l"), 1);

    /* Why there is none, with the place */
    assert_null(visual[3].file);
    assert_non_null(strstr(visual[3].missing, "found no file for mesh none.stl"));
    assert_non_null(strstr(visual[4].missing, "bad.obj:2:5: found 'zero'"));
    assert_int_equal(visual[5].shape, VISUAL_CYLINDER);
    assert_false(visual[5].colored);
    assert_int_equal(count_by("grep -c 'visual mesh of link' r-import.txt"), 2);
}

/* Groups from 3 on are hidden, what touches may be seen, a material's color is that of the geom. */
TEST_WITH(geoms_of_mjcf_are_seen_as_in_its_viewer, open_folder, remove_folder)
{
    struct import_result result;
    const struct robot_visual *visual;

    write_file("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_file("a.mtl", "newmtl m\nKd 0 0 1\n");
    write_file(
        "r.urdf",
        "<mujoco model='r'><asset><mesh name='a' file='a.obj'/><material name='steel' "
        "rgba='0.1 0.2 0.3 1'/></asset><worldbody><body name='base'><inertial pos='0 0 0' "
        "mass='1' diaginertia='1e-2 1e-2 1e-2'/>"
        "<geom type='sphere' size='0.1' group='3'/><geom type='sphere' size='0.2'/>"
        "<body name='arm'><joint name='j' axis='1 0 0' range='-60 60'/><inertial pos='0 0 0' "
        "mass='1' diaginertia='1e-2 1e-2 1e-2'/><geom type='mesh' mesh='a' contype='0' "
        "conaffinity='0' material='steel'/><geom type='box' size='1 2 3' contype='0' "
        "conaffinity='0' rgba='0 1 0 0.5' material='steel'/></body></body></worldbody>"
        "</mujoco>\n");
    import_limbs("icub", &result);
    visual = result.loaded->visual;
    assert_int_equal(result.loaded->nvisual, 3);
    assert_int_equal(result.loaded->ncapsule, 2);
    assert_true(visual[0].radius == 0.2 && visual[0].color[0] == 0.5);
    assert_int_equal(visual[1].shape, VISUAL_MESH);
    assert_true(visual[1].color[2] == 0.3); /* not the blue of its file */
    assert_true(visual[2].half[2] == 3.0 && visual[2].color[1] == 1.0 && visual[2].color[3] == 0.5);
}

/* A biped of 40 kg whose center is 0.85 m above its ankles, which alone show little inertia: they
 * are stiff enough to keep it from tipping over them, and other joints are as before. */
TEST_WITH(ankles_hold_up_what_stands_on_them, open_folder, remove_folder)
{
    static const char text[] =
        "<mujoco model='biped'><compiler angle='radian'/><worldbody>"
        "<body name='trunk' pos='0 0 0.9'><freejoint/><inertial pos='0 0 0' mass='39' "
        "diaginertia='2 2 1'/><geom type='sphere' size='0.1'/>"
        "<body name='left' pos='0 0.1 -0.85'><joint name='left_ankle' axis='0 1 0' range='-1 1' "
        "armature='0.1'/><inertial pos='0.05 0 -0.03' mass='0.5' diaginertia='1e-3 1e-3 1e-3'/>"
        "<geom type='capsule' fromto='-0.1 0 -0.03 0.2 0 -0.03' size='0.02'/></body>"
        "<body name='right' pos='0 -0.1 -0.85'><joint name='right_ankle' axis='0 1 0' "
        "range='-1 1' armature='0.1'/><inertial pos='0.05 0 -0.03' mass='0.5' "
        "diaginertia='1e-3 1e-3 1e-3'/><geom type='capsule' fromto='-0.1 0 -0.03 0.2 0 -0.03' "
        "size='0.02'/></body>"
        "<body name='arm' pos='0 0.2 0.2'><joint name='elbow' axis='0 1 0' range='-1 1' "
        "armature='0.1'/><inertial pos='0.05 0 0' mass='0.01' diaginertia='1e-3 1e-3 1e-3'/>"
        "<geom type='sphere' size='0.02'/></body>"
        "</body></worldbody><actuator><motor joint='left_ankle' ctrlrange='-40 40'/>"
        "<motor joint='right_ankle' ctrlrange='-40 40'/><motor joint='elbow' ctrlrange='-9 9'/>"
        "</actuator><keyframe><key name='stand' qpos='0 0 0.9 1 0 0 0 0 0 0'/></keyframe></mujoco>";
    const double tips = 0.5 * 9.81 * (40.01 * 0.85 - 1.0 * 0.88);
    struct import_request request = {.file = file, .folder = folder, .protocol = "icub"};
    struct import_result result;
    const struct rig *rig;
    struct error error;

    snprintf(file, sizeof file, "%s/biped.xml", folder);
    put_file(file, text);
    if (import_run(&request, &arena, &result, &error) ||
        rig_load(result.standing, &arena, &rig, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(rig->naxis, 3);
    for (size_t i = 0; i < rig->naxis; i++) {
        const struct robot_sea *sea = &result.loaded->joint[i].sea;
        double stiffness = rig->servo.gains[i].kp_v_per_rad * sea->Kt / sea->R;

        assert_string_equal(rig->axis[i].joint, result.loaded->joint[i].name);
        if (i < 2) {
            assert_true(fabs(stiffness / (1.5 * tips) - 1.0) < 0.02);
        } else {
            assert_true(stiffness < 900.0 * 0.11);
        }
    }
}

/* "footstand" is no standing, "home" and "low-stand" are */
TEST_WITH(poses_are_chosen_by_whole_words, open_folder, remove_folder)
{
    static const char robot[] =
        "<mujoco model='kb'><worldbody><body name='base'><freejoint/><inertial pos='0 0 0' "
        "mass='5' "
        "diaginertia='.1 .1 .1'/><geom type='sphere' size='.05'/><body name='a'><joint name='j' "
        "axis='0 1 0' range='-90 90'/><inertial pos='0 0 -.1' mass='1' diaginertia='.01 .01 .01'/>"
        "</body></body></worldbody><keyframe>%s</keyframe></mujoco>";
    static const char *const cases[][2] = {{"home", "footstand"},
                                           {"low-stand", "handstand"},
                                           {"stand_2", "home"},
                                           {"standing", "homeless"}};

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct import_result result;
        char keys[400], text[4096];
        size_t size;
        FILE *out = fopen(file, "w");

        snprintf(keys, sizeof keys,
                 "<key name='%s' qpos='0 0 0 1 0 0 0 1'/><key name='%s' qpos='0 0 0 1 0 0 0 0'/>",
                 cases[i][1], cases[i][0]);
        assert_non_null(out);
        fprintf(out, robot, keys);
        assert_int_equal(fclose(out), 0);
        import_limbs("icub", &result);
        out = fopen(result.rig, "r");
        assert_non_null(out);
        size = fread(text, 1, sizeof text - 1, out);
        text[size] = '\0';
        fclose(out);
        snprintf(keys, sizeof keys, "pose: \"%s\"", cases[i][0]);
        assert_non_null(strstr(text, keys));
    }
}

/* ---- what boards see ---- */

/* An arm of one joint that a load of 0.1 m turns. */
static void write_arm(const char *joint, const char *actuator)
{
    FILE *out = fopen(file, "w");

    assert_non_null(out);
    fprintf(out,
            "<mujoco model='arm'><compiler angle='radian'/><worldbody><body name='a' pos='0 0 1'>"
            "<joint name='j' axis='0 1 0' damping='0.5' %s/><inertial pos='0.1 0 0' mass='0.55' "
            "diaginertia='.001 .001 .001'/></body></worldbody><actuator>%s</actuator></mujoco>",
            joint, actuator);
    assert_int_equal(fclose(out), 0);
}

/* The rig of that arm, as it is loaded. */
static const struct rig *import_arm(const char *protocol, struct import_result *result)
{
    const struct rig *rig;
    struct error error;

    import_limbs(protocol, result);
    assert_no_error(rig_load(result->rig, &arena, &rig, &error), error.text);
    return rig;
}

/* 22 bits of 1e-5 rad with a sign are 20.97 rad, and 50 turns are more */
TEST_WITH(joints_that_turn_farther_than_boards_report_are_doubted, open_folder, remove_folder)
{
    static const struct {
        const char *joint, *protocol, *words;
    } cases[] = {
        {"", "compact", "at most 20.97 either way"},
        {"", HIL_SOURCE_DIR "/config/protocols/mini-cheetah.yaml", "at most 12.5 either way"},
        {"", "icub", NULL},
        {"range='-20 20'", "compact", NULL}};

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct import_result result;
        size_t doubted = 0;

        write_arm(cases[i].joint, "<motor joint='j' ctrlrange='-5 5'/>");
        import_arm(cases[i].protocol, &result);
        for (size_t n = 0; n < result.notes.count; n++) {
            const struct import_note *note = &result.notes.note[n];

            doubted += note->fate == IMPORT_DOUBTED && cases[i].words &&
                       strstr(note->text, cases[i].words);
            assert_true(cases[i].words || !strstr(note->text, "either way: another --protocol"));
        }
        assert_int_equal(doubted, cases[i].words != NULL);
    }
}

/* A stop yields by torque / stiffness, and the board must not see the joint beyond its limits */
TEST_WITH(limits_of_boards_lie_outside_the_stops, open_folder, remove_folder)
{
    struct import_result result;
    const struct rig *rig;

    write_arm("range='0 2'", "<motor joint='j' ctrlrange='-50 50'/>");
    rig = import_arm("icub", &result);
    for (size_t b = 0; b < rig->boards.nboard; b++) {
        const struct board_axis_config *axis = &rig->boards.board[b].axis[0];
        const struct robot_joint *joint = &result.loaded->joint[0];

        if (rig->boards.board[b].kind == BOARD_MOTOR) {
            assert_true(axis->lower_rad <= -1.5 * joint->torque_limit / joint->stop.stiffness);
            assert_true(axis->upper_rad >= 2 + 1.5 * joint->torque_limit / joint->stop.stiffness);
        }
    }
    assert_true(rig->axis[0].lower_rad == 0.0 && rig->axis[0].upper_rad == 2.0);
}

/* The loop of a short finger is 20 times as stiff as its gravity load. When the clamp opens, the
 * finger moves by at most 50 mrad */
TEST_WITH(light_links_are_held_as_stiffly_as_gravity_asks, open_folder, remove_folder)
{
    struct import_result result;
    const struct robot_sea *sea;
    const struct rig *rig;

    write_arm("range='-2 2' armature='0.001'", "<position joint='j' kp='8' forcerange='-5 5'/>");
    rig = import_arm("icub", &result);
    sea = &result.loaded->joint[0].sea;
    assert_near(rig->servo.gains[0].kp_v_per_rad * sea->Kt / sea->R, 20.0 * 0.55 * 9.81 * 0.1,
                0.05);
}

/* The file's dry friction deflects the loop by 5 mrad, unless the inertia limits the loop to 60
 * rad/s */
TEST_WITH(dry_friction_stiffens_the_loop, open_folder, remove_folder)
{
    static const struct {
        const char *joint;
        double stiffness;
    } cases[] = {{"range='-2 2' armature='0.02' frictionloss='0.2'", 0.2 / 5e-3},
                 {"range='-2 2' armature='0.02' frictionloss='9'", 3600.0 * 0.0265}};

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct import_result result;
        const struct robot_sea *sea;
        const struct rig *rig;

        write_arm(cases[i].joint, "<position joint='j' kp='8' forcerange='-50 50'/>");
        rig = import_arm("icub", &result);
        sea = &result.loaded->joint[0].sea;
        assert_near(rig->servo.gains[0].kp_v_per_rad * sea->Kt / sea->R, cases[i].stiffness,
                    1e-3 * cases[i].stiffness);
    }
}

/* The inertia sets the stiffness of the loop (30 rad/s), for any inertia of the rotor */
TEST_WITH(light_rotor_does_not_soften_the_loop, open_folder, remove_folder)
{
    static const char *const armature[] = {"range='-2 2' armature='0.02'",
                                           "range='-2 2' armature='0.0002'"};

    for (size_t i = 0; i < ARRAY_COUNT(armature); i++) {
        struct import_result result;
        const struct robot_sea *sea;
        const struct rig *rig;

        write_arm(armature[i], "<position joint='j' kp='8' forcerange='-5 5'/>");
        rig = import_arm("icub", &result);
        sea = &result.loaded->joint[0].sea;
        assert_true(rig->servo.gains[0].kp_v_per_rad * sea->Kt / sea->R >= 900.0 * 0.0065 * 0.99);
    }
}
