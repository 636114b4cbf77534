/* SPDX-License-Identifier: Apache-2.0 */
/* Robots for the tests of the symbolic generator, and its expressions evaluated without a compiler:
 * an interpreter of the graph, so that hundreds of trees can be tried. */
#ifndef TESTS_UNIT_MODEL_SYMBOLIC_EVALUATE_H
#define TESTS_UNIT_MODEL_SYMBOLIC_EVALUATE_H

#include "model/symbolic/derive.h"
#include "tests/unit/model/random_robot.h"

/* Evaluates a derived function: argument[array] may be NULL when it is not read, pose when
 * it is not written. Returns false when there is no memory. */
bool evaluate(const struct graph *graph, const struct derivation *derivation,
              const double *const argument[DERIVE_ARRAYS], double *pose, double *out);

/* A trunk with pairs and triples of like limbs on its bodies: what goes into lanes. Fits struct
 * random_tree; every second body is observed. */
enum error_code limbed_tree_make(uint64_t *seed, struct random_tree *tree, struct error *error);

/* A pendulum of 1 kg and 1 m: the smallest robot that there is, with a name that needs escapes. */
enum error_code pendulum_make(struct random_tree *tree, struct error *error);

/* |a - b| / |b|, Euclidean norms. */
double relative_difference(const double *a, const double *b, size_t n);

#endif
