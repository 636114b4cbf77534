/* SPDX-License-Identifier: Apache-2.0 */
/* Reads MJCF geoms, as shapes and as the mass and inertia of bodies. */
#include "app/import/mjcf_private.h"

#include "base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define DENSITY 1000.0 /* kg/m3, MuJoCo's default */

/* A solid of density 1: volume, m3, and inertia, m5, about its center of mass, which is the origin
 * except for meshes. */
struct geom_solid {
    double volume, center[3], I[6];
};

/* Computes volume and inertia from semi-axes or half edges, with the shape's factor: 1/5 for an
 * ellipsoid, 1/3 for a box. volume: volume of the shape with half edges 1. */
static void solid_take_ellipsoid(const double half[3], double volume, struct geom_solid *solid)
{
    solid->volume = volume * half[0] * half[1] * half[2];
    for (int i = 0; i < 3; i++) {
        double a = half[(i + 1) % 3], b = half[(i + 2) % 3];

        solid->I[sym3_index[i][i]] = solid->volume * (a * a + b * b);
    }
}

/* Computes volume and inertia of a cylinder or capsule about z. */
static void solid_take_round(const struct import_geometry *g, struct geom_solid *solid)
{
    const double radius = g->radius, length = g->length;
    double along, across, ball;

    solid->volume = M_PI * radius * radius * length;
    along = 0.5 * solid->volume * radius * radius;
    across = solid->volume * (3.0 * radius * radius + length * length) / 12.0;
    if (g->shape == IMPORT_CAPSULE) {
        /* Add the half-spheres, whose centers of mass are 3/8 of the radius beyond the cylinder */
        ball = 4.0 / 3.0 * M_PI * radius * radius * radius;
        solid->volume += ball;
        along += 0.4 * ball * radius * radius;
        across += ball * (0.4 * radius * radius + 0.375 * radius * length + 0.25 * length * length);
    }
    solid->I[0] = solid->I[3] = across;
    solid->I[5] = along;
}

/* Computes volume and inertia of a geom's mesh, in the frame of its file. */
static enum error_code solid_take_mesh(const struct mjcf_reader *r, const struct import_geometry *g,
                                       struct geom_solid *solid)
{
    struct arena scratch = {0};
    struct import_mesh mesh;
    struct error why;
    const char *path;
    enum error_code code;

    if (!r->packages) {
        return import_error(r->error, g->file, g->line,
                            "found a body that weighs what mesh \"%.100s\" does, in a text without "
                            "a folder, expected <inertial>",
                            g->mesh);
    }
    if ((code = arena_init(&scratch, IMPORT_MESH_ARENA, &why)) ||
        (code = import_find_mesh(r->model, g, r->packages, &scratch, &path, r->error))) {
        arena_fini(&scratch);
        return code;
    }

    /* The mesh is needed only for its integrals, so its memory is freed immediately */
    code = import_read_mesh(path, g->scale, &scratch, &mesh, &why);
    if (code) {
        import_error(r->error, g->file, g->line,
                     "found a body that weighs what its mesh does: %.400s", why.text);
    } else {
        solid->volume = import_measure_mesh(&mesh, r->exact_meshes, solid->center, solid->I);
    }
    arena_fini(&scratch);
    return code;
}

/* Computes volume and inertia of a geom of any shape. */
static enum error_code geom_measure(const struct mjcf_reader *r, const struct import_geometry *g,
                                    struct geom_solid *solid)
{
    const double ball[3] = {g->radius, g->radius, g->radius};

    *solid = (struct geom_solid){0};
    switch (g->shape) {
    case IMPORT_SPHERE:
    case IMPORT_ELLIPSOID:
        solid_take_ellipsoid(g->shape == IMPORT_SPHERE ? ball : g->half, 4.0 / 3.0 * M_PI, solid);
        for (int i = 0; i < 6; i++) {
            solid->I[i] *= 0.2;
        }
        return ERROR_NONE;
    case IMPORT_BOX:
        solid_take_ellipsoid(g->half, 8.0, solid);
        for (int i = 0; i < 6; i++) {
            solid->I[i] /= 3.0;
        }
        return ERROR_NONE;
    case IMPORT_CYLINDER:
    case IMPORT_CAPSULE:
        solid_take_round(g, solid);
        return ERROR_NONE;
    default:
        return solid_take_mesh(r, g, solid);
    }
}

/* Checks whether the group of a geom is within inertiagrouprange, and so counts for mass. */
static enum error_code geom_is_counted(const struct mjcf_reader *r, const xmlNode *node,
                                       const char *childclass, bool *counted)
{
    double group = 0.0;
    enum error_code code = mjcf_reals(r, node, childclass, "group", 1, &group, NULL);

    *counted = group >= r->groups[0] && group <= r->groups[1];
    return code;
}

