/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the buses of a rig and the boards on them. */
#include "base/config.h"
#include "base/array.h"
#include "base/text.h"
#include "boards/described/protocol.h"
#include "boards/protocol_list.h"
#include "model/hydraulics/hydraulic.h"
#include "rig/builder_private.h"

#include <stdio.h>

/* Returns the name or the file of a bus's protocol, or NULL for the default. The bus's own key
 * comes first, then the rig's. Files with the old key "personality" differ in two ways. On a bus,
 * "described" means the protocol file of the rig. A rig may give this file, and also a personality
 * for all buses without a key. */
static const char *rig_bus_protocol(const struct rig_builder *b, const struct raw_bus *bus)
{
    const char *described = protocol_described.name, *own = bus->protocol;

    if (!own && b->raw->personality) {
        return b->raw->personality;
    }
    return own && strcmp(own, described) != 0 ? own : b->raw->protocol;
}

/* Refuses a key that the protocol of a bus does not support. `capability`: offset of a bool in
 * struct protocol. */
static enum error_code rig_refuse_protocol(struct rig_builder *b, const struct yaml_mark *mark,
                                           const char *found, const struct protocol *protocol,
                                           size_t capability)
{
    char list[80];

    return yaml_error(b->error, mark, "found %s with protocol %s, expected it with %s only", found,
                      protocol->name, protocols_list(capability, list, sizeof list));
}

/* Refuses a full scale that is not an integer. */
static enum error_code board_check_full_scale(struct rig_builder *b, const struct yaml_mark *mark,
                                              double value)
{
    return value == floor(value)
               ? ERROR_NONE
               : yaml_error(b->error, mark,
                            "found full scale %.15g, expected an integer: boards report it as one",
                            value);
}

/* Checks that a board has the keys of its kind and no others. */
static enum error_code board_check_keys(struct rig_builder *b, const struct raw_board *raw)
{
    static const char *const what[] = {"a motor board", "an F/T board", "a torque board",
                                       "an inertial board"};
    const unsigned motor = 1 << BOARD_MOTOR, ft = 1 << BOARD_FT, torque = 1 << BOARD_TORQUE;
    const unsigned inertial = 1 << BOARD_INERTIAL;
    const struct rig_key keys[] = {
        {"axes", motor, motor},
        {"current_limit_a", motor, 0},
        {"current_gain", motor, 0},
        {"torque_gain", motor, 0},
        {"torque_offset_nm", motor, 0},
        {"model", motor, 0},
        {"joints", torque, torque},
        {"sensor", ft, ft},
        {"full_scale_n", ft, ft},
        {"full_scale_nm", ft, ft},
        {"period_s", ft | torque | inertial, 0},
    };

    return rig_check_keys(b, &raw->mark, what[raw->board.kind], raw->board.kind, keys,
                          ARRAY_COUNT(keys));
}

/* Checks the period of a STRAIN or inertial board. It must be a multiple of 1 ms, because the
 * board's command has this unit. */
static enum error_code board_check_period(struct rig_builder *b, const struct raw_board *raw)
{
    const int64_t period_ns = raw->board.period_ns;

    return period_ns % 1000000 == 0
               ? ERROR_NONE
               : yaml_error(b->error, yaml_place(&raw->mark, "period_s"),
                            "found a period of %.15g s, expected whole milliseconds",
                            (double)period_ns * 1e-9);
}

/* Builds a force-torque board with its sensor and its full scales. */
static enum error_code board_build_ft(struct rig_builder *b, const struct raw_board *raw,
                                      struct board_config *board)
{
    enum error_code code = rig_find(b, yaml_place(&raw->mark, "sensor"), "F/T sensor", raw->sensor,
                                    RIG_NAMES(b->robot->ft, b->robot->nft), &board->ft);

    if (code) {
        return code;
    }
    if (b->ft[board->ft]) {
        return yaml_error(b->error, yaml_place(&raw->mark, "sensor"),
                          "found sensor \"%s\" again, expected it on one board (line %d)",
                          raw->sensor, b->ft[board->ft]->mark.line);
    }
    b->ft[board->ft] = raw;
    for (int i = 0; i < 6 && !code; i++) {
        code = board_check_full_scale(
            b, yaml_place(&raw->mark, i < 3 ? "full_scale_n" : "full_scale_nm"),
            board->full_scale[i]);
    }
    return code ? code : board_check_period(b, raw);
}

