/* SPDX-License-Identifier: Apache-2.0 */
/* Runs the steps of an import. */
#include "app/import/import.h"

#include "app/import/drive.h"
#include "app/import/readers.h"
#include "app/import/shapes.h"
#include "app/import/write.h"
#include "base/array.h"
#include "base/whole_file.h"
#include "boards/described/protocol.h"
#include "rig/rig.h"

#include <ctype.h>
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Reserved address space for reading a written rig, bytes. */
#define RIG_ARENA ((size_t)1 << 30)

/* Height of a hanging robot's lowest point above the ground, m. */
#define HANG_CLEARANCE_M 0.3
/* A wheel whose lowest point is this close to the robot's lowest point is on the ground. */
#define WHEEL_HEIGHT_M 0.02

/* The output folder and its subfolders. Subfolders for copies are only made if they are needed. */
static const char *const import_folder[] = {"",        "/robots", "/rigs",
                                            "/meshes", "/drives", "/protocols"};
enum { IMPORT_FOLDERS = ARRAY_COUNT(import_folder), IMPORT_OWN_FOLDERS = 4 };

/* A copy of a user's own file. The written files refer to it as "../drives/NAME" or
 * "../protocols/NAME". */
struct import_copy {
    const char *from, *name;
};

/* A running import. */
struct importer {
    const struct import_request *request;
    struct import_result *result;
    struct arena *arena;
    struct error *error;
    struct import_model model;
    struct import_robot robot;
    struct import_plan plan;
    struct import_boards boards;
    struct import_copy *copy;
    size_t ncopy;
    double supply_v;           /* supply voltage of the drives */
    double reach;              /* largest angle that its boards report, rad */
    bool made[IMPORT_FOLDERS]; /* folders that this import has made */
};

/* ---- reading ---- */

/* Reads a robot file; the name of its root element decides between URDF and MJCF. */
static enum error_code import_read_model(const struct xml_file *file,
                                         const struct import_packages *packages,
                                         struct arena *arena, struct import_model *model,
                                         struct import_notes *notes, struct error *error)
{
    if (xml_is(file->root, "sdf") || xml_is(file->root, "COLLADA")) {
        return import_error(error, file->name, xml_line(file->root),
                            "found <%.40s>, expected <robot> of a URDF or <mujoco>; `gz sdf` and "
                            "sdformat tools convert SDF",
                            (const char *)file->root->name);
    }
    return xml_is(file->root, "mujoco") ? mjcf_read(file, packages, arena, model, notes, error)
                                        : urdf_read(file, arena, model, notes, error);
}

/* Makes a robot from the model: merges links, finishes and checks it, and gives it drives. */
static enum error_code import_make_robot(struct import_model *model,
                                         const struct import_options *options, struct arena *arena,
                                         struct import_notes *notes, struct import_robot *robot,
                                         double *supply_v, struct error *error)
{
    enum error_code code =
        options->drive_slides ? import_add_pinions(model, arena, notes, error) : ERROR_NONE;

    if (code || (code = import_simplify_tree(model, options, arena, notes, robot, error))) {
        return code;
    }
    if (robot_finish(robot->robot, error)) {
        return error_prefix(error, "%.200s", model->file);
    }
    code = import_pick_drives(options, arena, robot, error);
    return code ? code : import_assume_drives(robot, arena, notes, supply_v, error);
}

enum error_code import_model_text(const char *name, const char *text, size_t size,
                                  const struct import_options *options, struct arena *arena,
                                  struct import_model *model, struct import_notes *notes,
                                  struct import_robot *robot, double *supply_v, struct error *error)
{
    struct xml_file file;
    enum error_code code;

    notes->arena = arena;
    code = xml_text_open(&file, name, text, size, error);
    if (code) {
        return code;
    }
    code = import_read_model(&file, NULL, arena, model, notes, error);
    xml_file_close(&file);
    return code ? code : import_make_robot(model, options, arena, notes, robot, supply_v, error);
}

