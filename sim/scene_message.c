/* SPDX-License-Identifier: Apache-2.0 */
/* Writes a scene as primitives for a viewer (foxglove.SceneUpdate in JSON). */
#include "sim/scene_message.h"

#include "base/json_text.h"
#include "base/portable_math.h"
#include "model/spatial.h"

#include <math.h>

/* The ground is drawn as a slab: edge length and depth, m. */
#define GROUND_M 20.0
#define GROUND_DEPTH_M 0.05

/* Density of the ellipsoid for a body without surfaces: water. */
#define DENSITY_KG_M3 1000.0

struct scene_color {
    double r, g, b, a;
};

static const struct scene_color color_body = {0.62, 0.66, 0.72, 1.0};
static const struct scene_color color_sole = {0.25, 0.27, 0.30, 1.0};
static const struct scene_color color_inertia = {0.30, 0.50, 0.80, 0.6};
static const struct scene_color color_world = {0.45, 0.48, 0.45, 1.0};

/* Lists of an entity, in the order in which they are written. */
enum scene_list { LIST_CUBES, LIST_SPHERES, LIST_CYLINDERS, LIST_TRIANGLES, LISTS };

static const char *const list_names[LISTS] = {"cubes", "spheres", "cylinders", "triangles"};

struct scene_writer {
    const struct rig *rig;
    FILE *out;
};

/* ---- primitives ---- */

/* Writes a vector as a member of a JSON object. */
static void scene_put_vector(FILE *out, const char *key, const double v[3])
{
    fprintf(out, "\"%s\":{\"x\":%.9g,\"y\":%.9g,\"z\":%.9g}", key, v[0], v[1], v[2]);
}

/* Writes a pose; the rotation is a 3 x 3 matrix, row by row. */
static void scene_put_pose(FILE *out, const double position[3], const double rotation[9])
{
    double q[4];

    quaternion_from_mat3(rotation, q);
    fputs("\"pose\":{", out);
    scene_put_vector(out, "position", position);
    fprintf(out, ",\"orientation\":{\"x\":%.9g,\"y\":%.9g,\"z\":%.9g,\"w\":%.9g}},", q[1], q[2],
            q[3], q[0]);
}

/* Writes a color as another member. */
static void scene_put_color(FILE *out, const struct scene_color *c)
{
    fprintf(out, ",\"color\":{\"r\":%g,\"g\":%g,\"b\":%g,\"a\":%g}", c->r, c->g, c->b, c->a);
}

/* Writes a cube, a sphere or a cylinder with a size (m) in its frame. */
static void scene_put_solid(FILE *out, const double position[3], const double rotation[9],
                            const double size[3], const struct scene_color *color, bool cylinder)
{
    putc('{', out);
    scene_put_pose(out, position, rotation);
    scene_put_vector(out, "size", size);
    scene_put_color(out, color);
    fputs(cylinder ? ",\"bottom_scale\":1,\"top_scale\":1}" : "}", out);
}

/* Writes a mesh as a list of triangles. */
static void scene_put_mesh(FILE *out, const struct contact_surface *surface,
                           const struct scene_color *color)
{
    const struct mesh *mesh = surface->mesh;

    putc('{', out);
    scene_put_pose(out, surface->position, surface->rotation);
    fputs("\"points\":[", out);
    for (size_t i = 0; i < mesh->nvertex; i++) {
        fprintf(out, "%s{\"x\":%.6g,\"y\":%.6g,\"z\":%.6g}", i ? "," : "", mesh->vertex[i][0],
                mesh->vertex[i][1], mesh->vertex[i][2]);
    }
    fputs("],\"indices\":[", out);
    for (size_t i = 0; i < mesh->nface; i++) {
        fprintf(out, "%s%d,%d,%d", i ? "," : "", mesh->face[i][0], mesh->face[i][1],
                mesh->face[i][2]);
    }
    fputs("],\"colors\":[]", out);
    scene_put_color(out, color);
    putc('}', out);
}

/* ---- surfaces ---- */

/* Returns the number of primitives of a list in a surface. */
static int surface_count_primitives(const struct contact_surface *s, enum scene_list list)
{
    switch (s->shape) {
    case CONTACT_HALF_SPACE:
    case CONTACT_BOX:
        return list == LIST_CUBES;
    case CONTACT_SPHERE:
        return list == LIST_SPHERES;
    case CONTACT_CAPSULE:
        return list == LIST_SPHERES ? 2 : list == LIST_CYLINDERS;
    case CONTACT_CYLINDER:
        return list == LIST_CYLINDERS;
    case CONTACT_MESH:
        return list == LIST_TRIANGLES;
    }
    return 0;
}

/* ---- bodies ---- */

/* Returns the rig's body (the robot's, then free ones) with this surface; -1 = the world. */
static int scene_surface_body(const struct rig *rig, const struct contact_surface *surface)
{
    return surface->body < 0 ? -1 : rig->contact_body[surface->body];
}

/* Checks whether a body has a surface of its own. */
static bool scene_body_has_surface(const struct rig *rig, int body)
{
    for (size_t i = 0; i < rig->contact.nsurface; i++) {
        if (scene_surface_body(rig, &rig->contact.surface[i]) == body) {
            return true;
        }
    }
    return false;
}

