/* SPDX-License-Identifier: Apache-2.0 */
/* Plans the buses of an imported robot: assigns joints and sensors to buses. */
#include "app/import/board_layout.h"

#include "app/import/path.h"
#include "base/config.h"
#include "base/text.h"
#include "boards/described/protocol.h"
#include "boards/protocol_list.h"

#include <string.h>

/* Servo valves per bus: the axes of one board. They load the bus to 70 %, below IMPORT_BUS_LOAD. */
enum { VALVES_MOST = 4 };

/* Layout for a protocol without its own layout: one board per joint. */
static const struct protocol_bench one_each = {.bus_axes = IMPORT_BUS_AXES,
                                               .board_axes = 1,
                                               .ft_address = 1,
                                               .ft_period_s = "0.005",
                                               .command_period_s = "0.001"};

/* ---- the protocol ---- */

/* Reads the largest address in a protocol file, and whether the protocol needs CAN FD. fd: over CAN
 * FD, which the protocol's frames must follow. */
static enum error_code boards_read_file(const char *path, bool fd, struct arena *arena,
                                        struct import_boards *boards, struct error *error)
{
    const struct described_protocol *protocol;
    enum error_code code = described_load(path, fd, arena, &protocol, error);

    if (!code && fd && !protocol->frame[0].either) {
        return error_set(error, ERROR_INPUT,
                         "--protocol: found \"%.200s-fd\", expected a protocol whose file has "
                         "follow_fd: true before -fd",
                         boards->name);
    }
    for (size_t i = 0; !code && i < protocol->nframe; i++) {
        boards->fd = boards->fd || protocol->frame[i].flags & FRAME_FD;
        boards->optional = boards->optional ||
                           (protocol->frame[i].optional && protocol->frame[i].of & DESCRIBED_MOTOR);
    }
    boards->protocol = &protocol_described;
    boards->described = code ? NULL : protocol;
    boards->address_max = code ? 0 : protocol->address_max;
    return code;
}

enum error_code import_find_boards(const char *name, struct arena *arena,
                                   struct import_boards *boards, struct error *error)
{
    const size_t length = name ? strlen(name) : 0;
    const bool fd = length > 3 && !strcmp(name + length - 3, "-fd");
    enum error_code code;
    const char *path;
    char word[64];

    /* A protocol in C; the suffix "-fd" selects CAN FD */
    snprintf(word, sizeof word, "%.*s", (int)(fd ? length - 3 : length), name ? name : "");
    boards->protocol = name ? protocol_find(word) : protocol_at(0);
    if (boards->protocol && !boards->protocol->needs_file && (!fd || boards->protocol->canfd)) {
        boards->fd = fd || boards->protocol->canfd_only;
        boards->address_max = boards->protocol->motor_address_max;
        return ERROR_NONE;
    }

    /* The name of a protocol file, or the path of a user's own file; a rig file names the copy
     * ../protocols/NAME */
    if (!strpbrk(name, "/.")) {
        code = config_locate_from(CONFIG_PROTOCOL, name, "", arena, &path, error);
        const bool follows =
            code == ERROR_INPUT && fd &&
            !config_locate_from(CONFIG_PROTOCOL, word, "", arena, &path, &(struct error){0});

        boards->name = follows ? arena_strdup(arena, word) : name;
        if (!boards->name) {
            return error_set(error, ERROR_MEMORY, "no memory for the protocol");
        }
        return code && !follows ? error_prefix(error, "--protocol")
                                : boards_read_file(path, follows, arena, boards, error);
    }
    code = import_find_own_file(
        "protocol", name,
        "a protocol or its file: no such file; `coman-hil list protocols` lists the protocols",
        arena, &boards->copy, &boards->name, error);
    if (code) {
        return code;
    }
    return boards->copy && boards->name
               ? boards_read_file(boards->copy, false, arena, boards, error)
               : error_set(error, ERROR_MEMORY, "no memory for the protocol");
}

