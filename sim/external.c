/* SPDX-License-Identifier: Apache-2.0 */
/* Reads frames of external boards and moves the rotors of their joints. */
#include "sim/external.h"

#include "base/portable_math.h"
#include "model/drives/actuator.h"
#include "tasks/host.h"

#include <math.h>

/* An axis or a sensor of an external board. */
struct external_axis {
    size_t board;               /* index in the rig's boards */
    size_t index;               /* index among the host's axes or sensors */
    bool sensor;                /* force/torque sensor: only monitored, no rotor follows it */
    bool torque;                /* true: the rotor follows the torque; false: the angle */
    int joint;                  /* index of the robot's joint */
    double lower, upper, speed; /* limits of the rotor, rad, rad/s */
    double stall_nm;
    const struct robot_sea *sea;
    double settled;     /* part of a step response that the spring reaches in one tick */
    bool aimed;         /* a target has been received */
    double target;      /* rad, or N m */
    int64_t told_ns;    /* time of the last target */
    int64_t between_ns; /* between the last two targets; from a tick to the timeout */
    int64_t heard_ns;   /* -1 = never */
    int64_t timeout_ns;
};

struct external {
    struct host *host;
    struct boards *boards;
    struct plant *plant;
    int64_t tick_ns;
    size_t count;
    struct external_axis *axis;
    size_t *by_bus; /* first axis of each bus; nbus + 1 entries */
};

/* ---- creation ---- */

/* Adds an axis of an external board, with the bounds of its drive: no-load speed U / Kw and
 * stall torque Kt U / R. */
static void external_add_motor(struct external *external, const struct rig *rig, size_t board,
                               size_t axis)
{
    const struct board_config *of = &rig->boards.board[board];
    const struct board_axis_config *config = &of->axis[axis];
    const struct robot_sea *sea = &rig->robot->joint[config->joint].sea;
    const double tick_s = 1e-9 * (double)rig->tick_ns;
    struct external_axis *to = &external->axis[external->count++];

    *to = (struct external_axis){
        .board = board,
        .torque = of->external_torque,
        .joint = config->joint,
        .lower = config->lower_rad,
        .upper = config->upper_rad,
        .speed = rig->supply_v / sea->Kw,
        .stall_nm = sea->Kt * rig->supply_v / sea->R,
        .sea = sea,
        .settled = sea->Ds > 0.0 ? -portable_expm1(-sea->Ks * tick_s / sea->Ds) : 1.0,
        .between_ns = rig->tick_ns,
        .heard_ns = -1,
        .timeout_ns = of->external_timeout_ns,
    };
    while (rig->axis[to->index].bus != of->bus || rig->axis[to->index].address != of->address ||
           rig->axis[to->index].axis != axis) {
        to->index++;
    }
}

enum error_code external_create(const struct rig *rig, struct boards *boards, struct plant *plant,
                                struct arena *arena, struct external **out, struct error *error)
{
    const struct host_config config = rig_host_config(rig, NULL, false);
    struct external *external;
    enum error_code code;
    bool any = false;

    /* Returns early for a rig without external boards */
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        any = any || rig->boards.board[i].external;
    }
    if (!any) {
        return ERROR_NONE;
    }

    /* The axes of all buses in one array */
    external = arena_alloc(arena, 1, sizeof *external);
    if (external) {
        external->axis = arena_alloc(arena, rig->naxis + rig->nft, sizeof *external->axis);
        external->by_bus = arena_alloc(arena, rig->nbus + 1, sizeof *external->by_bus);
    }
    if (!external || !external->axis || !external->by_bus) {
        return error_set(error, ERROR_MEMORY, "no memory left for external boards");
    }
    external->boards = boards;
    external->plant = plant;
    external->tick_ns = rig->tick_ns;
    for (size_t b = 0; b < rig->nbus; b++) {
        /* Adds the axes and sensors of a bus's external boards, in the order of the boards */
        const size_t first = rig->bus[b].first_board;

        external->by_bus[b] = external->count;
        for (size_t i = first; i < first + rig->bus[b].nboard; i++) {
            const struct board_config *board = &rig->boards.board[i];

            for (size_t k = 0; board->external && board->kind == BOARD_MOTOR && k < BOARD_AXES_MAX;
                 k++) {
                if (board->axis[k].joint >= 0) {
                    external_add_motor(external, rig, i, k);
                }
            }
            if (board->external && board->kind == BOARD_FT) {
                /* Adds the sensor of an external force/torque board, to detect its frames */
                const struct board_config *of = &rig->boards.board[i];
                struct external_axis *to = &external->axis[external->count++];

                *to = (struct external_axis){.board = i, .sensor = true, .heard_ns = -1};
                while (rig->ft[to->index].bus != of->bus ||
                       rig->ft[to->index].address != of->address) {
                    to->index++;
                }
            }
        }
        external->by_bus[b + 1] = external->count;
    }

    /* A host's codec reads the boards' frames */
    code = host_create(&config, arena, &external->host, error);
    if (!code) {
        host_begin_listening(external->host);
        *out = external;
    }
    return code;
}

