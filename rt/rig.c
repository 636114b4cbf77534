/* SPDX-License-Identifier: Apache-2.0 */
/*
 * From the rig file as it is written to the pieces that run: names are looked up, what contradicts
 * itself is refused with the place where it stands.
 */
#include "rt/rig.h"

#include "base/text.h"
#include "boards/icub_protocol.h"
#include "rt/rig_build.h"
#include "rt/rig_path.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { MAX_NAMES = 512 /* offered to text_nearest */ };

/* ---- helpers ---- */

enum error_code rig_no_memory(struct rig_builder *b)
{
    return error_set(b->error, ERROR_MEMORY, "%.200s: no memory left for this rig",
                     b->raw->mark.file);
}

static const char *name_at(const struct rig_names *names, size_t i)
{
    const unsigned char *entry = (const unsigned char *)names->array + i * names->stride;

    return *(const char *const *)(const void *)(entry + names->offset);
}

enum error_code rig_find(struct rig_builder *b, const struct yaml_mark *mark, const char *what,
                         const char *name, struct rig_names names, int *index)
{
    const char *words[MAX_NAMES], *nearest;
    size_t count = 0;

    for (size_t i = 0; i < names.count; i++) {
        if (!strcmp(name_at(&names, i), name)) {
            *index = (int)i;
            return ERROR_NONE;
        }
        if (count < MAX_NAMES) {
            words[count++] = name_at(&names, i);
        }
    }
    nearest = text_nearest(name, words, count);
    if (nearest) {
        return yaml_error(b->error, mark, "found unknown %s \"%.60s\", expected \"%.60s\"", what,
                          name, nearest);
    }
    return yaml_error(b->error, mark, "found unknown %s \"%.60s\", expected one of %zu that exist",
                      what, name, count);
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

bool rig_whole_ns(double seconds, int64_t *ns)
{
    *ns = (int64_t)llround(seconds * 1e9);
    return fabs(seconds * 1e9 - (double)*ns) < 1e-6;
}

enum error_code rig_check_keys(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *what, int kind, const struct rig_key *keys, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (keys[i].given && !(keys[i].allowed & 1U << kind)) {
            return yaml_error(b->error, mark, "found key \"%s\" in %s, expected none there",
                              keys[i].key, what);
        }
        if (!keys[i].given && (keys[i].required & 1U << kind)) {
            return yaml_error(b->error, mark, "found %s without key \"%s\", expected it", what,
                              keys[i].key);
        }
    }
    return ERROR_NONE;
}

/* ---- robot, time, pose ---- */

static enum error_code load_robot(struct rig_builder *b)
{
    const struct raw_robot *raw = &b->raw->robot;
    const char *path;
    enum error_code code = yaml_resolve_path(&raw->file_mark, raw->file, b->arena, &path, b->error);

    if (!code) {
        code = robot_load(path, raw->variant, b->arena, &b->robot, b->error);
    }
    if (code) {
        return code;
    }
    b->rig->robot = b->robot;
    b->rig->variant = raw->variant;
    b->torque = arena_alloc(b->arena, b->robot->njoint, sizeof *b->torque);
    b->driver = arena_alloc(b->arena, b->robot->njoint, sizeof *b->driver);
    b->ft = arena_alloc(b->arena, b->robot->nft, sizeof *b->ft);
    return b->torque && b->driver && b->ft ? ERROR_NONE : rig_no_memory(b);
}

static enum error_code build_time(struct rig_builder *b)
{
    const struct raw_rig *raw = b->raw;
    struct rig *rig = b->rig;

    if (!rig_whole_ns(raw->tick_s, &rig->tick_ns)) {
        return yaml_error(b->error, &raw->tick_mark,
                          "found a tick of %.15g s, expected a whole number of nanoseconds",
                          raw->tick_s);
    }
    if (!rig_whole_ns(raw->substep_s, &rig->substep_ns) || rig->tick_ns % rig->substep_ns != 0) {
        return yaml_error(b->error, &raw->substep_mark,
                          "found a substep of %.15g s, expected one that divides the tick of %.15g "
                          "s exactly",
                          raw->substep_s, raw->tick_s);
    }
    rig->substeps = (size_t)(rig->tick_ns / rig->substep_ns);
    rig->clock = (enum rig_clock)raw->clock;
    rig->integrator = (enum plant_integrator)raw->integrator;
    rig->tolerance = raw->tolerance;
    rig->dynamics = (enum rig_dynamics)raw->dynamics;
    rig->supply_v = raw->supply_v;
    return ERROR_NONE;
}

