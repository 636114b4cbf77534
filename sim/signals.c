/* SPDX-License-Identifier: Apache-2.0 */
/* The signals of a run, their titles and rows: for signals.csv and for subscribers. */
#include "sim/private.h"

#include <stdio.h>
#include <string.h>

enum {
    SIGNALS_PER_JOINT = 5,
    SIGNALS_PER_CONTACT = 6,
    SIGNALS_PER_PAIR = 6,
    SIGNALS_BASE = 7,
    SIGNALS_PER_FREE = 7,
    SIGNALS_PER_BUS = 2
};
enum { TITLE_SIZE = 192 };
enum { STREAM_ROWS = 1024 }; /* a second at 1 kHz */

/* Where the recording of a wire goes. */
struct bus_tap {
    struct recorder *recorder;
    size_t bus;
};

/* ---- rows ---- */

/* what each pair of surfaces does to its second one; the moment is about the middle of the patch */
static void record_pairs(const struct simulator *simulator, double *to)
{
    size_t npair = simulator->config.rig->contact.npair, count;

    memset(to, 0, npair * SIGNALS_PER_PAIR * sizeof *to);
    count = npair ? plant_patches(simulator->plant, simulator->patch, simulator->npatch) : 0;
    for (size_t i = 0; i < count && i < simulator->npatch; i++) {
        const struct contact_patch *patch = &simulator->patch[i];
        double *row = to + (size_t)patch->pair * SIGNALS_PER_PAIR;

        for (int k = 0; k < 3; k++) {
            row[k] += patch->force[k];
            row[3 + k] += patch->moment[k];
        }
    }
}

/* the columns in the order of make_titles; returns where the next would go */
static double *fill_row(const struct simulator *simulator, double *to)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_sensors *sensors = plant_sensors(simulator->plant);
    const struct contact_wrench *wrench = plant_contact_wrenches(simulator->plant);

    for (size_t j = 0; j < rig->robot->njoint; j++) {
        const struct motor_sense *motor = &sensors->motor[j];

        *to++ = motor->q;
        *to++ = motor->qm;
        *to++ = motor->torque_nm;
        *to++ = motor->current_a;
        *to++ = motor->voltage_v;
    }
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        memcpy(to, wrench[c].force, sizeof wrench[c].force);
        memcpy(to + 3, wrench[c].moment, sizeof wrench[c].moment);
        to += SIGNALS_PER_CONTACT;
    }
    record_pairs(simulator, to);
    to += rig->contact.npair * SIGNALS_PER_PAIR;
    if (rig->robot->floating) {
        memcpy(to, simulator->status.base, sizeof simulator->status.base);
        to += SIGNALS_BASE;
    }
    for (size_t i = 0; i < rig->nfree; i++) {
        plant_free_pose(simulator->plant, i, to);
        to += SIGNALS_PER_FREE;
    }
    return to;
}

void simulator_record_row(struct simulator *simulator)
{
    if (simulator->recorder && simulator->status.tick % simulator->row_ticks == 0) {
        fill_row(simulator, simulator->row);
        recorder_row(simulator->recorder, simulator->status.time_ns, simulator->row);
    }
}

/* for subscribers, when a row is due */
void simulator_stream_row(struct simulator *simulator)
{
    const struct simulator_status *status = &simulator->status;
    double *to = stream_begin(simulator->stream, status->tick, status->time_ns);

    if (!to) {
        return;
    }
    to = fill_row(simulator, to);
    for (size_t b = 0; b < simulator->config.rig->nbus; b++) {
        *to++ = (double)status->bus[b].rx_frames;
        *to++ = (double)status->bus[b].tx_frames;
    }
    stream_commit(simulator->stream);
}

/* ---- titles ---- */

/* appends a formatted title */
static bool add_title(struct arena *arena, const char **titles, size_t *count, const char *format,
                      const char *name)
{
    char text[TITLE_SIZE];
    int size = snprintf(text, sizeof text, "%s", format);
    const char *hole = strchr(format, '*');

    if (hole) {
        size =
            snprintf(text, sizeof text, "%.*s%s%s", (int)(hole - format), format, name, hole + 1);
    }
    titles[*count] = size < TITLE_SIZE ? arena_strdup(arena, text) : NULL;
    return titles[(*count)++] != NULL;
}

/* titles of the columns of signals.csv and of what only the stream has; false when memory is short or
 * a name too long */