/* Builds a torque board with the joints of its channels. */
static enum error_code board_build_torque(struct rig_builder *b, const struct raw_board *raw,
                                          struct board_config *board)
{
    if (raw->njoint < 1 || raw->njoint > BOARD_CHANNELS) {
        return yaml_error(b->error, yaml_place(&raw->mark, "joints"),
                          "found %zu joints, expected 1 to %d", raw->njoint, BOARD_CHANNELS);
    }

    /* Mark all channels as unused */
    for (int i = 0; i < BOARD_CHANNELS; i++) {
        board->torque_joint[i] = -1;
        board->full_scale[i] = b->raw->motors.axis.torque_full_scale_nm;
    }
    for (size_t i = 0; i < raw->njoint; i++) {
        const struct yaml_name *name = &raw->joint[i];
        struct rig_torque *source;
        enum error_code code;

        if (!strcmp(name->name, "spare")) {
            continue;
        }
        code = rig_find(b, &name->mark, "joint", name->name,
                        RIG_NAMES(b->robot->joint, b->robot->njoint), &board->torque_joint[i]);
        if (code) {
            return code;
        }
        source = &b->torque[board->torque_joint[i]];
        if (source->board) {
            return yaml_error(b->error, &name->mark,
                              "found joint \"%s\" again, expected it on one torque board (line %d)",
                              name->name, source->board->mark.line);
        }
        *source = (struct rig_torque){raw, board->bus, (int)i};
    }
    return board_check_period(b, raw);
}

/* Builds the inertial board. A rig has at most one. */
static enum error_code board_build_inertial(struct rig_builder *b, const struct raw_board *raw)
{
    if (b->robot->imu_frame < 0) {
        return yaml_error(b->error, &raw->mark,
                          "found an inertial board, expected none: the robot has no imu");
    }
    if (b->imu) {
        return yaml_error(b->error, &raw->mark,
                          "found an inertial board again, expected one (line %d)",
                          b->imu->mark.line);
    }
    b->imu = raw;
    return board_check_period(b, raw);
}

/* Builds an axis of a motor board. The axis may be unused. */
static enum error_code board_build_axis(struct rig_builder *b, const struct raw_board *raw,
                                        const struct yaml_name *name,
                                        struct board_axis_config *axis)
{
    const struct raw_motors *motors = &b->raw->motors;
    const struct robot_joint *joint;
    enum error_code code;

    /* Set the common values, also for an unused axis */
    *axis = motors->axis;
    axis->joint = -1;
    axis->joint_ticks_per_rad = motors->joint_ticks_per_rev / (2.0 * M_PI);
    axis->motor_ticks_per_rad = motors->motor_ticks_per_link_rev / (2.0 * M_PI);
    if (yaml_has(&raw->mark, "current_limit_a")) {
        axis->current_limit_a = raw->current_limit_a;
    }
    axis->current_gain = raw->current_gain;
    axis->torque_gain = raw->torque_gain;
    axis->torque_offset_nm = raw->torque_offset_nm;
    if (!strcmp(name->name, "spare")) {
        return ERROR_NONE;
    }

    /* Check that the joint has a drive and that no other board drives it */
    code = rig_find(b, &name->mark, "joint", name->name,
                    RIG_NAMES(b->robot->joint, b->robot->njoint), &axis->joint);
    if (code) {
        return code;
    }
    joint = &b->robot->joint[axis->joint];
    if (!robot_joint_is_driven(joint)) {
        return yaml_error(b->error, &name->mark,
                          "found joint \"%s\", which has no drive, expected a driven joint",
                          name->name);
    }
    if (b->driver[axis->joint]) {
        return yaml_error(b->error, &name->mark,
                          "found joint \"%s\" again, expected it on one axis (board in line %d)",
                          name->name, b->driver[axis->joint]->mark.line);
    }
    b->driver[axis->joint] = raw;

    /* Copy the values of the drive that the board needs */
    axis->lower_rad = joint->lower - motors->limit_margin_rad;
    axis->upper_rad = joint->upper + motors->limit_margin_rad;
    axis->valve = joint->hydraulic.present;
    axis->gear = axis->valve ? 1.0 : joint->sea.N;
    axis->winding_ohm = joint->sea.R;
    axis->winding_h = joint->sea.L;
    axis->current_loop_hz = joint->sea.current_loop_hz;
    axis->bemf_v_s_rad =
        axis->valve ? hydraulic_speed_constant(&joint->hydraulic, &b->robot->hydraulic_supply,
                                               joint->lower, joint->upper)
                    : joint->sea.Kw;
    axis->torque_nm_a = joint->sea.Kt;
    return ERROR_NONE;
}

