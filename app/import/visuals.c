/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the robot's visuals from the visual shapes of the file. */
#include "app/import/shapes.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

/* The visuals made from one mesh of the file, so that it is written once. */
struct visual_source {
    const char *mesh;
    double scale[3];
    size_t first, count;
};

/* Data for making the visuals. */
struct visual_builder {
    struct import_robot *from;
    const struct import_packages *packages;
    const char *folder;
    struct arena *arena;
    struct import_notes *notes;
    struct error *error;

    struct visual_source *source;
    /* Sources; faces written so far; shapes beyond ROBOT_VISUALS_MAX. */
    size_t nsource, faces, left_out;
    bool *painted; /* by visual: its color is the mesh's own */
};

static enum error_code visual_no_memory(const struct visual_builder *b)
{
    return error_set(b->error, ERROR_MEMORY, "no memory for what the robot looks like");
}

/* ---- one visual ---- */

/* Adds a visual at a shape's pose, without its size or file; *out is NULL if the robot has no
 * room. */
static enum error_code visual_add(struct visual_builder *b, const struct import_geometry *shape,
                                  struct robot_visual **out)
{
    struct import_robot *from = b->from;
    struct robot *robot = from->robot;
    struct robot_visual *visual;
    struct import_place place;
    char name[64];

    *out = NULL;
    if (robot->nvisual == ROBOT_VISUALS_MAX) {
        b->left_out++;
        return ERROR_NONE;
    }
    visual = &robot->visual[robot->nvisual++];
    snprintf(name, sizeof name, "%.40s-visual%zu", robot->body[from->body[shape->link]].name,
             robot->nvisual);

    /* The pose in the body: the link's pose in the body times the shape's pose in the link */
    import_place_compose(&from->place[shape->link], &shape->place, &place);
    visual->name = arena_strdup(b->arena, name);
    visual->body = from->body[shape->link];
    memcpy(visual->position, place.xyz, sizeof visual->position);
    memcpy(visual->rotation, place.R, sizeof visual->rotation);
    visual->colored = shape->colored;
    memcpy(visual->color, shape->color, sizeof visual->color);
    *out = visual;
    return visual->name ? ERROR_NONE : visual_no_memory(b);
}

/* Adds the visual of a sphere, box, cylinder or capsule. */
static enum error_code visual_add_primitive(struct visual_builder *b,
                                            const struct import_geometry *shape)
{
    static const enum robot_visual_shape shapes[] = {
        [IMPORT_SPHERE] = VISUAL_SPHERE,
        [IMPORT_BOX] = VISUAL_BOX,
        [IMPORT_CYLINDER] = VISUAL_CYLINDER,
        [IMPORT_CAPSULE] = VISUAL_CAPSULE,
    };
    struct robot_visual *visual;
    enum error_code code = visual_add(b, shape, &visual);

    if (!code && visual) {
        visual->shape = shapes[shape->shape];
        visual->radius = shape->radius;
        visual->length = shape->length;
        memcpy(visual->half, shape->half, sizeof visual->half);
    }
    return code;
}

/* ---- meshes ---- */

/* Writes the faces of one tint to an STL file named after the visual. */
static enum error_code visual_write(struct visual_builder *b, const struct import_mesh *mesh,
                                    int tint, struct robot_visual *visual)
{
    char path[PATH_MAX];

    snprintf(path, sizeof path, "../meshes/%s.stl", visual->name);
    visual->file = arena_strdup(b->arena, path);
    if (!visual->file) {
        return visual_no_memory(b);
    }
    snprintf(path, sizeof path, "%s/%s.stl", b->folder, visual->name);
    return import_write_tint(mesh, tint, path, b->error);
}

/* Adds a visual for each tint of a mesh that has faces, the uncolored ones (-1) first. */
static enum error_code visual_add_tints(struct visual_builder *b,
                                        const struct import_geometry *shape,
                                        const struct import_mesh *mesh)
{
    enum error_code code = ERROR_NONE;

    for (int tint = -1; tint < (int)mesh->ncolor && !code; tint++) {
        struct robot_visual *visual;

        if (import_count_tint(mesh, tint) == 0) {
            continue;
        }
        code = visual_add(b, shape, &visual);
        if (!code && visual && tint >= 0) {
            b->painted[visual - b->from->robot->visual] = visual->colored = true;
            memcpy(visual->color, mesh->color[tint], sizeof visual->color);
        }
        code = code || !visual ? code : visual_write(b, mesh, tint, visual);
    }
    return code;
}

/* Adds a visual that only states why its mesh is missing. */
static enum error_code visual_add_missing(struct visual_builder *b,
                                          const struct import_geometry *shape, const char *why)
{
    const struct import_model *model = b->from->model;
    struct robot_visual *visual;
    enum error_code code = visual_add(b, shape, &visual);
    char text[360];

    import_note_add(b->notes, IMPORT_MISSING, shape->file, shape->line,
                    "visual mesh of link \"%.63s\": %.300s", model->link[shape->link].name,
                    import_reason(shape->file, shape->line, why));
    if (!code && visual) {
        snprintf(text, sizeof text, "%.350s", why);
        visual->missing = arena_strdup(b->arena, text);
        code = visual->missing ? ERROR_NONE : visual_no_memory(b);
    }
    return code;
}

/* Reads a mesh. It gets one color if the shape's color overrides the mesh's own. Refuses a mesh
 * that exceeds the limit for all meshes together. */
