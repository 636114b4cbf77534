/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Rig files and what they refer to: an input is the rig, then, each behind a line of its own, "%%%
 * b" (a rig that the first may extend), "%%% r" (the robot) and "%%% m" (a mesh); what is not given
 * is that of tests/unit/rig/rig_files.h. Refused with a place in one of the files, or a rig that
 * all who get a part of it take: contact, boards, sensors, faults, the export of the protocol.
 */
#include "rig/rig.h"

#include "rig/dbc.h"
#include "tests/fuzz/fuzz.h"
#include "tests/unit/rig/rig_files.h"

#include <math.h>

enum { FILES = 4 };

static const char *const file_names[FILES] = {"config/rigs/toy.yaml", "config/rigs/base.yaml",
                                              "config/robots/toy.yaml", "config/meshes/toy.obj"};

struct section {
    const char *text;
    size_t size;
};

static void leave(void)
{
    char path[128];

    snprintf(path, sizeof path, "%s/%s", tree, file_names[1]);
    unlink(path);
    remove_tree();
}

/* Cuts the input at its marks; a file that is named twice is what is said last. */
static void cut(const char *text, size_t size, struct section section[FILES])
{
    static const char mark[] = "\n%%% ", letters[] = ".brm";
    const char *end = text + size;
    size_t file = 0;

    while (text) {
        const char *next = memmem(text, (size_t)(end - text), mark, sizeof mark - 1);

        section[file] = (struct section){text, (size_t)((next ? next + 1 : end) - text)};
        text = NULL;
        if (next && end - next > (ptrdiff_t)sizeof mark && next[sizeof mark - 1] &&
            strchr(letters, next[sizeof mark - 1])) {
            file = (size_t)(strchr(letters, next[sizeof mark - 1]) - letters);
            text = next + sizeof mark; /* behind the letter: the rest of the line is empty */
        }
    }
}

static void write_files(const char *text, size_t size)
{
    struct section section[FILES] = {
        {NULL, 0},
        {toy_rig, sizeof toy_rig - 1},
        {toy_robot, sizeof toy_robot - 1},
        {toy_mesh, sizeof toy_mesh - 1},
    };

    cut(text, size, section);
    for (size_t i = 0; i < FILES; i++) {
        fuzz_require(write_file(file_names[i], section[i].text, section[i].size) == 0, "%s",
                     file_names[i]);
    }
}

/* A place in one of the files; what is wrong with a file as a whole has none. */
static bool has_place(const char *message)
{
    static const char *const whole[] = {"cannot be read", "cannot be opened", "found a directory",
                                        "no regular file"};
    char prefix[96];
    int line, column;

    for (size_t i = 0; i < sizeof whole / sizeof *whole; i++) {
        if (strstr(message, whole[i])) {
            return fuzz_is_sentence(message);
        }
    }
    for (size_t i = 0; i < FILES; i++) {
        snprintf(prefix, sizeof prefix, "%s/%s:", tree, file_names[i]);
        if (!strncmp(message, prefix, strlen(prefix))) {
            return fuzz_is_sentence(message) &&
                   sscanf(message + strlen(prefix), "%d:%d: ", &line, &column) == 2 && line > 0 &&
                   column > 0;
        }
    }
    return false;
}

static void check_robot(const struct robot *robot)
{
    for (size_t i = 0; i < robot->nbody; i++) {
        const struct robot_body *body = &robot->body[i];

        fuzz_require(body->parent < (int)i && isfinite(body->inertia.mass) &&
                         robot_check_inertia(&body->inertia, NULL) == ERROR_NONE,
                     "%s", body->name);
    }
    for (size_t i = 0; i < robot->njoint; i++) {
        const struct robot_joint *joint = &robot->joint[i];

        fuzz_require(joint->lower <= joint->upper && isfinite(joint->torque_limit), "%s",
                     joint->name);
        fuzz_require(!joint->hydraulic.present ||
                         (!joint->sea.present && joint->hydraulic.A2 > 0.0 &&
                          robot->hydraulic_supply.pressure > robot->hydraulic_supply.back),
                     "%s", joint->name);
        fuzz_require(!joint->sea.present || (joint->sea.J > 0.0 && joint->sea.R > 0.0), "%s",
                     joint->name);
    }
    fuzz_require(isfinite(robot->total_mass), "%g kg", robot->total_mass);
}

