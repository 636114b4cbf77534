/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the robot file of an import, and the report. */
#include "app/import/write.h"

#include "base/array.h"
#include "base/input_file.h"
#include "base/whole_file.h"
#include "model/stop.h"

#include <stdlib.h>
#include <string.h>

enum { COPY_BYTES_MAX = 16 << 20 };

/* ---- values as text ---- */

/* Numbers as text; several numbers are a list. */
struct written {
    char text[400];
};

/* Returns numbers as a YAML list. Each has as many digits as it needs to be read back exactly. */
static struct written write_list(const double *value, size_t count)
{
    struct written list = {"["};
    size_t used = 1;

    for (size_t i = 0; i < count; i++) {
        const double real = value[i] == 0.0 ? 0.0 : value[i]; /* avoids -0 */
        char text[32];

        for (int digits = 15; digits <= 17; digits++) {
            snprintf(text, sizeof text, "%.*g", digits, real);
            if (strtod(text, NULL) == real) {
                break;
            }
        }
        used += (size_t)snprintf(list.text + used, sizeof list.text - used, "%s%s%s", i ? ", " : "",
                                 text, strpbrk(text, ".e") ? "" : ".0");
    }
    snprintf(list.text + used, sizeof list.text - used, "]");
    return list;
}

/* Returns one number as text. */
static struct written write_real(double value)
{
    struct written real = write_list(&value, 1);
    const size_t length = strlen(real.text) - 2;

    memmove(real.text, real.text + 1, length);
    real.text[length] = '\0';
    return real;
}

/* Returns a pose as text: position, and fixed-axis roll, pitch and yaw. */
static struct written write_pose(const double R[9], const double xyz[3])
{
    struct written place;
    double rpy[3];

    import_rpy(R, rpy);
    snprintf(place.text, sizeof place.text, "xyz_m: %.110s, rpy_rad: %.110s",
             write_list(xyz, 3).text, write_list(rpy, 3).text);
    return place;
}

/* Returns a text in double quotes. Omits quotes, backslashes and non-ASCII characters. */
static struct written write_quoted(const char *text)
{
    struct written quoted = {"\""};
    size_t used = 1;

    for (; *text && used < sizeof quoted.text - 2; text++) {
        if (*text != '"' && *text != '\\' && *text >= ' ' && *text < 0x7f) {
            quoted.text[used++] = *text;
        }
    }
    quoted.text[used] = '"';
    quoted.text[used + 1] = '\0';
    return quoted;
}

/* ---- parts ---- */

/* Writes mass, center of mass and inertia, each on an indented line. */
static void write_inertia(FILE *out, const struct robot_inertia *inertia, const char *indent)
{
    fprintf(out, "%smass_kg: %s\n%scom_m: %s\n%sinertia_kg_m2: %s\n", indent,
            write_real(inertia->mass).text, indent, write_list(inertia->com, 3).text, indent,
            write_list(inertia->I, 6).text);
}

/* Writes a drive. A catalogue drive is written as its file name, with the triangle if it is
 * hydraulic. An assumed drive is written as its numbers, with the joint's friction, N m. */
static void write_drive(FILE *out, const struct robot_joint *joint, const char *file,
                        double friction)
{
    const struct robot_hydraulic *cylinder = &joint->hydraulic;
    const struct robot_sea *sea = &joint->sea;

    if (file && cylinder->present) {
        fprintf(out,
                "    drive: {file: \"%s\", base_m: %s, arm_m: %s,\n            offset_rad: %s, "
                "closed_m: %s}\n",
                file, write_real(cylinder->base).text, write_real(cylinder->arm).text,
                write_real(cylinder->offset).text, write_real(cylinder->closed).text);
    } else if (file) {
        fprintf(out, "    drive: \"%s\"\n", file);
    } else if (sea->present) {
        fprintf(out,
                "    drive:\n      J_kg_m2: %.9g\n      Dm_nm_s_rad: %.9g\n      Ks_nm_rad: %.9g\n"
                "      Ds_nm_s_rad: %.9g\n      N: %.9g\n      NKt_nm_a: %.9g\n"
                "      NKw_v_s_rad: %.9g\n      R_ohm: %.9g\n      L_h: %.9g\n",
                sea->J, sea->Dm, sea->Ks, sea->Ds, sea->N, sea->Kt, sea->Kw, sea->R, sea->L);
        if (friction > 0.0) {
            fprintf(out, "      coulomb_nm: %.9g\n", friction);
        }
    }
}

