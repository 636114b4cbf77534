/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the robot file of an import, and the report. */
#include "app/import/write.h"

#include "base/array.h"
#include "base/input_file.h"
#include "base/whole_file.h"
#include "model/stop.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* ---- numbers ---- */

/* Writes a number with as many digits as it takes to read the same value back. */
static void import_write_real(FILE *out, double value)
{
    char text[32];

    value = value == 0.0 ? 0.0 : value; /* no -0 */
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) {
            break;
        }
    }
    fputs(text, out);
    if (!strpbrk(text, ".e")) {
        fputs(".0", out);
    }
}

/* Writes numbers as a YAML list. */
static void import_write_reals(FILE *out, const double *value, size_t count)
{
    fputc('[', out);
    for (size_t i = 0; i < count; i++) {
        fputs(i ? ", " : "", out);
        import_write_real(out, value[i]);
    }
    fputc(']', out);
}

/* ---- parts ---- */

/* Writes mass, center of mass and inertia, each on a line behind the indent. */
static void write_inertia(FILE *out, const struct robot_inertia *inertia, const char *indent)
{
    fprintf(out, "%smass_kg: ", indent);
    import_write_real(out, inertia->mass);
    fprintf(out, "\n%scom_m: ", indent);
    import_write_reals(out, inertia->com, 3);
    fprintf(out, "\n%sinertia_kg_m2: ", indent);
    import_write_reals(out, inertia->I, 6);
    fputc('\n', out);
}

/* Writes a place as position and fixed-axis roll, pitch, yaw. */
static void write_robot_place(FILE *out, const double xyz[3], const double R[9])
{
    double rpy[3];

    import_rpy(R, rpy);
    fputs("xyz_m: ", out);
    import_write_reals(out, xyz, 3);
    fputs(", rpy_rad: ", out);
    import_write_reals(out, rpy, 3);
}

/* Writes the bodies with their inertias. */
static void write_bodies(FILE *out, const struct robot *robot)
{
    fputs("\nbodies:\n", out);
    for (size_t b = 0; b < robot->nbody; b++) {
        fprintf(out, "  - name: \"%s\"\n", robot->body[b].name);
        write_inertia(out, &robot->body[b].inertia, "    ");
    }
}

/* Writes the parameters of an electric drive. */
static void write_drive(FILE *out, const struct robot_sea *sea)
{
    const struct {
        const char *key;
        double value;
    } parameter[] = {
        {"J_kg_m2", sea->J},
        {"Dm_nm_s_rad", sea->Dm},
        {"Ks_nm_rad", sea->Ks},
        {"Ds_nm_s_rad", sea->Ds},
        {"N", sea->N},
        {"NKt_nm_a", sea->Kt},
        {"NKw_v_s_rad", sea->Kw},
        {"R_ohm", sea->R},
        {"L_h", sea->L},
    };

    fputs("    drive:\n", out);
    for (size_t i = 0; i < ARRAY_COUNT(parameter); i++) {
        fprintf(out, "      %s: %.6g\n", parameter[i].key, parameter[i].value);
    }
}

/* Writes the reference to a drive of the catalogue, and of a hydraulic one the triangle. */
static void write_catalogue_drive(FILE *out, const char *file,
                                  const struct robot_hydraulic *cylinder)
{
    if (!cylinder->present) {
        fprintf(out, "    drive: \"%s\"\n", file);
        return;
    }
    fprintf(out, "    drive: {file: \"%s\", base_m: ", file);
    import_write_real(out, cylinder->base);
    fputs(", arm_m: ", out);
    import_write_real(out, cylinder->arm);
    fputs(",\n            offset_rad: ", out);
    import_write_real(out, cylinder->offset);
    fputs(", closed_m: ", out);
    import_write_real(out, cylinder->closed);
    fputs("}\n", out);
}

/* Writes the hydraulic supply, if the robot has one. */
static void write_hydraulic_supply(FILE *out, const struct robot_hydraulic_supply *supply)
{
    if (supply->pressure > 0.0) {
        fprintf(out,
                "\nhydraulic_supply:\n  pressure_pa: %.6g\n  return_pa: %.6g\n  pump_m3_s: %.6g\n"
                "  accumulator_m3: %.6g\n  precharge_pa: %.6g\n  relief_pa: %.6g\n"
                "  relief_m3_s_pa: %.6g\n",
                supply->pressure, supply->back, supply->pump, supply->accumulator,
                supply->precharge, supply->relief, supply->relief_flow);
    }
}

