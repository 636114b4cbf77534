/* SPDX-License-Identifier: Apache-2.0 */
/* Fits capsules and cylinders to collision shapes. */
#include "app/import/shapes.h"

#include "base/text.h"
#include "base/vec3.h"
#include "contact/mesh/mesh.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    SIZE_DOUBT = 20, /* a shape larger than this many joint distances may be a mistake */
    SECTORS = 12,    /* sectors about a wheel's axis; each must have points of the rim */
};

/* Smallest distances of points of the rim and of the tread from the axis, as shares of the largest
 * distance. The width of the tread is the wheel's width. */
#define RIM 0.95
#define TREAD 0.9

/* On a base with wheels, the box of a mesh is smaller than the mesh by this on all sides, so that
 * the wheels bear the weight. */
#define CLEARANCE_M 5e-3

void import_place_shape(const struct import_builder *b, const struct import_geometry *shape,
                        const struct import_place *own, double position[3], double rotation[9])
{
    struct import_place in_body, place;

    import_place_compose(&b->from->place[shape->link], &shape->place, &in_body);
    import_place_compose(&in_body, own, &place);
    memcpy(position, place.xyz, sizeof place.xyz);
    memcpy(rotation, place.R, sizeof place.R);
}

void import_shape_note(const struct import_builder *b, const struct import_geometry *shape,
                       enum import_fate fate, const char *what, const char *format, ...)
{
    char text[400];

    TEXT_FORMAT(text, format);
    import_note_add(b->notes, fate, shape->file, shape->line, "%s of link \"%.63s\"%s", what,
                    b->from->model->link[shape->link].name, text);
}

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

/* Fits the enclosing capsule of points along the longest side of their bounding box. On the base,
 * which is rarely round, and on all of a robot that rolls, whose parts must clear the ground, fits
 * the box if its volume is smaller. */
static void capsule_hold_points(const double (*point)[3], size_t count, bool rolls,
                                struct robot_capsule *capsule)
{
    double low[3], high[3], middle[3], side[3], radius = 0.0, half = 0.0;
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

    /* First pass: find the radius from the point farthest from the axis. Second pass: find the
     * length that the ends must reach */
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

    /* The box */
    for (int m = 0; m < 3; m++) {
        side[m] = 0.5 * (high[m] - low[m]);
        side[m] = fmax(side[m] - (rolls ? fmin(CLEARANCE_M, 0.2 * side[m]) : 0.0), 1e-6);
    }
    if ((capsule->body == 0 || rolls) &&
        8.0 * side[0] * side[1] * side[2] <
            M_PI * radius * radius * (capsule->length + 4.0 / 3.0 * radius)) {
        memcpy(capsule->half, side, sizeof side);
        mat3_identity(capsule->rotation);
        capsule->radius = capsule->length = 0.0;
    }
}

/* Fits a cylinder to the points of a wheel. A wheel is a shape that a continuous joint turns.
 * Either all sectors about the joint's axis reach equally far, or the shape is as wide as high
 * across the axis, as a box that stands for a wheel. Returns false for other shapes. */
static bool cylinder_hold_wheel(const struct import_builder *b, const struct import_geometry *shape,
                                const double (*point)[3], size_t count,
                                struct robot_capsule *capsule)
{
    const size_t j = (size_t)capsule->body - 1;
    double axis[3], middle[3], rim[SECTORS] = {0}, side[4] = {0}, low = INFINITY, high = -INFINITY;
    double far = 0.0, least = INFINITY;
    double *R = capsule->rotation;
    struct import_place place;

    if (capsule->body == 0 || b->from->source[j]->type != IMPORT_CONTINUOUS) {
        return false;
    }

    /* The joint's axis in the frame of the shape: two directions across it, and one along it */
    import_place_compose(&b->from->place[shape->link], &shape->place, &place);
    mat3_apply_transposed(place.R, b->from->robot->joint[j].axis, axis);
    mat3_apply_transposed(place.R, place.xyz, middle);
    import_turn_z(axis, R);