/* Writes a joint: its pose, limits and drive. A continuous joint has no stops. */
static void write_joint(FILE *out, const struct import_robot *from, size_t j)
{
    const struct robot *robot = from->robot;
    const struct robot_joint *joint = &robot->joint[j];
    const struct robot_passive *passive = &joint->passive;
    const bool turns = joint->type == JOINT_REVOLUTE;

    fprintf(out,
            "  - name: \"%s\"\n    type: %s\n    parent: \"%s\"\n    child: \"%s\"\n    axis: %s\n"
            "    origin: {%s}\n    limits: {lower_%s: %s, upper_%s: %s, %s: %s}\n",
            joint->name, turns ? "revolute" : "prismatic",
            robot->body[robot->body[j + 1].parent].name, robot->body[j + 1].name,
            write_list(joint->axis, 3).text, write_pose(joint->rotation, joint->origin).text,
            turns ? "rad" : "m", write_real(joint->lower).text, turns ? "rad" : "m",
            write_real(joint->upper).text, turns ? "torque_nm" : "force_n",
            write_real(joint->torque_limit).text);

    /* A joint without limits has no stops */
    if (from->source[j]->type == IMPORT_CONTINUOUS) {
        fputs("    stops: {enabled: false}\n", out);
    }
    write_drive(out, joint, from->drive_file[j], from->source[j]->friction);
    if (passive_is_present(passive)) {
        fprintf(out, "    passive: {%s: %s, %s: %s, %s: %s}\n",
                turns ? "stiffness_nm_rad" : "stiffness_n_m", write_real(passive->stiffness).text,
                turns ? "damping_nm_s_rad" : "damping_n_s_m", write_real(passive->damping).text,
                turns ? "rest_rad" : "rest_m", write_real(passive->rest).text);
    }
}

/* Writes the couplings of joints that follow others, in the units of the follower. */
static void write_couplings(FILE *out, const struct robot *robot)
{
    fputs(robot->ncoupling ? "\ncouplings:\n" : "", out);
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        const bool turns = robot->joint[coupling->follower].type == JOINT_REVOLUTE;

        fprintf(out, "  - {follower: \"%s\", leader: \"%s\", multiplier: %s",
                robot->joint[coupling->follower].name, robot->joint[coupling->leader].name,
                write_real(coupling->multiplier).text);
        if (coupling->offset != 0.0) {
            fprintf(out, ", offset_%s: %s", turns ? "rad" : "m", write_real(coupling->offset).text);
        }
        fprintf(out, ",\n     %s: %.6g, %s: %.6g}\n", turns ? "stiffness_nm_rad" : "stiffness_n_m",
                coupling->stiffness, turns ? "damping_nm_s_rad" : "damping_n_s_m",
                coupling->damping);
    }
}

/* Writes the frames, and the collision capsules. */
static void write_frames(FILE *out, const struct robot *robot)
{
    fputs(robot->nframe ? "\nframes:\n" : "", out);
    for (size_t f = 0; f < robot->nframe; f++) {
        const struct robot_frame *frame = &robot->frame[f];

        fprintf(out, "  - {name: \"%s\", body: \"%s\", %s}\n", frame->name,
                robot->body[frame->body].name, write_pose(frame->rotation, frame->position).text);
    }
    fputs(robot->ncapsule ? "\ncapsules:\n" : "", out);
    for (size_t c = 0; c < robot->ncapsule; c++) {
        const struct robot_capsule *capsule = &robot->capsule[c];

        fprintf(out, "  - {name: \"%s\", body: \"%s\", %s, ", capsule->name,
                robot->body[capsule->body].name,
                write_pose(capsule->rotation, capsule->position).text);
        if (capsule->radius == 0.0) {
            fprintf(out, "half_extents_m: %s}\n", write_list(capsule->half, 3).text);
        } else {
            fprintf(out, "radius_m: %s, length_m: %s%s}\n", write_real(capsule->radius).text,
                    write_real(capsule->length).text, capsule->flat ? ", flat: true" : "");
        }
    }
}

/* Writes a visual: its pose, its shape with dimensions, and its color. */
static void write_visual(FILE *out, const struct robot *robot, const struct robot_visual *visual)
{
    fprintf(out, "  - {name: \"%s\", body: \"%s\", %s,\n     ", visual->name,
            robot->body[visual->body].name, write_pose(visual->rotation, visual->position).text);
    switch (visual->shape) {
    case VISUAL_BOX:
        fprintf(out, "shape: box, half_extents_m: %s", write_list(visual->half, 3).text);
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
        fprintf(out, "shape: mesh, %s: %s", visual->missing ? "missing" : "file",
                write_quoted(visual->missing ? visual->missing : visual->file).text);
        break;
    }
    if (visual->colored) {
        fprintf(out, ", color: [%.4g, %.4g, %.4g, %.4g]", visual->color[0], visual->color[1],
                visual->color[2], visual->color[3]);
    }
    fputs("}\n", out);
}