/* Adds a geom's mass and inertia to a body that gets its inertia from geoms. */
static enum error_code geom_add_inertia(const struct mjcf_reader *r, const xmlNode *node,
                                        const char *childclass, const struct import_geometry *g,
                                        struct robot_inertia *inertia)
{
    const char *shell = mjcf_attribute(r, node, childclass, "shellinertia");
    struct robot_inertia own = {0};
    double density = DENSITY, mass;
    struct geom_solid solid;
    bool by_mass, counted;
    enum error_code code;

    /* Geoms outside the groups and those without mass add nothing */
    if ((code = mjcf_reals(r, node, childclass, "density", 1, &density, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "mass", 1, &mass, &by_mass)) ||
        (code = geom_is_counted(r, node, childclass, &counted)) || !counted ||
        (by_mass ? mass == 0.0 : density == 0.0) || (code = geom_measure(r, g, &solid))) {
        return code;
    }
    own.mass = by_mass ? mass : density * solid.volume;
    if (!(solid.volume > 0.0) || !(own.mass > 0.0) || own.mass > 1e6 ||
        (shell && !strcmp(shell, "true"))) {
        return import_error(
            r->error, g->file, g->line,
            "found a body that weighs what its geoms do, of which one weighs %g kg and has %g "
            "m3%s, expected a solid: load the file in MuJoCo and save it (mj_saveLastXML), which "
            "writes inertias",
            own.mass, solid.volume, shell ? " of a shell" : "");
    }
    if (g->shape == IMPORT_MESH && !by_mass && !r->exact_meshes) {
        import_note_add(r->notes, IMPORT_ASSUMED, g->file, g->line,
                        "mesh \"%.100s\" weighs %g kg, by its volume; MuJoCo 2.2 takes that of a "
                        "box of its inertia unless exactmeshinertia is \"true\"",
                        g->mesh, own.mass);
    }

    /* Scale the solid of density 1 to the mass, and move it to the geom's place */
    memcpy(own.com, solid.center, sizeof own.com);
    for (int i = 0; i < 6; i++) {
        own.I[i] = solid.I[i] * own.mass / solid.volume;
    }
    import_add_inertia(inertia, &own, &g->place);
    return ERROR_NONE;
}

/* Finds the mesh that a geom names: its file, below meshdir unless the path is absolute, and its
 * scale. */
static enum error_code geom_read_mesh(const struct mjcf_reader *r, const xmlNode *node,
                                      const char *childclass, struct import_geometry *g)
{
    const char *name = mjcf_attribute(r, node, childclass, "mesh"), *file;
    const struct mjcf_name *mesh = name ? mjcf_find(&r->meshes, name) : NULL;
    bool below = *r->meshdir != '\0';
    char path[512];

    g->scale[0] = g->scale[1] = g->scale[2] = 1;
    if (!mesh) {
        return import_error(r->error, g->file, g->line,
                            "found mesh \"%.63s\", expected one of <asset> with a file",
                            name ? name : "");
    }
    if (xml_attribute(mesh->node, "refpos") || xml_attribute(mesh->node, "refquat")) {
        return mjcf_refuse(r, mesh->node,
                           "found refpos or refquat of a mesh, expected it where its file has it: "
                           "move the geom instead");
    }

    /* The path is that of the file, below meshdir unless it is absolute */
    file = xml_attribute(mesh->node, "file");
    below = below && file[0] != '/';
    snprintf(path, sizeof path, "%.200s%s%.300s", below ? r->meshdir : "", below ? "/" : "", file);
    g->mesh = arena_strdup(r->arena, path);
    return g->mesh ? mjcf_reals(r, mesh->node, NULL, "scale", 3, g->scale, NULL)
                   : mjcf_no_memory(r);
}

/* Reads the shape of a geom; known is false, with a note, for planes and other shapes that robots
 * here lack. */
static enum error_code geom_read_type(const struct mjcf_reader *r, const xmlNode *node,
                                      const char *childclass, struct import_geometry *g,
                                      bool *known)
{
    static const struct {
        const char *word;
        enum import_shape shape;
    } shapes[] = {{"sphere", IMPORT_SPHERE},     {"box", IMPORT_BOX},
                  {"cylinder", IMPORT_CYLINDER}, {"capsule", IMPORT_CAPSULE},
                  {"mesh", IMPORT_MESH},         {"ellipsoid", IMPORT_ELLIPSOID},
                  {NULL, IMPORT_SPHERE}};
    const char *type = mjcf_attribute(r, node, childclass, "type");

    type = type ? type : mjcf_attribute(r, node, childclass, "mesh") ? "mesh" : "sphere";
    *known = false;
    for (size_t i = 0; shapes[i].word && !*known; i++) {
        *known = !strcmp(type, shapes[i].word);
        g->shape = shapes[i].shape;
    }
    if (!*known) {
        import_note_add(r->notes, IMPORT_DROPPED, g->file, g->line,
                        "geom of type \"%.40s\": robots here have spheres, boxes, cylinders, "
                        "capsules, ellipsoids and meshes",
                        type);
    }
    return ERROR_NONE;
}

