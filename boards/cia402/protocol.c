/* SPDX-License-Identifier: Apache-2.0 */
/* Describes the frames of a cia402 bus (boards/cia402/protocol.h), and the protocol as a module. */
#include "boards/cia402/private.h"

#include "base/text.h"
#include "boards/protocol_list.h"
#include "manual/protocol_cia402.h"

enum { AXIS_STEP = 0x100 }; /* distance between the PDO identifiers of two axes */

/* clang-format off */
#define FIELDS(...) (const struct field[]){__VA_ARGS__, {.type = FIELD_END}}
#define VALUE(kind, label, of, by) {.type = kind, .name = label, .unit = of, .scale = by}
#define NUMBER(kind, label) {.type = kind, .name = label}
#define NAMED(kind, label, list) {.type = kind, .name = label, .values = list}

static const struct field_value nmt_commands[] = {
    {CIA402_NMT_START, "start"}, {CIA402_NMT_STOP, "stop"},
    {CIA402_NMT_PRE_OPERATIONAL, "pre_operational"}, {CIA402_NMT_RESET_NODE, "reset_node"},
    {CIA402_NMT_RESET_COMMUNICATION, "reset_communication"}, {0, NULL}};
static const struct field_value nmt_states[] = {
    {CIA402_BOOT_UP, "boot_up"}, {CIA402_STOPPED, "stopped"}, {CIA402_OPERATIONAL, "operational"},
    {CIA402_PRE_OPERATIONAL, "pre_operational"}, {0, NULL}};
static const struct field sdo[] = {
    NUMBER(FIELD_U8, "specifier"), NUMBER(FIELD_U16, "index"), NUMBER(FIELD_U8, "sub_index"),
    NUMBER(FIELD_U32, "data"), {.type = FIELD_END}};

/* Fields of the PDOs by the name of their plan; each field is a mapped object */
static const struct {
    const char *name;
    const struct field *fields;
} plans[] = {
    {"TELEMETRY", FIELDS(VALUE(FIELD_I32, "motor_encoder", "rad", CIA402_POSITION_RAD),
                         VALUE(FIELD_I16, "deflection", "rad", CIA402_POSITION_RAD),
                         VALUE(FIELD_I16, "spring_torque", "Nm", CIA402_SPRING_NM))},
    {"STATUS", FIELDS(NUMBER(FIELD_U16, "statusword"))},
    {"VOLTAGE", FIELDS(VALUE(FIELD_I16, "target_voltage", "V", CIA402_VOLTAGE_V))},
    {"CONTROL", FIELDS(NUMBER(FIELD_U16, "controlword"))},
    {"FORCE", FIELDS(VALUE(FIELD_I16, "fx", "N", CIA402_FORCE_N),
                     VALUE(FIELD_I16, "fy", "N", CIA402_FORCE_N),
                     VALUE(FIELD_I16, "fz", "N", CIA402_FORCE_N))},
    {"MOMENT", FIELDS(VALUE(FIELD_I16, "mx", "Nm", CIA402_MOMENT_NM),
                      VALUE(FIELD_I16, "my", "Nm", CIA402_MOMENT_NM),
                      VALUE(FIELD_I16, "mz", "Nm", CIA402_MOMENT_NM))},
    {"ACCELERATION", FIELDS(VALUE(FIELD_I16, "ax", "m/s2", CIA402_ACCELERATION_M_S2),
                            VALUE(FIELD_I16, "ay", "m/s2", CIA402_ACCELERATION_M_S2),
                            VALUE(FIELD_I16, "az", "m/s2", CIA402_ACCELERATION_M_S2))},
    {"RATE", FIELDS(VALUE(FIELD_I16, "wx", "rad/s", CIA402_RATE_RAD_S),
                    VALUE(FIELD_I16, "wy", "rad/s", CIA402_RATE_RAD_S),
                    VALUE(FIELD_I16, "wz", "rad/s", CIA402_RATE_RAD_S))},
    {"ORIENTATION", FIELDS(VALUE(FIELD_I16, "qw", NULL, CIA402_QUATERNION),
                           VALUE(FIELD_I16, "qx", NULL, CIA402_QUATERNION),
                           VALUE(FIELD_I16, "qy", NULL, CIA402_QUATERNION),
                           VALUE(FIELD_I16, "qz", NULL, CIA402_QUATERNION))},
    {"MAGNETIC", FIELDS(VALUE(FIELD_I16, "bx", "uT", CIA402_MAGNETIC_UT),
                        VALUE(FIELD_I16, "by", "uT", CIA402_MAGNETIC_UT),
                        VALUE(FIELD_I16, "bz", "uT", CIA402_MAGNETIC_UT))},
};

/* Messages of the services: of a node, and from the host to all nodes. The cycle is the one that
 * this program's host configures; 0 = on demand */
