/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Colors of COLLADA: the material that a primitive names is a symbol, which the instance of its
 * geometry binds to a <material>, which has an <effect>, whose shader has a diffuse color. Colors
 * are opaque: what files say of transparency contradicts itself from exporter to exporter. A link
 * that leads nowhere is no error, but no color.
 */
#include "app/import/collada_private.h"

#include "base/array.h"

#include <string.h>

enum { COLLADA_STEP_WORK = 64 }; /* charged for each binding looked at, in bytes */

/* The first descendant along a path of names that ends in NULL. */
static const xmlNode *collada_descend(const xmlNode *node, const char *const path[])
{
    for (size_t i = 0; path[i] && node; i++) {
        node = xml_child(node, path[i]);
    }
    return node;
}

/* Returns the element that an attribute of the node refers to; NULL when it refers to none. */
static const xmlNode *collada_refer(const struct collada *c, const xmlNode *node,
                                    const char *attribute, const char *name)
{
    const char *reference = node ? xml_attribute(node, attribute) : NULL;

    return reference ? collada_find(c, reference, name) : NULL;
}

/* Finds the material that an instance binds to a symbol; NULL when it binds none. Charges the
 * work. */
static const xmlNode *collada_bound_material(struct collada *c, const xmlNode *instance,
                                             const char *symbol)
{
    static const char *const path[] = {"bind_material", "technique_common", "instance_material",
                                       NULL};

    for (const xmlNode *bound = collada_descend(instance, path); bound;
         bound = xml_next(bound, "instance_material")) {
        const char *name = xml_attribute(bound, "symbol");

        c->work += COLLADA_STEP_WORK;
        if (name && !strcmp(name, symbol)) {
            return collada_refer(c, bound, "target", "material");
        }
    }
    return NULL;
}

/* Finds the element with the color by which an effect scatters light (diffuse), or for a
 * constant shader emits it; NULL when there is none. */
static const xmlNode *collada_find_diffuse(const xmlNode *effect)
{
    static const char *const technique[] = {"profile_COMMON", "technique", NULL};
    static const char *const shader[] = {"phong", "lambert", "blinn", "constant"};
    const xmlNode *found = collada_descend(effect, technique);

    for (size_t i = 0; found && i < ARRAY_COUNT(shader); i++) {
        const xmlNode *node = xml_child(found, shader[i]);

        if (node) {
            return xml_child(node, i == 3 ? "emission" : "diffuse");
        }
    }
    return NULL;
}

int collada_find_tint(struct collada *c, const xmlNode *instance, const xmlNode *primitive)
{
    const char *symbol = xml_attribute(primitive, "material");
    const xmlNode *material, *effect, *diffuse, *color;
    struct error unused;
    double rgba[4];

    if (c->counting || !symbol) {
        return -1;
    }
    /* Follow symbol, material, effect and shader to the color; any missing link means no color */
    material = collada_bound_material(c, instance, symbol);
    effect =
        collada_refer(c, material ? xml_child(material, "instance_effect") : NULL, "url", "effect");
    diffuse = effect ? collada_find_diffuse(effect) : NULL;
    if (diffuse && xml_child(diffuse, "texture")) {
        c->to->mesh->remark = "without its texture";
    }
    color = diffuse ? xml_child(diffuse, "color") : NULL;
    if (!color || xml_parse_reals(&c->file, color, "value", xml_content(color), 4, rgba, &unused)) {
        return -1;
    }
    rgba[3] = 1.0;
    return mesh_find_tint(c->to->mesh, rgba);
}
