/* SPDX-License-Identifier: Apache-2.0 */
/* Reads URDF colors. A material may be given anywhere in the file and named before or after. */
#include "app/import/urdf_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Reads the color of a <material>, clamped to 0 to 1; false when it has none or it cannot be
 * read. */
static bool material_read_color(const struct urdf_reader *r, const xmlNode *material,
                                double color[4])
{
    const xmlNode *node = xml_child(material, "color");
    const char *text = node ? xml_attribute(node, "rgba") : NULL;
    struct error unused;

    if (!text || xml_parse_reals(r->file, node, "rgba", text, 4, color, &unused)) {
        return false;
    }
    for (int m = 0; m < 4; m++) {
        color[m] = fmin(fmax(color[m], 0.0), 1.0);
    }
    return true;
}

/* Adds a material with a name and a color; while there is no room allocated, only counts it. */
static void material_add(struct urdf_reader *r, const xmlNode *material)
{
    struct urdf_material added = {.name = xml_attribute(material, "name"),
                                  .order = (int)r->nmaterial};

    if (added.name && *added.name && material_read_color(r, material, added.color)) {
        if (r->material) {
            r->material[r->nmaterial] = added;
        }
        r->nmaterial++;
    }
}

/* Adds the materials of the robot, then those of its visuals. */
static void material_add_all(struct urdf_reader *r)
{
    const xmlNode *root = r->file->root;

    r->nmaterial = 0;
    for (const xmlNode *node = xml_child(root, "material"); node;
         node = xml_next(node, "material")) {
        material_add(r, node);
    }
    for (const xmlNode *link = xml_child(root, "link"); link; link = xml_next(link, "link")) {
        for (const xmlNode *visual = xml_child(link, "visual"); visual;
             visual = xml_next(visual, "visual")) {
            const xmlNode *material = xml_child(visual, "material");

            if (material) {
                material_add(r, material);
            }
        }
    }
}

/* Orders materials for qsort by name, then as in the file. */
static int material_compare(const void *a, const void *b)
{
    const struct urdf_material *x = a, *y = b;
    int order = strcmp(x->name, y->name);

    return order ? order : (x->order > y->order) - (x->order < y->order);
}

enum error_code urdf_read_materials(struct urdf_reader *r)
{
    /* Count, allocate, then fill */
    material_add_all(r);
    r->material = arena_alloc(r->arena, r->nmaterial + 1, sizeof *r->material);
    if (!r->material) {
        return urdf_no_memory(r);
    }
    material_add_all(r);
    qsort(r->material, r->nmaterial, sizeof *r->material, material_compare);
    return ERROR_NONE;
}

/* Finds the first material of a name by bisection; NULL when there is none. */
static const struct urdf_material *urdf_find_material(const struct urdf_reader *r, const char *name)
{
    size_t low = 0, high = r->nmaterial;

    while (low < high) {
        size_t middle = (low + high) / 2;

        if (strcmp(r->material[middle].name, name) < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < r->nmaterial && !strcmp(r->material[low].name, name) ? &r->material[low] : NULL;
}

void urdf_read_color(const struct urdf_reader *r, const xmlNode *visual,
                     struct import_geometry *shape)
{
    const xmlNode *material = xml_child(visual, "material");
    const char *name = material ? xml_attribute(material, "name") : NULL;
    const struct urdf_material *named = NULL;

    if (!material) {
        return;
    }
    shape->colored = material_read_color(r, material, shape->color);
    if (!shape->colored && name) {
        named = urdf_find_material(r, name);
    }
    if (named) {
        memcpy(shape->color, named->color, sizeof shape->color);
        shape->colored = true;
    }
    if (!shape->colored) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(material),
                        "material \"%.63s\" of link \"%.63s\": no color of four numbers%s",
                        name ? name : "", r->model->link[shape->link].name,
                        xml_child(material, "texture") ? "; textures are not read" : "");
    }
}
