/* SPDX-License-Identifier: Apache-2.0 */
/* Finds, reads and writes mesh files. */
#include "app/import/mesh_private.h"

#include "base/input_file.h"
#include "base/vec3.h"
#include "base/whole_file.h"
#include "canbus/frame.h"

#include <errno.h>
#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <math.h>

/* ---- where a mesh is ---- */

/* Writes the path folder/rest, using `length` characters of the folder. Returns whether it is a
 * regular file. */
static bool path_try(const char *folder, int length, const char *rest, char path[PATH_MAX])
{
    struct stat status;
    int used = snprintf(path, PATH_MAX, "%.*s/%s", length, folder, rest);

    return used > 0 && used < PATH_MAX && !stat(path, &status) && S_ISREG(status.st_mode);
}

/* Finds package://NAME/REST. Tries NAME/REST in the given folders and in the folders above the
 * robot file, and REST in the folder of the package itself. */
static bool package_find(const char *reference, const char *above,
                         const struct import_packages *packages, char path[PATH_MAX])
{
    const char *rest = strchr(reference, '/');
    int length;

    rest = rest ? rest + 1 : "";
    for (size_t i = 0; i < packages->count; i++) {
        const char *folder = packages->folder[i];

        length = (int)strlen(folder);
        if (path_try(folder, length, reference, path) || path_try(folder, length, rest, path)) {
            return true;
        }
    }
    /* Go up from the robot file's folder, one name at a time; do not try the root */
    for (length = (int)strlen(above); length > 0; length--) {
        if (above[length] != '/' && above[length] != '\0') {
            continue;
        }
        if (path_try(above, length, reference, path) || path_try(above, length, rest, path)) {
            return true;
        }
    }
    return false;
}

enum import_path import_find_mesh(const struct import_model *model,
                                  const struct import_geometry *shape,
                                  const struct import_packages *packages, char path[PATH_MAX],
                                  struct error *error)
{
    static const char package[] = "package://", plain[] = "file://";
    const char *name = shape->mesh;
    const bool is_package = !strncmp(name, package, sizeof package - 1);
    enum import_path where = IMPORT_PATH_MISSING;
    char folder[PATH_MAX];

    /* Search for packages; other paths are relative to the robot file's folder */
    error->code = ERROR_NONE;
    name += !strncmp(name, plain, sizeof plain - 1) ? sizeof plain - 1 : 0;
    if (!import_find_folder(model->file, folder)) {
        error_set_file(error, errno, model->file, "cannot be found again");
    } else if (is_package && import_has_word(name, '/', "..")) {
        import_error(error, shape->file, shape->line,
                     "found mesh \"%.200s\", expected no \"..\" in it", shape->mesh);
    } else if (is_package) {
        where = package_find(name + sizeof package - 1, folder, packages, path)
                    ? IMPORT_PATH_FOUND
                    : IMPORT_PATH_MISSING;
    } else if (strstr(name, "://")) {
        import_error(error, shape->file, shape->line,
                     "found mesh \"%.200s\", expected package://, file:// or a path", shape->mesh);
    } else {
        where = import_resolve_path(folder, folder, name, packages->trust, path);
    }
    if (where == IMPORT_PATH_OUTSIDE) {
        import_error(error, shape->file, shape->line,
                     "found mesh \"%.200s\", which is outside the folder of %.200s, expected one "
                     "in it: give --trust if you trust whoever wrote it",
                     shape->mesh, model->file);
    } else if (where == IMPORT_PATH_MISSING) {
        import_error(error, shape->file, shape->line, "found no file for mesh \"%.200s\"%s",
                     shape->mesh,
                     is_package ? "; --package-path names the folder that holds the package" : "");
    }
    return where;
}

/* ---- reading and writing ---- */

enum error_code import_read_mesh(const char *path, const double scale[3], struct arena *arena,
                                 struct import_mesh *mesh, struct error *error)
{
    char *text;
    size_t size;
    enum error_code code = input_file_load(path, IMPORT_MESH_BYTES_MAX, &text, &size, error);

    if (code) {
        return code;
    }
    code = import_parse_mesh(path, true, text, size, scale, arena, mesh, error);
    free(text);
    return code;
}