/* Sets the switches of an axis's joint. The board's protocol must support switches. */
static enum error_code board_place_switches(struct rig_builder *b, const struct protocol *protocol,
                                            const struct robot_joint *joint,
                                            struct board_axis_config *axis)
{
    const struct raw_motors *motors = &b->raw->motors;

    for (size_t i = 0; i < motors->nswitches; i++) {
        const struct raw_switches *raw = &motors->switches[i];

        if (strcmp(raw->joint, joint->name) != 0) {
            continue;
        }

        /* Check that the protocol supports switches, and that their angles are in order */
        if (!protocol->switches) {
            return rig_refuse_protocol(b, &raw->mark, "a joint's switches", protocol,
                                       offsetof(struct protocol, switches));
        }
        if (yaml_has(&raw->mark, "home_rad") &&
            !(raw->switches.home_rad[0] < raw->switches.home_rad[1])) {
            return yaml_error(b->error, yaml_place(&raw->mark, "home_rad"),
                              "found a home switch that is on from %g to %g rad, expected the "
                              "smaller angle first",
                              raw->switches.home_rad[0], raw->switches.home_rad[1]);
        }
        if (yaml_has(&raw->mark, "negative_limit_rad") &&
            yaml_has(&raw->mark, "positive_limit_rad") &&
            !(raw->switches.negative_rad < raw->switches.positive_rad)) {
            return yaml_error(
                b->error, yaml_place(&raw->mark, "negative_limit_rad"),
                "found negative_limit_rad %g, expected it below positive_limit_rad, %g",
                raw->switches.negative_rad, raw->switches.positive_rad);
        }

        /* Convert the distance of index pulses to the joint: one pulse per revolution of the
         * rotor */
        axis->switches = raw->switches;
        axis->switches.negative = yaml_has(&raw->mark, "negative_limit_rad");
        axis->switches.positive = yaml_has(&raw->mark, "positive_limit_rad");
        axis->switches.home = yaml_has(&raw->mark, "home_rad");
        axis->switches.index_rad = raw->index_pulse ? 2.0 * M_PI / axis->gear : 0.0;
    }
    return ERROR_NONE;
}

/* Checks an external board. The host's codec must be able to read its frames, without configuring
 * the board. */
static enum error_code board_check_external(struct rig_builder *b, const struct raw_board *raw,
                                            const struct protocol *protocol)
{
    static const char *const keys[] = {"external_timeout_s", "external_follows"};

    for (size_t i = 0; i < ARRAY_COUNT(keys) && !raw->board.external; i++) {
        if (yaml_has(&raw->mark, keys[i])) {
            return yaml_error(b->error, yaml_place(&raw->mark, keys[i]),
                              "found %s without external: true, expected both or none", keys[i]);
        }
    }
    if (!raw->board.external) {
        return ERROR_NONE;
    }
    if (!protocol->external) {
        return rig_refuse_protocol(b, yaml_place(&raw->mark, "external"), "external: true",
                                   protocol, offsetof(struct protocol, external));
    }
    if (raw->board.kind != BOARD_MOTOR && raw->board.kind != BOARD_FT) {
        return yaml_error(b->error, yaml_place(&raw->mark, "external"),
                          "found external: true on a board of another kind, expected it on a motor "
                          "or an F/T board");
    }

    /* Check that only a motor board has joints that follow an external board */
    if (yaml_has(&raw->mark, "external_follows") && raw->board.kind != BOARD_MOTOR) {
        return yaml_error(b->error, yaml_place(&raw->mark, "external_follows"),
                          "found external_follows on an F/T board, expected it on a motor board: "
                          "no joint follows a sensor");
    }
    return raw->external_torque && !protocol->external_torque
               ? rig_refuse_protocol(b, yaml_place(&raw->mark, "external_follows"),
                                     "external_follows: torque", protocol,
                                     offsetof(struct protocol, external_torque))
               : ERROR_NONE;
}

