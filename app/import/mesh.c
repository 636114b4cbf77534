/* SPDX-License-Identifier: Apache-2.0 */
/* Finds, reads and writes mesh files. */
#include "app/import/mesh_private.h"

#include "app/import/path.h"
#include "base/input_file.h"
#include "base/vec3.h"
#include "base/whole_file.h"
#include "canbus/frame.h"

#include <errno.h>
#include <float.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <math.h>

/* ---- where a mesh is ---- */

/* Checks whether a path contains "..". */
static bool path_has_parent(const char *path)
{
    for (const char *at = path; *at;) {
        size_t length = strcspn(at, "/");

        if (length == 2 && at[0] == '.' && at[1] == '.') {
            return true;
        }
        at += length + (at[length] == '/');
    }
    return false;
}

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
    } else if (is_package && path_has_parent(name)) {
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

/* Computes the centroid of the surface: the mean of its faces, weighted by their areas. */
static void mesh_find_middle(const struct import_mesh *mesh, double middle[3])
{
    double total = 0.0;

    memset(middle, 0, 3 * sizeof *middle);
    for (size_t f = 0; f < mesh->nface; f++) {
        const int *face = mesh->face[f];
        double edge[2][3], across[3], area;

        vec3_sub(mesh->vertex[face[1]], mesh->vertex[face[0]], edge[0]);
        vec3_sub(mesh->vertex[face[2]], mesh->vertex[face[0]], edge[1]);
        vec3_cross(edge[0], edge[1], across);
        area = 0.5 * vec3_norm(across);
        total += area;
        for (int c = 0; c < 3; c++) {
            vec3_add_scaled(middle, area / 3.0, mesh->vertex[face[c]], middle);
        }
    }
    for (int m = 0; m < 3 && total > 0.0; m++) {
        middle[m] /= total;
    }
}

/* Computes the center of mass of the enclosed volume or of the shell, m. Returns the volume, m3, or
 * the area, m2. */
static double mesh_find_center(const struct import_mesh *mesh, enum import_solid solid,
                               double center[3])
{
    const double share = solid == IMPORT_SOLID_SHELL ? 1.0 / 3.0 : 0.25;
    double middle[3], sum[3] = {0, 0, 0}, total = 0.0;

    mesh_find_middle(mesh, middle);
    for (size_t f = 0; f < mesh->nface; f++) {
        double corner[3][3], volume = pyramid_measure(mesh, f, middle, solid, corner);

        /* The center of a pyramid is a quarter of the sum of its four corners; the apex is the
         * origin. The center of a face is a third of the sum of its own */
        total += volume;
        for (int c = 0; c < 3; c++) {
            vec3_add_scaled(sum, share * volume, corner[c], sum);
        }
    }
    for (int m = 0; m < 3; m++) {
        center[m] = total > 0.0 ? middle[m] + sum[m] / total : 0.0;
    }
    return total;
}

double import_measure_mesh(const struct import_mesh *mesh, enum import_solid solid,
                           double center[3], double I[6])
{
    const double parts = solid == IMPORT_SOLID_SHELL ? 12.0 : 20.0;
    double second[3][3] = {{0}}, trace, total = mesh_find_center(mesh, solid, center), own = 0.0;

    memset(I, 0, 6 * sizeof *I);
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

#define HULL_STEPS_MAX 1000000000 /* comparisons of vertices, faces and edges */
enum { HULL_SPARE = 16 };
#define HULL_FLAT 1e-10 /* least height of a vertex above a face, over the mesh's size */

/* Computes the height of a point above the plane of a face. */
static double hull_height(const struct import_mesh *hull, const int face[3], const double point[3])
{
    const double *a = hull->vertex[face[0]];
    double edge[2][3], normal[3], to[3];

    vec3_sub(hull->vertex[face[1]], a, edge[0]);
    vec3_sub(hull->vertex[face[2]], a, edge[1]);
    vec3_cross(edge[0], edge[1], normal);
    vec3_sub(point, a, to);
    return vec3_dot(normal, to) / fmax(vec3_norm(normal), DBL_MIN);
}

/* Begins a hull with a tetrahedron of far vertices. Returns the mesh's size, 0 for a flat mesh. */
static double hull_begin(struct import_mesh *hull)
{
    static const int side[4][3] = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
    double far = 0.0, size = 0.0;
    int corner[4] = {0};

    /* Each corner is the vertex farthest from the corners before it, their line, or their plane */
    for (int k = 1; k < 4; k++) {
        far = 0.0;
        for (size_t v = 0; v < hull->nvertex; v++) {
            double to[3], along[3], across[3], height;

            vec3_sub(hull->vertex[v], hull->vertex[corner[0]], to);
            vec3_sub(hull->vertex[corner[1]], hull->vertex[corner[0]], along);
            vec3_cross(along, to, across);
            height = k == 1   ? vec3_norm(to)
                     : k == 2 ? vec3_norm(across) / size
                              : fabs(hull_height(hull, corner, hull->vertex[v]));
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
    if (hull_height(hull, corner, hull->vertex[corner[3]]) > 0.0) {
        const int first = corner[0];

        corner[0] = corner[1];
        corner[1] = first;
    }
    for (int f = 0; f < 4; f++) {
        for (int c = 0; c < 3; c++) {
            hull->face[f][c] = corner[side[f][c]];
        }
    }
    hull->nface = 4;
    return size;
}

/* Adds a vertex to a hull. The faces below the vertex give way to faces between their common border
 * and the vertex. The removed faces are kept in `seen`. Returns false after too many steps. */
static bool hull_add(struct import_mesh *hull, int vertex, double least, int (*seen)[3],
                     size_t *steps)
{
    size_t kept = 0, nseen = 0;

    for (size_t f = 0; f < hull->nface; f++) {
        const bool below = hull_height(hull, hull->face[f], hull->vertex[vertex]) > least;

        memcpy(below ? seen[nseen++] : hull->face[kept++], hull->face[f], sizeof *seen);
    }
    *steps += hull->nface + 9 * nseen * nseen;
    if (*steps > HULL_STEPS_MAX || kept + 3 * nseen > 6 * hull->nvertex + HULL_SPARE) {
        return false;
    }
    for (size_t e = 0; e < 3 * nseen; e++) {
        const int from = seen[e / 3][e % 3], to = seen[e / 3][(e + 1) % 3];
        bool border = true;

        /* An edge of two removed faces is inside the border */
        for (size_t k = 0; k < 3 * nseen && border; k++) {
            border = seen[k / 3][k % 3] != to || seen[k / 3][(k + 1) % 3] != from;
        }
        if (border) {
            memcpy(hull->face[kept++], (const int[3]){from, to, vertex}, sizeof *seen);
        }
    }
    hull->nface = kept;
    return true;
}

enum error_code import_make_hull(const struct import_mesh *mesh, struct arena *arena,
                                 struct import_mesh *hull, struct error *error)
{
    const size_t n = mesh->nvertex, most = 6 * n + HULL_SPARE;
    int(*seen)[3] = arena_alloc(arena, most, sizeof *seen);
    size_t steps = 0;
    double size;

    *hull = *mesh;
    hull->face = arena_alloc(arena, most, sizeof *hull->face);
    if (!hull->face || !seen) {
        return error_set(error, ERROR_MEMORY, "no memory for the hull of a mesh");
    }
    size = hull_begin(hull);
    if (!(size > 0.0)) {
        return error_set(error, ERROR_INPUT, "found a flat mesh, expected one with a volume");
    }

    /* Add the vertices in 64 rounds through the list, because neighbors in a file are close */
    for (size_t i = 0; i < 64 * (n / 64 + 1); i++) {
        const size_t vertex = i / (n / 64 + 1) + i % (n / 64 + 1) * 64;

        if (vertex < n && !hull_add(hull, (int)vertex, HULL_FLAT * size, seen, &steps)) {
            return error_set(error, ERROR_INPUT,
                             "found a convex hull of %zu faces and more for %zu vertices, expected "
                             "fewer: simplify the mesh",
                             hull->nface, n);
        }
    }
    return ERROR_NONE;
}
