/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the faults in a rig file and on the command line. Faults use the names of the rig. */

#include "rig/builder_private.h"

/* Bytes of reserved address space for the names of a rig. */
#define NAMES_ARENA ((size_t)4 << 20)

/* Collects the names of a rig for fault_parse. Returns false if no memory is left. */
static bool rig_collect_fault_names(const struct rig *rig, const bool *wire, struct arena *arena,
                                    struct fault_names *names)
{
    const struct robot *robot = rig->robot;
    const char **joint = arena_alloc(arena, robot->njoint + 1, sizeof *joint);
    bool *driven = arena_alloc(arena, robot->njoint + 1, sizeof *driven);
    bool *hydraulic = arena_alloc(arena, robot->njoint + 1, sizeof *hydraulic);
    const char **ft = arena_alloc(arena, robot->nft + 1, sizeof *ft);
    const char **bus = arena_alloc(arena, rig->nbus + 1, sizeof *bus);
    const char **board = arena_alloc(arena, rig->boards.nboard + 1, sizeof *board);
    size_t *board_bus = arena_alloc(arena, rig->boards.nboard + 1, sizeof *board_bus);
    int *board_address = arena_alloc(arena, rig->boards.nboard + 1, sizeof *board_address);

    if (!joint || !driven || !hydraulic || !ft || !bus || !board || !board_bus || !board_address) {
        return false;
    }

    /* Collect the names of the robot, then of the buses and boards */
    for (size_t j = 0; j < robot->njoint; j++) {
        joint[j] = robot->joint[j].name;
        driven[j] = robot_joint_is_driven(&robot->joint[j]);
        hydraulic[j] = robot->joint[j].hydraulic.present;
    }
    for (size_t f = 0; f < robot->nft; f++) {
        ft[f] = robot->ft[f].name;
    }
    for (size_t i = 0; i < rig->nbus; i++) {
        bus[i] = rig->bus[i].name;
    }
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        board[i] = rig->boards.board[i].name;
        board_bus[i] = (size_t)rig->boards.board[i].bus;
        board_address[i] = rig->boards.board[i].address;
    }
    *names = (struct fault_names){
        .njoint = robot->njoint,
        .joint = joint,
        .driven = driven,
        .hydraulic = hydraulic,
        .oil_store = robot->hydraulic_supply.accumulator > 0.0,
        .nft = robot->nft,
        .ft = ft,
        .imu = robot->imu_frame >= 0,
        .nbus = rig->nbus,
        .bus = bus,
        .wire = wire,
        .nboard = rig->boards.nboard,
        .board = board,
        .board_bus = board_bus,
        .board_address = board_address,
    };
    return true;
}

/* Parses a fault line. Refuses faults of external boards, because these boards are real. */
static enum error_code rig_parse_fault(const struct rig *rig, const char *text,
                                       const struct fault_names *names, struct fault *fault,
                                       struct error *error)
{
    enum error_code code = fault_parse(text, names, fault, error);

    if (!code && fault->target == FAULT_BOARD && rig->boards.board[fault->index].external) {
        return error_set(error, ERROR_INPUT,
                         "\"%.100s\": found a fault of board %s, which is external, expected one "
                         "of the simulator's own",
                         text, rig->boards.board[fault->index].name);
    }
    return code;
}

enum error_code rig_faults_create(const struct rig *rig, const char *const *extra, size_t nextra,
                                  uint64_t seed, const bool *wire, struct arena *arena,
                                  struct faults **faults, struct error *error)
{
    size_t count = rig->nfault + nextra;
    struct fault *fault = arena_alloc(arena, count + 1, sizeof *fault);
    struct fault_names names;

    if (!fault || !rig_collect_fault_names(rig, wire, arena, &names)) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu faults", count);
    }

    /* Parse the lines of the rig, then the lines of the command line */
    for (size_t i = 0; i < count; i++) {
        const struct yaml_name *line = i < rig->nfault ? &rig->fault[i] : NULL;

        if (rig_parse_fault(rig, line ? line->name : extra[i - rig->nfault], &names, &fault[i],
                            error)) {
            return line ? error_prefix(error, "%.200s:%d:%d", line->mark.file, line->mark.line,
                                       line->mark.column)
                        : error_prefix(error, "--fault");
        }
    }
    return faults_create(fault, count, seed, arena, faults, error);
}

/* Argument for rig_collect_fault_names that treats each bus as a wire in virtual time. */
static const bool wires[RIG_BUSES_MAX] = {[0 ... RIG_BUSES_MAX - 1] = true};

/* Collects the names of a rig in a new arena, and treats each bus as a wire. After success, the
 * caller must call arena_fini. */
static enum error_code rig_open_fault_names(const struct rig *rig, struct arena *arena,
                                            struct fault_names *names, struct error *error)
{
    enum error_code code = arena_init(arena, NAMES_ARENA, error);

    if (!code && !rig_collect_fault_names(rig, wires, arena, names)) {
        arena_fini(arena);
        return error_set(error, ERROR_MEMORY, "no memory left for the names of faults");
    }
    return code;
}

enum error_code rig_list_faults(const struct rig *rig, fault_list_put put, void *context,
                                struct error *error)
{
    struct fault_names names;
    struct arena arena;
    enum error_code code = rig_open_fault_names(rig, &arena, &names, error);

    if (!code) {
        faults_list(&names, put, context);
        arena_fini(&arena);
    }
    return code;
}

enum error_code rig_check_fault(const struct rig *rig, const struct yaml_name *line,
                                struct fault *fault, struct error *error)
{
    struct fault_names names;
    struct arena arena;
    enum error_code code = rig_open_fault_names(rig, &arena, &names, error);

    if (code) {
        return code;
    }
    code = rig_parse_fault(rig, line->name, &names, fault, error);
    if (code) {
        error_prefix(error, "%.200s:%d:%d", line->mark.file, line->mark.line, line->mark.column);
    }
    arena_fini(&arena);
    return code;
}

/* Checks the fault lines of the rig file. Each bus counts as a wire, because the kind of a bus is
 * known only when a run opens it. */
enum error_code rig_build_faults(struct rig_builder *b)
{
    struct faults *unused;

    if (rig_faults_create(b->rig, NULL, 0, b->rig->seed, wires, b->arena, &unused, b->error)) {
        bool placed = !strncmp(b->error->text, b->raw->mark.file, strlen(b->raw->mark.file));

        return placed ? b->error->code : error_prefix(b->error, "%.200s", b->raw->mark.file);
    }
    return ERROR_NONE;
}