enum error_code import_write_mesh(const struct import_mesh *mesh, const char *path,
                                  struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }
    for (size_t v = 0; v < mesh->nvertex; v++) {
        fprintf(file.out, "v %.9g %.9g %.9g\n", mesh->vertex[v][0], mesh->vertex[v][1],
                mesh->vertex[v][2]);
    }
    for (size_t f = 0; f < mesh->nface; f++) {
        fprintf(file.out, "f %d %d %d\n", mesh->face[f][0] + 1, mesh->face[f][1] + 1,
                mesh->face[f][2] + 1);
    }
    return whole_file_close(&file, ERROR_NONE, error);
}

/* ---- binary STL ---- */

size_t import_count_tint(const struct import_mesh *mesh, int tint)
{
    size_t count = 0;

    for (size_t f = 0; f < mesh->nface; f++) {
        count += mesh->tint[f] == tint;
    }
    return count;
}

enum error_code import_write_tint(const struct import_mesh *mesh, int tint, const char *path,
                                  struct error *error)
{
    uint8_t header[84] = "Made by coman-hil import", face[50];
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }
    /* Write 80 bytes of text, the number of facets, then the facets of this tint */
    put_u32_le(header + 80, (uint32_t)import_count_tint(mesh, tint));
    fwrite(header, 1, sizeof header, file.out);
    for (size_t f = 0; f < mesh->nface; f++) {
        const int *at = mesh->face[f];
        const double *const corner[3] = {mesh->vertex[at[0]], mesh->vertex[at[1]],
                                         mesh->vertex[at[2]]};

        if (mesh->tint[f] == tint) {
            /* Write a facet of 50 bytes. It has the unit normal (0 for a face without area) and
             * three corners, all as little-endian floats, and two zero bytes. */
            double a[3], b[3], normal[3], length;

            vec3_sub(corner[1], corner[0], a);
            vec3_sub(corner[2], corner[0], b);
            vec3_cross(a, b, normal);
            length = vec3_norm(normal);
            memset(face, 0, 50);
            for (int i = 0; i < 12; i++) {
                const double unit = length > 0.0 ? normal[i % 3] / length : 0.0;
                const float real = (float)(i < 3 ? unit : corner[i / 3 - 1][i % 3]);
                uint32_t word;

                memcpy(&word, &real, sizeof word);
                put_u32_le(face + 4 * i, word);
            }

            fwrite(face, 1, sizeof face, file.out);
        }
    }
    return whole_file_close(&file, ERROR_NONE, error);
}

/* ---- volume and inertia ---- */

/* Computes the corners of a face from an apex. Returns the volume of the pyramid between them, m3,
 * with its sign only if it is exact; for a shell the area of the face, m2. */
static double pyramid_measure(const struct import_mesh *mesh, size_t face, const double apex[3],
                              enum import_solid solid, double corner[3][3])
{
    double across[3], edge[2][3], volume;

    for (int c = 0; c < 3; c++) {
        vec3_sub(mesh->vertex[mesh->face[face][c]], apex, corner[c]);
    }
    if (solid == IMPORT_SOLID_SHELL) {
        vec3_sub(corner[1], corner[0], edge[0]);
        vec3_sub(corner[2], corner[0], edge[1]);
        vec3_cross(edge[0], edge[1], across);
        return 0.5 * vec3_norm(across);
    }
    vec3_cross(corner[1], corner[2], across);
    volume = vec3_dot(corner[0], across) / 6.0;
    return solid == IMPORT_SOLID_EXACT ? volume : fabs(volume);
}

/* Computes the center of mass of the enclosed volume or of the shell, m, from pyramids with this
 * apex. Returns the volume, m3, or the area, m2. */
