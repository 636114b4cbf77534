/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes expressions as C text: one function of a generated module at a time, and the common
 * preamble. An emission owns its memory; the caller owns the file. Not RT-safe: it allocates and
 * prints.
 */
#ifndef MODEL_SYMBOLIC_EMIT_H
#define MODEL_SYMBOLIC_EMIT_H

#include "model/symbolic/derive.h"
#include "model/symbolic/symbolic.h"

/* A derived function that is being written as C. */
struct emission;

/* Plans the function: inputs, pieces, and cost (added to count). The time of a compiler grows
 * faster than the size of a block. So a function of more than `longest` operations is cut into
 * pieces of at most that size. Pieces are functions that pass values through a scratch array. name,
 * graph and derivation must outlive the emission. The caller must destroy *out unless it is NULL,
 * also after an error. */
enum error_code emission_create(const char *name, const struct graph *graph,
                                const struct derivation *derivation, int longest,
                                struct emission **out, struct symbolic_count *count,
                                struct error *error);
void emission_destroy(struct emission *emission);

/* Writes the function once, as static void. Its arguments are the arrays that it reads, the array
 * pose if it writes a pose, and the array out. The caller checks ferror for file errors. */
void emission_write(struct emission *emission, FILE *file);

/* Returns whether the function reads an argument array. Call it after emission_create. */
bool emission_reads(const struct emission *emission, enum derive_array array);

/* Returns whether the function writes a pose. The argument pose then comes before out. Call it
 * after emission_create. */
bool emission_keeps(const struct emission *emission);

/* Writes the text before all variants: vector types and macros. */
void emit_preamble(FILE *file);

/* Writes the function for sine and cosine of 8 lanes, which each variant compiles. */
void emit_sincos(FILE *file);

/* Returns the name of an argument array. */
const char *emit_array_name(enum derive_array array);

#endif
