/* SPDX-License-Identifier: Apache-2.0 */
/* Reads MJCF geoms, both as shapes and as mass and inertia of bodies. */
#include "app/import/readers_private.h"

#include "base/array.h"
#include "base/text.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

#define DENSITY 1000.0 /* kg/m3, MuJoCo's default */

/* A solid of density 1: its volume, m3, its center of mass (the origin except for meshes), and its
 * inertia about the center of mass, m5. */
struct geom_solid {
    double volume, center[3], I[6];
};

/* Computes volume and inertia of a box from half edges, or of an ellipsoid from semi-axes. */
static void solid_take_block(const double half[3], bool box, struct geom_solid *solid)
{
    solid->volume = (box ? 8.0 : 4.0 / 3.0 * M_PI) * half[0] * half[1] * half[2];
    for (int i = 0; i < 3; i++) {
        double a = half[(i + 1) % 3], b = half[(i + 2) % 3];
        double moment = solid->volume * (a * a + b * b);

        solid->I[sym3_index[i][i]] = box ? moment / 3.0 : 0.2 * moment;
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
static void solid_take_mesh(const struct import_reader *r, const struct import_geometry *g,
                            struct geom_solid *solid)
{
    struct arena scratch = {0};
    struct import_mesh mesh, hull;
    struct error why = {.code = ERROR_NONE};
    char path[PATH_MAX];

    if (!r->packages) {
        import_error(r->error, g->file, g->line,
                     "found a body that weighs what mesh \"%.100s\" does, in a text without a "
                     "folder, expected <inertial>",
                     g->mesh);
    } else if (import_find_mesh(r->model, g, r->packages, path, r->error) == IMPORT_PATH_FOUND &&
               !arena_init(&scratch, IMPORT_MESH_ARENA, &why) &&
               !import_read_mesh(path, g->scale, &scratch, &mesh, &why)) {
        /* The mesh is only needed for its integrals, so free its memory immediately */
        if (g->solid != IMPORT_SOLID_CONVEX) {
            solid->volume = import_measure_mesh(&mesh, g->solid, solid->center, solid->I);
        } else if (!import_make_hull(&mesh, &scratch, &hull, &why)) {
            solid->volume = import_measure_mesh(&hull, IMPORT_SOLID_EXACT, solid->center, solid->I);
        }
    }
    if (why.code) {
        import_error(r->error, g->file, g->line,
                     "found a body that weighs what its mesh does: %.400s", why.text);
    }
    arena_fini(&scratch);
}

/* Computes volume and inertia of a geom of any shape. */
static void geom_measure(const struct import_reader *r, const struct import_geometry *g,
                         struct geom_solid *solid)
{
    const double ball[3] = {g->radius, g->radius, g->radius};

    *solid = (struct geom_solid){0};
    switch (g->shape) {
    case IMPORT_SPHERE:
        solid_take_block(ball, false, solid);
        break;
    case IMPORT_ELLIPSOID:
        solid_take_block(g->half, false, solid);
        break;
    case IMPORT_BOX:
        solid_take_block(g->half, true, solid);
        break;
    case IMPORT_CYLINDER:
    case IMPORT_CAPSULE:
        solid_take_round(g, solid);
        break;
    default:
        solid_take_mesh(r, g, solid);
        break;
    }
}

/* Checks whether fixed joints attach a link to the world. */
static bool link_stands_still(const struct import_model *model, int link)
{
    for (size_t j = model->njoint; j-- > 0;) {
        const struct import_joint *joint = &model->joint[j];

        if (joint->child_link == link) {
            if (joint->type != IMPORT_FIXED) {
                return false;
            }
            link = joint->parent_link;
        }
    }
    return true;
}

/* Adds a geom's mass and inertia to a body whose inertia comes from geoms. */
static void geom_add_inertia(const struct import_reader *r, const xmlNode *node,
                             const struct import_geometry *g, bool fitted,
                             struct robot_inertia *inertia)
{
    const char *shell = mjcf_attribute(r, node, "shellinertia");
    double density = DENSITY, mass = 0.0, group = 0.0;
    const bool by_mass = mjcf_reals(r, node, "mass", 1, &mass);
    struct robot_inertia own = {0};
    struct geom_solid solid;

    /* Skip geoms outside inertiagrouprange and geoms without mass */
    mjcf_reals(r, node, "density", 1, &density);
    mjcf_reals(r, node, "group", 1, &group);
    if (group < r->groups[0] || group > r->groups[1] || (by_mass ? mass == 0.0 : density == 0.0)) {
        return;
    }
    if (fitted && link_stands_still(r->model, g->link)) {
        reader_note(r, IMPORT_DROPPED, node,
                    "mass of a geom that MuJoCo fits to a mesh: its body stands still");
        return;
    }
    if (fitted) {
        xml_refuse(r->file, node,
                   "found a body that weighs what a shape does that MuJoCo fits to the mesh, "
                   "expected type \"mesh\", a size without a mesh, or <inertial>");
        return;
    }
    geom_measure(r, g, &solid);
    own.mass = by_mass ? mass : density * solid.volume;
    if (!(solid.volume > 0.0) || !(own.mass > 0.0) || own.mass > 1e6 ||
        (shell && !strcmp(shell, "true"))) {
        xml_refuse(r->file, node,
                   "found a body that weighs what its geoms do, of which one weighs %g kg and has "
                   "%g m3%s, expected a solid: load the file in MuJoCo and save it "
                   "(mj_saveLastXML), which writes inertias",
                   own.mass, solid.volume, shell ? " of a shell" : "");
        return;
    }
    /* Scale the solid of density 1 to the mass, and move it to the geom's pose */
    memcpy(own.com, solid.center, sizeof own.com);
    for (int i = 0; i < 6; i++) {
        own.I[i] = solid.I[i] * own.mass / solid.volume;
    }
    import_add_inertia(inertia, &own, &g->place);
}

/* Moves a geom so that the vertices of its mesh can stay as in the mesh file. MuJoCo subtracts
 * refpos from the vertices, rotates them by the inverse of refquat, and scales them. */
static void geom_move_mesh(const struct import_reader *r, const xmlNode *mesh,
                           struct import_geometry *g)
{
    double origin[3] = {0, 0, 0}, quat[4] = {1, 0, 0, 0}, R[9];
    const struct import_place own = g->place;
    struct import_place moved;

    mjcf_reals(r, mesh, "refpos", 3, origin);
    if (mjcf_reals(r, mesh, "refquat", 4, quat) &&
        (g->scale[0] != g->scale[1] || g->scale[0] != g->scale[2])) {
        xml_refuse(r->file, mesh,
                   "found refquat of a mesh with scale %g %g %g, expected one scale: turned meshes "
                   "are not stretched",
                   g->scale[0], g->scale[1], g->scale[2]);
    }
    mat3_from_quaternion(quat, R);
    mat3_transpose(R, moved.R);
    for (int m = 0; m < 3; m++) {
        origin[m] *= -g->scale[m];
    }
    mat3_apply(moved.R, origin, moved.xyz);
    import_place_compose(&own, &moved, &g->place);
}

/* Finds the mesh of a geom: its file, below meshdir unless the path is absolute, its scale, its
 * reference pose, and the method for its inertia. */
static void geom_read_mesh(const struct import_reader *r, const xmlNode *node,
                           struct import_geometry *g)
{
    const char *name = mjcf_attribute(r, node, "mesh"), *file, *how;
    const struct xml_name *mesh = name ? xml_names_find(&r->meshes, name, NULL) : NULL;
    bool below;

    g->scale[0] = g->scale[1] = g->scale[2] = 1;
    g->mesh = "";
    if (!mesh) {
        xml_refuse(r->file, node, "found mesh \"%.63s\", expected one of <asset> with a file",
                   name ? name : "");
        return;
    }
    /* In MuJoCo 3, the mesh gives the method for its inertia */
    how = mjcf_attribute(r, mesh->node, "inertia");
    how = how ? how : r->exact_meshes ? "exact" : "";
    g->solid = !strcmp(how, "exact")    ? IMPORT_SOLID_EXACT
               : !strcmp(how, "shell")  ? IMPORT_SOLID_SHELL
               : !strcmp(how, "convex") ? IMPORT_SOLID_CONVEX
                                        : IMPORT_SOLID_PYRAMIDS;
    if (g->solid == IMPORT_SOLID_CONVEX && mjcf_attribute(r, mesh->node, "maxhullvert")) {
        xml_refuse(r->file, mesh->node,
                   "found maxhullvert and inertia \"convex\" of a mesh, expected one of them: "
                   "import computes the whole hull");
    }
    file = xml_attribute(mesh->node, "file");
    below = *r->meshdir != '\0' && file[0] != '/';
    g->mesh = reader_format(r, "%.200s%s%.300s", below ? r->meshdir : "", below ? "/" : "", file);
    mjcf_reals(r, mesh->node, "scale", 3, g->scale);
    geom_move_mesh(r, mesh->node, g);
}

/* Reads the shape of a geom. Returns false, with a note, for planes and other shapes that robot
 * files do not have. */
static bool geom_read_type(const struct import_reader *r, const xmlNode *node,
                           struct import_geometry *g)
{
    static const char *const words[] = {
        [IMPORT_SPHERE] = "sphere",       [IMPORT_BOX] = "box",
        [IMPORT_CYLINDER] = "cylinder",   [IMPORT_CAPSULE] = "capsule",
        [IMPORT_ELLIPSOID] = "ellipsoid", [IMPORT_MESH] = "mesh",
    };
    const char *type = mjcf_attribute(r, node, "type");
    int i;

    type = type ? type : mjcf_attribute(r, node, "mesh") ? "mesh" : "sphere";
    i = TEXT_INDEX(words, ARRAY_COUNT(words), type);
    g->shape = (enum import_shape)i;
    if (i < 0) {
        reader_note(r, IMPORT_DROPPED, node,
                    "geom of type \"%.40s\": robots here have spheres, boxes, cylinders, capsules, "
                    "ellipsoids and meshes",
                    type);
    }
    return i >= 0;
}

/* Reads the dimensions of a geom from size, or from the ends in fromto. */
static void geom_read_size(const struct import_reader *r, const xmlNode *node,
                           struct import_geometry *g)
{
    double size[3] = {0, 0, 0}, ends[6], along[3];
    const bool round = g->shape == IMPORT_CYLINDER || g->shape == IMPORT_CAPSULE;
    int need = g->shape == IMPORT_SPHERE ? 1 : round ? 2 : 3;

    mjcf_some_reals(r, node, "size", 3, size);
    if (g->shape != IMPORT_SPHERE && mjcf_reals(r, node, "fromto", 6, ends)) {
        /* The ends give the length. size gives the half width, the same in x and y */
        vec3_sub(ends, ends + 3, along);
        size[1] = round ? 0.5 * vec3_norm(along) : size[0];
        size[2] = 0.5 * vec3_norm(along);
        need = 1;
    }
    memcpy(g->half, size, sizeof g->half);
    g->radius = size[0];
    g->length = 2.0 * size[1];
    for (int i = 0; i < need; i++) {
        if (!(size[i] > 0 && size[i] < 1e3)) {
            xml_refuse(r->file, node, "found size %g of a geom, expected %d above 0", size[i],
                       need);
        }
    }
}

void mjcf_read_geom(const struct import_reader *r, const xmlNode *node, int link,
                    struct robot_inertia *inertia)
{
    struct import_geometry g = {
        .file = xml_name(r->file, node), .line = xml_line(node), .link = link};
    double type = 1, affinity = 1;
    bool fitted;

    mjcf_read_place(r, node, &g.place);
    mjcf_reals(r, node, "contype", 1, &type);
    mjcf_reals(r, node, "conaffinity", 1, &affinity);
    if (!geom_read_type(r, node, &g)) {
        return; /* planes and height fields have no mass in MuJoCo */
    }

    /* Read dimensions first, because mass and inertia depend on them. Where MuJoCo fits a shape to
     * a mesh, use the mesh itself, without mass */
    fitted = g.shape != IMPORT_MESH && mjcf_attribute(r, node, "mesh");
    if (fitted) {
        reader_note(r, IMPORT_SHAPED, node,
                    "geom that MuJoCo fits to mesh \"%.63s\" has the shape of the mesh",
                    mjcf_attribute(r, node, "mesh"));
        g.shape = IMPORT_MESH;
    }
    if (g.shape == IMPORT_MESH) {
        geom_read_mesh(r, node, &g);
    } else {
        geom_read_size(r, node, &g);
    }
    if (inertia && !r->error->code) {
        geom_add_inertia(r, node, &g, fitted, inertia);
    }
    g.collision = type != 0 || affinity != 0;

    /* Read the color of a geom from its rgba or its material. A geom is visible if it is in groups
     * 0 to 2, as in MuJoCo's viewer. Ignore colors in the mesh file. */
    static const double gray[4] = {0.5, 0.5, 0.5, 1.0}, white[4] = {1.0, 1.0, 1.0, 1.0};
    const char *name = mjcf_attribute(r, node, "material");
    const struct xml_name *material = name ? xml_names_find(&r->materials, name, NULL) : NULL;
    double group = 0.0;

    /* The geom's own rgba has priority over its material's */
    mjcf_reals(r, node, "group", 1, &group);
    memcpy(g.color, gray, sizeof g.color);
    if (!mjcf_reals(r, node, "rgba", 4, g.color) && material) {
        memcpy(g.color, white, sizeof g.color);
        mjcf_reals(r, material->node, "rgba", 4, g.color);
    }
    for (int m = 0; m < 4; m++) {
        g.color[m] = fmin(fmax(g.color[m], 0.0), 1.0);
    }
    g.visual = group < 3.0 && g.color[3] > 0.0;
    g.colored = g.repaints = true;
    r->model->geometry[r->model->ngeometry++] = g;
}