/* Writes the force-torque sensors with the inertia below them, and the frame of the inertial
 * sensor. */
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

/* Writes the positions of a pose for the joints of one type, except zeros. */
static void write_pose_joints(FILE *out, const struct robot *robot, const struct robot_pose *pose,
                              enum joint_type type)
{
    const char *before = type == JOINT_REVOLUTE ? "    joints_rad:\n" : "    joints_m:\n";

    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot->joint[j].type == type && pose->joint[j] != 0.0) {
            fprintf(out, "%s      \"%s\": %s\n", before, robot->joint[j].name,
                    write_real(pose->joint[j]).text);
            before = "";
        }
    }
}

enum error_code import_write_robot(const struct import_robot *from, const char *path,
                                   struct error *error)
{
    const struct robot *robot = from->robot;
    const struct robot_hydraulic_supply *supply = &robot->hydraulic_supply;
    const char *source = strrchr(from->model->file, '/');
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }

    /* Sections in the order of the robot file's manual; each function writes nothing if its section
     * is empty */
    fprintf(file.out,
            "# Made by `coman-hil import`; what was merged, dropped and assumed stands in the "
            "report\n# beside it, %s-import.txt. Drives are assumed: no such file has their "
            "constants.\n# The format is that of coman-hil-robot(5).\nname: \"%s\"\nsource: %s\n"
            "gravity_m_s2: %s\nbase: {type: %s, body: \"%s\"}\n",
            robot->name, robot->name, write_quoted(source ? source + 1 : from->model->file).text,
            write_list(robot->gravity, 3).text, robot->floating ? "floating" : "fixed",
            robot->body[0].name);
    if (supply->pressure > 0.0) {
        fprintf(file.out,
                "\nhydraulic_supply:\n  pressure_pa: %.6g\n  return_pa: %.6g\n  pump_m3_s: %.6g\n"
                "  accumulator_m3: %.6g\n  precharge_pa: %.6g\n  relief_pa: %.6g\n"
                "  relief_m3_s_pa: %.6g\n",
                supply->pressure, supply->back, supply->pump, supply->accumulator,
                supply->precharge, supply->relief, supply->relief_flow);
    }
    fputs("\nbodies:\n", file.out);
    for (size_t b = 0; b < robot->nbody; b++) {
        fprintf(file.out, "  - name: \"%s\"\n", robot->body[b].name);
        write_inertia(file.out, &robot->body[b].inertia, "    ");
    }
    fputs(robot->njoint ? "\njoints:\n" : "", file.out);
    for (size_t j = 0; j < robot->njoint; j++) {
        write_joint(file.out, from, j);
    }
    write_couplings(file.out, robot);
    write_frames(file.out, robot);
    fputs(robot->nvisual ? "\nvisuals:\n" : "", file.out);
    for (size_t v = 0; v < robot->nvisual; v++) {
        write_visual(file.out, robot, &robot->visual[v]);
    }
    write_sensors(file.out, robot);

    /* Write the poses. A pose without positions is an empty map. */
    fputs("\nposes:\n", file.out);
    for (size_t p = 0; p < robot->npose; p++) {
        const struct robot_pose *pose = &robot->pose[p];
        bool any = robot->floating;

        for (size_t j = 0; j < robot->njoint; j++) {
            any |= pose->joint[j] != 0.0;
        }
        fprintf(file.out, "  \"%s\":%s\n%s", pose->name, any ? "" : " {}",
                robot->floating ? "    base_xyz_m: [0.0, 0.0, 0.0]\n" : "");
        write_pose_joints(file.out, robot, pose, JOINT_REVOLUTE);
        write_pose_joints(file.out, robot, pose, JOINT_PRISMATIC);
    }
    return whole_file_close(&file, ERROR_NONE, error);
}

enum error_code import_copy_file(const char *from, const char *path, struct error *error)
{
    char *text;
    size_t size;
    struct whole_file file;
    enum error_code code = input_file_load(from, COPY_BYTES_MAX, &text, &size, error);

    code = code ? code : whole_file_open(&file, path, error);
    if (!code) {
        fwrite(text, 1, size, file.out);
        code = whole_file_close(&file, ERROR_NONE, error);
    }
    free(text);
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