/* Writes a joint: its place, limits, and drive; a continuous one has no stops. */
static void write_joint(FILE *out, const struct import_robot *from, size_t j)
{
    const struct robot *robot = from->robot;
    const struct robot_joint *joint = &robot->joint[j];
    bool turns = joint->type == JOINT_REVOLUTE;

    fprintf(out, "  - name: \"%s\"\n    type: %s\n    parent: \"%s\"\n    child: \"%s\"\n",
            joint->name, turns ? "revolute" : "prismatic",
            robot->body[robot->body[j + 1].parent].name, robot->body[j + 1].name);
    fputs("    axis: ", out);
    import_write_reals(out, joint->axis, 3);
    fputs("\n    origin: {", out);
    write_robot_place(out, joint->origin, joint->rotation);
    fprintf(out, "}\n    limits: {lower_%s: ", turns ? "rad" : "m");
    import_write_real(out, joint->lower);
    fprintf(out, ", upper_%s: ", turns ? "rad" : "m");
    import_write_real(out, joint->upper);
    fprintf(out, ", %s: %.6g}\n", turns ? "torque_nm" : "force_n", joint->torque_limit);

    /* A joint without limits has no stops to run into */
    if (from->source[j]->type == IMPORT_CONTINUOUS) {
        fputs("    stops: {enabled: false}\n", out);
    }

    /* A drive of the catalogue goes by its file, an assumed one by its numbers */
    if (from->drive_file[j]) {
        write_catalogue_drive(out, from->drive_file[j], &joint->hydraulic);
    } else if (joint->sea.present) {
        write_drive(out, &joint->sea);
    }
    if (passive_is_present(&joint->passive)) {
        const struct robot_passive *passive = &joint->passive;

        fprintf(out, "    passive: {%s: ", turns ? "stiffness_nm_rad" : "stiffness_n_m");
        import_write_real(out, passive->stiffness);
        fprintf(out, ", %s: ", turns ? "damping_nm_s_rad" : "damping_n_s_m");
        import_write_real(out, passive->damping);
        fprintf(out, ", %s: ", turns ? "rest_rad" : "rest_m");
        import_write_real(out, passive->rest);
        fputs("}\n", out);
    }
}

/* Writes the couplings of joints that follow others, in the units of the follower. */
static void write_couplings(FILE *out, const struct robot *robot)
{
    fputs(robot->ncoupling ? "\ncouplings:\n" : "", out);
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        const bool turns = robot->joint[coupling->follower].type == JOINT_REVOLUTE;

        fprintf(out, "  - {follower: \"%s\", leader: \"%s\", multiplier: ",
                robot->joint[coupling->follower].name, robot->joint[coupling->leader].name);
        import_write_real(out, coupling->multiplier);
        if (coupling->offset != 0.0) {
            fprintf(out, ", offset_%s: ", turns ? "rad" : "m");
            import_write_real(out, coupling->offset);
        }
        fprintf(out, ",\n     %s: %.6g, %s: %.6g}\n", turns ? "stiffness_nm_rad" : "stiffness_n_m",
                coupling->stiffness, turns ? "damping_nm_s_rad" : "damping_n_s_m",
                coupling->damping);
    }
}

/* Writes the frames. */
static void write_frames(FILE *out, const struct robot *robot)
{
    fputs(robot->nframe ? "\nframes:\n" : "", out);
    for (size_t f = 0; f < robot->nframe; f++) {
        const struct robot_frame *frame = &robot->frame[f];

        fprintf(out, "  - {name: \"%s\", body: \"%s\", ", frame->name,
                robot->body[frame->body].name);
        write_robot_place(out, frame->position, frame->rotation);
        fputs("}\n", out);
    }
}

/* Writes the collision capsules. */
static void write_capsules(FILE *out, const struct robot *robot)
{
    fputs(robot->ncapsule ? "\ncapsules:\n" : "", out);
    for (size_t c = 0; c < robot->ncapsule; c++) {
        const struct robot_capsule *capsule = &robot->capsule[c];

        fprintf(out, "  - {name: \"%s\", body: \"%s\", ", capsule->name,
                robot->body[capsule->body].name);
        write_robot_place(out, capsule->position, capsule->rotation);
        fprintf(out, ", radius_m: %.9g, length_m: %.9g}\n", capsule->radius, capsule->length);
    }
}