    /* First pass: find the rim. Second pass: find the width of the tread */
    for (size_t i = 0; i < 2 * count; i++) {
        double d[3], at[3], across;

        vec3_add_scaled(point[i % count], 1.0, middle, d);
        mat3_apply_transposed(R, d, at);
        across = hypot(at[0], at[1]);
        if (i < count) {
            const int sector = (int)((atan2(at[1], at[0]) / (2.0 * M_PI) + 0.5) * SECTORS);

            far = fmax(far, across);
            rim[sector % SECTORS] = fmax(rim[sector % SECTORS], across);
            for (int m = 0; m < 4; m++) {
                side[m] = fmax(side[m], m % 2 ? -at[m / 2] : at[m / 2]);
            }
        } else if (across >= TREAD * far) {
            low = fmin(low, at[2]);
            high = fmax(high, at[2]);
        }
    }
    for (int i = 0; i < SECTORS; i++) {
        least = fmin(least, rim[i]);
    }
    if (least < RIM * far) {
        least = fmin(fmin(side[0], side[1]), fmin(side[2], side[3]));
        far = fmax(fmax(side[0], side[1]), fmax(side[2], side[3]));
    }
    if (!(least >= RIM * far)) {
        return false;
    }
    vec3_add_scaled((const double[3]){0}, -1.0, middle, middle);
    vec3_add_scaled(middle, 0.5 * (low + high), axis, capsule->position);
    capsule->radius = fmax(far, 1e-6);
    capsule->length = high - low;
    capsule->flat = true;
    return true;
}

/* ---- meshes ---- */

/* Returns a text that says whether contact accepts a mesh as a surface. */
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

/* Reads a mesh, fits a capsule, box or cylinder, and writes the OBJ file. Returns false, with a
 * note, if one of these fails. */
static bool shape_fit_mesh(const struct import_builder *b, const struct import_geometry *shape,
                           struct robot_capsule *capsule)
{
    struct import_mesh mesh;
    struct arena scratch = {0};
    struct error why = {.code = ERROR_NONE};
    char path[PATH_MAX];
    bool fitted = false;

    if (arena_init(&scratch, IMPORT_MESH_ARENA, &why) ||
        import_find_mesh(b->from->model, shape, b->packages, path, &why) != IMPORT_PATH_FOUND ||
        import_read_mesh(path, shape->scale, &scratch, &mesh, &why)) {
        import_shape_note(b, shape, IMPORT_MISSING, "collision mesh", ": %.300s",
                          import_reason(shape->file, shape->line, why.text));
        arena_fini(&scratch);
        return false;
    }

    /* Fit the shape, and write the mesh as an OBJ file for scenes that use it */
    const double(*point)[3] = (const double(*)[3])mesh.vertex;

    if (!cylinder_hold_wheel(b, shape, point, mesh.nvertex, capsule)) {
        capsule_hold_points(point, mesh.nvertex, b->from->rolls, capsule);
    }
    snprintf(path, sizeof path, "%s/%s.obj", b->folder, capsule->name);
    if (import_write_mesh(&mesh, path, &why)) {
        import_note_add(b->notes, IMPORT_DROPPED, shape->file, shape->line, "%.400s", why.text);
    } else {
        ++*b->written;
        import_note_add(b->notes, IMPORT_SHAPED, shape->file, shape->line,
                        "collision mesh \"%.150s\" is meshes/%s.obj (%zu faces, %s), and the "
                        "%s that holds it",
                        shape->mesh, capsule->name, mesh.nface, mesh_judge(&mesh),
                        capsule->flat            ? "wheel"
                        : capsule->radius == 0.0 ? "box"
                                                 : "capsule");
        fitted = true;
    }
    arena_fini(&scratch);
    return fitted;
}

/* ---- the whole ---- */

/* Fits a capsule to a shape, in the shape's frame, and adds a note if it is inexact. Ellipsoids get
 * an enclosing capsule, meshes a capsule or box, meshes of wheels a cylinder. Returns false if
 * there is none. */
static bool shape_fit(const struct import_builder *b, const struct import_geometry *shape,
                      struct robot_capsule *capsule)
{
    int along;

    mat3_identity(capsule->rotation);
    switch (shape->shape) {
    case IMPORT_MESH:
        return b->folder && shape_fit_mesh(b, shape, capsule);
    case IMPORT_BOX:
        memcpy(capsule->half, shape->half, sizeof capsule->half);
        return true;
    case IMPORT_ELLIPSOID:
        /* Fit a capsule along the longest semi-axis, with the second longest as radius. It encloses
         * the ellipsoid, whose ends are slimmer than half-spheres. */
        along = shape->half[1] > shape->half[0] ? 1 : 0;
        along = shape->half[2] > shape->half[along] ? 2 : along;
        axis_to_rotation(along, capsule->rotation);
        capsule->radius = fmax(shape->half[(along + 1) % 3], shape->half[(along + 2) % 3]);
        capsule->length = 2.0 * (shape->half[along] - capsule->radius);
        import_shape_note(b, shape, IMPORT_SHAPED, "collision ellipsoid",
                          " is the capsule that holds it");
        return true;
    default:
        capsule->radius = shape->radius;
        capsule->length = shape->length;
        capsule->flat = shape->shape == IMPORT_CYLINDER;
        return true;
    }
}