static void check_buses(const struct rig *rig, struct arena *arena)
{
    struct error error = {0};
    struct dbc *dbc;
    double telemetry, command;
    char text[512];

    for (size_t bus = 0; bus < rig->nbus; bus++) {
        rig_bus_load(rig, bus, rig->tick_ns, &telemetry, &command);
        fuzz_require(isfinite(telemetry) && telemetry >= 0.0 && isfinite(command) && command >= 0.0,
                     "%g and %g bit/s", telemetry, command);
        fuzz_require(!rig_bus_over_budget(rig, bus, text, sizeof text) || fuzz_is_sentence(text),
                     "%s", text);
        if (rig_dbc(rig, bus, arena, &dbc, &error)) {
            fuzz_require(error.code == ERROR_INPUT && fuzz_is_sentence(error.text), "%s",
                         error.text);
        }
    }
}

static void check_rig(const struct rig *rig, struct arena *arena)
{
    bool *wire = arena_alloc(arena, rig->nbus + 1, sizeof *wire);
    struct boards_config boards_config = rig->boards;
    struct sensing_config sensing_config = rig->sensing;
    struct error error = {0};
    struct boards *boards;
    struct sensing *sensing;

    fuzz_require(rig->tick_ns > 0 && rig->substep_ns > 0 &&
                     rig->tick_ns == (int64_t)rig->substeps * rig->substep_ns,
                 "%lld ns, %lld ns", (long long)rig->tick_ns, (long long)rig->substep_ns);
    fuzz_require(rig->supply_v > 0.0 && isfinite(rig->supply_v), "%g V", rig->supply_v);
    check_robot(rig->robot);
    fuzz_require(rig->contact_engine == RIG_CONTACT_NONE ||
                     contact_config_check(&rig->contact, &error) == ERROR_NONE,
                 "%s", error.text);
    for (size_t i = 0; i < rig->nfree; i++) {
        fuzz_require(plant_check_free_body(&rig->free[i], &error) == ERROR_NONE, "%s", error.text);
    }
    fuzz_require(wire, "no memory");
    memset(wire, 1, rig->nbus * sizeof *wire);
    fuzz_require(rig_faults_create(rig, NULL, 0, rig->seed, wire, arena,
                                   (struct faults **)(uintptr_t)&boards_config.faults,
                                   &error) == ERROR_NONE,
                 "%s", error.text);
    fuzz_require(boards_create(&boards_config, arena, &boards, &error) == ERROR_NONE, "%s",
                 error.text);
    sensing_config.faults = boards_config.faults;
    if (sensing_create(&sensing_config, arena, &sensing, &error)) {
        fuzz_require(error.code == ERROR_MEMORY, "%s", error.text); /* long delay lines */
    }
    check_buses(rig, arena);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct arena *arena = fuzz_arena((size_t)64 << 20);
    const struct rig *rig = NULL;
    struct error error = {0};
    static bool made;

    if (!made) {
        fuzz_require(make_tree() == 0 && atexit(leave) == 0, "no folder");
        made = true;
    }
    write_files((const char *)data, size);
    if (rig_load(rig_path, arena, &rig, &error)) {
        fuzz_require((error.code == ERROR_INPUT || error.code == ERROR_UNSUPPORTED) &&
                         has_place(error.text),
                     "%d: %s", (int)error.code, error.text);
        fuzz_tally.refused++;
    } else {
        check_rig(rig, arena);
        fuzz_tally.taken++;
    }
    return 0;
}
