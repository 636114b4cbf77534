/* SPDX-License-Identifier: Apache-2.0 */
/* Records a run: rows of signals and body poses, frames of the wires, events. */
#include "model/spatial.h"
#include "sim/contact_arrows.h"
#include "sim/scene_message.h"
#include "sim/simulator_private.h"

#include <math.h>
#include <stdlib.h>

/* The recording of one wire. */
struct bus_tap {
    struct recorder *recorder;
    size_t bus;
};

/* ---- rows ---- */

void simulator_record_row(struct simulator *simulator)
{
    if (simulator->recorder && simulator->status.tick % simulator->row_ticks == 0) {
        /* Writes the poses of the robot's bodies, then of the free bodies: position (m), quaternion
         * wxyz */
        double *to = simulator_fill_signals(simulator, simulator->row);
        const struct rig *rig = simulator->config.rig;
        const struct body_motion *motion = plant_whole_motion(simulator->plant);

        for (size_t b = 0; b < rig->robot->nbody; b++) {
            memcpy(to, motion[b].p, sizeof motion[b].p);
            quaternion_from_mat3(motion[b].R, to + 3);
            to += RECORDER_POSE;
        }
        for (size_t i = 0; i < rig->nfree; i++) {
            plant_free_pose(simulator->plant, i, to);
            to += RECORDER_POSE;
        }
        recorder_row(simulator->recorder, simulator->status.time_ns, simulator->row);
    }
}

/* ---- wires ---- */

/* Records a frame that a wire has carried, with the wire's time. */
static void recorder_tap_frame(void *context, const struct bus_frame *frame)
{
    const struct bus_tap *tap = context;

    recorder_frame(tap->recorder, tap->bus, frame, frame->time_ns);
}

/* Makes the wires of timed buses record the frames that they carry. */
static enum error_code simulator_tap_wires(struct simulator *simulator, struct error *error)
{
    const size_t nbus = simulator->config.rig->nbus;
    struct bus_tap *tap = arena_alloc(simulator->arena, nbus, sizeof *tap);

    if (!tap) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder's buses");
    }
    for (size_t b = 0; b < nbus && simulator->buses.timed; b++) {
        tap[b] = (struct bus_tap){simulator->recorder, b};
        buses_tap(&simulator->buses, b, recorder_tap_frame, &tap[b]);
    }
    return ERROR_NONE;
}

/* ---- contact ---- */

/* Length of the arrow for the robot's weight, m, as on the viewer's page. */
#define WEIGHT_ARROW_M 0.42
#define GRAVITY_M_S2 9.81

/* Selects the wrenches that are shown as arrows; NULL = no memory. */
static struct contact_arrows *recording_find_contacts(struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;
    size_t count = rig->contact.nbody;
    struct contact_shown *contact = arena_alloc(simulator->arena, count + 1, sizeof *contact);
    struct contact_arrows *arrows = arena_alloc(simulator->arena, 1, sizeof *arrows);

    if (!contact || !arrows) {
        return NULL;
    }
    for (size_t c = 0; c < count; c++) {
        contact[c] = (struct contact_shown){
            .signal = simulator_contact_column(simulator, c),
            .body = (size_t)rig->contact_body[c],
        };
    }
    *arrows = (struct contact_arrows){
        .ncontact = count,
        .contact = contact,
        .arrow_m_per_n = WEIGHT_ARROW_M / fmax(1.0, GRAVITY_M_S2 * rig->robot->total_mass),
    };

    /* The first plane of the world is the ground */
    for (size_t s = 0; s < rig->contact.nsurface && !arrows->has_ground; s++) {
        const struct contact_surface *surface = &rig->contact.surface[s];

        arrows->has_ground = surface->body < 0 && surface->shape == CONTACT_HALF_SPACE;
        for (int k = 0; k < 3; k++) {
            arrows->ground_point[k] = surface->position[k];
            arrows->ground_normal[k] = surface->rotation[3 * k + 2];
        }
    }
    return arrows;
}

/* ---- opening ---- */

enum error_code simulator_create_recorder(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct recorder_config recorder = {
        .directory = config->record,
        .overwrite = config->overwrite,
        .lossless = config->clock != LOOP_CLOCK_REAL,
        .nbus = config->rig->nbus,
        .bus = simulator->buses.interface,
        .signal = simulator->title,
        .nsignal = simulator->nrecorded,
        .format = config->record_format,
    };
    enum error_code code = ERROR_NONE;

    if (!config->record) {
        return ERROR_NONE;
    }
    /* A row holds the signals, then the poses */
    size_t *count = &recorder.nbody;
    const struct rig *rig = simulator->config.rig;
    const char **name = arena_alloc(simulator->arena, rig->robot->nbody + rig->nfree, sizeof *name);

    *count = 0;
    for (size_t b = 0; name && b < rig->robot->nbody; b++) {
        name[(*count)++] = rig->robot->body[b].name;
    }
    for (size_t i = 0; name && i < rig->nfree; i++) {
        name[(*count)++] = rig->free[i].name;
    }
    recorder.body = name;
    simulator->row =
        arena_alloc(simulator->arena, simulator->nrecorded + RECORDER_POSE * recorder.nbody + 1,
                    sizeof(double));
    simulator->row_ticks = (uint64_t)(config->row_period_ns / config->rig->tick_ns);
    if (!simulator->row || !recorder.body) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder's signals");
    }
    if (recorder.format & RECORDER_MCAP) {
        struct recorder_channel *channel = arena_alloc(simulator->arena, 2, sizeof *channel);
        struct contact_arrows *arrows = recording_find_contacts(simulator);
        struct memory_file scene = {.text = NULL};

        /* Add the channels that viewers draw: the scene once, contacts in each row */
        code = scene_message_make(rig, &scene, error);
        if (!code && channel && arrows) {
            channel[0] = (struct recorder_channel){
                .topic = "/scene",
                .type = "foxglove.SceneUpdate",
                .schema = recorder_schema_scene,
                .first = arena_strdup(simulator->arena, scene.text),
            };
            channel[1] = contact_arrows_channel(arrows);
            recorder.channel = channel;
            recorder.nchannel = arrows->ncontact ? 2 : 1;
        }
        free(scene.text);
        code = code || (recorder.nchannel && channel[0].first)
                   ? code
                   : error_set(error, ERROR_MEMORY, "no memory left for the recorder's channels");
    }
    code = code ? code : recorder_open(&recorder, simulator->arena, &simulator->recorder, error);
    return code ? code : simulator_tap_wires(simulator, error);
}
