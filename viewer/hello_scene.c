/* SPDX-License-Identifier: Apache-2.0 */
/* Describes the scene: bodies, joints, shapes and what touches. Lengths in m, quaternions wxyz,
 * a body by its index: those of the robot, then the free ones; -1 is the world. */
#include "viewer/private.h"

#include "control/parse.h"
#include "base/vec3.h"

/* Describes a body: parent (-1 = the world), mass, center of mass and inertia about it. */
static json_t *scene_body(const char *name, int parent, const struct robot_inertia *inertia)
{
    return json_pack("{s:o, s:i, s:f, s:o, s:o}", "name", control_text(name), "parent", parent,
                     "mass_kg", inertia->mass, "com_m", hello_numbers(inertia->com, 3),
                     "inertia_kg_m2", hello_numbers(inertia->I, 6));
}

/* Lists the robot's bodies, then the free ones. */
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

/* Describes where a shape lies in its body's frame. */
static json_t *scene_place(const char *name, int body, const char *shape, const double position[3],
                           const double rotation[9])
{
    double quaternion[4];

    quaternion_from_mat3(rotation, quaternion);
    return json_pack("{s:o, s:i, s:s, s:o, s:o}", "name", control_text(name), "body", body, "shape",
                     shape, "position_m", hello_numbers(position, 3), "quaternion",
                     hello_numbers(quaternion, 4));
}

/* Describes a contact surface; a mesh by the path of its file. */
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

/* Checks whether the rig gives a body's capsules a surface, which then shows them. */
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

/* Lists the contact surfaces, then the capsules that are none. */
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

/* Describes a visual of the robot's file, which may differ from what can touch. */
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