/* Checks that the protocol and the board support the drive of an axis. */
static enum error_code board_check_axis(struct rig_builder *b, const struct raw_board *raw,
                                        const struct yaml_name *name,
                                        const struct described_protocol *described,
                                        const struct robot_joint *joint)
{
    if (joint->hydraulic.present && described &&
        !described_law_suits_valve(described_state_law(described, described->host.on_state, 0))) {
        return yaml_error(b->error, &name->mark,
                          "found hydraulic joint \"%s\", expected one with a motor: protocol %s "
                          "switches on into a law of current or torque",
                          name->name, described->name);
    }
    if (joint->hydraulic.present && raw->board.external) {
        return yaml_error(b->error, &name->mark,
                          "found joint \"%s\" with a hydraulic drive on an external board, "
                          "expected one with a motor: there is no rotor that could follow",
                          name->name);
    }
    return raw->external_torque && joint->sea.Ks <= 0.0
               ? yaml_error(b->error, &name->mark,
                            "found joint \"%s\" without a spring on a board with external_follows: "
                            "torque, expected one with a spring, which exerts it",
                            name->name)
               : ERROR_NONE;
}

/* Builds a motor board and its axes, and checks each axis. */
static enum error_code board_build_motor(struct rig_builder *b, const struct raw_board *raw,
                                         const struct protocol *protocol,
                                         struct board_config *board)
{
    static const struct yaml_name spare = {.name = "spare"};
    const struct described_protocol *described = b->bus[board->bus].described;
    enum error_code code = ERROR_NONE;

    board->period_ns = 0; /* motor boards have other rules for sending */

    /* Check that the protocol allows this number of axes */
    if (raw->naxis < 1 || raw->naxis > protocol->axes_max) {
        return yaml_error(b->error, yaml_place(&raw->mark, "axes"), "found %zu axes, expected %s%d",
                          raw->naxis, protocol->axes_max > 1 ? "1 to " : "", protocol->axes_max);
    }
    for (size_t i = 0; i < BOARD_AXES_MAX && !code; i++) {
        struct board_axis_config *axis = &board->axis[i];

        /* Build all axes of the board; axes after the listed ones are unused */
        code = board_build_axis(b, raw, i < raw->naxis ? &raw->axis[i] : &spare, axis);
        if (!code && axis->joint >= 0) {
            const struct robot_joint *joint = &b->robot->joint[axis->joint];

            code = board_check_axis(b, raw, &raw->axis[i], described, joint);
            code = code ? code : board_place_switches(b, protocol, joint, axis);
        } else if (!code && i < raw->naxis && !protocol->spare_axes) {
            code = rig_refuse_protocol(b, &raw->axis[i].mark, "a spare axis", protocol,
                                       offsetof(struct protocol, spare_axes));
        }
    }
    return code;
}

/* Checks that the protocol allows the address and the kind of a board. */
static enum error_code board_check_address(struct rig_builder *b, const struct raw_board *raw,
                                           const struct protocol *protocol)
{
    int64_t max =
        raw->board.kind == BOARD_MOTOR ? protocol->motor_address_max : protocol->address_max;

    if (raw->board.kind == BOARD_TORQUE && !protocol->torque_boards) {
        return rig_refuse_protocol(b, &raw->mark, "a torque board", protocol,
                                   offsetof(struct protocol, torque_boards));
    }
    if (raw->board.kind != BOARD_MOTOR && protocol->motors_only) {
        return yaml_error(
            b->error, &raw->mark,
            "found a board of sensors on a bus with protocol %s, expected motor boards only",
            protocol->name);
    }
    if (raw->address > max) {
        return yaml_error(b->error, yaml_place(&raw->mark, "address"),
                          "found address %d, expected 1 to %d with protocol %s", (int)raw->address,
                          (int)max, protocol->name);
    }
    return ERROR_NONE;
}

/* Checks a board of a described protocol: its address, its number of axes, and whether the protocol
 * has frames for this kind of board. Finds the model of its drive. */