static double mesh_find_center(const struct import_mesh *mesh, enum import_solid solid,
                               const double apex[3], double center[3])
{
    const double share = solid == IMPORT_SOLID_SHELL ? 1.0 / 3.0 : 0.25;
    double sum[3] = {0, 0, 0}, total = 0.0;

    for (size_t f = 0; f < mesh->nface; f++) {
        double corner[3][3], volume = pyramid_measure(mesh, f, apex, solid, corner);

        /* Corners are relative to the apex. The center of a pyramid is a quarter of the sum of its
         * corners, the center of a face a third */
        total += volume;
        for (int c = 0; c < 3; c++) {
            vec3_add_scaled(sum, share * volume, corner[c], sum);
        }
    }
    for (int m = 0; m < 3; m++) {
        center[m] = apex[m] + (total > 0.0 ? sum[m] / total : 0.0);
    }
    return total;
}

double import_measure_mesh(const struct import_mesh *mesh, enum import_solid solid,
                           double center[3], double I[6])
{
    const double parts = solid == IMPORT_SOLID_SHELL ? 12.0 : 20.0;
    static const double origin[3];
    double second[3][3] = {{0}}, middle[3], trace, total, own = 0.0;

    /* Use the center of the surface as the apex of the pyramids */
    memset(I, 0, 6 * sizeof *I);
    total = mesh_find_center(mesh, IMPORT_SOLID_SHELL, origin, middle);
    total = total > 0.0 ? mesh_find_center(mesh, solid, middle, center) : 0.0;
    if (!(total > 0.0)) {
        return 0.0;
    }

    /* Second moments about the center: a pyramid with its apex there adds volume / 20 times the sum
     * of products: of each corner with itself, and of the corners' sum with itself. A face adds
     * area / 12 times that sum */
    for (size_t f = 0; f < mesh->nface; f++) {
        double corner[3][3], sum[3], volume = pyramid_measure(mesh, f, center, solid, corner);

        own += volume;
        for (int m = 0; m < 3; m++) {
            sum[m] = corner[0][m] + corner[1][m] + corner[2][m];
        }
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                double product = sum[i] * sum[j];

                for (int c = 0; c < 3; c++) {
                    product += corner[c][i] * corner[c][j];
                }
                second[i][j] += volume / parts * product;
            }
        }
    }
    /* Inertia from second moments: I = trace(S) 1 - S */
    trace = second[0][0] + second[1][1] + second[2][2];
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            I[sym3_index[i][j]] = (i == j ? trace : 0.0) - second[i][j];
        }
    }
    return own;
}

/* ---- convex hull ---- */

#define HULL_STEPS_MAX 200000000 /* limit of comparisons of vertices, faces and edges */
enum { HULL_SPARE = 16 };
#define HULL_FLAT 1e-10 /* least height of a vertex above a face, relative to the mesh's size */

/* A face of a hull, with its plane: unit normal, and distance from the origin. */
struct hull_face {
    int corner[3];
    double plane[4];
};

/* A hull of vertices. */
struct hull {
    double (*vertex)[3];
    size_t nvertex, nface, nseen, steps;
    struct hull_face *face, *seen; /* seen: faces that the newest vertex is above */
};

static void hull_add_face(struct hull *hull, int a, int b, int c)
{
    struct hull_face *face = &hull->face[hull->nface++];
    double edge[2][3], *plane = face->plane, length;

    *face = (struct hull_face){.corner = {a, b, c}};
    vec3_sub(hull->vertex[b], hull->vertex[a], edge[0]);
    vec3_sub(hull->vertex[c], hull->vertex[a], edge[1]);
    vec3_cross(edge[0], edge[1], plane);
    length = fmax(vec3_norm(plane), DBL_MIN);
    for (int m = 0; m < 3; m++) {
        plane[m] /= length;
    }
    plane[3] = vec3_dot(plane, hull->vertex[a]);
}

