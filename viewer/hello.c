/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the first message to a client. It describes the run, its signals, buses, boards and
 * faults, and the scene: bodies, joints, shapes, contacts. Lengths in m, quaternions wxyz. Body
 * indices count the robot's bodies, then the free bodies; -1 is the world. */
#include "viewer/private.h"

#include "base/array.h"
#include "base/vec3.h"
#include "boards/protocol.h"

static json_t *hello_numbers(const double *value, size_t count)
{
    json_t *array = json_array();

    for (size_t i = 0; i < count; i++) {
        json_array_append_new(array, control_number(value[i]));
    }
    return array;
}

/* Describes a body: parent (-1 = the world), mass, center of mass, inertia about the center of
 * mass. */
static json_t *scene_body(const char *name, int parent, const struct robot_inertia *inertia)
{
    return json_pack("{s:o, s:i, s:f, s:o, s:o}", "name", control_text(name), "parent", parent,
                     "mass_kg", inertia->mass, "com_m", hello_numbers(inertia->com, 3),
                     "inertia_kg_m2", hello_numbers(inertia->I, 6));
}

/* Lists the robot's bodies, then the free bodies. */
static json_t *scene_bodies(const struct rig *rig)
{
    json_t *array = json_array();

    for (size_t i = 0; i < rig->robot->nbody; i++) {
        const struct robot_body *body = &rig->robot->body[i];

        json_array_append_new(array, scene_body(body->name, body->parent, &body->inertia));
    }
    for (size_t i = 0; i < rig->nfree; i++) {
        json_array_append_new(array, scene_body(rig->free[i].name, -1, &rig->free[i].inertia));
    }
    return array;
}

/* Lists the joints: axis, type and limits (rad or m). */
static json_t *scene_joints(const struct rig *rig)
{
    json_t *array = json_array();

    for (size_t j = 0; j < rig->robot->njoint; j++) {
        const struct robot_joint *joint = &rig->robot->joint[j];

        json_array_append_new(
            array, json_pack("{s:o, s:i, s:s, s:o, s:o, s:o, s:o}", "name",
                             control_text(joint->name), "body", (int)j + 1, "type",
                             joint->type == JOINT_REVOLUTE ? "revolute" : "prismatic", "axis",
                             hello_numbers(joint->axis, 3), "lower", control_number(joint->lower),
                             "upper", control_number(joint->upper), "torque_limit_nm",
                             control_number(joint->torque_limit)));
    }
    return array;
}

/* ---- shapes ---- */

/* Describes the pose of a shape in its body's frame. */
static json_t *scene_place(const char *name, int body, const char *shape, const double position[3],
                           const double rotation[9])
{
    double quaternion[4];

    quaternion_from_mat3(rotation, quaternion);
    return json_pack("{s:o, s:i, s:s, s:o, s:o}", "name", control_text(name), "body", body, "shape",
                     shape, "position_m", hello_numbers(position, 3), "quaternion",
                     hello_numbers(quaternion, 4));
}

/* Describes a contact surface; a mesh is given by the path of its file. */
static json_t *scene_surface(const struct viewer *viewer, size_t index)
{
    static const char *const shapes[] = {
        [CONTACT_HALF_SPACE] = "half_space",
        [CONTACT_SPHERE] = "sphere",
        [CONTACT_BOX] = "box",
        [CONTACT_MESH] = "mesh",
        [CONTACT_CAPSULE] = "capsule",
    };
    const struct contact_surface *surface = &viewer->rig->contact.surface[index];
    int body = surface->body < 0 ? -1 : viewer->rig->contact_body[surface->body];
    json_t *object = scene_place(surface->name, body, shapes[surface->shape], surface->position,
                                 surface->rotation);

    json_object_set_new(object, "radius_m", control_number(surface->radius_m));
    json_object_set_new(object, "length_m", control_number(surface->length_m));
    json_object_set_new(object, "half_extent_m", hello_numbers(surface->half_extent_m, 3));
    if (surface->shape == CONTACT_MESH) {
        json_object_set_new(object, "mesh", json_sprintf("/mesh/%zu", index));
    }
    return object;
}

/* Checks whether the rig makes contact surfaces from a body's capsules. The page then shows the
 * surfaces and not the capsules. */
static bool capsule_is_surface(const struct rig *rig, const struct robot_capsule *capsule)
{
    for (size_t i = 0; i < rig->contact.nsurface; i++) {
        const struct contact_surface *surface = &rig->contact.surface[i];

        if (surface->body >= 0 && surface->shape == CONTACT_CAPSULE &&
            rig->contact_body[surface->body] == capsule->body) {
            return true;
        }
    }
    return false;
}

