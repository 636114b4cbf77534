/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Builds a struct rig from a raw rig: looks up names, and refuses contradictions with file, line
 * and column. This file builds the time settings, the host's configuration and the settings of the
 * run. Other files build the other sections.
 */
#include "rig/rig.h"

#include "base/array.h"
#include "base/hash.h"
#include "base/text.h"
#include "boards/protocol_list.h"
#include "model/drives/effects.h"
#include "rig/builder_private.h"
#include "base/config.h"

#include <stdio.h>
#include <unistd.h>

/* ---- helpers ---- */

enum error_code rig_no_memory(struct rig_builder *b)
{
    return error_set(b->error, ERROR_MEMORY, "%.200s: no memory left for this rig",
                     b->raw->mark.file);
}

enum error_code rig_find(struct rig_builder *b, const struct yaml_mark *mark, const char *what,
                         const char *name, struct yaml_names names, int *index)
{
    return yaml_find_name(names, what, name, mark, index, b->error);
}

enum error_code rig_check_name(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *what, const char *name)
{
    if (!text_is_name(name)) {
        return yaml_error(b->error, mark,
                          "found %s \"%.63s\", expected letters, digits and _ - . only", what,
                          name);
    }
    return ERROR_NONE;
}

enum error_code rig_place_file(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *path, enum error_code code)
{
    return code && access(path, R_OK)
               ? error_prefix(b->error, "%s:%d:%d", mark->file, mark->line, mark->column)
               : code;
}

bool rig_whole_ns(double seconds, int64_t *ns)
{
    *ns = (int64_t)llround(seconds * 1e9);
    return fabs(seconds * 1e9 - (double)*ns) < 1e-6;
}

enum error_code rig_check_keys(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *what, int kind, const struct rig_key *keys, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const bool given = yaml_has(mark, keys[i].key);

        if (given && !(keys[i].allowed & 1U << kind)) {
            return yaml_error(b->error, mark, "found key \"%s\" in %s, expected none there",
                              keys[i].key, what);
        }
        if (!given && (keys[i].required & 1U << kind)) {
            return yaml_error(b->error, mark, "found %s without key \"%s\", expected it", what,
                              keys[i].key);
        }
    }
    return ERROR_NONE;
}

/* ---- supply ---- */

/* Checks the supply bus behind the source. */
static enum error_code rig_check_supply(struct rig_builder *b)
{
    const struct yaml_mark *mark = &b->raw->mark, *chopper = yaml_place(mark, "brake_chopper");
    const struct supply_bus *bus = &b->rig->supply_bus;

    if (bus->capacitance_f > 0.0 && b->rig->supply_ohm == 0.0) {
        return yaml_error(b->error, mark,
                          "found supply_capacitance_f without supply_ohm, expected both: the bus "
                          "is charged through a resistance");
    }
    if (yaml_has(mark, "brake_chopper") && bus->capacitance_f == 0.0) {
        return yaml_error(b->error, chopper,
                          "found a brake chopper without supply_capacitance_f, expected both");
    }
    if (bus->returns && bus->capacitance_f == 0.0) {
        return yaml_error(b->error, mark,
                          "found supply_returns without supply_capacitance_f, expected both: "
                          "without a bus every source takes energy back");
    }
    if (yaml_has(mark, "brake_chopper") &&
        !(bus->on_v > bus->off_v && bus->off_v > b->rig->supply_v)) {
        return yaml_error(b->error, chopper,
                          "found on_v %g and off_v %g, expected on_v above off_v above supply_v, "
                          "%g",
                          bus->on_v, bus->off_v, b->rig->supply_v);
    }
    return ERROR_NONE;
}

/* ---- time ---- */

/* Checks that the substep resolves the oscillations of rotors on their cogging. */
static enum error_code rig_check_cogging(struct rig_builder *b)
{
    const double substep_s = 1e-9 * (double)b->rig->substep_ns;

    for (size_t j = 0; j < b->robot->njoint && b->rig->integrator == PLANT_IMPLICIT; j++) {
        const struct robot_joint *joint = &b->robot->joint[j];
        const double rate = joint->sea.present ? effects_cogging_rate(&joint->sea) : 0.0;

        if (rate * substep_s > EFFECTS_COGGING_SWING) {
            return yaml_error(b->error, yaml_place(&b->raw->mark, "substep_s"),
                              "joint %s: the rotor oscillates on its cogging at up to %.4g rad/s, "
                              "expected no more than %.4g rad/s for substeps of %g s; lower the "
                              "cogging, or set substep_s to at most %.3g",
                              joint->name, rate, EFFECTS_COGGING_SWING / substep_s, substep_s,
                              EFFECTS_COGGING_SWING / rate);
        }
    }
    return ERROR_NONE;
}