#define SERVICE(label, cob_id, host, size, cycle_ms, reply, list)                                  \
    {.name = label, .base = cob_id, .from_host = host, .length = size, .cycle_ns = cycle_ms * MS,  \
     .answer = reply, .fields = list, .repeats = 1, .slot = -1}

static const struct message services[] = {
    SERVICE("EMCY", CIA402_EMCY, false, CIA402_EMCY_LENGTH, 0, NULL,
            FIELDS(NUMBER(FIELD_U16, "code"), NUMBER(FIELD_U8, "error_register"),
                   NUMBER(FIELD_U8, "axis"), NUMBER(FIELD_U32, "faults"))),
    SERVICE("SDO_REQUEST", CIA402_SDO_REQUEST, true, CIA402_SDO_LENGTH, 0, "SDO_REPLY", sdo),
    SERVICE("SDO_REPLY", CIA402_SDO_REPLY, false, CIA402_SDO_LENGTH, 0, NULL, sdo),
    SERVICE("HEARTBEAT", CIA402_HEARTBEAT, false, 1, CIA402_HEARTBEAT_MS, NULL,
            FIELDS({.type = 7, .name = "state", .values = nmt_states},
                   {.type = 1, .name = "toggle"})),
}, broadcasts[] = {
    SERVICE("NMT", CIA402_NMT, true, CIA402_NMT_LENGTH, 0, NULL,
            FIELDS(NAMED(FIELD_U8, "command", nmt_commands), NUMBER(FIELD_U8, "node"))),
    SERVICE("SYNC", CIA402_SYNC, true, 0, 1, NULL, NULL),
};
/* clang-format on */

enum cia402_kind cia402_kind_of(const struct board_config *board)
{
    return board->kind == BOARD_MOTOR      ? CIA402_KIND_DRIVE
           : board->kind == BOARD_INERTIAL ? CIA402_KIND_INERTIAL
                                           : CIA402_KIND_FT;
}

const struct field *cia402_plan_fields(const struct cia402_plan *plan)
{
    const int at = TEXT_FIND(plans, ARRAY_COUNT(plans), name, plan->name);

    return at < 0 ? NULL : plans[at].fields;
}

/* Visits a message of a board, or of the host to all nodes (board = MESSAGE_NO_BOARD). Sets its
 * identifier, sender and receiver from the board's address. */
static void cia402_visit(struct message_walk *walk, int board, struct message message)
{
    if (board != MESSAGE_NO_BOARD) {
        message.step = 1;
        message.number = walk->config->board[board].address;
    }
    message.id += message.base + message.number;
    message.counts = MESSAGE_OF_NODE;
    message.sender = message.from_host ? MESSAGE_NO_BOARD : board;
    message.receiver = message.from_host ? board : MESSAGE_NO_BOARD;
    message.code = MESSAGE_NO_CODE;
    message.section = message.from_host ? MESSAGE_FROM_HOST : MESSAGE_FROM_BOARDS;
    message_visit(walk, &message);
}

static void cia402_visit_broadcasts(struct message_walk *walk)
{
    for (size_t i = 0; i < ARRAY_COUNT(broadcasts); i++) {
        cia402_visit(walk, MESSAGE_NO_BOARD, broadcasts[i]);
    }
}

/* Visits the messages of a board: first the PDOs that this program's host sets up (struct
 * cia402_plan), then the services. */
static void cia402_visit_board(struct message_walk *walk, int index, unsigned first_slot)
{
    const struct board_config *board = &walk->config->board[index];
    int64_t period_ns = board->period_ns > 0 ? board->period_ns : MS;
    struct cia402_plan plan;

    for (unsigned row = 0;
         cia402_plan_row(cia402_kind_of(board), board_config_axes(board), row, &plan); row++) {
        const struct field *fields = cia402_plan_fields(&plan);
        bool of_axis = plan.axis < CIA402_BOARD_AXES;
        bool list = board->kind == BOARD_MOTOR && !of_axis && fields_count(fields) == 1;
        unsigned axis = of_axis ? plan.axis : 0;

        /* Telemetry and voltages have the cycle of SYNC: the rig's period, or 1 ms */
        cia402_visit(walk, index,
                     (struct message){
                         .name = plan.name,
                         .id = AXIS_STEP * axis,
                         .base = plan.cob_id - AXIS_STEP * axis,
                         .axis_step = of_axis ? AXIS_STEP : 0,
                         .from_host = plan.receive,
                         .length = plan.length,
                         .cycle_ns = (uint32_t)(plan.event_ms      ? plan.event_ms * MS
                                                : plan.type <= 240 ? plan.type * period_ns
                                                : plan.number == 0 ? MS
                                                                   : 0),
                         .fields = fields,
                         .repeats = (uint8_t)(plan.length / fields_bytes(fields)),
                         .slot = of_axis || list ? (int)(first_slot + axis) : -1,
                         .list = list,
                     });
    }
    for (size_t i = 0; i < ARRAY_COUNT(services); i++) {
        cia402_visit(walk, index, services[i]);
    }
}

