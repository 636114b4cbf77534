/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to the OBJ reader (obj.c, obj_text.c, obj_vertex.c, obj_face.c): where it is in the text,
 * and what it has read so far. Coordinates are meters. What is read lives on the heap until obj.c
 * copies it into the caller's arena. Every error names file:line:column. Not RT-safe.
 */
#ifndef CONTACT_MESH_OBJ_PRIVATE_H
#define CONTACT_MESH_OBJ_PRIVATE_H

#include "base/error.h"
#include "contact/mesh/mesh.h"

#include <stdbool.h>
#include <stddef.h>

#define OBJ_QUOTE_SIZE 40 /* longest piece of the file that a message repeats, with its end */

/* A place in the file, counted from 1. */
struct obj_place {
    size_t line, column;
};

/* A word of the text; its length is 0 at the end of a line. */
struct obj_token {
    const char *text;
    size_t length;
    struct obj_place place;
};

struct obj_reader {
    /* The text and the position in it */
    const char *name;
    const char *text;
    size_t size, at;
    size_t line, line_start;
    struct error *error;

    /* The vertices and triangles read so far, and where they are written */
    double (*vertex)[3];
    struct obj_place *vertex_place;
    size_t nvertex, vertex_capacity;
    int (*face)[3];
    struct obj_place (*corner_place)[3];
    size_t nface, face_capacity;

    /* The polygon being read */
    int polygon[MESH_MAX_CORNERS];
    struct obj_place polygon_place[MESH_MAX_CORNERS];
    size_t ncorner;
};

/* ---- the text (obj_text.c) ---- */

/* Returns the length of a line end at an offset, 0 when there is none. */
size_t obj_line_end(const struct obj_reader *r, size_t at);

/* Moves to an offset where a line begins, and counts the line. */
void obj_begin_line(struct obj_reader *r, size_t at);

/* Reads the next word of this line, empty at its end. A line goes on after a backslash at its
 * end. */
struct obj_token obj_next_token(struct obj_reader *r);

/* Skips to the end of a line; may_continue: a backslash at its end continues it. */
void obj_skip_line(struct obj_reader *r, bool may_continue);

/* Checks whether a token is this word. */
bool obj_token_is(const struct obj_token *token, const char *word);

/* Writes a token as a message may show it, printable, short, in quotes, and returns that text. */
const char *obj_quote_token(const struct obj_token *token, char out[OBJ_QUOTE_SIZE]);

/* Sets an ERROR_INPUT with file:line:column. */
__attribute__((format(printf, 3, 4))) enum error_code
obj_refuse(struct obj_reader *r, struct obj_place place, const char *format, ...);

/* Sets ERROR_MEMORY with the file's name. */
enum error_code obj_no_memory(struct obj_reader *r);

/* Returns the capacity to grow a full array to. */
size_t obj_grown_capacity(size_t capacity);

/* ---- the statements (obj_vertex.c, obj_face.c); the keyword has been read ---- */

/* Reads the rest of a vertex or face statement; place: that of its keyword. */
enum error_code obj_read_vertex(struct obj_reader *r, struct obj_place place);
enum error_code obj_read_face(struct obj_reader *r, struct obj_place place);

#endif