/* ---- buses ---- */

/* Returns the first body of a body's limb, which follows directly after the last branch of the
 * tree. */
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
static enum error_code plan_add_bus(struct import_plan *plan, const char *protocol,
                                    struct import_bus **bus, struct error *error)
{
    if (plan->nbus == IMPORT_BUSES_MAX) {
        return error_set(error, ERROR_INPUT,
                         "found more joints than %d buses carry, expected fewer: give --protocol "
                         "compact-fd, of which a bus carries %u",
                         IMPORT_BUSES_MAX, protocol_compact.bench_fd.bus_axes);
    }
    *bus = &plan->bus[plan->nbus++];
    **bus = (struct import_bus){.protocol = protocol};
    return ERROR_NONE;
}

/* Checks whether a joint has a motor or, if `valves`, a servo valve. */
static bool joint_is_for(const struct robot_joint *joint, bool valves)
{
    return valves ? joint->hydraulic.present : joint->sea.present;
}

/* Assigns joints to buses in order. A new limb starts a new bus unless all its joints fit on the
 * last bus. */
static enum error_code plan_add_joints(const struct robot *robot, size_t most, bool valves,
                                       struct import_plan *plan, struct error *error)
{
    struct import_bus *bus = NULL;
    int limb = -1;

    for (size_t j = 0; j < robot->njoint; j++) {
        int own = body_find_limb(robot, (int)j + 1);

        if (!joint_is_for(&robot->joint[j], valves)) {
            continue;
        }

        /* One more joint of the same limb must fit, or all joints of a new limb */
        size_t more = own == limb;

        for (size_t k = 0; k < robot->njoint && own != limb; k++) {
            more +=
                joint_is_for(&robot->joint[k], valves) && body_find_limb(robot, (int)k + 1) == own;
        }
        if (!bus || bus->njoint + more > most) {
            enum error_code code = plan_add_bus(plan, valves ? "servo-valve" : NULL, &bus, error);

            if (code) {
                return code;
            }
        }
        limb = own;
        bus->joint[bus->njoint++] = j;
    }
    return ERROR_NONE;
}

/* Returns the motor bus without a sensor whose joints include the nearest joint above a body; NULL
 * if there is none. */
static struct import_bus *plan_find_limb_bus(const struct robot *robot, struct import_plan *plan,
                                             int body)
{
    for (int up = body; up > 0; up = robot->body[up].parent) {
        for (size_t i = 0; i < plan->nbus; i++) {
            struct import_bus *bus = &plan->bus[i];

            for (size_t k = 0; k < bus->njoint && bus->nft == 0 && !bus->protocol; k++) {
                if ((int)bus->joint[k] == up - 1) {
                    return bus;
                }
            }
        }
    }
    return NULL;
}

/* Assigns each force-torque sensor to the bus of its limb, or to a new bus. The inertial board gets
 * its own bus. If the protocol has no layout, sensors share buses with the protocol compact. */
static enum error_code plan_add_sensors(const struct robot *robot, struct import_plan *plan,
                                        struct error *error)
{
    const char *protocol = plan->counted ? protocol_compact.name : NULL;
    enum error_code code = ERROR_NONE;
    struct import_bus *bus = NULL;

    for (size_t s = 0; s < robot->nft && !code; s++) {
        if (!plan->counted) {
            bus = plan_find_limb_bus(robot, plan, robot->frame[robot->ft[s].frame].body);
        }
        if (!bus || bus->nft == IMPORT_BUS_FT) {
            code = plan_add_bus(plan, protocol, &bus, error);
        }
        if (!code) {
            bus->ft[bus->nft++] = (int)s;
        }
    }
    if (!code && robot->imu_frame >= 0) {
        code = plan_add_bus(plan, protocol, &bus, error);
        if (!code) {
            bus->imu = true;
        }
    }
    return code;
}

/* ---- addresses ---- */

