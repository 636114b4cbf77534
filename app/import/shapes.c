/* SPDX-License-Identifier: Apache-2.0 */
/* Fits capsules to collision shapes. */
#include "app/import/shapes.h"

#include "base/vec3.h"
#include "contact/mesh/mesh.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

enum { SIZE_DOUBT = 20 }; /* a shape larger than so many joint distances is probably a mistake */

/* Data for fitting the shapes; written counts OBJ files in folder. */
struct shape_builder {
    struct import_robot *from;
    const struct import_packages *packages;
    const char *folder;
    struct arena *arena;
    struct import_notes *notes;
    size_t *written;
    struct error *error;
};

/* ---- fitting ---- */

/* Returns a right-handed rotation whose third column is axis m. */
static void axis_to_rotation(int m, double R[9])
{
    static const double column[3][9] = {
        {0, 0, 1, 1, 0, 0, 0, 1, 0},
        {0, 1, 0, 0, 0, 1, 1, 0, 0},
        {1, 0, 0, 0, 1, 0, 0, 0, 1},
    };

    memcpy(R, column[m], sizeof column[m]);
}

/* Fits the enclosing capsule of points along the longest side of their bounding box. */
static void capsule_hold_points(const double (*point)[3], size_t count,
                                struct robot_capsule *capsule)
{
    double low[3], high[3], middle[3], radius = 0.0, half = 0.0;
    int along = 0;

    memcpy(low, point[0], sizeof low);
    memcpy(high, point[0], sizeof high);
    for (size_t i = 0; i < count; i++) {
        for (int m = 0; m < 3; m++) {
            low[m] = fmin(low[m], point[i][m]);
            high[m] = fmax(high[m], point[i][m]);
        }
    }

    /* Axis: through the middle of the box, along its longest side */
    for (int m = 0; m < 3; m++) {
        middle[m] = 0.5 * (low[m] + high[m]);
        along = high[m] - low[m] > high[along] - low[along] ? m : along;
    }

    /* First pass: the radius, by the point farthest from the axis. Second: the length that its ends
     * must reach */
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < count; i++) {
            double d[3], across, reach;

            vec3_sub(point[i], middle, d);
            reach = fabs(d[along]);
            d[along] = 0.0;
            across = vec3_norm(d);
            if (pass == 0) {
                radius = fmax(radius, across);
            } else {
                half = fmax(half, reach - sqrt(fmax(radius * radius - across * across, 0.0)));
            }
        }
    }
    memcpy(capsule->position, middle, sizeof middle);
    axis_to_rotation(along, capsule->rotation);
    capsule->radius = fmax(radius, 1e-6);
    capsule->length = 2.0 * half;
}

/* Fits an enclosing capsule of a box with these half edges, m. */
static void capsule_hold_box(const double half[3], struct robot_capsule *capsule)
{
    double corner[8][3];

    for (int c = 0; c < 8; c++) {
        for (int m = 0; m < 3; m++) {
            corner[c][m] = c & 1 << m ? half[m] : -half[m];
        }
    }
    capsule_hold_points(corner, 8, capsule);
}

/* Fits a capsule along the longest semi-axis with the next one as radius. It encloses the
 * ellipsoid, which is slimmer toward the ends than the half-spheres. */
static void capsule_hold_ellipsoid(const double half[3], struct robot_capsule *capsule)
{
    int along = half[1] > half[0] ? 1 : 0;

    along = half[2] > half[along] ? 2 : along;
    memset(capsule->position, 0, sizeof capsule->position);
    axis_to_rotation(along, capsule->rotation);
    capsule->radius = fmax(half[(along + 1) % 3], half[(along + 2) % 3]);
    capsule->length = 2.0 * (half[along] - capsule->radius);
}

/* Fits a capsule into a cylinder, of the same radius and overall length; a capsule stays as it
 * is. */
static void capsule_from_cylinder(const struct import_geometry *shape,
                                  struct robot_capsule *capsule)
{
    memset(capsule->position, 0, sizeof capsule->position);
    mat3_identity(capsule->rotation);
    capsule->radius = shape->radius;
    capsule->length = shape->shape == IMPORT_CYLINDER
                          ? fmax(shape->length - 2.0 * shape->radius, 0.0)
                          : shape->length;
}

/* ---- meshes ---- */

/* Returns in words whether contact accepts a mesh as a surface. */
static const char *mesh_judge(const struct import_mesh *mesh)
{
    const struct mesh surface = {.name = "",
                                 .nvertex = mesh->nvertex,
                                 .nface = mesh->nface,
                                 .vertex = (const double(*)[3])mesh->vertex,
                                 .face = (const int(*)[3])mesh->face};
    struct mesh_finding finding = {0};

    if (mesh_check(&surface, &finding, NULL)) {
        return "not checked";
    }
    return finding.fault == MESH_SOUND ? "a sound surface" : mesh_fault_text(finding.fault);
}