/* Builds the tick and the substep, and checks the supply and the cogging. */
static enum error_code rig_build_time(struct rig_builder *b)
{
    const struct raw_rig *raw = b->raw;
    struct rig *rig = b->rig;
    enum error_code code;

    if (!rig_whole_ns(raw->tick_s, &rig->tick_ns)) {
        return yaml_error(b->error, yaml_place(&raw->mark, "tick_s"),
                          "found a tick of %.15g s, expected a whole number of nanoseconds",
                          raw->tick_s);
    }
    rig->substep_ns = rig->tick_ns; /* default; the file may set another substep */
    if (raw->substep_s > 0.0 &&
        (!rig_whole_ns(raw->substep_s, &rig->substep_ns) || rig->tick_ns % rig->substep_ns != 0)) {
        return yaml_error(b->error, yaml_place(&raw->mark, "substep_s"),
                          "found a substep of %.15g s, expected one that divides the tick of %.15g "
                          "s exactly",
                          raw->substep_s, raw->tick_s);
    }
    rig->substeps = (size_t)(rig->tick_ns / rig->substep_ns);
    if ((code = rig_check_cogging(b))) {
        return code;
    }
    return rig_check_supply(b);
}

/* ---- the controller's side ---- */

/* Builds a driven joint for the host. The host decodes torque only from boards on the axis's own
 * bus. A torque board on another bus is therefore refused. */
static enum error_code rig_build_host_axis(struct rig_builder *b, const struct board_config *board,
                                           uint8_t index, struct host_axis *axis)
{
    const struct board_axis_config *from = &board->axis[index];
    const struct rig_torque *source = &b->torque[from->joint];
    const struct robot_joint *joint = &b->robot->joint[from->joint];

    *axis = (struct host_axis){
        .joint = joint->name,
        .bus = board->bus,
        .address = board->address,
        .model = board->model,
        .axis = index,
        .joint_ticks_per_rad = from->joint_ticks_per_rad,
        .motor_ticks_per_rad = from->motor_ticks_per_rad,
        .torque_address = source->board ? (int)source->board->address : -1,
        .torque_channel = source->board ? source->channel : -1,
        .torque_full_scale_nm = from->torque_full_scale_nm,
        .torque_period_ns = source->board ? source->board->board.period_ns : 0,
        .drive =
            {
                .valve = from->valve,
                .gear = from->gear,
                .spring_nm_rad = joint->sea.Ks,
                .winding_ohm = joint->sea.R,
                .winding_h = joint->sea.L,
                .current_limit_a = from->current_limit_a,
                .poles = b->raw->motors.rotor_poles,
                .torque_nm_a = joint->sea.Kt,
                .bemf_v_s_rad = from->bemf_v_s_rad,
            },
        .lower_rad = joint->lower,
        .upper_rad = joint->upper,
    };

    /* Refuse a torque board on another bus, because the host would not receive its torque */
    if (source->board && source->bus != board->bus) {
        return yaml_error(b->error, yaml_place(&source->board->mark, "joints"),
                          "found joint \"%s\", which is driven from bus \"%s\", expected joints of "
                          "this bus",
                          axis->joint, b->bus[board->bus].name);
    }
    return ERROR_NONE;
}

/* Builds the host's lists of axes and sensors. */
static enum error_code rig_build_host(struct rig_builder *b)
{
    const struct boards_config *boards = &b->rig->boards;
    struct host_axis *axis = arena_alloc(b->arena, boards->nboard * BOARD_AXES_MAX, sizeof *axis);
    struct host_ft *ft = arena_alloc(b->arena, boards->nboard, sizeof *ft);
    double *initial = arena_alloc(b->arena, boards->nboard * BOARD_AXES_MAX, sizeof *initial);
    struct rig *rig = b->rig;

    if (!axis || !ft || !initial) {
        return rig_no_memory(b);
    }

    /* Collect the driven axes with their initial angles, and the sensors, in the order of the
     * boards */
    for (size_t i = 0; i < boards->nboard; i++) {
        const struct board_config *board = &boards->board[i];

        for (uint8_t k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
            enum error_code code;

            if (board->axis[k].joint < 0) {
                continue;
            }
            code = rig_build_host_axis(b, board, k, &axis[rig->naxis]);
            if (code) {
                return code;
            }
            b->bus[board->bus].naxis++;
            initial[rig->naxis++] = rig->joint[board->axis[k].joint];
        }
        if (board->kind == BOARD_FT) {
            ft[rig->nft++] = (struct host_ft){b->robot->ft[board->ft].name, board->bus,
                                              board->address, board->period_ns};
        }
        if (board->kind == BOARD_INERTIAL) {
            rig->imu = (struct host_imu){true, board->bus, board->address, board->period_ns};
        }
    }
    rig->axis = axis;
    rig->ft = ft;
    rig->initial_rad = initial;
    return ERROR_NONE;
}