static enum error_code board_check_described(struct rig_builder *b, const struct raw_board *raw,
                                             const struct described_protocol *protocol, int *model)
{
    static const unsigned kinds[] = {[BOARD_MOTOR] = DESCRIBED_MOTOR,
                                     [BOARD_FT] = DESCRIBED_FT,
                                     [BOARD_TORQUE] = 0,
                                     [BOARD_INERTIAL] = DESCRIBED_INERTIAL};
    bool known = false;

    if (raw->address > (int64_t)protocol->address_max) {
        return yaml_error(b->error, yaml_place(&raw->mark, "address"),
                          "found address %d, expected 1 to %u with protocol %s", (int)raw->address,
                          protocol->address_max, protocol->name);
    }
    if (raw->naxis > protocol->axes) {
        return yaml_error(b->error, yaml_place(&raw->mark, "axes"),
                          "found %zu axes, expected at most %u with protocol %s", raw->naxis,
                          protocol->axes, protocol->name);
    }
    *model = 0;
    if (raw->model &&
        yaml_find_name(YAML_NAMES(protocol->model, protocol->nmodel, name), "model", raw->model,
                       yaml_place(&raw->mark, "model"), model, b->error)) {
        return ERROR_INPUT;
    }
    for (size_t i = 0; i < protocol->nframe; i++) {
        known = known ||
                (!protocol->frame[i].from_host && protocol->frame[i].of & kinds[raw->board.kind]);
    }
    return known ? ERROR_NONE
                 : yaml_error(b->error, &raw->mark,
                              "found a board of a kind that sends no frame in protocol %s, "
                              "expected another kind or such a frame",
                              protocol->name);
}

/* Builds a board: first the common values, then the values of its kind. */
static enum error_code rig_build_board(struct rig_builder *b, int bus, const struct raw_board *raw,
                                       struct board_config *board)
{
    const struct raw_bus *raw_bus = &b->raw->bus[bus];
    const struct protocol *protocol = b->bus[bus].protocol;
    enum error_code code = board_check_keys(b, raw);
    struct raw_board merged;
    static const char *const described[] = {"model", "current_gain", "torque_gain",
                                            "torque_offset_nm"};
    char name[80];
    int model = 0;

    code = code ? code : board_check_address(b, raw, protocol);
    code = code ? code : board_check_external(b, raw, protocol);
    if (!code && b->bus[bus].described) {
        code = board_check_described(b, raw, b->bus[bus].described, &model);
    }
    for (size_t i = 0; i < ARRAY_COUNT(described) && !code && !b->bus[bus].described; i++) {
        if (yaml_has(&raw->mark, described[i])) {
            code = yaml_error(b->error, yaml_place(&raw->mark, described[i]),
                              "found %s on a bus with protocol %s, expected a protocol of a file",
                              described[i], protocol->name);
        }
    }
    if (code) {
        return code;
    }

    /* Check that no other board has the address */
    for (const struct raw_board *other = raw_bus->board; other < raw; other++) {
        if (other->address == raw->address) {
            return yaml_error(
                b->error, yaml_place(&raw->mark, "address"),
                "found address 0x%02x again on bus \"%s\", expected another (line %d has it)",
                (unsigned)raw->address, raw_bus->bus.name, other->mark.line);
        }
    }

    /* Merge the values for all kinds with the board's own values */
    merged.board = b->raw->motors.board;
    yaml_override(&rig_board_schema, &raw->mark, raw, &merged);
    *board = merged.board;
    snprintf(name, sizeof name, "%.60s/0x%02x", raw_bus->bus.name, (unsigned)raw->address);
    board->name = raw->board.name ? raw->board.name : arena_strdup(b->arena, name);
    board->bus = bus;
    board->model = (uint8_t)model;
    board->address = (uint8_t)raw->address;
    /* Without boot_s the boards are ready when the run starts */
    board->restart_ns = board->boot_ns < 0 ? BOARD_RESTART_NS : board->boot_ns;
    board->boot_ns = board->boot_ns > 0 ? board->boot_ns : 0;
    board->under_voltage_v = BOARD_UNDER_VOLTAGE_RATIO * b->rig->supply_v;
    board->over_voltage_v = BOARD_OVER_VOLTAGE_RATIO * b->rig->supply_v;
    board->under_pressure_pa = BOARD_UNDER_PRESSURE_RATIO * b->robot->hydraulic_supply.pressure;
    board->over_pressure_pa = BOARD_OVER_PRESSURE_RATIO * b->robot->hydraulic_supply.pressure;
    board->external_torque = raw->external_torque != 0;
    if (!board->name) {
        return rig_no_memory(b);
    }
    if (raw->board.name && (code = rig_check_name(b, &raw->mark, "board", raw->board.name))) {
        return code;
    }
    switch (board->kind) {
    case BOARD_MOTOR:
        return board_build_motor(b, raw, protocol, board);
    case BOARD_FT:
        return board_build_ft(b, raw, board);
    case BOARD_INERTIAL:
        return board_build_inertial(b, raw);
    default:
        return board_build_torque(b, raw, board);
    }
}