/* Reads the robot file, and the SRDF if one is given. */
static enum error_code import_read_files(struct importer *m)
{
    struct xml_file file;
    enum error_code code = xml_file_open(&file, m->request->file, m->arena, m->error);

    if (code) {
        return code;
    }
    code = import_read_model(&file, &m->request->packages, m->arena, &m->model, &m->result->notes,
                             m->error);
    xml_file_close(&file);
    if (code || !m->request->srdf) {
        return code;
    }
    code = xml_file_open(&file, m->request->srdf, m->arena, m->error);
    if (code) {
        return code;
    }
    code = srdf_read(&file, m->arena, &m->model, &m->result->notes, m->error);
    xml_file_close(&file);
    return code;
}

/* ---- folders ---- */

/* Writes the path FOLDER/before NAME after. Returns an error if it is too long. 128 bytes stay free
 * for the names of meshes. */
static enum error_code path_make(const struct importer *m, const char *before, const char *name,
                                 const char *after, char path[PATH_MAX])
{
    int used = snprintf(path, PATH_MAX, "%s/%s%s%s", m->request->folder, before, name, after);

    return used < PATH_MAX - 128
               ? ERROR_NONE
               : error_set(m->error, ERROR_INPUT, "%.200s: the folder's name is too long",
                           m->request->folder);
}

/* Makes the names of the files to write. */
static enum error_code import_name_files(struct importer *m)
{
    struct import_result *result = m->result;
    const char *name = m->robot.robot->name;
    enum error_code code;

    if ((code = path_make(m, "robots/", name, ".yaml", result->robot)) ||
        (code = path_make(m, "rigs/", name, ".yaml", result->rig)) ||
        (code = path_make(m, "rigs/", name, "-standing.yaml", result->standing))) {
        return code;
    }
    return path_make(m, "", name, "-import.txt", result->report);
}

/* Refuses a file that already exists. */
static enum error_code import_check_new(const struct importer *m, const char *path)
{
    struct stat status;

    return lstat(path, &status) ? ERROR_NONE
                                : error_set(m->error, ERROR_INPUT,
                                            "%.200s: found it there already, perhaps with changes "
                                            "of yours, expected no such file: give --force to "
                                            "write over what an import made, or another --output",
                                            path);
}

/* Lists the user's own files to copy: the protocol and the drives. */
static enum error_code import_list_copies(struct importer *m)
{
    const struct import_robot *robot = &m->robot;

    m->copy = arena_alloc(m->arena, robot->robot->njoint + 1, sizeof *m->copy);
    if (!m->copy) {
        return error_set(m->error, ERROR_MEMORY, "no memory for the names of files");
    }
    if (m->boards.copy) {
        m->copy[m->ncopy++] = (struct import_copy){m->boards.copy, m->boards.name};
    }
    for (size_t j = 0; j < robot->robot->njoint; j++) {
        if (robot->drive_copy[j]) {
            m->copy[m->ncopy++] = (struct import_copy){robot->drive_copy[j], robot->drive_file[j]};
        }
    }
    return ERROR_NONE;
}

/* Makes the path of a copy, even if its folder does not exist yet. *own receives whether the user's
 * file is already at this path. */
static enum error_code import_name_copy(const struct importer *m, const struct import_copy *copy,
                                        char path[PATH_MAX], bool *own)
{
    enum error_code code = path_make(m, copy->name + strlen("../"), "", "", path);
    struct stat from, to;

    *own = !code && !stat(copy->from, &from) && !stat(path, &to) && from.st_dev == to.st_dev &&
           from.st_ino == to.st_ino;
    return code;
}

/* Checks whether a file in the folder meshes has a name that an import makes: BODY-shellN.obj or
 * BODY-visualN.stl. */
