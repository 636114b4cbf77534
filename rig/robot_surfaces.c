/* SPDX-License-Identifier: Apache-2.0 */
/* Adds the robot's capsules as surfaces of a scene. */
#include "rig/builder_private.h"

#include <string.h>

enum error_code rig_add_robot_surfaces(struct rig_builder *b, struct contact_surface *surface,
                                       int *bodies)
{
    const struct raw_scene *scene = &b->raw->scene;
    const struct raw_robot_surfaces *raw = &scene->robot_surfaces;
    struct contact_config *contact = &b->rig->contact;
    struct contact_material material;
    enum error_code code;

    code = rig_find_material(b, yaml_mark(&raw->mark, "material"), raw->material, &material);
    for (size_t c = 0; !code && c < b->robot->ncapsule; c++) {
        const struct robot_capsule *capsule = &b->robot->capsule[c];
        struct contact_surface *s = &surface[contact->nsurface];

        /* A capsule has a name that no surface of the file has */
        for (size_t i = 0; i < contact->nsurface; i++) {
            if (!strcmp(surface[i].name, capsule->name)) {
                return yaml_error(b->error, yaml_mark(&scene->surface[i].mark, "name"),
                                  "found surface \"%s\", expected another name: a capsule of the "
                                  "robot has it",
                                  capsule->name);
            }
        }
        /* It moves with its body */
        *s = (struct contact_surface){
            .name = capsule->name,
            .body = rig_add_contact_body(b, bodies, capsule->body),
            .shape = CONTACT_CAPSULE,
            .radius_m = capsule->radius,
            .length_m = capsule->length,
            .material = material,
        };
        memcpy(s->position, capsule->position, sizeof s->position);
        memcpy(s->rotation, capsule->rotation, sizeof s->rotation);
        contact->nsurface++;
    }
    return code;
}
