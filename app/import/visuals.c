/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the robot's visuals from the visual shapes of the file. */
#include "app/import/shapes.h"

#include <stdio.h>
#include <string.h>

/* The visuals made from a mesh of the file, so that each mesh is written once. */
struct visual_source {
    const char *mesh;
    double scale[3];
    size_t first, count;
};

/* The state while visuals are made. Without memory the builder gets an error, and the visuals are
 * not used. */
struct visuals {
    const struct import_builder *b;
    struct visual_source *source;
    /* Number of sources, of faces written, and of shapes beyond ROBOT_VISUALS_MAX. */
    size_t nsource, faces, left_out;
    bool *painted; /* by visual: whether its color is from the mesh */
};

/* Returns a copy of a text; "" on an error. */
static const char *visual_copy(const struct visuals *v, const char *text)
{
    const char *copy = arena_strdup(v->b->arena, text);

    if (!copy) {
        error_set(v->b->error, ERROR_MEMORY, "no memory for what the robot looks like");
    }
    return copy ? copy : "";
}

/* Adds a visual at a shape's pose, without size or file. Returns NULL if the robot has no room. */
static struct robot_visual *visual_add(struct visuals *v, const struct import_geometry *shape)
{
    const struct import_robot *from = v->b->from;
    struct robot *robot = from->robot;
    struct robot_visual *visual;
    struct import_place here;
    char name[64];

    if (robot->nvisual == ROBOT_VISUALS_MAX) {
        v->left_out++;
        return NULL;
    }
    visual = &robot->visual[robot->nvisual++];
    snprintf(name, sizeof name, "%.40s-visual%zu", robot->body[from->body[shape->link]].name,
             robot->nvisual);
    visual->name = visual_copy(v, name);
    visual->body = from->body[shape->link];
    import_place_identity(&here);
    import_place_shape(v->b, shape, &here, visual->position, visual->rotation);
    visual->colored = shape->colored;
    memcpy(visual->color, shape->color, sizeof visual->color);
    return visual;
}

/* Sets the color of a visual to a color of its mesh. */
static void visual_paint(struct visuals *v, struct robot_visual *visual, const double color[4])
{
    v->painted[visual - v->b->from->robot->visual] = visual->colored = true;
    memcpy(visual->color, color, sizeof visual->color);
}

/* ---- meshes ---- */

/* Reads a mesh. If the shape's color overrides the mesh's colors, the mesh gets a single color.
 * Refuses a mesh that exceeds the limit for all meshes together. */
static enum error_code visual_read_mesh(struct visuals *v, const struct import_geometry *shape,
                                        struct arena *scratch, struct import_mesh *mesh,
                                        struct error *why)
{
    char file[PATH_MAX];

    if (import_find_mesh(v->b->from->model, shape, v->b->packages, file, why) !=
            IMPORT_PATH_FOUND ||
        import_read_mesh(file, shape->scale, scratch, mesh, why)) {
        return why->code;
    }
    if (mesh->nface > IMPORT_VISUAL_FACES_MAX - v->faces) {
        return error_set(why, ERROR_INPUT,
                         "%.200s: found %zu faces beyond those of the meshes before it, expected "
                         "at most %d of all: simplify the meshes",
                         file, mesh->nface, IMPORT_VISUAL_FACES_MAX);
    }
    if (shape->repaints) {
        memset(mesh->tint, -1, mesh->nface * sizeof *mesh->tint);
    }
    v->faces += mesh->nface;
    return ERROR_NONE;
}

/* Adds the visuals of an already written mesh again, at this shape's pose. */
static void visual_repeat(struct visuals *v, const struct import_geometry *shape,
                          const struct visual_source *source)
{
    const struct robot_visual *all = v->b->from->robot->visual;

    for (size_t i = source->first; i < source->first + source->count; i++) {
        struct robot_visual *visual = visual_add(v, shape);

        if (visual) {
            visual->file = all[i].file;
            visual->missing = all[i].missing;
        }
        if (visual && v->painted[i]) {
            visual_paint(v, visual, all[i].color);
        }
    }
}

/* Adds the visuals of a mesh. Uses the visuals of the same mesh with the same scale if they exist,
 * else reads and writes the mesh. */