/* The joints of the pose with those that the rig puts elsewhere. */
static enum error_code build_joints(struct rig_builder *b, const struct robot_pose *pose)
{
    const struct raw_initial *raw = &b->raw->initial;
    double *joint = arena_alloc(b->arena, b->robot->njoint, sizeof *joint);

    if (!joint) {
        return rig_no_memory(b);
    }
    memcpy(joint, pose->joint, b->robot->njoint * sizeof *joint);
    for (size_t i = 0; i < raw->njoint; i++) {
        const struct yaml_real_entry *entry = &raw->joint[i];
        const struct robot_joint *limits;
        int index;
        enum error_code code = rig_find(b, &entry->mark, "joint", entry->name,
                                        RIG_NAMES(b->robot->joint, b->robot->njoint), &index);

        if (code) {
            return code;
        }
        limits = &b->robot->joint[index];
        if (limits->type != JOINT_REVOLUTE || entry->value < limits->lower ||
            entry->value > limits->upper) {
            return yaml_error(b->error, &entry->mark,
                              "found joint \"%s\" at %g rad, expected a revolute joint within its "
                              "limits, %g to %g",
                              entry->name, entry->value, limits->lower, limits->upper);
        }
        joint[index] = entry->value;
    }
    b->rig->joint = joint;
    return ERROR_NONE;
}

void rig_quaternion_of_rpy(const double rpy[3], double q[4])
{
    double cr = cos(rpy[0] / 2), sr = sin(rpy[0] / 2), cp = cos(rpy[1] / 2), sp = sin(rpy[1] / 2);
    double cy = cos(rpy[2] / 2), sy = sin(rpy[2] / 2);

    q[0] = cy * cp * cr + sy * sp * sr;
    q[1] = cy * cp * sr - sy * sp * cr;
    q[2] = cy * sp * cr + sy * cp * sr;
    q[3] = sy * cp * cr - cy * sp * sr;
}

static enum error_code build_pose(struct rig_builder *b)
{
    const struct raw_initial *raw = &b->raw->initial;
    const struct robot_pose *pose;
    struct rig *rig = b->rig;
    enum error_code code;
    int index;

    code = rig_find(b, &raw->pose_mark, "pose", raw->pose,
                    RIG_NAMES(b->robot->pose, b->robot->npose), &index);
    if (code) {
        return code;
    }
    if (raw->position_given && raw->height_given) {
        return yaml_error(b->error, &raw->mark,
                          "found base_xyz_m and base_height_m, expected one of them");
    }
    if (!b->robot->floating && (raw->position_given || raw->height_given || raw->rpy_given)) {
        return yaml_error(b->error, &raw->mark,
                          "found a place of the base, expected none for a robot with a fixed base");
    }
    pose = &b->robot->pose[index];
    rig->pose = pose->name;
    rig->hold = (enum rig_hold)raw->hold;
    memcpy(rig->base_position, raw->position_given ? raw->base_xyz_m : pose->base_position,
           sizeof rig->base_position);
    memcpy(rig->base_quaternion, pose->base_quaternion, sizeof rig->base_quaternion);
    if (raw->height_given) {
        rig->base_position[2] = raw->base_height_m;
    }
    if (raw->rpy_given) {
        rig_quaternion_of_rpy(raw->base_rpy_rad, rig->base_quaternion);
    }
    return build_joints(b, pose);
}

/* ---- the controller's side ---- */

/* One driven joint as the controller finds it. The host decodes torque from boards of the axis's own
 * bus, so a torque board elsewhere would never be heard. */