static bool import_owns_mesh(const struct importer *m, const char *name)
{
    static const char *const kind[][2] = {{"-shell", ".obj"}, {"-visual", ".stl"}};
    const struct robot *robot = m->robot.robot;

    for (size_t i = 0; i < robot->nbody * ARRAY_COUNT(kind); i++) {
        const char *const *mark = kind[i % ARRAY_COUNT(kind)];
        char begin[64];
        int length = snprintf(begin, sizeof begin, "%.40s%s",
                              robot->body[i / ARRAY_COUNT(kind)].name, mark[0]);
        size_t digits =
            strncmp(name, begin, (size_t)length) ? 0 : strspn(name + length, "0123456789");

        if (digits > 0 && !strcmp(name + length + digits, mark[1])) {
            return true;
        }
    }
    return false;
}

/* Calls a function for each file in the folder meshes with a name that an import makes. Stops at
 * the first error. */
static enum error_code import_visit_meshes(const struct importer *m,
                                           enum error_code (*visit)(const struct importer *m,
                                                                    const char *path))
{
    char path[PATH_MAX];
    enum error_code code = path_make(m, "meshes", "", "", path);
    DIR *folder = code ? NULL : opendir(path);
    const struct dirent *entry;

    while (folder && !code && (entry = readdir(folder))) {
        if (import_owns_mesh(m, entry->d_name)) {
            code = path_make(m, "meshes/", entry->d_name, "", path);
            code = code ? code : visit(m, path);
        }
    }
    if (folder) {
        closedir(folder);
    }
    return code;
}

/* Refuses to overwrite files that may belong to the user: robot, rigs, drives and meshes. */
static enum error_code import_check_folder(const struct importer *m)
{
    const char *const made[] = {m->result->rig, m->result->standing, m->result->robot,
                                m->result->report};
    enum error_code code = ERROR_NONE;
    char path[PATH_MAX];
    bool own;

    if (m->request->force) {
        return ERROR_NONE;
    }
    for (size_t i = 0; i < ARRAY_COUNT(made) && !code; i++) {
        code = import_check_new(m, made[i]);
    }
    for (size_t i = 0; i < m->ncopy && !code; i++) {
        code = import_name_copy(m, &m->copy[i], path, &own);
        code = code || own ? code : import_check_new(m, path);
    }
    return code ? code : import_visit_meshes(m, import_check_new);
}

/* Removes a file of an import that failed. */
static enum error_code import_remove_file(const struct importer *m, const char *path)
{
    (void)m;
    unlink(path);
    return ERROR_NONE;
}

/* Removes the files of a failed import; none of them existed before. */
static void import_remove_files(const struct importer *m)
{
    const struct import_result *result = m->result;
    char path[PATH_MAX];
    bool own;

    unlink(result->robot);
    unlink(result->rig);
    unlink(result->standing); /* "" = none */
    for (size_t i = 0; i < m->ncopy; i++) {
        if (!import_name_copy(m, &m->copy[i], path, &own) && !own) {
            unlink(path);
        }
    }
    import_visit_meshes(m, import_remove_file);
}

/* Creates the output folder and its subfolders. made receives which ones are new. */
static enum error_code import_make_folders(struct importer *m)
{
    char path[PATH_MAX];
    enum error_code code = ERROR_NONE;

    folder_enclose(m->request->folder, strlen(m->request->folder));
    for (size_t i = 0; i < IMPORT_FOLDERS && !code; i++) {
        const char *name = import_folder[i];
        bool needed = i < IMPORT_OWN_FOLDERS;

        for (size_t k = 0; k < m->ncopy; k++) {
            needed = needed || !strncmp(m->copy[k].name + strlen(".."), name, strlen(name));
        }
        if (needed) {
            snprintf(path, sizeof path, "%s%s", m->request->folder, name);
            code = folder_make(path, &m->made[i], m->error);
        }
    }
    return code;
}

/* ---- the bench ---- */

/* Checks whether a name contains a word, delimited by other characters than letters or the name's
 * ends. */
static bool name_has_word(const char *name, const char *word)
{
    const char *at = strstr(name, word);

    while (at && ((at > name && isalpha((unsigned char)at[-1])) ||
                  isalpha((unsigned char)at[strlen(word)]))) {
        at = strstr(at + 1, word);
    }
    return at;
}