static bool make_titles(struct simulator *simulator)
{
    static const char *const joint[SIGNALS_PER_JOINT] = {"q_*_rad", "qm_*_rad", "torque_*_nm",
                                                         "current_*_a", "voltage_*_v"};
    static const char *const contact[SIGNALS_PER_CONTACT] = {"fx_*_n",  "fy_*_n",  "fz_*_n",
                                                             "mx_*_nm", "my_*_nm", "mz_*_nm"};
    static const char *const pair[SIGNALS_PER_PAIR] = {"fx_*_n",  "fy_*_n",  "fz_*_n",
                                                       "mx_*_nm", "my_*_nm", "mz_*_nm"};
    static const char *const base[SIGNALS_BASE] = {"base_x_m", "base_y_m", "base_z_m", "base_qw",
                                                   "base_qx",  "base_qy",  "base_qz"};
    static const char *const free_body[SIGNALS_PER_FREE] = {"*_x_m", "*_y_m", "*_z_m", "*_qw",
                                                            "*_qx",  "*_qy",  "*_qz"};
    static const char *const bus[SIGNALS_PER_BUS] = {"rx_*_frames", "tx_*_frames"};
    const struct rig *rig = simulator->config.rig;
    size_t count =
        rig->robot->njoint * SIGNALS_PER_JOINT + rig->contact.nbody * SIGNALS_PER_CONTACT +
        rig->contact.npair * SIGNALS_PER_PAIR + (rig->robot->floating ? SIGNALS_BASE : 0) +
        rig->nfree * SIGNALS_PER_FREE + rig->nbus * SIGNALS_PER_BUS;
    const char **titles = arena_alloc(simulator->arena, count + 1, sizeof *titles);
    bool good = titles != NULL;
    size_t n = 0;

    for (size_t i = 0; good && i < rig->robot->njoint * SIGNALS_PER_JOINT; i++) {
        good = add_title(simulator->arena, titles, &n, joint[i % SIGNALS_PER_JOINT],
                         rig->robot->joint[i / SIGNALS_PER_JOINT].name);
    }
    for (size_t i = 0; good && i < rig->contact.nbody * SIGNALS_PER_CONTACT; i++) {
        good = add_title(simulator->arena, titles, &n, contact[i % SIGNALS_PER_CONTACT],
                         rig_contact_name(rig, i / SIGNALS_PER_CONTACT));
    }
    for (size_t i = 0; good && i < rig->contact.npair * SIGNALS_PER_PAIR; i++) {
        const struct contact_pair *of = &rig->contact.pair[i / SIGNALS_PER_PAIR];
        char name[TITLE_SIZE];

        snprintf(name, sizeof name, "%.63s_on_%.63s", rig->contact.surface[of->a].name,
                 rig->contact.surface[of->b].name);
        good = add_title(simulator->arena, titles, &n, pair[i % SIGNALS_PER_PAIR], name);
    }
    for (size_t i = 0; good && rig->robot->floating && i < SIGNALS_BASE; i++) {
        good = add_title(simulator->arena, titles, &n, base[i], "");
    }
    for (size_t i = 0; good && i < rig->nfree * SIGNALS_PER_FREE; i++) {
        good = add_title(simulator->arena, titles, &n, free_body[i % SIGNALS_PER_FREE],
                         rig->free[i / SIGNALS_PER_FREE].name);
    }
    simulator->nrecorded = n;
    for (size_t i = 0; good && i < rig->nbus * SIGNALS_PER_BUS; i++) {
        good = add_title(simulator->arena, titles, &n, bus[i % SIGNALS_PER_BUS],
                         rig->bus[i / SIGNALS_PER_BUS].name);
    }
    simulator->nsignal = n;
    simulator->title = titles;
    return good;
}

enum error_code simulator_create_signals(struct simulator *simulator, struct error *error)
{
    /* an engine may cut a pair's patch in parts */
    simulator->npatch = 2 * simulator->config.rig->contact.npair;
    simulator->patch =
        arena_alloc(simulator->arena, simulator->npatch + 1, sizeof *simulator->patch);
    if (!simulator->patch || !make_titles(simulator)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the signals");
    }
    return stream_create(simulator->nsignal, STREAM_ROWS, simulator->arena, &simulator->stream,
                         error);
}

/* ---- the recorder ---- */

/* What a wire in virtual time has carried, with its time. */
static void record_carried(void *context, const struct bus_frame *frame)
{
    const struct bus_tap *tap = context;

    recorder_frame(tap->recorder, tap->bus, frame, frame->time_ns);
}

/* Timed buses record what they have carried themselves. */
static enum error_code tap_wires(struct simulator *simulator, struct error *error)
{
    const size_t nbus = simulator->config.rig->nbus;
    struct bus_tap *tap = arena_alloc(simulator->arena, nbus, sizeof *tap);

    if (!tap) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder's buses");
    }
    for (size_t b = 0; b < nbus && simulator->buses.timed; b++) {
        tap[b] = (struct bus_tap){simulator->recorder, b};
        buses_tap(&simulator->buses, b, record_carried, &tap[b]);
    }
    return ERROR_NONE;
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
    };
    enum error_code code;

    if (!config->record) {
        return ERROR_NONE;
    }
    recorder.signal = simulator->title;
    recorder.nsignal = simulator->nrecorded;
    simulator->row = arena_alloc(simulator->arena, simulator->nrecorded + 1, sizeof(double));
    simulator->row_ticks = (uint64_t)(config->row_period_ns / config->rig->tick_ns);
    if (!simulator->row) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder's signals");
    }
    code = recorder_open(&recorder, simulator->arena, &simulator->recorder, error);
    return code ? code : tap_wires(simulator, error);
}