static enum error_code build_host_axis(struct rig_builder *b, const struct board_config *board,
                                       uint8_t index, struct host_axis *axis)
{
    const struct board_axis_config *from = &board->axis[index];
    const struct rig_torque *source = &b->torque[from->joint];

    *axis = (struct host_axis){
        .joint = b->robot->joint[from->joint].name,
        .bus = board->bus,
        .address = board->address,
        .axis = index,
        .joint_ticks_per_rad = from->joint_ticks_per_rad,
        .motor_ticks_per_rad = from->motor_ticks_per_rad,
        .torque_address = source->board ? (int)source->board->address : -1,
        .torque_channel = source->board ? source->channel : -1,
        .torque_full_scale_nm = from->torque_full_scale_nm,
        .lower_rad = from->lower_rad,
        .upper_rad = from->upper_rad,
    };
    if (source->board && source->bus != board->bus) {
        return yaml_error(b->error, &source->board->joint_mark,
                          "found joint \"%s\", which is driven from bus \"%s\", expected joints of "
                          "this bus",
                          axis->joint, b->raw->bus[board->bus].name);
    }
    return ERROR_NONE;
}

static enum error_code build_host(struct rig_builder *b)
{
    const struct boards_config *boards = &b->rig->boards;
    struct host_axis *axis = arena_alloc(b->arena, boards->nboard * BOARD_AXES, sizeof *axis);
    struct host_ft *ft = arena_alloc(b->arena, boards->nboard, sizeof *ft);
    double *initial = arena_alloc(b->arena, boards->nboard * BOARD_AXES, sizeof *initial);
    struct rig *rig = b->rig;

    if (!axis || !ft || !initial) {
        return rig_no_memory(b);
    }
    for (size_t i = 0; i < boards->nboard; i++) {
        const struct board_config *board = &boards->board[i];

        for (uint8_t k = 0; k < BOARD_AXES && board->kind == BOARD_MOTOR; k++) {
            enum error_code code;

            if (board->axis[k].joint < 0) {
                continue;
            }
            code = build_host_axis(b, board, k, &axis[rig->naxis]);
            if (code) {
                return code;
            }
            b->bus[board->bus].naxis++;
            initial[rig->naxis++] = rig->joint[board->axis[k].joint];
        }
        if (board->kind == BOARD_FT) {
            ft[rig->nft++] =
                (struct host_ft){b->robot->ft[board->ft].name, board->bus, board->address};
        }
    }
    rig->axis = axis;
    rig->ft = ft;
    rig->initial_rad = initial;
    return ERROR_NONE;
}

static enum error_code build_tasks(struct rig_builder *b)
{
    const struct raw_servo *servo = &b->raw->tasks.servo;
    const struct raw_squat *squat = &b->raw->tasks.squat;
    struct rig *rig = b->rig;

    rig->squat = (struct squat_config){
        .thigh_m = squat->thigh_m,
        .shank_m = squat->shank_m,
        .depth_m = squat->depth_m,
        .period_s = squat->period_s,
        .cycles = (int)squat->cycles,
    };
    rig->servo = (struct servo_config){
        .kp_v_per_rad = servo->kp_v_per_rad,
        .ki_v_per_rad_s = servo->ki_v_per_rad_s,
        .kw_v_s_per_rad = servo->kw_v_s_per_rad,
        .trim_per_s = servo->trim_per_s,
        .command_period_ns = rig->tick_ns,
    };
    if (servo->command_period_s > 0 &&
        (!rig_whole_ns(servo->command_period_s, &rig->servo.command_period_ns) ||
         rig->servo.command_period_ns % rig->tick_ns != 0)) {
        return yaml_error(b->error, &servo->command_period_mark,
                          "found a command period of %.15g s, expected a multiple of the tick of "
                          "%.15g s",
                          servo->command_period_s, b->raw->tick_s);
    }
    return ERROR_NONE;
}

/* ---- how it runs ---- */

/* The lockstep frames must not look like a frame that a board sends or listens to. */
static enum error_code check_lockstep_id(struct rig_builder *b, const struct yaml_mark *mark,
                                         int64_t id)
{
    int64_t cls = id >> 8;

    if (cls == ICUB_POLLING_MOTOR || cls == ICUB_PERIODIC_MOTOR || cls == ICUB_POLLING_ANALOG ||
        cls == ICUB_PERIODIC_ANALOG || cls == ICUB_MANAGEMENT) {
        return yaml_error(b->error, mark,
                          "found id 0x%03x, which belongs to the boards, expected one from 0x400 "
                          "to 0x6ff",
                          (unsigned)id);
    }
    return ERROR_NONE;
}

static enum error_code build_lockstep(struct rig_builder *b)
{
    const struct raw_lockstep *raw = &b->raw->lockstep;
    struct rig_lockstep *lockstep = &b->rig->lockstep;
    enum error_code code = check_lockstep_id(b, &raw->step_mark, raw->step_id);