/* ---- the module ---- */

/* Returns whether an identifier is reserved on a cia402 bus: up to the SDO answer of the last node
 * (0x59f), or an SDO request (0x600 to 0x61f). */
static bool cia402_claims_id(const struct boards_bus_config *bus, uint32_t id, char *text,
                             size_t size)
{
    snprintf(text, size,
             "cia402 boards, expected one from 0x5a0 to 0x5ff, 0x620 to 0x67f or 0x6c0 to 0x6ff");
    return bus && (id <= CIA402_SDO_REPLY + CIA402_NODE_MAX ||
                   (id >= CIA402_SDO_REQUEST && id <= CIA402_SDO_REQUEST + CIA402_NODE_MAX));
}

/* Visits the periodic frames of a board: TPDOs at their SYNCs, TPDOs on change at the period of
 * their event timer, and the heartbeat. */
static void cia402_visit_board_load(struct load_walk *walk, const struct board_config *board)
{
    double period_s = load_period_s(walk, board->period_ns);
    struct cia402_plan plan;

    load_visit(walk, 1, CIA402_HEARTBEAT_MS * 1e-3);
    for (unsigned i = 0; cia402_plan_row(cia402_kind_of(board), load_axes(board), i, &plan); i++) {
        if (!plan.receive) {
            load_visit(walk, plan.length,
                       plan.event_ms ? plan.event_ms * 1e-3 : plan.type * period_s);
        }
    }
}

/* Visits the periodic frames of the host: SYNC, and the voltages of all axes of each node. */
static void cia402_visit_command_load(struct load_walk *walk)
{
    load_visit(walk, 0, load_period_s(walk, 0));
    for (size_t i = 0; i < walk->config->nboard; i++) {
        const struct board_config *board = &walk->config->board[i];

        if (board->bus == walk->index && load_axes(board) > 0) {
            load_visit(walk, 2 * load_axes(board), load_period_s(walk, 0));
        }
    }
}

/* Returns the name of a CiA 402 state; the board reports the state as its mode. */
static const char *cia402_state_name(uint32_t state)
{
    static const char *const names[CIA402_STATES] = {
        [CIA402_NOT_READY] = "not ready to switch on",
        [CIA402_SWITCH_ON_DISABLED] = "switch on disabled",
        [CIA402_READY_TO_SWITCH_ON] = "ready to switch on",
        [CIA402_SWITCHED_ON] = "switched on",
        [CIA402_OPERATION_ENABLED] = "operation enabled",
        [CIA402_QUICK_STOP_ACTIVE] = "quick stop active",
        [CIA402_FAULT_REACTION_ACTIVE] = "fault reaction active",
        [CIA402_FAULT] = "fault",
    };

    return state < CIA402_STATES ? names[state] : "unknown";
}

static const char *const cia402_fault_names[] = {
    "under-voltage", "over-voltage",   "over-current",  "motor encoder",
    "link encoder",  "torque sensor",  "temperature",   "following error",
    "connection",    "stale command",  "limit",         "saturated",
    "no reading",    "under-pressure", "over-pressure", NULL};

const struct protocol protocol_cia402 = {
    .name = "cia402",
    .summary = "CANopen drives (CiA 301, CiA 402), one to four axes a node, and sensors",
    .motor_address_max = CIA402_NODE_MAX,
    .address_max = CIA402_NODE_MAX,
    .axes_max = CIA402_BOARD_AXES,
    .switches = true,
    /* assumed: drives differ, and the standard only bounds it by the host's time-out */
    .reply = {.delay_ns = 200000},
    .bus = &cia402_bus_ops,
    .board = {[BOARD_MOTOR] = &cia402_motor_ops,
              [BOARD_FT] = &cia402_ft_ops,
              [BOARD_INERTIAL] = &cia402_inertial_ops},
    .visit_broadcasts = cia402_visit_broadcasts,
    .visit_board = cia402_visit_board,
    .claims_id = cia402_claims_id,
    .visit_board_load = cia402_visit_board_load,
    .visit_command_load = cia402_visit_command_load,
    .mode_name = cia402_state_name,
    .fault_names = cia402_fault_names,
    .modes_are_states = true,
    .timeout_text = "reference set to 0",
    .limit_text = "x 1e-5 rad, only commands that lead back are obeyed",
    .help = MANUAL_PROTOCOL_CIA402,
    .print_appendix = cia402_print_objects,
    .write_eds = cia402_eds_write,
};