/* Returns the inertia of a body of the rig: the robot's, then free ones. */
static const struct robot_inertia *scene_body_inertia(const struct rig *rig, int body)
{
    size_t nbody = rig->robot->nbody;

    return (size_t)body < nbody ? &rig->robot->body[body].inertia
                                : &rig->free[(size_t)body - nbody].inertia;
}

/* Writes one list of an entity: the primitives of the body's surfaces. A body without surfaces has
 * an ellipsoid. */
static void scene_put_list(const struct scene_writer *w, int body, enum scene_list list)
{
    const struct contact_config *contact = &w->rig->contact;
    const char *separator = "";

    fprintf(w->out, ",\"%s\":[", list_names[list]);
    for (size_t s = 0; s < contact->nsurface; s++) {
        const struct contact_surface *surface = &contact->surface[s];
        int count = surface_count_primitives(surface, list);

        for (int i = 0; i < count && scene_surface_body(w->rig, surface) == body; i++) {
            fputs(separator, w->out);

            /* Writes primitive i of a surface in a list */
            const struct scene_color *color = surface->body < 0                ? &color_world
                                              : surface->shape == CONTACT_MESH ? &color_sole
                                                                               : &color_body;
            const double width = 2.0 * surface->radius_m;
            double size[3] = {width, width, list == LIST_SPHERES ? width : surface->length_m};
            double at[3], along = 0.0; /* distance of the middle along the surface's axis */

            separator = ",";
            if (surface->shape == CONTACT_MESH) {
                scene_put_mesh(w->out, surface, color);
                continue;
            }
            if (surface->shape == CONTACT_HALF_SPACE) {
                /* A slab whose upper side is the plane */
                size[0] = size[1] = GROUND_M;
                size[2] = GROUND_DEPTH_M;
                along = -0.5 * GROUND_DEPTH_M;
            } else if (surface->shape == CONTACT_CAPSULE && list == LIST_SPHERES) {
                along = (i ? -0.5 : 0.5) * surface->length_m;
            }
            for (int k = 0; k < 3; k++) {
                size[k] = surface->shape == CONTACT_BOX ? 2.0 * surface->half_extent_m[k] : size[k];
                at[k] = surface->position[k] + along * surface->rotation[3 * k + 2];
            }
            scene_put_solid(w->out, at, surface->rotation, size, color, list == LIST_CYLINDERS);
        }
    }
    if (list == LIST_SPHERES && body >= 0 && !scene_body_has_surface(w->rig, body) &&
        scene_body_inertia(w->rig, body)->mass > 0.0) {
        const struct robot_inertia *inertia = scene_body_inertia(w->rig, body);
        static const double upright[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        const double I[3] = {inertia->I[0], inertia->I[3], inertia->I[5]};
        double size[3], volume = 1.0, scale;

        /* Write the ellipsoid with a body's inertia. A solid ellipsoid with semi-axes a, b, c
         * has I_xx = m (b^2 + c^2) / 5. So its proportions follow from the moments, and its size
         * from the mass. */
        for (int k = 0; k < 3; k++) {
            double square = 0.5 * (I[0] + I[1] + I[2]) - I[k];

            size[k] = sqrt(fmax(square, 0.02 * (I[0] + I[1] + I[2])));
            volume *= size[k];
        }
        scale = volume > 0.0
                    ? portable_pow(6.0 / M_PI * inertia->mass / DENSITY_KG_M3 / volume, 1.0 / 3)
                    : 0.0;
        for (int k = 0; k < 3; k++) {
            size[k] *= scale;
        }
        scene_put_solid(w->out, inertia->com, upright, size, &color_inertia, false);
    }
    putc(']', w->out);
}

/* Writes the entity of a body or of the world (body -1). Its frame has the name `name`. */
static void scene_put_entity(const struct scene_writer *w, int body, const char *name)
{
    fputs(body < 0 ? "{" : ",{", w->out);
    fputs("\"timestamp\":{\"sec\":0,\"nsec\":0},\"frame_id\":", w->out);
    json_text_put(name, w->out);
    fputs(",\"id\":", w->out);
    json_text_put(name, w->out);
    fputs(",\"lifetime\":{\"sec\":0,\"nsec\":0},\"frame_locked\":true,\"metadata\":[],"
          "\"arrows\":[]",
          w->out);
    for (int list = 0; list < LISTS; list++) {
        scene_put_list(w, body, (enum scene_list)list);
    }
    fputs(",\"lines\":[],\"texts\":[],\"models\":[]}", w->out);
}

enum error_code scene_message_make(const struct rig *rig, struct memory_file *text,
                                   struct error *error)
{
    struct scene_writer w = {.rig = rig, .out = memory_file_open(text)};

    if (!w.out) {
        return error_set(error, ERROR_MEMORY, "no memory left for the scene");
    }
    fputs("{\"deletions\":[],\"entities\":[", w.out);
    scene_put_entity(&w, -1, "world");
    for (size_t b = 0; b < rig->robot->nbody; b++) {
        scene_put_entity(&w, (int)b, rig->robot->body[b].name);
    }
    for (size_t i = 0; i < rig->nfree; i++) {
        scene_put_entity(&w, (int)(rig->robot->nbody + i), rig->free[i].name);
    }
    fputs("]}", w.out);
    return memory_file_close(w.out, text, "the scene", error);
}
