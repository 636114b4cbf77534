/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the description that a client gets first: the run, its signals, buses, boards and
 * faults. */
#include "viewer/private.h"

#include "control/parse.h"
#include "base/array.h"
#include "boards/protocol.h"

#include <string.h>

/* ---- pieces; NULL: no memory, which json_pack passes on ---- */

json_t *hello_numbers(const double *value, size_t count)
{
    json_t *array = json_array();

    for (size_t i = 0; i < count; i++) {
        json_array_append_new(array, control_number(value[i]));
    }
    return array;
}

/* ---- signals ---- */

/* Returns the unit that a signal's name ends with; "" = none. */
static const char *signal_unit(const char *name)
{
    static const struct {
        const char *end, *unit;
    } units[] = {
        {"_rad", "rad"},       {"_nm", "N m"}, {"_rad_s", "rad/s"}, {"_a", "A"},     {"_v", "V"},
        {"_n", "N"},           {"_m", "m"},    {"_m_s2", "m/s2"},   {"_c", "deg C"}, {"_t", "T"},
        {"_frames", "frames"}, {"_s", "s"},    {"_pa", "Pa"},
    };
    size_t size = strlen(name);
    const char *unit = "";

    for (size_t i = 0; i < ARRAY_COUNT(units); i++) {
        size_t end = strlen(units[i].end);

        if (size > end && strcmp(name + size - end, units[i].end) == 0) {
            unit = units[i].unit;
        }
    }
    return unit;
}

/* Lists the signals with their units. */
static json_t *hello_signals(const struct viewer *viewer)
{
    const char *const *name = viewer->signal;
    json_t *array = json_array();

    for (size_t i = 0; i < viewer->nsignal; i++) {
        json_array_append_new(array, json_pack("{s:o, s:s}", "name", control_text(name[i]), "unit",
                                               signal_unit(name[i])));
    }
    return array;
}

/* ---- buses and boards ---- */

/* Lists the buses of the rig. */
static json_t *hello_buses(const struct viewer *viewer)
{
    json_t *array = json_array();

    for (size_t b = 0; b < viewer->rig->nbus; b++) {
        const struct rig_bus *bus = &viewer->rig->bus[b];

        json_array_append_new(array, json_pack("{s:o, s:o, s:I, s:b, s:s}", "name",
                                               control_text(bus->name), "interface",
                                               control_text(bus->interface), "bitrate",
                                               (json_int_t)bus->bitrate, "fd", bus->fd,
                                               "personality", bus->protocol->name));
    }
    return array;
}

/* Lists the words for the modes of a protocol, by number. */
static json_t *hello_modes(const struct protocol *protocol)
{
    json_t *modes = json_object();

    for (uint32_t mode = 0; mode <= UINT8_MAX; mode++) {
        const char *name = protocol->mode_name(mode);
        char key[8];

        if (strcmp(name, "unknown") != 0) {
            snprintf(key, sizeof key, "%u", mode);
            json_object_set_new(modes, key, json_string(name));
        }
    }
    return modes;
}

/* Describes a board: name, bus, address, kind, and the joints of its axes. */
static json_t *hello_board(const struct board_config *board, const struct protocol *protocol)
{
    static const char *const kinds[] = {[BOARD_MOTOR] = "motor",
                                        [BOARD_FT] = "force-torque",
                                        [BOARD_TORQUE] = "joint torques",
                                        [BOARD_INERTIAL] = "inertial"};
    json_t *axes = json_array();

    for (size_t k = 0; board->kind == BOARD_MOTOR && k < protocol->axes_max; k++) {
        if (board->axis[k].joint >= 0) {
            json_array_append_new(axes, json_integer(board->axis[k].joint));
        }
    }
    return json_pack("{s:o, s:i, s:i, s:s, s:o}", "name",
                     control_text(board->name ? board->name : ""), "bus", board->bus, "address",
                     (int)board->address, "kind", kinds[board->kind], "joints", axes);
}

/* Lists the boards; a recording has none. */
static json_t *hello_boards(const struct viewer *viewer)
{
    const struct boards_config *boards = &viewer->rig->boards;
    json_t *array = json_array();

    for (size_t i = 0; i < boards->nboard && !viewer->playback; i++) {
        const struct protocol *protocol = viewer->rig->bus[boards->board[i].bus].protocol;

        json_array_append_new(array, hello_board(&boards->board[i], protocol));
    }
    return array;
}

/* Lists the words for modes, once for each protocol that the rig has. */
static json_t *hello_all_modes(const struct viewer *viewer)
{
    json_t *all = json_object();

    for (size_t b = 0; b < viewer->rig->nbus; b++) {
        const struct protocol *protocol = viewer->rig->bus[b].protocol;

        json_object_set_new(all, protocol->name, hello_modes(protocol));
    }
    return all;
}

/* Lists the faults; a recording has none. */
static json_t *hello_faults(const struct viewer *viewer)
{
    const struct faults *faults =
        viewer->playback ? NULL : simulator_faults(viewer->config.simulator);
    json_t *array = json_array();

    for (size_t i = 0; faults && i < faults_count(faults); i++) {
        const struct fault *fault = faults_at(faults, i);

        json_array_append_new(array, json_pack("{s:o, s:o}", "name", control_text(fault->name),
                                               "text", control_text(fault->text)));
    }
    return array;
}

/* ---- all of it ---- */

/* Describes the run, or the recording that is played back. */
static json_t *hello_run(const struct viewer *viewer)
{
    const struct simulator_config *config =
        viewer->playback ? NULL : simulator_configuration(viewer->config.simulator);
    const struct recording *recording = viewer->config.recording, *with = viewer->config.with;
    const char *directory = recording ? recording->config.directory : config->record;
    const char *task = config ? config->task : NULL;
    const struct rig *rig = viewer->rig;
    json_t *run =
        json_pack("{s:s, s:s, s:o, s:o, s:o, s:s, s:f, s:o, s:o, s:b}", "id", viewer->run,
                  "version", HIL_VERSION, "rig", control_text(rig->name), "robot",
                  control_text(rig->robot->name), "file", control_text(rig->file), "clock",
                  config ? word_of(loop_clock_words, config->clock) : "recorded", "tick_s",
                  (double)rig->tick_ns * 1e-9, "task", task ? control_text(task) : json_null(),
                  "recording", directory ? control_text(directory) : json_null(), "frames",
                  recording ? recording->log.file.data != NULL : viewer->config.ports != NULL);

    if (run && recording) {
        json_object_set_new(run, "replay",
                            json_pack("{s:f, s:f, s:f, s:o}", "from_s",
                                      (double)recording->first_ns * 1e-9, "to_s",
                                      (double)recording->last_ns * 1e-9, "period_s",
                                      (double)recording->period_ns * 1e-9, "with",
                                      with ? control_text(with->config.directory) : json_null()));
    }
    return run;
}

json_t *viewer_hello(const struct viewer *viewer)
{
    return json_pack("{s:s, s:i, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:{s:i, s:i, s:i, s:b}}",
                     "type", "hello", "protocol", VIEWER_PROTOCOL, "run", hello_run(viewer),
                     "scene", hello_scene(viewer), "signals", hello_signals(viewer), "buses",
                     hello_buses(viewer), "boards", hello_boards(viewer), "modes",
                     hello_all_modes(viewer), "faults", hello_faults(viewer), "limits", "rate_hz",
                     VIEWER_RATE_HZ, "signals", VIEWER_SIGNALS, "message_bytes", VIEWER_INBOX - 16,
                     "rows", viewer->history != NULL);
}
