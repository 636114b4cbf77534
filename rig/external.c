/* SPDX-License-Identifier: Apache-2.0 */
/* Checks which boards of a rig file may be external: real ones on the same bus. */
#include "boards/protocol_list.h"
#include "rig/builder_private.h"

/* Refuses keys that only an external board may have. */
static enum error_code external_check_keys(struct rig_builder *b, const struct raw_board *raw)
{
    if (!raw->board.external && yaml_has(&raw->mark, "external_timeout_s")) {
        return yaml_error(b->error, yaml_mark(&raw->mark, "external_timeout_s"),
                          "found external_timeout_s without external: true, expected both or none");
    }
    if (!raw->board.external && yaml_has(&raw->mark, "external_follows")) {
        return yaml_error(b->error, yaml_mark(&raw->mark, "external_follows"),
                          "found external_follows without external: true, expected both or none");
    }
    return ERROR_NONE;
}

/* Checks an external board: the host's codec must read its frames without having configured it. */
enum error_code rig_check_external(struct rig_builder *b, const struct raw_board *raw,
                                   const struct protocol *protocol)
{
    char list[RIG_LIST];

    if (!raw->board.external) {
        return external_check_keys(b, raw);
    }
    if (!protocol->external) {
        return yaml_error(b->error, yaml_mark(&raw->mark, "external"),
                          "found external: true with personality %s, expected it with %s only",
                          protocol->name,
                          protocols_list(offsetof(struct protocol, external), list, sizeof list));
    }
    if (raw->board.kind != BOARD_MOTOR && raw->board.kind != BOARD_FT) {
        return yaml_error(b->error, yaml_mark(&raw->mark, "external"),
                          "found external: true on a board of another kind, expected it on a motor "
                          "or an F/T board");
    }

    /* What its joints follow: only those of motor boards can */
    if (yaml_has(&raw->mark, "external_follows") && raw->board.kind != BOARD_MOTOR) {
        return yaml_error(b->error, yaml_mark(&raw->mark, "external_follows"),
                          "found external_follows on an F/T board, expected it on a motor board: "
                          "no joint follows a sensor");
    }
    if (raw->external_torque && !protocol->external_torque) {
        return yaml_error(
            b->error, yaml_mark(&raw->mark, "external_follows"),
            "found external_follows: torque with personality %s, expected it with %s "
            "only, whose motor boards tell the torque of their joints",
            protocol->name,
            protocols_list(offsetof(struct protocol, external_torque), list, sizeof list));
    }
    return ERROR_NONE;
}

enum error_code rig_check_external_axis(struct rig_builder *b, const struct raw_board *raw,
                                        const struct yaml_name *name,
                                        const struct robot_joint *joint)
{
    if (raw->board.external && joint->hydraulic.present) {
        return yaml_error(b->error, &name->mark,
                          "found joint \"%s\" with a hydraulic drive on an external board, "
                          "expected one with a motor: there is no rotor that could follow",
                          name->name);
    }
    if (raw->external_torque && joint->sea.Ks <= 0.0) {
        return yaml_error(b->error, &name->mark,
                          "found joint \"%s\" without a spring on a board with external_follows: "
                          "torque, expected one with a spring, which exerts it",
                          name->name);
    }
    return ERROR_NONE;
}