/* Reads the dimensions of a geom, by size or, for round ones, by the ends fromto. */
static enum error_code geom_read_size(const struct mjcf_reader *r, const xmlNode *node,
                                      const char *childclass, struct import_geometry *g)
{
    double size[3] = {0, 0, 0}, ends[6], along[6] = {0};
    bool by_ends, round = g->shape == IMPORT_CYLINDER || g->shape == IMPORT_CAPSULE;
    size_t count, need = g->shape == IMPORT_SPHERE ? 1 : round ? 2 : 3;
    enum error_code code;

    if ((code = mjcf_some_reals(r, node, childclass, "size", 3, size, &count)) ||
        (code = mjcf_reals(r, node, childclass, "fromto", 6, ends, &by_ends))) {
        return code;
    }
    memcpy(g->half, size, sizeof g->half);
    g->radius = size[0];
    g->length = 2.0 * size[1];
    if (by_ends && round) {
        /* From one end to the other: place the geom in the middle, with z along it */
        vec3_sub(ends + 3, ends, along);
        g->length = vec3_norm(along);
        for (int m = 0; m < 3; m++) {
            g->place.xyz[m] = 0.5 * (ends[m] + ends[3 + m]);
            /* A second axis not along the first: along the smallest components of the direction */
            along[3 + m] = fabs(along[m]) < 0.6 * g->length;
        }

        /* The columns come out as z, x, y: move the first one to the end */
        if (g->length > 0 && mjcf_axes_to_rotation(along, g->place.R)) {
            const double x[3] = {g->place.R[0], g->place.R[3], g->place.R[6]};

            for (int m = 0; m < 3; m++) {
                g->place.R[3 * m] = g->place.R[3 * m + 1];
                g->place.R[3 * m + 1] = g->place.R[3 * m + 2];
                g->place.R[3 * m + 2] = x[m];
            }
        }
        need = 1;
    }
    for (size_t i = 0; i < need; i++) {
        if (!(size[i] > 0 && size[i] < 1e3)) {
            return import_error(r->error, g->file, g->line,
                                "found size %g of a geom, expected %zu above 0", size[i], need);
        }
    }
    return ERROR_NONE;
}

/* Reads the color of a geom, by its rgba or its material, and whether MuJoCo's viewer shows it: it
 * shows groups 0 to 2. Colors in the file of a mesh do not count. */
static enum error_code geom_read_looks(const struct mjcf_reader *r, const xmlNode *node,
                                       const char *childclass, struct import_geometry *g)
{
    static const double gray[4] = {0.5, 0.5, 0.5, 1.0}, white[4] = {1.0, 1.0, 1.0, 1.0};
    const char *name = mjcf_attribute(r, node, childclass, "material");
    const struct mjcf_name *material = name ? mjcf_find(&r->materials, name) : NULL;
    double group = 0.0;
    bool own;
    enum error_code code;

    memcpy(g->color, gray, sizeof g->color);
    if ((code = mjcf_reals(r, node, childclass, "group", 1, &group, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "rgba", 4, g->color, &own))) {
        return code;
    }

    /* The geom's own rgba has priority over its material's */
    if (!own && material) {
        memcpy(g->color, white, sizeof g->color);
        code = mjcf_reals(r, material->node, NULL, "rgba", 4, g->color, NULL);
    }
    for (int m = 0; m < 4; m++) {
        g->color[m] = fmin(fmax(g->color[m], 0.0), 1.0);
    }

    /* MuJoCo's viewer shows groups 0 to 2; a color always overrides the mesh's */
    g->visual = group < 3.0 && g->color[3] > 0.0;
    g->colored = g->repaints = true;
    return code;
}

enum error_code mjcf_read_geom(const struct mjcf_reader *r, const xmlNode *node,
                               const char *childclass, int link, struct robot_inertia *inertia)
{
    struct import_geometry g = {.file = mjcf_file(r, node), .line = xml_line(node), .link = link};
    double type = 1, affinity = 1;
    bool known;
    enum error_code code;

    if ((code = mjcf_read_place(r, node, childclass, &g.place)) ||
        (code = mjcf_reals(r, node, childclass, "contype", 1, &type, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "conaffinity", 1, &affinity, NULL)) ||
        (code = geom_read_type(r, node, childclass, &g, &known))) {
        return code;
    }
    if (!known) {
        return ERROR_NONE; /* planes and height fields have no mass in MuJoCo either */
    }

    /* Dimensions first, because mass and inertia depend on them */
    if ((code = g.shape == IMPORT_MESH ? geom_read_mesh(r, node, childclass, &g)
                                       : geom_read_size(r, node, childclass, &g)) ||
        (inertia && (code = geom_add_inertia(r, node, childclass, &g, inertia)))) {
        return code;
    }
    g.collision = type != 0 || affinity != 0;
    if ((code = geom_read_looks(r, node, childclass, &g))) {
        return code;
    }
    r->model->geometry[r->model->ngeometry++] = g;
    return ERROR_NONE;
}