/* Overrides the gains of some joints. `changed`: for each axis, the place of an earlier override;
 * it detects a joint that is listed twice. */
static enum error_code gains_override_joints(struct rig_builder *b, const struct raw_gains *raw,
                                             struct servo_gains *gains,
                                             const struct yaml_name **changed)
{
    const struct rig *rig = b->rig;
    const struct yaml_names axes = YAML_NAMES(rig->axis, rig->naxis, joint);

    for (size_t n = 0; n < raw->njoint; n++) {
        const struct yaml_name *name = &raw->joint[n];
        struct raw_gains merged;
        int axis;
        enum error_code code = rig_find(b, &name->mark, "driven joint", name->name, axes, &axis);

        if (code) {
            return code;
        }
        if (changed[axis]) {
            return yaml_error(b->error, &name->mark,
                              "found joint \"%s\" again, expected it once (line %d)", name->name,
                              changed[axis]->mark.line);
        }
        changed[axis] = name;
        merged.gains = gains[axis];
        yaml_override(&gains_schema, &raw->mark, raw, &merged);
        gains[axis] = merged.gains;
    }
    return ERROR_NONE;
}

enum error_code rig_override_gains(struct rig_builder *b, const struct raw_gains *other,
                                   size_t nother, struct servo_gains *gains)
{
    const struct yaml_name **changed = arena_alloc(b->arena, b->rig->naxis, sizeof *changed);
    enum error_code code = ERROR_NONE;

    if (!changed) {
        return rig_no_memory(b);
    }
    for (size_t k = 0; k < nother && !code; k++) {
        code = gains_override_joints(b, &other[k], gains, changed);
    }
    return code;
}

/* Builds the command period and the gains of each axis: the common gains, then the exceptions in
 * "others". */
static enum error_code rig_build_servo(struct rig_builder *b)
{
    const struct raw_servo *raw = &b->raw->servo;
    struct rig *rig = b->rig;
    struct servo_gains *gains = arena_alloc(b->arena, rig->naxis, sizeof *gains);

    rig->servo.command_period_ns = rig->tick_ns;
    if (raw->command_period_s > 0 &&
        (!rig_whole_ns(raw->command_period_s, &rig->servo.command_period_ns) ||
         rig->servo.command_period_ns % rig->tick_ns != 0)) {
        return yaml_error(b->error, yaml_place(&raw->mark, "command_period_s"),
                          "found a command period of %.15g s, expected a multiple of the tick of "
                          "%.15g s",
                          raw->command_period_s, b->raw->tick_s);
    }
    if (!gains) {
        return rig_no_memory(b);
    }
    for (size_t i = 0; i < rig->naxis; i++) {
        gains[i] = raw->gains;
    }
    rig->servo.gains = gains;
    return rig_override_gains(b, raw->other, raw->nother, gains);
}

/* ---- the run ---- */

/* Returns whether boards send or receive an identifier. Either a protocol reserves it in every rig,
 * or a board on a bus of this rig uses it. */
static bool rig_find_id_owner(const struct rig *rig, uint32_t id, char *text, size_t size)
{
    const struct protocol *protocol;

    for (size_t i = 0; (protocol = protocol_at(i)); i++) {
        if (protocol->claims_id && protocol->claims_id(NULL, id, text, size)) {
            return true;
        }
    }
    for (size_t i = 0; i < rig->nbus; i++) {
        protocol = rig->bus[i].protocol;
        if (protocol->claims_id && protocol->claims_id(&rig->boards.bus[i], id, text, size)) {
            return true;
        }
    }
    return false;
}

/* Refuses an identifier of a lockstep frame that a board sends or receives. */
static enum error_code rig_check_lockstep_id(struct rig_builder *b, const char *key, uint32_t id)
{
    char owner[160];

    return rig_find_id_owner(b->rig, id, owner, sizeof owner)
               ? yaml_error(b->error, yaml_place(&b->raw->lockstep.mark, key),
                            "found id 0x%03x, which belongs to %s", (unsigned)id, owner)
               : ERROR_NONE;
}

/* Builds the lockstep clock: its bus, its identifiers and its timeout. */
static enum error_code rig_build_lockstep(struct rig_builder *b)
{
    const struct raw_lockstep *raw = &b->raw->lockstep;
    struct loop_lockstep *lockstep = &b->rig->lockstep;
    enum error_code code = rig_check_lockstep_id(b, "step_id", raw->lockstep.step_id);