/* Checks the names of a bus, its use of CAN FD, and the settings of its interface. */
static enum error_code rig_check_bus(struct rig_builder *b, const struct raw_bus *raw,
                                     const struct protocol *protocol)
{
    const struct rig_bus *bus = &raw->bus;
    enum error_code code;

    /* Check that name and interface are unique */
    for (const struct raw_bus *other = b->raw->bus; other < raw; other++) {
        if (!strcmp(other->bus.name, bus->name)) {
            return yaml_error(b->error, yaml_place(&raw->mark, "name"),
                              "found bus \"%s\" again, expected a name of its own (line %d has it)",
                              bus->name, other->mark.line);
        }
        if (!strcmp(other->bus.interface, bus->interface)) {
            return yaml_error(
                b->error, yaml_place(&raw->mark, "interface"),
                "found interface \"%s\" again, expected one of its own (bus \"%s\" has it)",
                bus->interface, other->bus.name);
        }
    }

    /* Check CAN FD: the boards must support it, and the bus needs a second bit rate */
    if (bus->fd && !protocol->canfd) {
        return rig_refuse_protocol(b, yaml_place(&raw->mark, "fd"), "fd", protocol,
                                   offsetof(struct protocol, canfd));
    }
    if (!bus->fd && protocol->canfd_only) {
        return yaml_error(b->error, yaml_place(&raw->mark, "name"),
                          "found bus \"%s\" without fd, expected fd: true with protocol %s",
                          bus->name, protocol->name);
    }
    if (bus->fd != (bus->data_bitrate > 0) || (bus->fd && bus->data_bitrate < bus->bitrate)) {
        return yaml_error(b->error, yaml_place(&raw->mark, "data_bitrate"),
                          "found %s on bus \"%s\", expected fd: true and a data_bitrate of at "
                          "least the bitrate together",
                          !bus->fd            ? "data_bitrate without fd"
                          : bus->data_bitrate ? "a data_bitrate below the bitrate"
                                              : "fd without data_bitrate",
                          bus->name);
    }

    /* Refuse padding except for iCub boards. In their DBC all commands have one length; other
     * protocols give each command its own length */
    if (raw->padded && !protocol->padded) {
        return rig_refuse_protocol(b, yaml_place(&raw->mark, "padded_frames"), "padded_frames",
                                   protocol, offsetof(struct protocol, padded));
    }

    /* Refuse settings of the interface without configure: true */
    for (int i = 0; i < 2 && !bus->configure; i++) {
        const char *key = i == 0 ? "sample_point" : "restart_ms";

        if (yaml_has(&raw->mark, key)) {
            return yaml_error(
                b->error, yaml_place(&raw->mark, key),
                "found %s on bus \"%s\" without configure: true, expected both or none", key,
                bus->name);
        }
    }
    code = rig_check_name(b, yaml_place(&raw->mark, "name"), "bus", bus->name);
    return code ? code
                : rig_check_name(b, yaml_place(&raw->mark, "interface"), "interface",
                                 bus->interface);
}

/* Checks that a protocol with CAN FD frames is on a CAN FD bus. Also checks that no frame has a
 * period shorter than a tick. */
static enum error_code rig_check_format(struct rig_builder *b, const struct raw_bus *raw,
                                        const struct described_protocol *protocol)
{
    for (size_t i = 0; i < protocol->nframe && !raw->bus.fd; i++) {
        if (protocol->frame[i].flags & FRAME_FD) {
            return yaml_error(b->error, &raw->mark,
                              "found bus \"%s\" of classic CAN, expected fd: true and a "
                              "data_bitrate: frame %s of protocol %s is a CAN FD one",
                              raw->bus.name, protocol->frame[i].name, protocol->name);
        }
    }
    for (size_t i = 0; i < protocol->nframe; i++) {
        const struct described_frame *frame = &protocol->frame[i];

        if (frame->period_ns > 0 && frame->period_ns < b->rig->tick_ns) {
            return yaml_error(b->error, &raw->mark,
                              "found frame %s of protocol %s every %g s on bus \"%s\", expected "
                              "the tick of %g s or more",
                              frame->name, protocol->name, (double)frame->period_ns * 1e-9,
                              raw->bus.name, (double)b->rig->tick_ns * 1e-9);
        }
    }
    return ERROR_NONE;
}

