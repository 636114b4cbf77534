/* SPDX-License-Identifier: Apache-2.0 */
/* Drives of the catalogue: those that are shipped, and how a robot takes one. */
#include "base/array.h"
#include "model/robot.h"

#include <dirent.h>
#include <limits.h>
#include <sys/stat.h>

#include "tests/unit/arena_fixture.h"

static char folder[] = "/tmp/hil-drives-XXXXXX";

static void write_file(const char *name, const char *text)
{
    char path[PATH_MAX];
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", folder, name);
    file = fopen(path, "we");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

FIXTURE(make_folder)
{
    char path[PATH_MAX];

    if (!mkdtemp(folder)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/robots", folder);
    if (mkdir(path, 0755)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/drives", folder);
    return mkdir(path, 0755);
}

FIXTURE(remove_folder)
{
    char command[128];

    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

/* A link on a drive that is written like that, loaded from robots/arm.yaml. */
static enum error_code load_arm(const char *all, const char *own, const struct robot **robot,
                                struct error *error)
{
    char text[2048], path[PATH_MAX];

    snprintf(
        text, sizeof text,
        "name: arm\n"
        "gravity_m_s2: [0, 0, -9.81]\n"
        "base: {type: fixed, body: stand}\n"
        "%s"
        "bodies:\n"
        "  - {name: stand, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}\n"
        "  - {name: link, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}\n"
        "joints:\n"
        "  - {name: pivot, type: revolute, parent: stand, child: link, axis: [0, 1, 0],\n"
        "     origin: {xyz_m: [0, 0, 1]}, limits: {lower_rad: -1, upper_rad: 1, torque_nm: 9},\n"
        "     drive: %s}\n",
        all, own);
    write_file("robots/arm.yaml", text);
    snprintf(path, sizeof path, "%s/robots/arm.yaml", folder);
    return robot_load(path, NULL, &arena, robot, error);
}

static void load_sound_arm(const char *all, const char *own, const struct robot **robot)
{
    struct error error;

    assert_no_error(load_arm(all, own, robot, &error), error.text);
}

#define MINE                                                                                       \
    "name: mine\ndescription: a drive of one's own\nsupply_v: 24\ndrive:\n"                        \
    "  {J_kg_m2: 0.5, Dm_nm_s_rad: 0.1, Ks_nm_rad: 300, Ds_nm_s_rad: 0.2, N: 50, NKt_nm_a: 3,\n"   \
    "   NKw_v_s_rad: 3, R_ohm: 2, L_h: 0.001, coulomb_nm: 0.25}\n"

#define OIL                                                                                        \
    "name: oil\ndescription: a cylinder of one's own\npressure_pa: 1.0e+7\ndrive:\n"               \
    "  {bore_m: 0.02, rod_m: 0.01, stroke_m: 0.1, dead_volume_m3: 1.0e-6, valve_hz: 100,\n"        \
    "   valve_damping: 0.7, valve_v: 10, valve_flow_m3_s: 1.0e-4, valve_drop_pa: 7.0e+6,\n"        \
    "   bulk_modulus_pa: 1.0e+9, valve_lap: 0.02}\n"
#define SUPPLY "hydraulic_supply: {pressure_pa: 1.0e+7}\n"
#define TRIANGLE "base_m: 0.4, arm_m: 0.05, offset_rad: 1.5, closed_m: 0.35"

/* Of each drive: torque at stall and speed without load at its voltage are those that are
 * published, or more where a board or a gear is what limits them. */
TEST_WITH(shipped_drives_reach_their_ratings, open_arena, close_arena)
{
    static const char path[] = HIL_SOURCE_DIR "/config/drives";
    DIR *directory = opendir(path);
    struct dirent *entry;
    size_t count = 0, cylinders = 0;

    assert_non_null(directory);
    while ((entry = readdir(directory))) {
        const struct robot_drive *drive;
        char file[PATH_MAX], stem[64];
        struct error error;

        if (entry->d_name[0] == '.') {
            continue;
        }
        snprintf(file, sizeof file, "%s/%s", path, entry->d_name);
        assert_no_error(robot_load_drive(file, &arena, &drive, &error), error.text);
        snprintf(stem, sizeof stem, "%.*s", (int)strcspn(entry->d_name, "."), entry->d_name);
        assert_string_equal(drive->name, stem);
        assert_non_null(drive->source);
        count++;
        if (drive->hydraulic.present) {
            assert_true(!drive->sea.present && drive->pressure > 0.0);
            assert_true(drive->hydraulic.A1 > drive->hydraulic.A2);
            cylinders++;
            continue;
        }
        assert_true(drive->sea.present && drive->supply_v > 0.0);
        assert_true(drive->sea.Kt <= 1.01 * drive->sea.Kw);
        assert_true(drive->supply_v / drive->sea.R * drive->sea.Kt >= 0.999 * drive->peak_torque);
        assert_true(drive->supply_v / drive->sea.Kw >= 0.999 * drive->speed);
        assert_true(drive->torque <= drive->peak_torque);
    }
    closedir(directory);
    assert_true(count >= 15 && cylinders >= 3);
}

TEST_WITH(a_joint_takes_a_drive_by_its_name, open_arena, close_arena)
{
    const struct robot *robot;

    write_file("drives/mine.yaml", MINE);
    load_sound_arm("", "mine", &robot);
    assert_true(robot->joint[0].sea.present);
    assert_true(robot->joint[0].sea.J == 0.5);
    assert_true(robot->joint[0].sea.Ks == 300.0);
    assert_true(robot->joint[0].sea.L == 0.001);
    assert_non_null(robot->joint[0].sea.effects);
    assert_true(robot->joint[0].sea.effects->coulomb == 0.25);

    /* the same by a path from the robot's folder */
    load_sound_arm("", "{file: ../drives/mine.yaml}", &robot);
    assert_true(robot->joint[0].sea.J == 0.5);
}

/* The joint's keys, its catalogue, the robot's keys, the robot's catalogue: in this order. */
TEST_WITH(what_stands_beside_the_name_goes_before_the_catalogue, open_arena, close_arena)
{
    const struct robot *robot;

    write_file("drives/mine.yaml", MINE);
    write_file("drives/other.yaml", "name: other\ndescription: half a drive\n"
                                    "drive: {J_kg_m2: 0.7, Ks_nm_rad: 100, R_ohm: 5}\n");
    load_sound_arm("", "{file: mine, Ks_nm_rad: 40}", &robot);
    assert_true(robot->joint[0].sea.Ks == 40.0);
    assert_true(robot->joint[0].sea.J == 0.5);

    load_sound_arm("drive: {file: mine, R_ohm: 4, L_h: 0.003}\n", "{file: other, Ks_nm_rad: 41}",
                   &robot);
    assert_true(robot->joint[0].sea.Ks == 41.0);
    assert_true(robot->joint[0].sea.J == 0.7);
    assert_true(robot->joint[0].sea.R == 5.0);
    assert_true(robot->joint[0].sea.L == 0.003);
    assert_true(robot->joint[0].sea.N == 50.0);

    load_sound_arm("drive: mine\n", "{}", &robot);
    assert_true(robot->joint[0].sea.R == 2.0);
}

/* The joint's keys, its catalogue, the robot's keys: the triangle is in any but the catalogue. */
TEST_WITH(a_joint_takes_a_hydraulic_drive, open_arena, close_arena)
{
    const struct robot *robot;
    const struct robot_hydraulic *c;

    write_file("drives/oil.yaml", OIL);
    write_file("drives/mine.yaml", MINE);
    load_sound_arm(SUPPLY, "{file: oil, stroke_m: 0.11, " TRIANGLE "}", &robot);
    c = &robot->joint[0].hydraulic;
    assert_true(c->present && !robot->joint[0].sea.present);
    assert_true(c->stroke == 0.11 && c->base == 0.4 && c->closed == 0.35 && c->lap == 0.02);

    load_sound_arm(SUPPLY "drive: {file: oil, " TRIANGLE "}\n", "{arm_m: 0.045}", &robot);
    c = &robot->joint[0].hydraulic;
    assert_true(c->stroke == 0.1 && c->arm == 0.045 && c->beta == 1e9);

    /* What the robot has of the other kind is not for this joint */
    load_sound_arm(SUPPLY "drive: mine\n", "{file: oil, " TRIANGLE "}", &robot);
    assert_true(robot->joint[0].hydraulic.present && !robot->joint[0].sea.present);
    load_sound_arm(SUPPLY "drive: {file: oil, " TRIANGLE "}\n", "mine", &robot);
    assert_true(!robot->joint[0].hydraulic.present && robot->joint[0].sea.J == 0.5);
}

TEST_WITH(kinds_of_drives_are_not_mixed, open_arena, close_arena)
{
    static const struct {
        const char *all, *own, *file, *text;
    } fault[] = {
        {SUPPLY, "{file: oil, R_ohm: 2}", OIL,
         "arm.yaml:11:32: found key \"R_ohm\" of an electric drive beside drive \"oil\", expected "
         "keys of a hydraulic drive"},
        {"", "{file: oil, freewheel: true}", OIL, "arm.yaml:10:36: found key \"freewheel\""},
        {"", "{file: oil, bore_m: 0.02}", MINE,
         "arm.yaml:10:33: found key \"bore_m\" of a hydraulic drive beside drive \"oil\""},
        {"", "{bore_m: 0.02, R_ohm: 2}", OIL,
         "arm.yaml:10:35: found key \"R_ohm\" of an electric drive beside key \"bore_m\" of a"},
        {"", "{file: oil, " TRIANGLE "}", OIL, "in a robot without key \"hydraulic_supply\""},
        {SUPPLY, "oil", OIL,
         "arm.yaml:11:13: found the hydraulic drive of joint \"pivot\" without key \"base_m\", "
         "expected it here (the triangle is the joint's) or in the robot's own drive"},
        {SUPPLY, "{file: oil, " TRIANGLE ", rod_m: 0.02}", OIL, "found a rod as thick as"},
        {SUPPLY, "oil", "name: oil\ndescription: x\npressure_pa: 1.0e+7\ndrive: {base_m: 0.4}\n",
         "oil.yaml:4:17: found key \"base_m\" in a drive's file, expected it at the joint"},
        {SUPPLY, "oil", "name: oil\ndescription: x\nsupply_v: 24\ndrive: {bore_m: 0.02}\n",
         "oil.yaml:3:11: found rating \"supply_v\" in the file of a hydraulic drive"},
        {SUPPLY, "oil", "name: oil\ndescription: x\npressure_pa: 1.0e+7\ndrive: {N: 2}\n",
         "oil.yaml:3:14: found rating \"pressure_pa\" in the file of an electric drive"},
        {SUPPLY, "oil", "name: oil\ndescription: x\ndrive: {bore_m: 0.02}\n",
         "oil.yaml:1:1: found the file of a hydraulic drive without key \"pressure_pa\""},
        {SUPPLY, "oil",
         "name: oil\ndescription: x\npressure_pa: 1.0e+7\ndrive: {bore_m: 1, N: 2}\n",
         "oil.yaml:4:23: found key \"N\" of an electric drive beside key \"bore_m\""},
    };

    for (size_t i = 0; i < ARRAY_COUNT(fault); i++) {
        const struct robot *robot;
        struct error error;

        write_file("drives/oil.yaml", fault[i].file);
        assert_int_equal(load_arm(fault[i].all, fault[i].own, &robot, &error), ERROR_INPUT);
        if (!strstr(error.text, fault[i].text)) {
            fail_msg("%s\n  is not %s", error.text, fault[i].text);
        }
    }
}

TEST_WITH(a_variant_keeps_the_kind_of_the_drive, open_arena, close_arena)
{
    static const char changed[] = "drive: mine\nvariants: {wet: {drive: {bore_m: 0.02}}}\n";
    char path[PATH_MAX];
    const struct robot *robot;
    struct error error;

    write_file("drives/mine.yaml", MINE);
    load_sound_arm(changed, "{}", &robot);
    snprintf(path, sizeof path, "%s/robots/arm.yaml", folder);
    assert_int_equal(robot_load(path, "wet", &arena, &robot, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "arm.yaml:5:34: found key \"bore_m\" of a hydraulic drive "
                                       "beside the robot's own drive"));
}

/* What a program that only names a drive needs of its file. */
TEST_WITH(a_drive_is_described_with_its_kind, open_arena, close_arena)
{
    char path[PATH_MAX];
    struct error error;
    const char *text;
    bool hydraulic;

    snprintf(path, sizeof path, "%s/drives/oil.yaml", folder);
    write_file("drives/oil.yaml", OIL);
    assert_ok(robot_describe_drive(path, &arena, &text, &hydraulic, &error));
    assert_true(hydraulic);
    assert_string_equal(text, "a cylinder of one's own");
    write_file("drives/oil.yaml", "name: other\ndescription: half\ndrive: {R_ohm: 5}\n");
    assert_ok(robot_describe_drive(path, &arena, &text, &hydraulic, &error));
    assert_false(hydraulic);
}

TEST_WITH(a_faulty_reference_is_refused_at_its_place, open_arena, close_arena)
{
    static const struct {
        const char *own, *file, *text;
    } fault[] = {
        {"nobody", MINE, "arm.yaml:10:13: found no file \"nobody\""},
        {"{file: ../drives/none.yaml}", MINE, "arm.yaml:10:20: found drive"},
        {"{file: /etc/passwd}", MINE, "arm.yaml:10:20: found absolute path"},
        {"5", MINE, "arm.yaml:10:13: found"},
        {"[mine]", MINE, "arm.yaml:10:13: found a list"},
        {"mine", "name: mine\ndescription: x\ndrive: {J_kgm2: 1}\n",
         "mine.yaml:3:9: found unknown key \"J_kgm2\" in a drive, expected \"J_kg_m2\""},
        {"mine", "name: mine\ndescription: x\ndrive: {file: other}\n",
         "mine.yaml:3:9: found unknown key \"file\""},
        {"mine", "name: mine\ndescription: x\ndrive: {J_kg_m2: -1}\n", "mine.yaml:3:18: found"},
        {"mine", "name: mine\ndescription: x\ndrive: {J_kg_m2: 1}\n",
         "arm.yaml:10:13: found the drive of joint \"pivot\" without key \"Dm_nm_s_rad\", expected "
         "it here, in the file of the drive, or in the robot's own drive"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(fault); i++) {
        const struct robot *robot;
        struct error error;

        write_file("drives/mine.yaml", fault[i].file);
        assert_int_equal(load_arm("", fault[i].own, &robot, &error), ERROR_INPUT);
        if (!strstr(error.text, fault[i].text)) {
            fail_msg("%s\n  is not %s", error.text, fault[i].text);
        }
    }
}

TEST_GROUP(make_folder, remove_folder)