    code = code ? code : check_lockstep_id(b, &raw->done_mark, raw->done_id);
    if (!code && raw->bus) {
        code = rig_find(b, &raw->bus_mark, "bus", raw->bus, RIG_NAMES(b->raw->bus, b->raw->nbus),
                        &lockstep->bus);
    }
    if (!code && raw->step_id == raw->done_id) {
        code = yaml_error(b->error, &raw->done_mark,
                          "found the id of the STEP frame, expected another for DONE");
    }
    lockstep->step_id = (uint32_t)raw->step_id;
    lockstep->done_id = (uint32_t)raw->done_id;
    lockstep->partner_timeout_ns = llround(raw->partner_timeout_s * 1e9);
    return code;
}

static void build_realtime(struct rig_builder *b)
{
    const struct raw_realtime *raw = &b->raw->realtime;

    b->rig->realtime = (struct rig_realtime){
        .priority = (int)raw->priority,
        .cpu = (int)raw->cpu,
        .lock_memory = raw->lock_memory,
        .overrun = (enum rig_overrun)raw->overrun,
        .stop_after = raw->stop_after,
    };
    b->rig->record.directory = b->raw->record.directory;
}

static enum error_code build(struct rig_builder *b)
{
    static enum error_code (*const step[])(struct rig_builder *) = {
        load_robot,       build_time,       build_pose, rig_build_bodies, rig_build_scene,
        rig_build_boards, rig_check_drives, build_host, build_tasks,      build_lockstep,
    };
    enum error_code code = rig_check_name(b, &b->raw->mark, "rig", b->raw->name);

    for (size_t i = 0; i < sizeof step / sizeof step[0] && !code; i++) {
        code = step[i](b);
    }
    build_realtime(b);
    return code;
}

enum error_code rig_load(const char *path, struct arena *arena, const struct rig **rig,
                         struct error *error)
{
    struct raw_rig raw;
    struct rig_builder b = {.raw = &raw, .arena = arena, .error = error};
    char found[PATH_MAX];
    enum error_code code = rig_locate(path, found, error);

    if (!code) {
        code = rig_yaml_read(found, arena, &raw, error);
    }
    if (code) {
        return code;
    }
    b.rig = arena_alloc(arena, 1, sizeof *b.rig);
    if (!b.rig) {
        return rig_no_memory(&b);
    }
    b.rig->file = raw.mark.file;
    b.rig->name = raw.name;
    code = build(&b);
    if (!code) {
        *rig = b.rig;
    }
    return code;
}

const char *rig_contact_name(const struct rig *rig, size_t motion)
{
    size_t body = (size_t)rig->contact_body[motion], nbody = rig->robot->nbody;

    return body < nbody ? rig->robot->body[body].name : rig->free[body - nbody].name;
}

int rig_find_bus(const struct rig *rig, const char *name)
{
    for (size_t i = 0; i < rig->nbus; i++) {
        if (!strcmp(rig->bus[i].name, name)) {
            return (int)i;
        }
    }
    return -1;
}

/* ---- load ---- */

/* Bits of a classic frame with an 11-bit identifier and n bytes: worst-case stuffing and the three
 * bits of interframe space (Davis, Burns, Bril, Lukkien 2007, eq. (1)). */
static double worst_case_bits(int n)
{
    return 8 * n + 47 + (34 + 8 * n - 1) / 4;
}

void rig_bus_load(const struct rig *rig, size_t bus, int64_t command_period_ns,
                  double *telemetry_bit_s, double *command_bit_s)
{
    /* POSITION, PID_VAL, CURRENT and VELOCITY in the board's four slots of 1 ms; STATUS every 5 s */
    const double motor_bit_s = 4.0 * worst_case_bits(8) / 0.004 + worst_case_bits(8) / 5.0;

    *telemetry_bit_s = 0.0;
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        if (board->bus == (int)bus) {
            *telemetry_bit_s += board->kind == BOARD_MOTOR
                                    ? motor_bit_s
                                    : 2.0 * worst_case_bits(6) / ((double)board->period_ns * 1e-9);
        }
    }
    *command_bit_s =
        (double)rig->bus[bus].naxis * worst_case_bits(3) / ((double)command_period_ns * 1e-9);
}