/* Finds the protocol of a bus from a name or a file in the rig. *path: the protocol's file, or NULL
 * for a protocol in C. A file is relative to the rig's folder, or a name in the configuration
 * trees. */
static enum error_code rig_find_protocol(struct rig_builder *b, const struct yaml_mark *mark,
                                         const char *name, const struct protocol **protocol,
                                         const char **path)
{
    enum { NAMES_MAX = 16 };
    const char *words[NAMES_MAX], *nearest;
    size_t count = 0;

    *path = NULL;
    *protocol = name ? protocol_find(name) : protocol_at(0);
    if (*protocol && !(*protocol)->needs_file) {
        return ERROR_NONE;
    }
    if (*protocol) {
        return yaml_error(b->error, mark,
                          "found protocol %s, expected the name or the file of a protocol", name);
    }
    *protocol = &protocol_described;
    if (strpbrk(name, "/.")) {
        return yaml_resolve_path(mark, name, b->arena, path, b->error);
    }
    if (!config_locate_from(CONFIG_PROTOCOL, name, mark->file, b->arena, path, b->error)) {
        return ERROR_NONE;
    }
    for (; count < NAMES_MAX && protocol_words[count].word; count++) {
        words[count] = protocol_words[count].word;
    }
    nearest = text_nearest(name, words, count);
    return nearest ? yaml_error(b->error, mark, "found unknown protocol \"%s\", expected \"%s\"",
                                name, nearest)
                   : error_prefix(b->error, "%s:%d:%d", mark->file, mark->line, mark->column);
}

/* Sets the protocol of a bus. Also loads its description if the protocol comes from a file or from
 * a built-in text. */
static enum error_code rig_load_protocol(struct rig_builder *b, const struct raw_bus *raw,
                                         struct rig_bus *bus)
{
    const char *source = rig_bus_protocol(b, raw), *path;
    const struct yaml_mark *mark =
        yaml_place(raw->protocol == source ? &raw->mark : &b->raw->mark, "protocol");
    enum error_code code = rig_find_protocol(b, mark, source, &bus->protocol, &path);
    const char *text = code || path ? NULL : bus->fd ? bus->protocol->text_fd : bus->protocol->text;

    if (code || (!path && !text)) {
        return code;
    }

    /* Share the description with an earlier bus of the same protocol */
    for (const struct rig_bus *other = b->bus; other < bus; other++) {
        const struct raw_bus *raw_other = &b->raw->bus[other - b->bus];

        if (rig_bus_protocol(b, raw_other) == source && other->fd == bus->fd) {
            bus->described = other->described;
            return rig_check_format(b, raw, bus->described);
        }
    }
    code = text ? described_read_text(bus->protocol->name, text, strlen(text), bus->fd, b->arena,
                                      &bus->described, b->error)
                : described_load(path, bus->fd, b->arena, &bus->described, b->error);
    code = path ? rig_place_file(b, mark, path, code) : code;
    return code ? code : rig_check_format(b, raw, bus->described);
}

enum error_code rig_build_boards(struct rig_builder *b)
{
    const struct raw_rig *raw = b->raw;
    struct rig_bus *bus = b->bus = arena_alloc(b->arena, b->rig->nbus, sizeof *bus);
    struct boards_bus_config *bus_config = arena_alloc(b->arena, b->rig->nbus, sizeof *bus_config);
    struct host_bus *host_bus = arena_alloc(b->arena, b->rig->nbus, sizeof *host_bus);
    struct board_config *board;
    size_t count = 0, n = 0;
    enum error_code code;
    int64_t delay_ns;