/* Returns the name of a pose that is probably for standing; NULL if there is none. */
static const char *pose_find_like(const struct robot *robot)
{
    static const char *const like[] = {"stand", "standing", "half_sitting", "home", "crouch"};

    for (size_t i = 0; i < ARRAY_COUNT(like); i++) {
        for (size_t p = 0; p < robot->npose; p++) {
            if (name_has_word(robot->pose[p].name, like[i])) {
                return robot->pose[p].name;
            }
        }
    }
    return NULL;
}

/* Checks whether the robot stands on wheels wherever they hang, on its base or on legs: two bodies
 * or more that turn for ever and have the lowest discs or balls. */
static bool robot_stands_on_wheels(const struct import_robot *from,
                                   const struct body_motion *bodies, double lowest)
{
    const struct robot *robot = from->robot;
    int first = 0;

    for (size_t c = 0; c < robot->ncapsule; c++) {
        const struct robot_capsule *capsule = &robot->capsule[c];
        const int body = capsule->body;

        if (body > 0 && from->source[body - 1]->type == IMPORT_CONTINUOUS &&
            (capsule->flat || capsule->length == 0.0) && capsule->radius > 0.0 &&
            import_capsule_bottom(capsule, bodies) < lowest + WHEEL_HEIGHT_M) {
            if (first && first != body) {
                return true;
            }
            first = body;
        }
    }
    return false;
}

/* Chooses the initial pose for hanging and, for a floating robot, for standing. Computes the height
 * of the base in both, m. */
static enum error_code import_choose_poses(struct importer *m, struct import_rig *rig)
{
    const struct robot *robot = rig->robot;
    struct body_motion *bodies = arena_alloc(m->arena, robot->nbody, sizeof *bodies);
    const char *like = m->request->pose ? m->request->pose : pose_find_like(robot);
    double lowest = 0.0;
    bool shaped;
    int pose;

    if (!bodies) {
        return error_set(m->error, ERROR_MEMORY, "no memory for the poses");
    }

    /* Use the requested pose, or a pose with a name like standing; pose 0 is rest */
    pose = like ? robot_find_pose(robot, like) : 0;
    if (pose < 0) {
        return error_set(m->error, ERROR_INPUT,
                         "--pose: found \"%.63s\", expected \"rest\" or a pose of the SRDF file",
                         like);
    }
    rig->pose = robot->pose[pose].name;

    /* A hanging robot is clear of the ground; a standing robot's lowest point is on the ground */
    shaped = import_find_lowest(robot, robot->pose[pose].joint, bodies, &lowest);
    rig->height_m = (shaped ? -lowest : 1.0) + HANG_CLEARANCE_M;
    rig->rolls = rig->rolls || (shaped && robot_stands_on_wheels(&m->robot, bodies, lowest));
    if (robot->floating && (like || rig->rolls) && shaped) {
        rig->standing = rig->pose;
        rig->standing_height_m = -lowest;
    }
    return ERROR_NONE;
}

/* Returns the largest angle either way that boards of a described protocol report for a model of
 * its drives, rad; INFINITY if there is no limit. */
static double protocol_find_reach(const struct described_protocol *protocol, unsigned model)
{
    double reach = 0.0;

    for (size_t i = 0; protocol && i < protocol->nframe; i++) {
        const struct described_frame *frame = &protocol->frame[i];

        for (size_t k = 0; k < frame->nfield && !frame->from_host; k++) {
            const struct described_field field =
                described_model_field(protocol, model, &frame->field[k]);

            if (field.meaning == DESCRIBED_MOTOR_POSITION ||
                field.meaning == DESCRIBED_LINK_POSITION) {
                const double low = field.offset + field.scale * (double)field.low;
                const double high = field.offset + field.scale * (double)field.high;

                reach = fmax(reach, field.real ? (double)INFINITY : fmin(fabs(low), fabs(high)));
            }
        }
    }
    return reach > 0.0 ? reach : (double)INFINITY;
}