/* Adds the capsule of a shape to the robot, with the name BODY-shellNUMBER. */
static enum error_code shape_add(const struct import_builder *b,
                                 const struct import_geometry *shape)
{
    struct robot *robot = b->from->robot;
    struct robot_capsule capsule = {.body = b->from->body[shape->link]};
    struct import_place own;
    char name[64];

    snprintf(name, sizeof name, "%.40s-shell%zu", robot->body[capsule.body].name,
             robot->ncapsule + 1);
    capsule.name = arena_strdup(b->arena, name);
    if (!capsule.name) {
        return error_set(b->error, ERROR_MEMORY, "no memory for the shapes of the robot");
    }
    if (shape_fit(b, shape, &capsule)) {
        /* Add a note if the capsule is much larger than the largest distance of a joint from its
         * parent link, for example a mesh in mm without a scale */
        const double length =
            capsule.length +
            2.0 *
                fmax(capsule.radius, fmax(capsule.half[0], fmax(capsule.half[1], capsule.half[2])));
        double reach = 0.0;

        for (size_t i = 0; i < b->from->model->njoint; i++) {
            const double *xyz = b->from->model->joint[i].place.xyz;

            reach = fmax(reach, hypot(hypot(xyz[0], xyz[1]), xyz[2]));
        }
        if (reach > 0.0 && length > SIZE_DOUBT * reach) {
            import_shape_note(
                b, shape, IMPORT_DOUBTED, "collision shape",
                " is %.3g m long, the largest distance of two joints is %.3g m%s", length, reach,
                shape->shape == IMPORT_MESH ? ": a mesh in mm needs scale=\"0.001 0.001 0.001\""
                                            : "");
        }

        memcpy(own.xyz, capsule.position, sizeof own.xyz);
        memcpy(own.R, capsule.rotation, sizeof own.R);
        import_place_shape(b, shape, &own, capsule.position, capsule.rotation);
        robot->capsule[robot->ncapsule++] = capsule;
    }
    return ERROR_NONE;
}

enum error_code import_check_shapes(const struct import_robot *from,
                                    const struct import_packages *packages, struct error *error)
{
    const struct import_model *model = from->model;
    struct error why = {.code = ERROR_NONE};
    char path[PATH_MAX];

    for (size_t i = 0; i < model->ngeometry; i++) {
        const struct import_geometry *shape = &model->geometry[i];

        if (shape->collision && shape->shape == IMPORT_MESH &&
            import_find_mesh(model, shape, packages, path, &why) == IMPORT_PATH_OUTSIDE) {
            *error = why;
            return why.code;
        }
    }
    return ERROR_NONE;
}

enum error_code import_add_shapes(const struct import_builder *b)
{
    const struct import_model *model = b->from->model;
    struct robot *robot = b->from->robot;
    enum error_code code = ERROR_NONE;

    robot->capsule = arena_alloc(b->arena, model->ngeometry + 1, sizeof *robot->capsule);
    if (!robot->capsule) {
        return error_set(b->error, ERROR_MEMORY, "no memory for the shapes of the robot");
    }
    for (size_t i = 0; i < model->ngeometry && !code; i++) {
        if (model->geometry[i].collision && b->from->body[model->geometry[i].link] >= 0) {
            code = shape_add(b, &model->geometry[i]);
        }
    }
    return code;
}

double import_capsule_bottom(const struct robot_capsule *capsule, const struct body_motion *bodies)
{
    const struct body_motion *body = &bodies[capsule->body];
    double end[3], world[3], reach = capsule->radius, turn[9], bottom = INFINITY;

    /* Compute how far a disc or a box reaches down. The last row of the rotation is the vertical
     * direction in the shape's frame */
    mat3_mul(body->R, capsule->rotation, turn);
    reach *= capsule->flat ? hypot(turn[6], turn[7]) : 1.0;
    for (int m = 0; m < 3 && capsule->radius == 0.0; m++) {
        reach += fabs(turn[6 + m]) * capsule->half[m];
    }

    for (int side = -1; side <= 1; side += 2) {
        for (int m = 0; m < 3; m++) {
            end[m] =
                capsule->position[m] + 0.5 * side * capsule->length * capsule->rotation[3 * m + 2];
        }
        mat3_apply(body->R, end, world);
        bottom = fmin(bottom, body->p[2] + world[2] - reach);
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