/* Lists the contact surfaces, then the capsules without a surface. */
static json_t *scene_shapes(const struct viewer *viewer)
{
    const struct rig *rig = viewer->rig;
    json_t *array = json_array();

    for (size_t i = 0; i < rig->contact.nsurface && i < VIEWER_MESHES; i++) {
        json_array_append_new(array, scene_surface(viewer, i));
    }
    for (size_t i = 0; i < rig->robot->ncapsule; i++) {
        const struct robot_capsule *capsule = &rig->robot->capsule[i];
        json_t *object;

        if (capsule_is_surface(rig, capsule)) {
            continue;
        }
        object = scene_place(capsule->name, capsule->body, "capsule", capsule->position,
                             capsule->rotation);
        json_object_set_new(object, "radius_m", control_number(capsule->radius));
        json_object_set_new(object, "length_m", control_number(capsule->length));
        json_array_append_new(array, object);
    }
    return array;
}

/* Describes a visual of the robot's file, which may differ from the contact surfaces. */
static json_t *scene_visual(const struct robot *robot, size_t index)
{
    static const char *const shapes[] = {
        [VISUAL_MESH] = "mesh",         [VISUAL_BOX] = "box",         [VISUAL_SPHERE] = "sphere",
        [VISUAL_CYLINDER] = "cylinder", [VISUAL_CAPSULE] = "capsule",
    };
    const struct robot_visual *visual = &robot->visual[index];
    json_t *object = scene_place(visual->name, visual->body, shapes[visual->shape],
                                 visual->position, visual->rotation);

    json_object_set_new(object, "radius_m", control_number(visual->radius));
    json_object_set_new(object, "length_m", control_number(visual->length));
    json_object_set_new(object, "half_extent_m", hello_numbers(visual->half, 3));
    json_object_set_new(object, "color",
                        visual->colored ? hello_numbers(visual->color, 4) : json_null());
    if (visual->missing) {
        json_object_set_new(object, "missing", control_text(visual->missing));
    } else if (visual->shape == VISUAL_MESH) {
        json_object_set_new(object, "mesh",
                            json_sprintf("/visual/%zu", viewer_visual_source(robot, index)));
    }
    return object;
}

static json_t *scene_visuals(const struct robot *robot)
{
    json_t *array = json_array();

    for (size_t i = 0; i < robot->nvisual; i++) {
        json_array_append_new(array, scene_visual(robot, i));
    }
    return array;
}

/* Lists the bodies with contact. */
static json_t *scene_contacts(const struct rig *rig)
{
    json_t *array = json_array();

    for (size_t c = 0; c < rig->contact.nbody; c++) {
        json_array_append_new(array, json_pack("{s:o, s:i}", "name",
                                               control_text(rig_contact_name(rig, c)), "body",
                                               rig->contact_body[c]));
    }
    return array;
}

json_t *hello_scene(const struct viewer *viewer)
{
    const struct rig *rig = viewer->rig;

    return json_pack("{s:o, s:b, s:f, s:o, s:o, s:o, s:o, s:o}", "gravity_m_s2",
                     hello_numbers(rig->robot->gravity, 3), "floating", rig->robot->floating,
                     "robot_mass_kg", rig->robot->total_mass, "bodies", scene_bodies(rig), "joints",
                     scene_joints(rig), "shapes", scene_shapes(viewer), "visuals",
                     scene_visuals(rig->robot), "contacts", scene_contacts(rig));
}

/* ---- signals ---- */

/* Returns the unit, the last part of a signal's name; "" = none. */
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
                                               (json_int_t)bus->bitrate, "fd", bus->fd, "protocol",
                                               bus->protocol->name));
    }
    return array;
}

/* Lists the names of a protocol's modes, by number. */
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

/* Lists the names of modes, once per protocol of the rig. */
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
        viewer->playback ? NULL : simulator_parts(viewer->config.simulator).faults;
    json_t *array = json_array();

    for (size_t i = 0; faults && i < faults_count(faults); i++) {
        const struct fault *fault = faults_at(faults, i);

        json_array_append_new(array, json_pack("{s:o, s:o}", "name", control_text(fault->name),
                                               "text", control_text(fault->text)));
    }
    return array;
}

/* ---- the complete description ---- */

/* Describes the run, or the recording in playback. */
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