static void visual_add_mesh(struct visuals *v, const struct import_geometry *shape)
{
    const struct robot *robot = v->b->from->robot;
    struct visual_source *source = &v->source[v->nsource];
    struct import_mesh mesh;
    struct arena scratch = {0};
    struct error why = {.code = ERROR_NONE};

    /* Use the files of the same mesh with the same scale */
    for (size_t i = 0; i < v->nsource; i++) {
        if (!strcmp(v->source[i].mesh, shape->mesh) &&
            !memcmp(v->source[i].scale, shape->scale, sizeof shape->scale)) {
            visual_repeat(v, shape, &v->source[i]);
            return;
        }
    }
    if (robot->nvisual == ROBOT_VISUALS_MAX) {
        v->left_out++;
        return;
    }
    *source = (struct visual_source){.mesh = shape->mesh, .first = robot->nvisual};
    memcpy(source->scale, shape->scale, sizeof source->scale);

    /* A mesh that cannot be read does not stop the import; its visual has the reason */
    if (arena_init(&scratch, IMPORT_MESH_ARENA, &why) ||
        visual_read_mesh(v, shape, &scratch, &mesh, &why)) {
        import_shape_note(v->b, shape, IMPORT_MISSING, "visual mesh", ": %.300s",
                          import_reason(shape->file, shape->line, why.text));
        why.text[350] = '\0';
        visual_add(v, shape)->missing = visual_copy(v, why.text);
    } else {
        /* Add a visual for each tint of a mesh that has faces, starting with the uncolored faces
         * (-1). Write the faces of each visual to an STL file with its name. */
        for (int tint = -1; tint < (int)mesh.ncolor && !v->b->error->code; tint++) {
            struct robot_visual *visual =
                import_count_tint(&mesh, tint) ? visual_add(v, shape) : NULL;
            char path[PATH_MAX];

            if (!visual) {
                continue;
            }
            if (tint >= 0) {
                visual_paint(v, visual, mesh.color[tint]);
            }
            snprintf(path, sizeof path, "../meshes/%s.stl", visual->name);
            visual->file = visual_copy(v, path);
            snprintf(path, sizeof path, "%s/%s.stl", v->b->folder, visual->name);
            import_write_tint(&mesh, tint, path, v->b->error);
        }

        if (mesh.remark) {
            import_note_add(v->b->notes, IMPORT_DROPPED, shape->file, shape->line,
                            "visual mesh \"%.150s\" is %s", shape->mesh, mesh.remark);
        }
    }
    arena_fini(&scratch);
    source->count = robot->nvisual - source->first;
    v->nsource++;
}

/* ---- the whole ---- */

enum error_code import_add_visuals(const struct import_builder *b)
{
    const struct import_model *model = b->from->model;
    struct robot *robot = b->from->robot;
    struct visuals v = {.b = b};

    v.source = arena_alloc(b->arena, ROBOT_VISUALS_MAX, sizeof *v.source);
    v.painted = arena_alloc(b->arena, ROBOT_VISUALS_MAX, sizeof *v.painted);
    robot->visual = arena_alloc(b->arena, ROBOT_VISUALS_MAX, sizeof *robot->visual);
    if (!v.source || !v.painted || !robot->visual) {
        return error_set(b->error, ERROR_MEMORY, "no memory for what the robot looks like");
    }
    for (size_t i = 0; i < model->ngeometry && !b->error->code; i++) {
        const struct import_geometry *shape = &model->geometry[i];

        /* Only visible shapes of links that are part of a body */
        if (!shape->visual || b->from->body[shape->link] < 0) {
            continue;
        }
        if (shape->shape == IMPORT_ELLIPSOID) {
            import_shape_note(b, shape, IMPORT_DROPPED, "visual ellipsoid",
                              ": what can touch is shown");
        } else if (shape->shape == IMPORT_MESH) {
            visual_add_mesh(&v, shape);
        } else {
            /* Add the visual of a sphere, box, cylinder or capsule */
            static const enum robot_visual_shape shapes[] = {
                [IMPORT_SPHERE] = VISUAL_SPHERE,
                [IMPORT_BOX] = VISUAL_BOX,
                [IMPORT_CYLINDER] = VISUAL_CYLINDER,
                [IMPORT_CAPSULE] = VISUAL_CAPSULE,
            };
            struct robot_visual *visual = visual_add(&v, shape);

            if (visual) {
                visual->shape = shapes[shape->shape];
                visual->radius = shape->radius;
                visual->length = shape->length;
                memcpy(visual->half, shape->half, sizeof visual->half);
            }
        }
    }
    if (v.left_out) {
        import_note_add(b->notes, IMPORT_DROPPED, model->file, 0,
                        "%zu visual shapes beyond the %d that a robot has at most", v.left_out,
                        ROBOT_VISUALS_MAX);
    }
    return b->error->code;
}
