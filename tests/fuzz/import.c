/* SPDX-License-Identifier: Apache-2.0 */
/*
 * URDF and MJCF from strangers: a file is refused in words with its place, or gives a robot that
 * passed every check of robots, whose masses add up and whose drives are possible.
 */
#include "app/import/import.h"
#include "model/hydraulics/hydraulic.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <string.h>

/* "FILE:LINE: text", or "FILE: text" of the robot as a whole, or the option that does not suit. */
static bool message_has_place(const char *message, size_t size)
{
    unsigned long line = 1;

    if (!strncmp(message, "--drive: ", 9)) {
        return fuzz_is_sentence(message);
    }
    return fuzz_is_sentence(message) && !strncmp(message, "x.urdf:", 7) &&
           (message[7] == ' ' || (sscanf(message + 7, "%lu:", &line) == 1 && line <= size + 1));
}

static void check_made(const struct import_model *model, const struct import_robot *made)
{
    const struct robot *robot = made->robot;
    double mass = 0;

    for (size_t b = 0; b < robot->nbody; b++) {
        mass += robot->body[b].inertia.mass;
    }
    fuzz_require(isfinite(mass) && mass == robot->total_mass, "%g of %g kg", robot->total_mass,
                 mass);
    fuzz_require(robot->njoint <= model->njoint && robot->nframe <= model->nlink + model->nsensor,
                 "%zu joints", robot->njoint);
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];

        fuzz_require(isfinite(joint->sea.Ks) && isfinite(joint->sea.R) && joint->torque_limit >= 0,
                     "joint %s", joint->name);
        fuzz_require(!joint->hydraulic.present || hydraulic_check(&joint->hydraulic, joint->lower,
                                                                  joint->upper, NULL) == ERROR_NONE,
                     "joint %s", joint->name);
        fuzz_require(joint->lower <= made->rest[j] && made->rest[j] <= joint->upper, "joint %s",
                     joint->name);
    }
    for (size_t i = 0; i < made->robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &made->robot->coupling[i];

        fuzz_require(isfinite(coupling->stiffness) && coupling->stiffness > 0 &&
                         isfinite(coupling->damping) && coupling->damping >= 0,
                     "coupling %zu", i);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct arena *arena = fuzz_arena((size_t)64 << 20);
    static const char *const drive[] = {HIL_SOURCE_DIR "/config/drives/hyq.yaml"};
    struct import_options options = {0};
    struct import_notes notes = {0};
    struct import_model model;
    struct import_robot made;
    struct error error = {0};
    double supply_v;

    /* The first byte chooses the options */
    if (size > 0) {
        options.base = data[0] % 3;
        options.mimic = data[0] / 4 % 4;
        options.drive = drive;
        options.ndrive = data[0] / 16 % 2;
        options.free_slides = data[0] & 64;
        options.repair_inertia = data[0] & 128;
        data++;
        size--;
    }
    if (import_model_text("x.urdf", (const char *)data, size, &options, arena, &model, &notes,
                          &made, &supply_v, &error)) {
        fuzz_require(error.code == ERROR_MEMORY ||
                         (error.code == ERROR_INPUT && message_has_place(error.text, size)),
                     "%d: %s", (int)error.code, error.text);
        fuzz_tally.refused++;
    } else {
        fuzz_require(supply_v > 0, "%g V", supply_v);
        check_made(&model, &made);
        fuzz_tally.taken++;
    }
    return 0;
}