/* Reads a mesh, fits a capsule and writes the OBJ file; false, with a note, when one of these
 * fails. */
static bool shape_fit_mesh(const struct shape_builder *b, const struct import_geometry *shape,
                           struct robot_capsule *capsule)
{
    const struct import_model *model = b->from->model;
    char path[PATH_MAX];
    struct import_mesh mesh;
    struct arena scratch = {0};
    struct error why;
    const char *file;
    bool fitted = false;

    if (arena_init(&scratch, IMPORT_MESH_ARENA, &why) ||
        import_find_mesh(model, shape, b->packages, &scratch, &file, &why) ||
        import_read_mesh(file, shape->scale, &scratch, &mesh, &why)) {
        import_note_add(b->notes, IMPORT_MISSING, shape->file, shape->line,
                        "collision mesh of link \"%.63s\": %.300s", model->link[shape->link].name,
                        import_reason(shape->file, shape->line, why.text));
        arena_fini(&scratch);
        return false;
    }

    /* The surface itself is kept as an OBJ file for scenes that want it */
    capsule_hold_points((const double(*)[3])mesh.vertex, mesh.nvertex, capsule);
    snprintf(path, sizeof path, "%s/%s.obj", b->folder, capsule->name);
    if (import_write_mesh(&mesh, path, &why)) {
        import_note_add(b->notes, IMPORT_DROPPED, shape->file, shape->line, "%.400s", why.text);
    } else {
        ++*b->written;
        import_note_add(
            b->notes, IMPORT_SHAPED, shape->file, shape->line,
            "collision mesh \"%.150s\" is meshes/%s.obj (%zu faces, %s), and the capsule "
            "that holds it",
            shape->mesh, capsule->name, mesh.nface, mesh_judge(&mesh));
        fitted = true;
    }
    arena_fini(&scratch);
    return fitted;
}

/* ---- the whole ---- */

/* Makes the name of a capsule, BODY-shellNUMBER. */
static enum error_code shape_make_name(const struct shape_builder *b,
                                       const struct import_geometry *shape, int number,
                                       const char **name)
{
    const struct import_robot *from = b->from;
    char text[64];

    snprintf(text, sizeof text, "%.40s-shell%d", from->robot->body[from->body[shape->link]].name,
             number);
    *name = arena_strdup(b->arena, text);
    return *name ? ERROR_NONE
                 : error_set(b->error, ERROR_MEMORY, "no memory for the shapes of the robot");
}

/* Fits a capsule to one shape, in the shape's own frame, and adds a note if it is inexact; returns
 * false if there is none. */
static bool shape_fit(const struct shape_builder *b, const struct import_geometry *shape,
                      struct robot_capsule *capsule)
{
    const struct import_model *model = b->from->model;

    switch (shape->shape) {
    /* Boxes, ellipsoids and meshes get the capsule that holds them; round shapes are close to
     * one */
    case IMPORT_MESH:
        return b->folder && shape_fit_mesh(b, shape, capsule);
    case IMPORT_BOX:
        capsule_hold_box(shape->half, capsule);
        import_note_add(b->notes, IMPORT_SHAPED, shape->file, shape->line,
                        "collision box of link \"%.63s\" is the capsule that holds it",
                        model->link[shape->link].name);
        return true;
    case IMPORT_ELLIPSOID:
        capsule_hold_ellipsoid(shape->half, capsule);
        import_note_add(b->notes, IMPORT_SHAPED, shape->file, shape->line,
                        "collision ellipsoid of link \"%.63s\" is the capsule that holds it",
                        model->link[shape->link].name);
        return true;
    case IMPORT_CYLINDER:
        import_note_add(b->notes, IMPORT_SHAPED, shape->file, shape->line,
                        "collision cylinder of link \"%.63s\" has round ends%s",
                        model->link[shape->link].name,
                        shape->length < 2.0 * shape->radius ? ", and is a sphere: it is wider than "
                                                              "long"
                                                            : "");
        capsule_from_cylinder(shape, capsule);
        return true;
    default:
        capsule_from_cylinder(shape, capsule);
        return true;
    }
}

/* Returns the largest distance between a joint and its parent link, m. */
static double shape_find_reach(const struct import_model *model)
{
    double reach = 0.0;

    for (size_t i = 0; i < model->njoint; i++) {
        const double *xyz = model->joint[i].place.xyz;

        reach = fmax(reach, hypot(hypot(xyz[0], xyz[1]), xyz[2]));
    }
    return reach;
}

