/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The half-edges of a triangle mesh in an order in which those of one edge are neighbors: found by
 * counting, so that it takes time in proportion to their number. Not RT-safe.
 */
#ifndef CONTACT_MESH_EDGES_H
#define CONTACT_MESH_EDGES_H

#include "contact/mesh/mesh.h"

#include <stdbool.h>

/* The half-edge from corner `number % 3` of face `number / 3` to the next corner. */
struct half_edge {
    int low, high; /* its vertices, sorted */
    int number;
    bool forward; /* runs from low to high */
};

/* Sorts the 3 * nface half-edges of a mesh whose corners are all in range by low vertex, high
 * vertex, number. sorted: the caller's, room for all. ERROR_MEMORY for scratch on the heap. */
enum error_code mesh_sort_half_edges(const struct mesh *mesh, struct half_edge *sorted,
                                     struct error *error);

#endif