    code = board_check_full_scale(b, yaml_place(&raw->motors.mark, "torque_full_scale_nm"),
                                  raw->motors.axis.torque_full_scale_nm);
    if (code) {
        return code;
    }
    if (raw->motors.board.require_calibration && !raw->motors.board.strict) {
        return yaml_error(b->error, yaml_place(&raw->motors.mark, "require_calibration"),
                          "found require_calibration without strict, expected both or none");
    }
    if (b->rig->nbus < 1 || b->rig->nbus > RIG_BUSES_MAX) {
        return yaml_error(b->error, yaml_place(&raw->mark, "buses"),
                          "found %zu buses, expected 1 to %d", b->rig->nbus, RIG_BUSES_MAX);
    }
    if (!rig_whole_ns(raw->voltage_delay_s, &delay_ns) || delay_ns % b->rig->tick_ns != 0) {
        return yaml_error(b->error, yaml_place(&raw->mark, "voltage_delay_s"),
                          "found a delay of %.15g s, expected whole ticks of %.15g s",
                          raw->voltage_delay_s, raw->tick_s);
    }
    for (size_t i = 0; i < b->rig->nbus; i++) {
        count += raw->bus[i].bus.nboard;
    }
    board = arena_alloc(b->arena, count, sizeof *board);
    if (!bus || !board || !bus_config || !host_bus) {
        return rig_no_memory(b);
    }

    /* Build each bus and its boards */
    for (size_t i = 0; i < b->rig->nbus; i++) {
        const struct raw_bus *from = &raw->bus[i];

        bus[i] = from->bus;
        bus[i].first_board = n;
        code = rig_load_protocol(b, from, &bus[i]);
        code = code ? code : rig_check_bus(b, from, bus[i].protocol);
        bus_config[i] =
            (struct boards_bus_config){bus[i].protocol, bus[i].fd, from->padded, bus[i].described};
        host_bus[i] = (struct host_bus){bus[i].protocol->name, bus[i].fd, bus[i].described};
        for (size_t k = 0; k < bus[i].nboard && !code; k++) {
            code = rig_build_board(b, (int)i, &from->board[k], &board[n++]);
        }
        if (code) {
            return code;
        }
    }

    b->rig->bus = bus;
    b->rig->host_bus = host_bus;
    b->rig->boards = (struct boards_config){
        .nboard = count,
        .board = board,
        .nbus = b->rig->nbus,
        .bus = bus_config,
        .njoint = b->robot->njoint,
        .nft = b->robot->nft,
        .tick_ns = b->rig->tick_ns,
        .voltage_delay_ticks = (size_t)(delay_ns / b->rig->tick_ns),
    };
    for (size_t i = 0; i < b->rig->nbus && !code; i++) {
        code = bus[i].described ? rig_check_described_ids(b, i) : ERROR_NONE;
    }
    return code;
}

enum error_code rig_check_drives(struct rig_builder *b)
{
    const struct raw_rig *raw = b->raw;

    /* Check that each joint with switches has a board */
    for (size_t i = 0; i < raw->motors.nswitches; i++) {
        const struct raw_switches *switches = &raw->motors.switches[i];
        int joint;
        enum error_code code = rig_find(b, &switches->mark, "joint", switches->joint,
                                        RIG_NAMES(b->robot->joint, b->robot->njoint), &joint);

        if (code) {
            return code;
        }
        if (!b->driver[joint]) {
            return yaml_error(b->error, &switches->mark,
                              "found switches of joint \"%s\", which no board drives, expected one "
                              "that a board drives",
                              switches->joint);
        }
    }

    /* Check that a joint in "undriven" has no board */
    for (size_t i = 0; i < raw->nundriven; i++) {
        int joint;
        enum error_code code = rig_find(b, &raw->undriven[i].mark, "joint", raw->undriven[i].name,
                                        RIG_NAMES(b->robot->joint, b->robot->njoint), &joint);

        if (code) {
            return code;
        }
        if (b->driver[joint]) {
            return yaml_error(
                b->error, &raw->undriven[i].mark,
                "found joint \"%s\", which a board drives (line %d), expected one without",
                raw->undriven[i].name, b->driver[joint]->mark.line);
        }
    }

    /* Check that each driven joint without a board is in "undriven" */
    for (size_t j = 0; j < b->robot->njoint; j++) {
        const struct robot_joint *joint = &b->robot->joint[j];
        bool listed = !robot_joint_is_driven(joint) || b->driver[j];

        for (size_t i = 0; i < raw->nundriven; i++) {
            listed = listed || !strcmp(raw->undriven[i].name, joint->name);
        }
        if (!listed) {
            return yaml_error(b->error, &raw->mark,
                              "found no axis for the drive of joint \"%s\", expected one on some "
                              "board, or the joint in \"undriven\"",
                              joint->name);
        }
    }
    return ERROR_NONE;
}