/* Adds a note on a capsule much larger than the robot, as from a mesh in mm without a scale. */
static void shape_doubt_size(const struct shape_builder *b, const struct import_geometry *shape,
                             const struct robot_capsule *capsule)
{
    const double reach = shape_find_reach(b->from->model);
    const double length = capsule->length + 2.0 * capsule->radius;

    if (reach > 0.0 && length > SIZE_DOUBT * reach) {
        import_note_add(
            b->notes, IMPORT_DOUBTED, shape->file, shape->line,
            "collision shape of link \"%.63s\" is %.3g m long, the largest distance of "
            "two joints is %.3g m%s",
            b->from->model->link[shape->link].name, length, reach,
            shape->shape == IMPORT_MESH ? ": a mesh in mm needs scale=\"0.001 0.001 0.001\"" : "");
    }
}

/* Adds the capsule of one shape to the robot. */
static enum error_code shape_add(const struct shape_builder *b, const struct import_geometry *shape,
                                 int number)
{
    struct robot *robot = b->from->robot;
    struct robot_capsule capsule = {0};
    struct import_place own, in_body, place;
    enum error_code code = shape_make_name(b, shape, number, &capsule.name);

    if (code || !shape_fit(b, shape, &capsule)) {
        return code;
    }
    shape_doubt_size(b, shape, &capsule);

    /* Compose places: the link's in the body, the shape's in the link, the capsule's in the
     * shape */
    memcpy(own.xyz, capsule.position, sizeof own.xyz);
    memcpy(own.R, capsule.rotation, sizeof own.R);
    import_place_compose(&b->from->place[shape->link], &shape->place, &in_body);
    import_place_compose(&in_body, &own, &place);
    memcpy(capsule.position, place.xyz, sizeof capsule.position);
    memcpy(capsule.rotation, place.R, sizeof capsule.rotation);
    capsule.body = b->from->body[shape->link];
    robot->capsule[robot->ncapsule++] = capsule;
    return ERROR_NONE;
}

enum error_code import_check_shapes(const struct import_robot *from,
                                    const struct import_packages *packages, struct error *error)
{
    const struct import_model *model = from->model;
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < model->ngeometry && !code; i++) {
        const struct import_geometry *shape = &model->geometry[i];

        if (shape->collision && shape->shape == IMPORT_MESH) {
            code = import_check_mesh(model, shape, packages, error);
        }
    }
    return code;
}

enum error_code import_add_shapes(struct import_robot *from, const struct import_packages *packages,
                                  const char *folder, struct arena *arena,
                                  struct import_notes *notes, size_t *written, struct error *error)
{
    const struct import_model *model = from->model;
    const struct shape_builder b = {from, packages, folder, arena, notes, written, error};
    enum error_code code = ERROR_NONE;

    from->robot->capsule = arena_alloc(arena, model->ngeometry + 1, sizeof *from->robot->capsule);
    if (!from->robot->capsule) {
        return error_set(error, ERROR_MEMORY, "no memory for the shapes of the robot");
    }
    for (size_t i = 0; i < model->ngeometry && !code; i++) {
        if (model->geometry[i].collision && from->body[model->geometry[i].link] >= 0) {
            code = shape_add(&b, &model->geometry[i], (int)from->robot->ncapsule + 1);
        }
    }
    return code;
}

double import_capsule_bottom(const struct robot_capsule *capsule, const struct body_motion *bodies)
{
    const struct body_motion *body = &bodies[capsule->body];
    double end[3], world[3], bottom = INFINITY;

    for (int side = -1; side <= 1; side += 2) {
        for (int m = 0; m < 3; m++) {
            end[m] =
                capsule->position[m] + 0.5 * side * capsule->length * capsule->rotation[3 * m + 2];
        }
        mat3_apply(body->R, end, world);
        bottom = fmin(bottom, body->p[2] + world[2] - capsule->radius);
    }
    return bottom;
}

bool import_find_lowest(const struct robot *robot, const double *joint, struct body_motion *bodies,
                        double *height)
{
    static const double origin[3] = {0, 0, 0}, upright[4] = {1, 0, 0, 0};
    double lowest = INFINITY;

    robot_place_bodies(robot, origin, upright, joint, bodies);
    for (size_t c = 0; c < robot->ncapsule; c++) {
        lowest = fmin(lowest, import_capsule_bottom(&robot->capsule[c], bodies));
    }
    *height = lowest;
    return isfinite(lowest);
}