/* Writes a text between double quotes; leaves out quotes, backslashes and non-ASCII characters. */
static void write_quoted(FILE *out, const char *text)
{
    fputc('"', out);
    for (; *text; text++) {
        if (*text != '"' && *text != '\\' && (unsigned char)*text >= ' ' &&
            (unsigned char)*text < 0x7f) {
            fputc(*text, out);
        }
    }
    fputc('"', out);
}

/* Writes the shape of a visual with its dimensions. */
static void write_visual_shape(FILE *out, const struct robot_visual *visual)
{
    switch (visual->shape) {
    case VISUAL_BOX:
        fputs("shape: box, half_extents_m: ", out);
        import_write_reals(out, visual->half, 3);
        break;
    case VISUAL_SPHERE:
        fprintf(out, "shape: sphere, radius_m: %.9g", visual->radius);
        break;
    case VISUAL_CYLINDER:
    case VISUAL_CAPSULE:
        fprintf(out, "shape: %s, radius_m: %.9g, length_m: %.9g",
                visual->shape == VISUAL_CYLINDER ? "cylinder" : "capsule", visual->radius,
                visual->length);
        break;
    default:
        fprintf(out, "shape: mesh, %s: ", visual->missing ? "missing" : "file");
        write_quoted(out, visual->missing ? visual->missing : visual->file);
        break;
    }
}

/* Writes the visuals. */
static void write_visuals(FILE *out, const struct robot *robot)
{
    fputs(robot->nvisual ? "\nvisuals:\n" : "", out);
    for (size_t v = 0; v < robot->nvisual; v++) {
        const struct robot_visual *visual = &robot->visual[v];

        fprintf(out, "  - {name: \"%s\", body: \"%s\", ", visual->name,
                robot->body[visual->body].name);
        write_robot_place(out, visual->position, visual->rotation);
        fputs(",\n     ", out);
        write_visual_shape(out, visual);
        if (visual->colored) {
            fprintf(out, ", color: [%.4g, %.4g, %.4g, %.4g]", visual->color[0], visual->color[1],
                    visual->color[2], visual->color[3]);
        }
        fputs("}\n", out);
    }
}

/* Writes the force-torque sensors with what hangs on them, and the inertial sensor's frame. */
static void write_sensors(FILE *out, const struct robot *robot)
{
    fputs(robot->nft ? "\nft_sensors:\n" : "", out);
    for (size_t s = 0; s < robot->nft; s++) {
        const struct robot_ft_sensor *ft = &robot->ft[s];

        fprintf(out, "  - name: \"%s\"\n    frame: \"%s\"\n    distal:\n", ft->name,
                robot->frame[ft->frame].name);
        write_inertia(out, &ft->distal, "      ");
    }
    if (robot->imu_frame >= 0) {
        fprintf(out, "\nimu: {frame: \"%s\"}\n", robot->frame[robot->imu_frame].name);
    }
}

/* Writes the joints of one type that a pose moves from 0. */
static void write_pose_joints(FILE *out, const struct robot *robot, const struct robot_pose *pose,
                              enum joint_type type)
{
    bool any = false;

    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot->joint[j].type == type && pose->joint[j] != 0.0) {
            fprintf(out, "%s\n      \"%s\": ",
                    any                      ? ""
                    : type == JOINT_REVOLUTE ? "    joints_rad:"
                                             : "    joints_m:",
                    robot->joint[j].name);
            import_write_real(out, pose->joint[j]);
            any = true;
        }
    }
    fputs(any ? "\n" : "", out);
}

/* Writes the poses; one in which nothing moves is an empty map. */
static void write_poses(FILE *out, const struct robot *robot)
{
    fputs("\nposes:\n", out);
    for (size_t p = 0; p < robot->npose; p++) {
        const struct robot_pose *pose = &robot->pose[p];
        bool any = robot->floating;

        for (size_t j = 0; j < robot->njoint; j++) {
            any |= pose->joint[j] != 0.0;
        }
        fprintf(out, "  \"%s\":%s\n", pose->name, any ? "" : " {}");
        if (robot->floating) {
            fputs("    base_xyz_m: [0.0, 0.0, 0.0]\n", out);
        }
        write_pose_joints(out, robot, pose, JOINT_REVOLUTE);
        write_pose_joints(out, robot, pose, JOINT_PRISMATIC);
    }
}

