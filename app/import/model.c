/* SPDX-License-Identifier: Apache-2.0 */
/* Handles notes, places and inertias of imported models. */
#include "app/import/model.h"

#include "base/portable_math.h"
#include "base/text.h"
#include "base/vec3.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

/* ---- notes ---- */

void *import_grow(struct arena *arena, void *array, size_t count, size_t *capacity, size_t size)
{
    const size_t wider = count ? 2 * count : 64;
    void *grown;

    if (count < *capacity) {
        return array;
    }
    grown = arena_alloc(arena, wider, size);
    if (grown) {
        *capacity = wider;
        if (count) {
            memcpy(grown, array, count * size);
        }
    }
    return grown;
}

void import_note_add(struct import_notes *notes, enum import_fate fate, const char *file, int line,
                     const char *format, ...)
{
    char text[512];
    struct import_note *grown = NULL, note = {.fate = fate, .line = line};

    TEXT_FORMAT(text, format);
    text_make_printable(text);
    note.text = arena_strdup(notes->arena, text);
    note.file = arena_strdup(notes->arena, file);
    if (note.text && note.file && notes->count < IMPORT_NOTES_MAX) {
        grown = import_grow(notes->arena, notes->note, notes->count, &notes->capacity, sizeof note);
    }
    if (!grown) {
        notes->overflow = true;
        return;
    }
    notes->note = grown;
    notes->note[notes->count++] = note;
}

const char *import_reason(const char *file, int line, const char *text)
{
    char place[PATH_MAX + 16];
    const int length = snprintf(place, sizeof place, "%s:%d: ", file, line);

    return length > 0 && !strncmp(text, place, (size_t)length) ? text + length : text;
}

enum error_code import_error(struct error *error, const char *file, int line, const char *format,
                             ...)
{
    char text[600];

    TEXT_FORMAT(text, format);
    text_make_printable(text);
    return error->code ? error->code
                       : error_set(error, ERROR_INPUT, "%.200s:%d: %s", file, line, text);
}

bool import_has_word(const char *list, char mark, const char *word)
{
    const size_t length = strlen(word);
    const char *at = strstr(list, word);

    while (at && ((at > list && at[-1] != mark) || (at[length] && at[length] != mark))) {
        at = strstr(at + 1, word);
    }
    return at;
}

/* ---- places ---- */

void import_place_identity(struct import_place *place)
{
    memset(place->xyz, 0, sizeof place->xyz);
    mat3_identity(place->R);
}

void import_place_compose(const struct import_place *a, const struct import_place *b,
                          struct import_place *out)
{
    double moved[3];

    mat3_apply(a->R, b->xyz, moved);
    vec3_add_scaled(a->xyz, 1.0, moved, out->xyz);
    mat3_mul(a->R, b->R, out->R);
}

void import_rpy(const double R[9], double rpy[3])
{
    double cp = hypot(R[0], R[3]), sr, cr;

    /* R = Rz(yaw) Ry(pitch) Rx(roll). Near a pitch of 90 degrees only the sum or the difference of
     * roll and yaw is defined, so roll is 0 there. Yaw follows from the middle column of R
     * Rx(-roll), which is [-sin yaw, cos yaw, 0] for any pitch */
    rpy[1] = portable_atan2(-R[6], cp);
    rpy[0] = cp > 1e-12 ? portable_atan2(R[7], R[8]) : 0.0;
    sr = portable_sin(rpy[0]);
    cr = portable_cos(rpy[0]);
    rpy[2] = portable_atan2(sr * R[2] - cr * R[1], cr * R[4] - sr * R[5]);
}

bool import_turn_z(const double z[3], double R[9])
{
    const double across = hypot(z[0], z[1]), least = 1e-10 * vec3_norm(z);
    const double axis[3] = {across > least ? -z[1] / across : 1.0,
                            across > least ? z[0] / across : 0.0, 0.0};

    mat3_about_axis(axis, portable_atan2(across, z[2]), R);
    return least > 0.0;
}

/* ---- names ---- */

int import_find_link(const struct import_model *model, const char *name)
{
    return TEXT_FIND(model->link, model->nlink, name, name);
}

int import_find_joint(const struct import_model *model, const char *name)
{
    return TEXT_FIND(model->joint, model->njoint, name, name);
}

/* ---- inertias ---- */

/* Adds the inertia of a point mass at r: mass (|r|^2 1 - r r^T). */
static void inertia_add_point(double I[6], double mass, const double r[3])
{
    double square = vec3_dot(r, r);

    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            I[sym3_index[i][j]] += mass * ((i == j ? square : 0.0) - r[i] * r[j]);
        }
    }
}

void import_add_inertia(struct robot_inertia *body, const struct robot_inertia *part,
                        const struct import_place *place)
{
    struct robot_inertia sum = {.mass = body->mass + part->mass};
    double at[3], I[6], apart[3];

    /* Rotate the part into the body's frame */
    mat3_apply(place->R, part->com, at);
    memcpy(I, part->I, sizeof I);
    if (!mat3_is_identity(place->R)) {
        sym3_rotate(place->R, I);
    }
    vec3_add_scaled(at, 1.0, place->xyz, at);
    if (body->mass == 0.0 && part->mass == 0.0) {
        return;
    }

    /* Sum both about their common center of mass (parallel axis theorem) */
    for (int m = 0; m < 3; m++) {
        sum.com[m] = (body->mass * body->com[m] + part->mass * at[m]) / sum.mass;
    }
    for (int i = 0; i < 6; i++) {
        sum.I[i] = body->I[i] + I[i];
    }
    vec3_sub(body->com, sum.com, apart);
    inertia_add_point(sum.I, body->mass, apart);
    vec3_sub(at, sum.com, apart);
    inertia_add_point(sum.I, part->mass, apart);
    *body = sum;
}
