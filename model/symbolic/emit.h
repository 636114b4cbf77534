/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Expressions as C text: one function of a generated module at a time, and what all of them stand
 * on. Memory is the emission's own; the file is the caller's. Not RT-safe: it allocates and prints.
 */
#ifndef MODEL_SYMBOLIC_EMIT_H
#define MODEL_SYMBOLIC_EMIT_H

#include "model/symbolic/derive.h"
#include "model/symbolic/symbolic.h"

/* One derived function on its way to C. */
struct emission;

/* Plans the function: what it reads, in which pieces it is written, what it costs (added to count).
 * Compilers take more than linear time for a block: a function of more than longest operations is
 * cut into pieces of at most so many, functions of their own, which hand values on through a
 * scratch array. name, graph and derivation must outlive it. *out is NULL or to be destroyed, also
 * after an error. */
enum error_code emission_create(const char *name, const struct graph *graph,
                                const struct derivation *derivation, int longest,
                                struct emission **out, struct symbolic_count *count,
                                struct error *error);
void emission_destroy(struct emission *emission);

/* Writes it, once: static, void, with the argument arrays that it reads, the array
 * pose if it writes one, and the array out. Errors of the file are left to ferror. */
void emission_write(struct emission *emission, FILE *file);

/* Returns whether the function reads an argument array; after emission_create. */
bool emission_reads(const struct emission *emission, enum derive_array array);

/* Returns whether it writes a pose, into the array pose before out; after emission_create. */
bool emission_keeps(const struct emission *emission);

/* Writes what stands once before all variants: vector types and macros. */
void emit_preamble(FILE *file);

/* Writes sine and cosine of 8 lanes, of the variant being compiled. */
void emit_sincos(FILE *file);

/* Returns the name of an argument array. */
const char *emit_array_name(enum derive_array array);

#endif