/* Parses an --address option, JOINT=NUMBER. Returns the joint's index, or -1 for another option. */
static int address_read(const char *option, const struct robot *robot, unsigned most,
                        unsigned *address)
{
    const char *equals = strrchr(option, '=');
    int64_t number;

    for (size_t j = 0; equals && j < robot->njoint; j++) {
        if (strlen(robot->joint[j].name) == (size_t)(equals - option) &&
            !strncmp(robot->joint[j].name, option, (size_t)(equals - option)) &&
            text_to_int(equals + 1, 1, most, &number)) {
            *address = (unsigned)number;
            return (int)j;
        }
    }
    return -1;
}

/* Checks whether a board on a bus already has this address. */
static bool bus_has_address(const struct import_bus *bus, unsigned address)
{
    for (size_t k = 0; k < bus->njoint; k++) {
        if (bus->address[k] == address) {
            return true;
        }
    }
    return false;
}

/* Gives the board of each joint of a bus its address: the address from --address, else the next
 * free one. */
static enum error_code bus_number_boards(const struct robot *robot, const struct import_plan *plan,
                                         struct import_bus *bus, struct error *error)
{
    const struct import_boards *boards = &plan->boards;
    unsigned next = 1, given;

    for (size_t i = 0; i < boards->naddress; i++) {
        int joint = address_read(boards->address[i], robot, boards->address_max, &given);

        for (size_t k = 0; k < bus->njoint; k++) {
            if ((int)bus->joint[k] == joint && bus_has_address(bus, given)) {
                return error_set(error, ERROR_INPUT,
                                 "--address: found %u twice on the bus of joint \"%.63s\", "
                                 "expected addresses of their own",
                                 given, robot->joint[joint].name);
            }
            bus->address[k] = (int)bus->joint[k] == joint ? given : bus->address[k];
        }
    }
    for (size_t k = 0; k < bus->njoint; k++) {
        while (bus_has_address(bus, next)) {
            next++;
        }
        bus->address[k] = bus->address[k] ? bus->address[k] : next;
    }
    return ERROR_NONE;
}

/* ---- the plan ---- */

enum error_code import_plan_begin(const struct robot *robot, const struct import_boards *boards,
                                  struct import_plan *plan, struct error *error)
{
    const struct protocol_bench *bench =
        boards->fd ? &boards->protocol->bench_fd : &boards->protocol->bench;
    unsigned unused;

    *plan = (struct import_plan){.boards = *boards, .counted = bench->bus_axes == 0};
    plan->boards.name = boards->name ? boards->name : boards->protocol->name;
    plan->bench = plan->counted ? &one_each : bench;
    plan->bus_axes = plan->bench->bus_axes;
    for (size_t i = 0; i < boards->naddress; i++) {
        if (plan->bench->board_axes > 1 ||
            address_read(boards->address[i], robot, boards->address_max, &unused) < 0) {
            return error_set(error, ERROR_INPUT,
                             "--address: found \"%.80s\", expected JOINT=NUMBER with a joint of "
                             "the robot and 1 to %u, and a protocol of one board a joint",
                             boards->address[i], boards->address_max);
        }
    }
    return ERROR_NONE;
}

enum error_code import_plan_buses(const struct robot *robot, struct import_plan *plan,
                                  struct error *error)
{
    enum error_code code;

    plan->nbus = 0;
    code = plan_add_joints(robot, plan->bus_axes, false, plan, error);
    for (size_t i = 0; i < plan->nbus && !code; i++) {
        code = bus_number_boards(robot, plan, &plan->bus[i], error);
    }
    code = code ? code : plan_add_joints(robot, VALVES_MOST, true, plan, error);
    if (!code && plan->nbus == 0) {
        return error_set(
            error, ERROR_INPUT,
            "found no joint that a drive can turn, expected one: all of its joints "
            "are fixed, slide, or have no actuator; --prismatic drive drives those that "
            "slide, --drive those without an actuator");
    }
    return code ? code : plan_add_sensors(robot, plan, error);
}
