/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the visuals: what the bodies of a robot file look like. */
#include "base/array.h"
#include "base/vec3.h"
#include "model/description/yaml.h"

#include <string.h>

/* Refuses keys that a shape does not have, and a shape without those that it needs. */
static enum error_code check_visual_keys(struct robot_builder *b, const struct visual_yaml *given)
{
    static const char *const shape[] = {
        [VISUAL_MESH] = "mesh",         [VISUAL_BOX] = "box",         [VISUAL_SPHERE] = "sphere",
        [VISUAL_CYLINDER] = "cylinder", [VISUAL_CAPSULE] = "capsule",
    };
    enum {
        MESH = 1 << VISUAL_MESH,
        ROUND = 1 << VISUAL_CYLINDER | 1 << VISUAL_CAPSULE,
    };
    const struct {
        const char *key;
        bool given;
        int needed; /* by these shapes */
    } keys[] = {
        {"half_extents_m", given->has_half_extents, 1 << VISUAL_BOX},
        {"radius_m", given->has_radius, 1 << VISUAL_SPHERE | ROUND},
        {"length_m", given->has_length, ROUND},
        {given->missing ? "missing" : "file", given->missing || given->file, MESH},
    };

    if (given->missing && given->file) {
        return yaml_error(b->error, &given->file_mark,
                          "found \"file\" beside \"missing\", expected one of them");
    }
    for (size_t i = 0; i < ARRAY_COUNT(keys); i++) {
        bool needed = keys[i].needed & 1 << given->shape;

        if (needed != keys[i].given) {
            return yaml_error(b->error, &given->mark, "found a %s %s \"%s\", expected %s",
                              shape[given->shape], needed ? "without" : "with", keys[i].key,
                              needed ? "it" : "none there");
        }
    }
    return ERROR_NONE;
}

/* Builds a visual and finds its body and its mesh file. */
static enum error_code build_visual(struct robot_builder *b, const struct visual_yaml *given,
                                    struct robot_visual *visual)
{
    enum error_code code = check_visual_keys(b, given);

    if (code) {
        return code;
    }
    visual->name = given->name;
    visual->shape = (enum robot_visual_shape)given->shape;
    visual->body = robot_find_body(b->robot, given->body);
    if (visual->body < 0) {
        return robot_unknown_name(b, &given->body_mark, "body", given->body, b->file.body,
                                  b->file.nbody, sizeof *b->file.body);
    }
    memcpy(visual->position, given->xyz, sizeof visual->position);
    mat3_from_rpy(given->rpy, visual->rotation);
    memcpy(visual->half, given->half_extents, sizeof visual->half);
    visual->radius = given->radius;
    visual->length = given->length;
    visual->missing = given->missing;
    visual->colored = given->has_color;
    memcpy(visual->color, given->color, sizeof visual->color);
    return given->file ? yaml_resolve_path(&given->file_mark, given->file, b->arena, &visual->file,
                                           b->error)
                       : ERROR_NONE;
}

enum error_code robot_build_visuals(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    enum error_code code = ERROR_NONE;

    if (file->nvisual > ROBOT_VISUALS_MAX) {
        return yaml_error(b->error, &file->visual[ROBOT_VISUALS_MAX].mark,
                          "found %zu visuals, expected at most %d", file->nvisual,
                          ROBOT_VISUALS_MAX);
    }
    robot->visual = arena_alloc(b->arena, file->nvisual, sizeof *robot->visual);
    if (!robot->visual) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < file->nvisual && !code; i++) {
        code = build_visual(b, &file->visual[i], &robot->visual[i]);
    }
    robot->nvisual = file->nvisual;
    return code;
}
