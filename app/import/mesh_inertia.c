/* SPDX-License-Identifier: Apache-2.0 */
/* Computes volume, center of mass and inertia of what a mesh encloses, as sums of pyramids on
 * its faces. */
#include "app/import/mesh.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* Computes a face's corners as seen from the apex, and returns the volume of the pyramid
 * between, m3: signed when exact, otherwise its magnitude. */
static double pyramid_measure(const struct import_mesh *mesh, size_t face, const double apex[3],
                              bool exact, double corner[3][3])
{
    double across[3], volume;

    for (int c = 0; c < 3; c++) {
        vec3_sub(mesh->vertex[mesh->face[face][c]], apex, corner[c]);
    }
    vec3_cross(corner[1], corner[2], across);
    volume = vec3_dot(corner[0], across) / 6.0;
    return exact ? volume : fabs(volume);
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

/* Computes the center of mass of the enclosed volume, m; returns the volume, m3. */
static double mesh_find_center(const struct import_mesh *mesh, bool exact, double center[3])
{
    double middle[3], sum[3] = {0, 0, 0}, total = 0.0;

    mesh_find_middle(mesh, middle);
    for (size_t f = 0; f < mesh->nface; f++) {
        double corner[3][3], volume = pyramid_measure(mesh, f, middle, exact, corner);

        /* The center of a pyramid is a quarter of the sum of its corners */
        total += volume;
        for (int c = 0; c < 3; c++) {
            vec3_add_scaled(sum, 0.25 * volume, corner[c], sum);
        }
    }
    for (int m = 0; m < 3; m++) {
        center[m] = total > 0.0 ? middle[m] + sum[m] / total : 0.0;
    }
    return total;
}

double import_measure_mesh(const struct import_mesh *mesh, bool exact, double center[3],
                           double I[6])
{
    double second[3][3] = {{0}}, trace, total = mesh_find_center(mesh, exact, center), own = 0.0;

    memset(I, 0, 6 * sizeof *I);
    if (!(total > 0.0)) {
        return 0.0;
    }

    /* Second moments about the center: a pyramid with its apex there adds volume / 20 times the
     * products of its corners, each with itself, and of their sum with itself */
    for (size_t f = 0; f < mesh->nface; f++) {
        double corner[3][3], sum[3], volume = pyramid_measure(mesh, f, center, exact, corner);

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
                second[i][j] += volume / 20.0 * product;
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