/* Returns the file's name at the end of a path. */
static const char *path_find_name(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash ? slash + 1 : path;
}

enum error_code import_write_robot(const struct import_robot *from, const char *path,
                                   struct error *error)
{
    const struct robot *robot = from->robot;
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }

    /* Sections in the order of the robot file's manual; each writes nothing when it is empty */
    fprintf(file.out,
            "# Made by `coman-hil import`; what was merged, dropped and assumed stands in the "
            "report\n# beside it, %s-import.txt. Drives are assumed: no such file has their "
            "constants.\n# The format is that of coman-hil-robot(5).\nname: \"%s\"\nsource: ",
            robot->name, robot->name);
    write_quoted(file.out, path_find_name(from->model->file));
    fputs("\ngravity_m_s2: ", file.out);
    import_write_reals(file.out, robot->gravity, 3);
    fprintf(file.out, "\nbase: {type: %s, body: \"%s\"}\n", robot->floating ? "floating" : "fixed",
            robot->body[0].name);
    write_hydraulic_supply(file.out, &robot->hydraulic_supply);
    write_bodies(file.out, robot);
    fputs(robot->njoint ? "\njoints:\n" : "", file.out);
    for (size_t j = 0; j < robot->njoint; j++) {
        write_joint(file.out, from, j);
    }
    write_couplings(file.out, robot);
    write_frames(file.out, robot);
    write_capsules(file.out, robot);
    write_visuals(file.out, robot);
    write_sensors(file.out, robot);
    write_poses(file.out, robot);
    return whole_file_close(&file, ERROR_NONE, error);
}

enum error_code import_copy_drive(const char *from, const char *path, struct error *error)
{
    FILE *in;
    struct whole_file file;
    enum error_code code = input_file_stream(from, &in, error);
    char block[4096];
    size_t size;

    if (code) {
        return code;
    }
    code = whole_file_open(&file, path, error);
    if (!code) {
        while ((size = fread(block, 1, sizeof block, in)) > 0) {
            fwrite(block, 1, size, file.out);
        }
        code = ferror(in) ? error_set_file(error, errno, from, "cannot be read") : ERROR_NONE;
        code = whole_file_close(&file, code, error);
    }
    fclose(in);
    return code;
}

/* ---- report ---- */

const char *import_fate_word(enum import_fate fate)
{
    static const char *const word[] = {
        [IMPORT_DROPPED] = "dropped", [IMPORT_MERGED] = "merged", [IMPORT_CHANGED] = "changed",
        [IMPORT_ASSUMED] = "assumed", [IMPORT_SHAPED] = "shaped", [IMPORT_MISSING] = "missing",
        [IMPORT_DOUBTED] = "doubted",
    };

    return word[fate];
}

size_t import_count_notes(const struct import_notes *notes, enum import_fate fate)
{
    size_t count = 0;

    for (size_t i = 0; i < notes->count; i++) {
        count += notes->note[i].fate == fate;
    }
    return count;
}

enum error_code import_write_report(const struct import_notes *notes, const char *source,
                                    const char *path, struct error *error)
{
    static const enum import_fate order[] = {IMPORT_MISSING, IMPORT_DOUBTED, IMPORT_CHANGED,
                                             IMPORT_ASSUMED, IMPORT_DROPPED, IMPORT_SHAPED,
                                             IMPORT_MERGED};
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }
    fprintf(file.out, "What became of %s\n", source);
    for (size_t f = 0; f < ARRAY_COUNT(order); f++) {
        fprintf(file.out, "\n%s: %zu\n", import_fate_word(order[f]),
                import_count_notes(notes, order[f]));
        for (size_t i = 0; i < notes->count; i++) {
            const struct import_note *note = &notes->note[i];

            if (note->fate == order[f]) {
                fprintf(file.out, "%s:%d: %s\n", note->file, note->line, note->text);
            }
        }
    }
    return whole_file_close(&file, ERROR_NONE, error);
}