static enum error_code visual_read_mesh(struct visual_builder *b,
                                        const struct import_geometry *shape, struct arena *scratch,
                                        struct import_mesh *mesh, struct error *why)
{
    const char *file;
    enum error_code code =
        import_find_mesh(b->from->model, shape, b->packages, scratch, &file, why);

    code = code ? code : import_read_mesh(file, shape->scale, scratch, mesh, why);
    if (code) {
        return code;
    }
    if (mesh->nface > IMPORT_VISUAL_FACES_MAX - b->faces) {
        return error_set(why, ERROR_INPUT,
                         "%.200s: found %zu faces beyond those of the meshes before it, expected "
                         "at most %d of all: simplify the meshes",
                         file, mesh->nface, IMPORT_VISUAL_FACES_MAX);
    }
    if (shape->repaints) {
        memset(mesh->tint, -1, mesh->nface * sizeof *mesh->tint);
    }
    b->faces += mesh->nface;
    return ERROR_NONE;
}

/* Adds the visuals of a mesh that an earlier shape has used again, at this shape's pose. */
static enum error_code visual_repeat(struct visual_builder *b, const struct import_geometry *shape,
                                     const struct visual_source *source)
{
    struct robot_visual *all = b->from->robot->visual;
    enum error_code code = ERROR_NONE;

    for (size_t i = source->first; i < source->first + source->count && !code; i++) {
        struct robot_visual *visual;

        code = visual_add(b, shape, &visual);
        if (code || !visual) {
            continue;
        }
        visual->file = all[i].file;
        visual->missing = all[i].missing;
        if (b->painted[i]) {
            b->painted[visual - all] = visual->colored = true;
            memcpy(visual->color, all[i].color, sizeof visual->color);
        }
    }
    return code;
}

/* Adds the visuals of a mesh: reuses those of an equal mesh with the same scale, or reads and
 * writes the mesh. */
static enum error_code visual_add_mesh(struct visual_builder *b,
                                       const struct import_geometry *shape)
{
    struct visual_source *source = &b->source[b->nsource];
    struct import_mesh mesh;
    struct arena scratch = {0};
    struct error why;
    enum error_code code;

    /* The same file with the same scale is already written */
    for (size_t i = 0; i < b->nsource; i++) {
        if (!strcmp(b->source[i].mesh, shape->mesh) &&
            !memcmp(b->source[i].scale, shape->scale, sizeof shape->scale)) {
            return visual_repeat(b, shape, &b->source[i]);
        }
    }
    if (b->from->robot->nvisual == ROBOT_VISUALS_MAX) {
        b->left_out++;
        return ERROR_NONE;
    }

    *source = (struct visual_source){.mesh = shape->mesh, .first = b->from->robot->nvisual};
    memcpy(source->scale, shape->scale, sizeof source->scale);

    /* A mesh that cannot be read does not stop the import: its visual states the reason */
    if (arena_init(&scratch, IMPORT_MESH_ARENA, &why) ||
        visual_read_mesh(b, shape, &scratch, &mesh, &why)) {
        code = visual_add_missing(b, shape, why.text);
    } else {
        code = visual_add_tints(b, shape, &mesh);
        if (mesh.remark) {
            import_note_add(b->notes, IMPORT_DROPPED, shape->file, shape->line,
                            "visual mesh \"%.150s\" is %s", shape->mesh, mesh.remark);
        }
    }
    arena_fini(&scratch);
    source->count = b->from->robot->nvisual - source->first;
    b->nsource++;
    return code;
}

/* ---- the whole ---- */

enum error_code import_add_visuals(struct import_robot *from,
                                   const struct import_packages *packages, const char *folder,
                                   struct arena *arena, struct import_notes *notes,
                                   struct error *error)
{
    const struct import_model *model = from->model;
    struct visual_builder b = {from, packages, folder, arena, notes, error, .nsource = 0};
    enum error_code code = ERROR_NONE;

    b.source = arena_alloc(arena, ROBOT_VISUALS_MAX, sizeof *b.source);
    b.painted = arena_alloc(arena, ROBOT_VISUALS_MAX, sizeof *b.painted);
    from->robot->visual = arena_alloc(arena, ROBOT_VISUALS_MAX, sizeof *from->robot->visual);
    if (!b.source || !b.painted || !from->robot->visual) {
        return visual_no_memory(&b);
    }
    for (size_t i = 0; i < model->ngeometry && !code; i++) {
        const struct import_geometry *shape = &model->geometry[i];

        /* Visible shapes of links that are part of a body */
        if (!shape->visual || from->body[shape->link] < 0) {
            continue;
        }
        if (shape->shape == IMPORT_ELLIPSOID) {
            import_note_add(notes, IMPORT_DROPPED, shape->file, shape->line,
                            "visual ellipsoid of link \"%.63s\": what can touch is shown",
                            model->link[shape->link].name);
        } else {
            code = shape->shape == IMPORT_MESH ? visual_add_mesh(&b, shape)
                                               : visual_add_primitive(&b, shape);
        }
    }
    if (b.left_out) {
        import_note_add(notes, IMPORT_DROPPED, model->file, 0,
                        "%zu visual shapes beyond the %d that a robot has at most", b.left_out,
                        ROBOT_VISUALS_MAX);
    }
    return code;
}