/* ---- received values ---- */

/* Sets the target of an axis within its bounds, and measures the time between targets. */
static void external_aim(const struct external *external, struct external_axis *axis,
                         int64_t now_ns, double target)
{
    /* Several frames within one tick count as one */
    if (axis->told_ns != now_ns && axis->aimed) {
        int64_t between_ns = now_ns - axis->told_ns;

        axis->between_ns = between_ns < external->tick_ns  ? external->tick_ns
                           : between_ns > axis->timeout_ns ? axis->timeout_ns
                                                           : between_ns;
    }
    axis->told_ns = now_ns;
    axis->aimed = true;
    axis->target = axis->torque ? fmin(fmax(target, -axis->stall_nm), axis->stall_nm)
                                : fmin(fmax(target, axis->lower), axis->upper);
}

/* Checks whether the frame just read has a new target of an axis, or a new value of a sensor.
 * Stores a new target. */
static bool external_take_news(const struct external *external, struct external_axis *axis,
                               int64_t now_ns)
{
    const struct host_joint *joint;
    bool motor;

    if (axis->sensor) {
        const struct host_force *force = host_force(external->host, axis->index);

        return force->force_time_ns == now_ns || force->torque_time_ns == now_ns;
    }

    joint = host_joint(external->host, axis->index);
    if (axis->torque) {
        if (joint->torque_time_ns != now_ns) {
            return false;
        }
        external_aim(external, axis, now_ns, joint->torque_nm);
        return true;
    }

    /* Use the motor's angle, or the link's if the frames have no motor angle */
    motor = joint->motor_time_ns >= 0 &&
            joint->joint_time_ns - joint->motor_time_ns <= axis->timeout_ns;
    if ((motor ? joint->motor_time_ns : joint->joint_time_ns) != now_ns) {
        return false;
    }
    external_aim(external, axis, now_ns, motor ? joint->motor_rad : joint->joint_rad);
    return true;
}

void external_receive(struct external *external, int64_t now_ns, size_t bus,
                      const struct bus_frame *frame)
{
    host_listen(external->host, bus, frame, now_ns);
    for (size_t i = external->by_bus[bus]; i < external->by_bus[bus + 1]; i++) {
        struct external_axis *axis = &external->axis[i];

        if (external_take_news(external, axis, now_ns)) {
            axis->heard_ns = now_ns;
            if (external->boards) {
                boards_external_heard(external->boards, now_ns, axis->board);
            }
        }
    }
}

int64_t external_heard_ns(const struct external *external, size_t board)
{
    int64_t heard_ns = -1;

    for (size_t i = 0; i < external->count; i++) {
        if (external->axis[i].board == board && external->axis[i].heard_ns > heard_ns) {
            heard_ns = external->axis[i].heard_ns;
        }
    }
    return heard_ns;
}

/* ---- motion of the joints ---- */

/* Computes the rotor speed of a joint in the coming tick, rad/s. Angle: covers the remaining
 * distance in the time between two frames, so that the rotor glides between rare frames instead of
 * jumping. Torque: the spring's deflection e follows Ks e + Ds e' = torque, so it approaches the
 * deflection at rest with the time constant Ds / Ks. The rotor adds the change of e over the tick
 * to the link's motion. */
static double external_rotor_speed(const struct external *external,
                                   const struct external_axis *axis)
{
    const struct motor_sense *is = &plant_sensors(external->plant)->motor[axis->joint];
    double wanted;

    if (!axis->aimed || !boards_external_present(external->boards, axis->board) ||
        plant_is_clamped(external->plant)) {
        return 0.0;
    }
    if (axis->torque) {
        const double rest = sea_deflection(axis->sea, axis->target) - (is->qm - is->q);

        wanted = is->qd + axis->settled * rest / ((double)external->tick_ns * 1e-9);
    } else {
        wanted = (axis->target - is->qm) / ((double)axis->between_ns * 1e-9);
    }
    return fmin(fmax(wanted, -axis->speed), axis->speed);
}

void external_control(struct external *external, int64_t now_ns)
{
    struct plant_command *command = plant_command(external->plant);

    boards_external_step(external->boards, now_ns);
    for (size_t i = 0; i < external->count; i++) {
        const struct external_axis *axis = &external->axis[i];

        if (!axis->sensor) {
            struct motor_command *motor = &command->motor[axis->joint];

            motor->bridge_on = false;
            motor->voltage_v = 0.0;
            motor->condition |= DRIVE_IMPOSED;
            motor->rotor_rad_s = external_rotor_speed(external, axis);
        }
    }
}
