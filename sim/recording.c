/* SPDX-License-Identifier: Apache-2.0 */
/* What a run records: rows of signals and of the poses of bodies, frames of its wires, events. */
#include "model/spatial.h"
#include "sim/scene_message.h"
#include "sim/simulator_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The recording of one wire. */
struct bus_tap {
    struct recorder *recorder;
    size_t bus;
};

/* ---- rows ---- */

/* Bodies of the robot, then free ones. */
static void recording_fill_poses(const struct simulator *simulator, double *to)
{
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
}

void simulator_record_row(struct simulator *simulator)
{
    if (simulator->recorder && simulator->status.tick % simulator->row_ticks == 0) {
        recording_fill_poses(simulator, simulator_fill_signals(simulator, simulator->row));
        recorder_row(simulator->recorder, simulator->status.time_ns, simulator->row);
    }
}

static const char *const *recording_body_names(struct simulator *simulator, size_t *count)
{
    const struct rig *rig = simulator->config.rig;
    const char **name = arena_alloc(simulator->arena, rig->robot->nbody + rig->nfree, sizeof *name);

    *count = 0;
    for (size_t b = 0; name && b < rig->robot->nbody; b++) {
        name[(*count)++] = rig->robot->body[b].name;
    }
    for (size_t i = 0; name && i < rig->nfree; i++) {
        name[(*count)++] = rig->free[i].name;
    }
    return name;
}

/* ---- wires ---- */

/* Records a frame that a wire has carried, with the wire's time. */
static void recorder_tap_frame(void *context, const struct bus_frame *frame)
{
    const struct bus_tap *tap = context;

    recorder_frame(tap->recorder, tap->bus, frame, frame->time_ns);
}

/* Has the wires of timed buses record what they carry. */
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

/* Length of an arrow of the robot's weight, as on the page */
#define WEIGHT_ARROW_M 0.42
#define GRAVITY_M_S2 9.81

/* Which wrenches are shown as arrows. */
static enum error_code recording_find_contacts(struct simulator *simulator,
                                               struct recorder_contacts *contacts,
                                               struct error *error)
{
    const struct rig *rig = simulator->config.rig;
    size_t count = rig->contact.nbody;
    struct recorder_contact *contact = arena_alloc(simulator->arena, count + 1, sizeof *contact);

    if (!contact) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder's contacts");
    }
    for (size_t c = 0; c < count; c++) {
        contact[c] = (struct recorder_contact){
            .signal = simulator_contact_column(simulator, c),
            .body = (size_t)rig->contact_body[c],
        };
    }
    *contacts = (struct recorder_contacts){
        .ncontact = count,
        .contact = contact,
        .arrow_m_per_n = WEIGHT_ARROW_M / fmax(1.0, GRAVITY_M_S2 * rig->robot->total_mass),
    };

    /* The first plane of the world is the ground */
    for (size_t s = 0; s < rig->contact.nsurface && !contacts->has_ground; s++) {
        const struct contact_surface *surface = &rig->contact.surface[s];

        contacts->has_ground = surface->body < 0 && surface->shape == CONTACT_HALF_SPACE;
        for (int k = 0; k < 3; k++) {
            contacts->ground_point[k] = surface->position[k];
            contacts->ground_normal[k] = surface->rotation[3 * k + 2];
        }
    }
    return ERROR_NONE;
}

/* ---- opening ---- */

/* The scene, in the arena. */
static enum error_code recording_make_scene(struct simulator *simulator, const char **scene,
                                            struct error *error)
{
    struct memory_file text = {.text = NULL};
    enum error_code code = scene_message_make(simulator->config.rig, &text, error);

    *scene = code ? NULL : arena_strdup(simulator->arena, text.text);
    free(text.text);
    return code || *scene ? code : error_set(error, ERROR_MEMORY, "no memory left for the scene");
}

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
    recorder.body = recording_body_names(simulator, &recorder.nbody);
    simulator->row =
        arena_alloc(simulator->arena, simulator->nrecorded + RECORDER_POSE * recorder.nbody + 1,
                    sizeof(double));
    simulator->row_ticks = (uint64_t)(config->row_period_ns / config->rig->tick_ns);
    if (!simulator->row || !recorder.body) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder's signals");
    }
    if (recorder.format & RECORDER_MCAP) {
        code = recording_make_scene(simulator, &recorder.scene, error);
        code = code ? code : recording_find_contacts(simulator, &recorder.contacts, error);
    }
    code = code ? code : recorder_open(&recorder, simulator->arena, &simulator->recorder, error);
    return code ? code : simulator_tap_wires(simulator, error);
}