/* Begins a hull with a tetrahedron of far vertices. Returns the mesh's size, 0 for a flat mesh. */
static double hull_begin(struct hull *hull)
{
    double far = 0.0, size = 0.0;
    int corner[4] = {0};

    /* Each corner is the vertex farthest from the corners before it, their line, or their plane */
    for (int k = 1; k < 4; k++) {
        hull->nface = 0;
        hull_add_face(hull, corner[0], corner[1], corner[2]);
        far = 0.0;
        for (size_t v = 0; v < hull->nvertex; v++) {
            double to[3], along[3], across[3], height;

            vec3_sub(hull->vertex[v], hull->vertex[corner[0]], to);
            vec3_sub(hull->vertex[corner[1]], hull->vertex[corner[0]], along);
            vec3_cross(along, to, across);
            height = k == 1   ? vec3_norm(to)
                     : k == 2 ? vec3_norm(across) / size
                              : fabs(vec3_dot(hull->face[0].plane, to));
            if (height > far) {
                far = height;
                corner[k] = (int)v;
            }
        }
        size = k == 1 ? far : size;
        if (!(far > HULL_FLAT * size)) {
            return 0.0;
        }
    }

    /* Orient the faces: the normal of the first face points away from the last corner */
    const double *plane = hull->face[0].plane;
    const bool above = vec3_dot(plane, hull->vertex[corner[3]]) > plane[3];
    const int a = corner[above], b = corner[!above];

    hull->nface = 0;
    hull_add_face(hull, a, b, corner[2]);
    hull_add_face(hull, a, corner[3], b);
    hull_add_face(hull, b, corner[3], corner[2]);
    hull_add_face(hull, corner[2], corner[3], a);
    return size;
}

/* Adds a vertex to a hull: replaces the faces below the vertex by faces from their border to the
 * vertex. Returns false after too many steps. */
static bool hull_add(struct hull *hull, int vertex, double least)
{
    const double *point = hull->vertex[vertex];
    const size_t nface = hull->nface;

    hull->nface = hull->nseen = 0;
    for (size_t f = 0; f < nface; f++) {
        const struct hull_face *face = &hull->face[f];

        if (vec3_dot(face->plane, point) - face->plane[3] > least) {
            hull->seen[hull->nseen++] = *face;
        } else {
            hull->face[hull->nface++] = *face;
        }
    }
    hull->steps += nface + 9 * hull->nseen * hull->nseen;
    if (hull->steps > HULL_STEPS_MAX ||
        hull->nface + 3 * hull->nseen > 6 * hull->nvertex + HULL_SPARE) {
        return false;
    }
    for (size_t e = 0; e < 3 * hull->nseen; e++) {
        const int *edge = hull->seen[e / 3].corner;
        const int from = edge[e % 3], to = edge[(e + 1) % 3];
        bool border = true;

        /* An edge of two removed faces is inside the border */
        for (size_t k = 0; k < 3 * hull->nseen && border; k++) {
            const int *other = hull->seen[k / 3].corner;

            border = other[k % 3] != to || other[(k + 1) % 3] != from;
        }
        if (border) {
            hull_add_face(hull, from, to, vertex);
        }
    }
    return true;
}

enum error_code import_make_hull(const struct import_mesh *mesh, struct arena *arena,
                                 struct import_mesh *out, struct error *error)
{
    const size_t n = mesh->nvertex, most = 6 * n + HULL_SPARE, stride = n / 64 + 1;
    struct hull hull = {.vertex = mesh->vertex,
                        .nvertex = n,
                        .face = arena_alloc(arena, most, sizeof *hull.face),
                        .seen = arena_alloc(arena, most, sizeof *hull.seen)};
    double size;

    *out = *mesh;
    out->face = arena_alloc(arena, most, sizeof *out->face);
    if (!hull.face || !hull.seen || !out->face) {
        return error_set(error, ERROR_MEMORY, "no memory for the hull of a mesh");
    }
    size = hull_begin(&hull);
    if (!(size > 0.0)) {
        return error_set(error, ERROR_INPUT, "found a flat mesh, expected one with a volume");
    }

    /* Add every 64th vertex in each of 64 rounds, because neighbors in a file are close together */
    for (size_t i = 0; i < 64 * stride; i++) {
        const size_t vertex = i / stride + i % stride * 64;

        if (vertex < n && !hull_add(&hull, (int)vertex, HULL_FLAT * size)) {
            return error_set(error, ERROR_INPUT,
                             "found a convex hull of %zu faces and more for %zu vertices, expected "
                             "fewer: simplify the mesh",
                             hull.nface, n);
        }
    }
    out->nface = hull.nface;
    for (size_t f = 0; f < hull.nface; f++) {
        memcpy(out->face[f], hull.face[f].corner, sizeof hull.face[f].corner);
    }
    return ERROR_NONE;
}