    *lockstep = raw->lockstep;
    code = code ? code : rig_check_lockstep_id(b, "done_id", lockstep->done_id);
    if (!code && raw->bus) {
        code = rig_find(b, yaml_place(&raw->mark, "bus"), "bus", raw->bus,
                        RIG_NAMES(b->rig->bus, b->rig->nbus), &lockstep->bus);
    }
    if (!code && lockstep->step_id == lockstep->done_id) {
        code = yaml_error(b->error, yaml_place(&raw->mark, "done_id"),
                          "found the id of the STEP frame, expected another for DONE");
    }
    return code;
}

/* Builds all parts of a rig in the order of their dependencies. */
static enum error_code rig_build(struct rig_builder *b)
{
    static enum error_code (*const step[])(struct rig_builder *) = {
        rig_build_robot,    rig_build_time,   rig_build_pose,      rig_build_bodies,
        rig_build_scene,    rig_build_boards, rig_build_faults,    rig_build_sensors,
        rig_check_drives,   rig_build_host,   rig_build_task_body, rig_build_servo,
        rig_build_lockstep,
    };
    enum error_code code = rig_check_name(b, &b->raw->mark, "rig", b->rig->name);

    for (size_t i = 0; i < ARRAY_COUNT(step) && !code; i++) {
        code = step[i](b);
    }
    b->rig->record.mark = *yaml_place(&b->raw->mark, "record.directory");
    b->rig->page.mark = *yaml_place(&b->raw->mark, "page.listen");
    return code;
}

/* Builds a rig from a raw rig. */
static enum error_code rig_make(const struct raw_rig *raw, struct arena *arena,
                                const struct rig **rig, struct error *error)
{
    struct rig_builder b = {.raw = raw, .arena = arena, .error = error};
    enum error_code code;

    b.rig = arena_alloc(arena, 1, sizeof *b.rig);
    if (!b.rig) {
        return rig_no_memory(&b);
    }
    *b.rig = raw->rig;
    b.rig->file = raw->mark.file;
    code = rig_build(&b);
    if (code) {
        return code;
    }

    /* Hash the rig's sources: the rig's files, the robot's files and the meshes */
    uint64_t hash = hash_bytes(b.rig->hash, &b.robot->source_hash, sizeof b.robot->source_hash);

    for (size_t s = 0; s < b.rig->contact.nsurface; s++) {
        const struct mesh *mesh = b.rig->contact.surface[s].mesh;

        if (mesh) {
            hash = hash_bytes(hash, mesh->vertex, mesh->nvertex * sizeof *mesh->vertex);
            hash = hash_bytes(hash, mesh->face, mesh->nface * sizeof *mesh->face);
        }
    }
    b.rig->hash = hash;
    *rig = b.rig;
    return ERROR_NONE;
}

/* Appends the name of the rig's file to an error in another file that the rig uses. The user may
 * not know the other file. */
static enum error_code rig_name_file(const char *path, enum error_code code, struct error *error)
{
    size_t used = error ? strlen(error->text) : 0;

    if (code == ERROR_INPUT && error && !strstr(error->text, path)) {
        snprintf(error->text + used, sizeof error->text - used, " (read for %.200s)", path);
    }
    return code;
}

enum error_code rig_load(const char *path, struct arena *arena, const struct rig **rig,
                         struct error *error)
{
    struct raw_rig raw;
    char found[PATH_MAX];
    enum error_code code = config_locate(CONFIG_RIG, path, found, error);

    if (code) {
        return code;
    }
    code = yaml_read_file(found, &rig_file_schema, arena, &raw, error);
    code = code ? code : rig_make(&raw, arena, rig, error);
    return rig_name_file(found, code, error);
}

enum error_code rig_load_text(const char *name, const char *text, size_t size, struct arena *arena,
                              const struct rig **rig, struct error *error)
{
    struct yaml_schema schema = rig_file_schema;
    struct raw_rig raw;
    enum error_code code;

    schema.quoted_values = true;
    code = yaml_read_text(name, text, size, &schema, arena, &raw, error);

    if (!code) {
        raw.rig.hash -= hash_bytes(HASH_START, text, size);
        code = rig_make(&raw, arena, rig, error);
    }
    return rig_name_file(name, code, error);
}

const char *rig_contact_name(const struct rig *rig, size_t motion)
{
    size_t body = (size_t)rig->contact_body[motion], nbody = rig->robot->nbody;

    return body < nbody ? rig->robot->body[body].name : rig->free[body - nbody].name;
}

int rig_find_bus(const struct rig *rig, const char *name)
{
    return TEXT_FIND(rig->bus, rig->nbus, name, name);
}
