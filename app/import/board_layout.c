/* SPDX-License-Identifier: Apache-2.0 */
/* Plans which joint is on which bus. */
#include "app/import/board_layout.h"

#include "boards/protocol_list.h"

#include <stdio.h>

/* Servo valves of one bus: one board, which loads it to 70 %, below IMPORT_BUS_LOAD. */
enum { VALVES_MOST = 4 };

/* Returns the largest number of axes on a bus with any protocol; word receives the option's name
 * of that protocol. */
static size_t find_roomiest(char *word, size_t size)
{
    const struct protocol *protocol;
    size_t most = 0;

    for (size_t i = 0; (protocol = protocol_at(i)); i++) {
        for (int fd = 0; fd < 2; fd++) {
            size_t axes = fd ? protocol->bench_fd.bus_axes : protocol->bench.bus_axes;

            if (axes > most) {
                most = axes;
                snprintf(word, size, "%s%s", protocol->name, fd ? "-fd" : "");
            }
        }
    }
    return most;
}

/* Returns the first body of a body's limb: the one directly after the last branch of the tree. */
static int body_find_limb(const struct robot *robot, int body)
{
    while (robot->body[body].parent > 0) {
        int parent = robot->body[body].parent;
        size_t children = 0;

        for (size_t b = 1; b < robot->nbody; b++) {
            children += robot->body[b].parent == parent;
        }
        if (children > 1) {
            break;
        }
        body = parent;
    }
    return body;
}

/* Adds an empty bus to the plan; refuses more than IMPORT_BUSES_MAX. */
static enum error_code plan_add_bus(struct import_plan *plan, struct import_bus **bus,
                                    struct error *error)
{
    if (plan->nbus == IMPORT_BUSES_MAX) {
        char word[40];
        size_t most = find_roomiest(word, sizeof word);

        return error_set(error, ERROR_INPUT,
                         "found more joints than %d buses carry, expected fewer: give "
                         "--protocol %s, of which a bus carries %zu",
                         IMPORT_BUSES_MAX, word, most);
    }
    *bus = &plan->bus[plan->nbus++];
    **bus = (struct import_bus){.ft = -1};
    return ERROR_NONE;
}

/* Checks whether a joint has a motor; with valves, a servo valve. */
static bool joint_is_for(const struct robot_joint *joint, bool valves)
{
    return valves ? joint->hydraulic.present : joint->sea.present;
}

/* Counts the joints with motors, or with valves, on the limb of a body. */
static size_t limb_count_axes(const struct robot *robot, int limb, bool valves)
{
    size_t count = 0;

    for (size_t j = 0; j < robot->njoint; j++) {
        count +=
            joint_is_for(&robot->joint[j], valves) && body_find_limb(robot, (int)j + 1) == limb;
    }
    return count;
}

/* Assigns joints to buses in order; a limb starts a new bus unless it fits completely on the last
 * one. */
static enum error_code plan_add_joints(const struct robot *robot, size_t most, bool valves,
                                       struct import_plan *plan, struct error *error)
{
    struct import_bus *bus = NULL;
    int limb = -1;

    for (size_t j = 0; j < robot->njoint; j++) {
        int own = body_find_limb(robot, (int)j + 1);
        bool fits;

        if (!joint_is_for(&robot->joint[j], valves)) {
            continue;
        }

        /* For a limb in progress one more joint must fit, for a new limb all its joints */
        fits = bus && bus->njoint + (own == limb ? 1 : limb_count_axes(robot, own, valves)) <= most;
        if (!fits) {
            enum error_code code = plan_add_bus(plan, &bus, error);

            if (code) {
                return code;
            }
            bus->valves = valves;
        }
        limb = own;
        bus->joint[bus->njoint++] = j;
    }
    return ERROR_NONE;
}

/* Returns the motor bus without a sensor that has the nearest joint above a body; NULL if there is
 * none. */
static struct import_bus *plan_find_limb_bus(const struct robot *robot, struct import_plan *plan,
                                             int body)
{
    for (int up = body; up > 0; up = robot->body[up].parent) {
        for (size_t i = 0; i < plan->nbus; i++) {
            struct import_bus *bus = &plan->bus[i];

            for (size_t k = 0; k < bus->njoint && bus->ft < 0 && !bus->valves; k++) {
                if ((int)bus->joint[k] == up - 1) {
                    return bus;
                }
            }
        }
    }
    return NULL;
}

/* Puts each force-torque sensor on its limb's bus, or a new one; the inertial board gets a bus of
 * its own. */
static enum error_code plan_add_sensors(const struct robot *robot, struct import_plan *plan,
                                        struct error *error)
{
    enum error_code code = ERROR_NONE;
    struct import_bus *bus = NULL;

    for (size_t s = 0; s < robot->nft && !code; s++) {
        bus = plan_find_limb_bus(robot, plan, robot->frame[robot->ft[s].frame].body);
        if (!bus) {
            code = plan_add_bus(plan, &bus, error);
        }
        if (!code) {
            bus->ft = (int)s;
        }
    }
    if (!code && robot->imu_frame >= 0) {
        code = plan_add_bus(plan, &bus, error);
        if (!code) {
            bus->imu = true;
        }
    }
    return code;
}

enum error_code import_plan_buses(const struct robot *robot, const struct import_boards *boards,
                                  struct import_plan *plan, struct error *error)
{
    enum error_code code;

    *plan = (struct import_plan){
        .boards = *boards,
        .bench = boards->fd ? &boards->protocol->bench_fd : &boards->protocol->bench,
    };
    code = plan_add_joints(robot, plan->bench->bus_axes, false, plan, error);
    code = code ? code : plan_add_joints(robot, VALVES_MOST, true, plan, error);
    if (!code && plan->nbus == 0) {
        return error_set(error, ERROR_INPUT,
                         "found no joint that a drive can turn, expected one: all of its joints "
                         "are fixed, or slide");
    }
    return code ? code : plan_add_sensors(robot, plan, error);
}