/* Loads the written rig. *load receives the load of its fullest bus, 0 to 1; load may be NULL. */
static enum error_code import_check_rig(struct importer *m, const char *path, double *load)
{
    struct arena arena = {0};
    const struct rig *rig;
    double telemetry, commands;
    enum error_code code = arena_init(&arena, RIG_ARENA, m->error);

    code = code ? code : rig_load(path, &arena, &rig, m->error);
    for (size_t i = 0; !code && load && i < rig->nbus; i++) {
        rig_bus_load(rig, i, rig->servo.command_period_ns, &telemetry, &commands);
        *load = fmax(*load, (telemetry + commands) / (double)rig->bus[i].bitrate);
    }
    for (size_t i = 0; !code && load && i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        m->reach =
            fmin(m->reach, protocol_find_reach(rig->bus[board->bus].described, board->model));
    }
    arena_fini(&arena);
    return code;
}

/* Plans the buses and writes the hanging rig, then reads the rig back to find the load of its
 * buses. For a protocol without its own layout, it reduces the number of boards per bus until no
 * load is too high. */
static enum error_code import_write_hanging(struct importer *m, const struct import_rig *rig)
{
    struct import_plan *plan = &m->plan;
    double *load = &m->result->worst_load;
    const double given = m->request->bus_load, most = given > 0.0 ? 0.01 * given : IMPORT_BUS_LOAD;
    enum error_code code;

    do {
        *load = 0.0;
        if ((code = import_plan_buses(rig->robot, plan, m->error))) {
            return error_prefix(m->error, "%.200s", m->model.file);
        }
        if ((code = import_write_rig(rig, m->result->rig, m->error)) ||
            (code = import_check_rig(m, m->result->rig, load))) {
            return code;
        }
    } while (*load > most && plan->counted && --plan->bus_axes > 0);
    m->result->nbus = plan->nbus;
    return *load > most ? error_set(m->error, ERROR_UNSUPPORTED,
                                    "%.200s: a bus is loaded to %.1f %%, expected at most %.0f %%",
                                    m->result->rig, 100.0 * *load, 100.0 * most)
                        : ERROR_NONE;
}

/* Finds the gains, and writes the hanging rig. If the robot has a pose for standing, also writes
 * the standing rig. */
static enum error_code import_write_bench(struct importer *m)
{
    struct import_rig rig = {.robot = m->result->loaded,
                             .plan = &m->plan,
                             .supply_v = m->supply_v,
                             .rolls = m->robot.rolls,
                             .drive_file = m->robot.drive_file};
    struct import_gains *gains = arena_alloc(m->arena, rig.robot->njoint + 1, sizeof *gains);
    enum error_code code;

    if (!gains) {
        return error_set(m->error, ERROR_MEMORY, "no memory for the gains");
    }
    rig.gains = gains;
    /* Gains differ between hanging and standing; each file is read back immediately */
    if ((code = import_plan_begin(rig.robot, &m->boards, &m->plan, m->error)) ||
        (code = import_choose_poses(m, &rig)) ||
        (code = import_find_gains(rig.robot,
                                  rig.robot->pose[robot_find_pose(rig.robot, rig.pose)].joint,
                                  rig.standing != NULL, m->arena, gains, m->error)) ||
        (code = import_write_hanging(m, &rig))) {
        return code;
    }
    for (size_t j = 0; j < rig.robot->njoint; j++) {
        const struct import_joint *source = m->robot.source[j];
        const struct robot_joint *joint = &rig.robot->joint[j];

        if (joint->sea.present && fmax(-joint->lower, joint->upper) > m->reach) {
            import_note_add(&m->result->notes, IMPORT_DOUBTED, source->file, source->line,
                            "joint \"%.63s\" turns from %.4g to %.4g rad, and its board reports at "
                            "most %.4g either way: another --protocol, or a narrower range",
                            source->name, joint->lower, joint->upper, m->reach);
        }
        if (gains[j].short_of > 0.0) {
            import_note_add(
                &m->result->notes, IMPORT_DOUBTED, source->file, source->line,
                "joint \"%.63s\": its loop has %.2g of the stiffness that holds it against gravity "
                "with a margin of 1.5; inertia, rotor and the delay of the buses allow no more",
                source->name, gains[j].short_of);
        }
    }
    if (!rig.standing) {
        m->result->standing[0] = '\0';
        return ERROR_NONE;
    }
    code = import_write_standing(&rig, m->result->standing, m->error);
    return code ? code : import_check_rig(m, m->result->standing, NULL);
}

/* ---- the whole ---- */

/* Copies the user's own files to the output folder. */
static enum error_code import_write_copies(const struct importer *m)
{
    enum error_code code = ERROR_NONE;
    char path[PATH_MAX];
    bool own;

    for (size_t i = 0; i < m->ncopy && !code; i++) {
        code = import_name_copy(m, &m->copy[i], path, &own);
        code = code || own ? code : import_copy_file(m->copy[i].from, path, m->error);
    }
    return code;
}

/* Writes shapes, visuals, robot, rigs, and the report. */
static enum error_code import_write_files(struct importer *m)
{
    struct import_result *result = m->result;
    char meshes[PATH_MAX];
    const struct import_builder builder = {.from = &m->robot,
                                           .packages = &m->request->packages,
                                           .folder = meshes,
                                           .arena = m->arena,
                                           .notes = &result->notes,
                                           .written = &result->meshes,
                                           .error = m->error};
    enum error_code code;

    /* Write the robot with its shapes and visuals; later steps use the file as read back */
    if ((code = path_make(m, "meshes", "", "", meshes)) || (code = import_add_shapes(&builder)) ||
        (code = import_add_visuals(&builder)) || (code = import_write_copies(m)) ||
        (code = import_write_robot(&m->robot, result->robot, m->error)) ||
        (code = robot_load(result->robot, NULL, m->arena, &result->loaded, m->error))) {
        return code;
    }
    code = import_write_bench(m);
    if (code) {
        return code;
    }
    if (result->notes.overflow) {
        return error_set(m->error, ERROR_MEMORY,
                         "%.200s: found more than %d things to report, expected fewer",
                         m->model.file, IMPORT_NOTES_MAX);
    }
    return import_write_report(&result->notes, m->model.file, result->report, m->error);
}

enum error_code import_run(const struct import_request *request, struct arena *arena,
                           struct import_result *result, struct error *error)
{
    struct importer m = {.request = request,
                         .result = result,
                         .arena = arena,
                         .error = error,
                         .reach = (double)INFINITY,
                         .boards.address = request->address,
                         .boards.naddress = request->naddress};
    enum error_code code;

    *result = (struct import_result){.notes.arena = arena};
    error->code = ERROR_NONE;
    /* Read and check everything before writing the first file */
    if ((code = import_find_boards(request->protocol, arena, &m.boards, error)) ||
        (code = import_read_files(&m)) ||
        (code = import_make_robot(&m.model, &request->options, arena, &result->notes, &m.robot,
                                  &m.supply_v, error)) ||
        (code = import_check_shapes(&m.robot, &request->packages, error)) ||
        (code = import_list_copies(&m)) || (code = import_name_files(&m)) ||
        (code = import_check_folder(&m))) {
        return code;
    }
    code = import_make_folders(&m);
    if (!code && (code = import_write_files(&m)) && !request->force) {
        import_remove_files(&m);
    }
    if (code) {
        /* Remove the new folders that are empty, subfolders first */
        char path[PATH_MAX];

        for (size_t i = IMPORT_FOLDERS; i-- > 0;) {
            snprintf(path, sizeof path, "%s%s", m.request->folder, import_folder[i]);
            if (m.made[i]) {
                rmdir(path);
            }
        }
    }
    return code;
}
