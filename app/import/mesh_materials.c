/* SPDX-License-Identifier: Apache-2.0 */
/* Handles colors of meshes: the color table of a mesh, and the materials of an OBJ (MTL files). */
#include "app/import/mesh_private.h"

#include "base/input_file.h"
#include "base/text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    MTL_BYTES_MAX = 1 << 20,
    MATERIALS_MAX = 512,
    LIBRARIES_MAX = 16,          /* largest number of MTL files of an OBJ */
    MATERIAL_WORK_MAX = 1 << 24, /* largest number of name comparisons for an OBJ */
};

int mesh_find_tint(struct import_mesh *mesh, const double color[4])
{
    double nearest = INFINITY;
    int found = -1;

    /* The nearest color by squared distance over red, green, blue and opacity */
    for (size_t i = 0; i < mesh->ncolor; i++) {
        double distance = 0.0;

        for (int m = 0; m < 4; m++) {
            double apart = mesh->color[i][m] - color[m];

            distance += apart * apart;
        }
        if (distance < nearest) {
            nearest = distance;
            found = (int)i;
        }
    }
    /* Adds a color while there is room; afterwards the nearest one replaces it */
    if (nearest > 1e-6 && mesh->ncolor < IMPORT_COLORS_MAX) {
        found = (int)mesh->ncolor++;
        for (int m = 0; m < 4; m++) {
            mesh->color[found][m] = fmin(fmax(color[m], 0.0), 1.0);
        }
    }
    return found;
}

/* ---- MTL ---- */

/* Records a missing part of a mesh's appearance, if it is the first: "without BEFORE
 * "NAME"AFTER". */
static void mesh_remark(struct mesh_reader *r, const char *before, const char *name,
                        const char *after)
{
    char line[200], shown[100];

    if (!r->mesh->remark) {
        snprintf(shown, sizeof shown, "%s", name);
        text_make_printable(shown);
        snprintf(line, sizeof line, "without %s \"%s\"%s", before, shown, after);
        r->mesh->remark = arena_strdup(r->arena, line);
    }
}

/* Returns the material with this name. Adds a missing one if requested and if there is room, else
 * returns NULL. */
static struct mesh_material *mtl_find_material(struct mesh_reader *r, const char *name, bool add)
{
    for (size_t i = 0; i < r->nmaterial && r->material_work < MATERIAL_WORK_MAX; i++) {
        r->material_work++;
        if (!strcmp(r->material[i].name, name)) {
            return &r->material[i];
        }
    }
    if (!add || r->nmaterial == MATERIALS_MAX) {
        return NULL;
    }
    if (!r->material) {
        r->material = arena_alloc(r->arena, MATERIALS_MAX, sizeof *r->material);
    }
    if (!r->material) {
        return NULL;
    }
    r->material[r->nmaterial].tint = -1;
    snprintf(r->material[r->nmaterial].name, MESH_WORD_MAX, "%s", name);
    return &r->material[r->nmaterial++];
}

/* ---- lines of an OBJ ---- */

/* Reads the materials of an MTL file. */
static void mesh_read_library(struct mesh_reader *r, const char *file)
{
    const char *slash = strrchr(r->name, '/');
    char path[PATH_MAX], *text;
    struct error why;
    size_t size;

    if (!r->is_file || r->libraries == LIBRARIES_MAX || !*file) {
        return;
    }
    r->libraries++;

    /* Only read a file in the OBJ's folder or below */
    snprintf(path, sizeof path, "%.*s%s", slash ? (int)(slash - r->name) + 1 : 0, r->name, file);
    if (file[0] == '/' || strstr(file, "..")) {
        mesh_remark(r, "its materials", file, ": expected a file beside it");
    } else if (input_file_load(path, MTL_BYTES_MAX, &text, &size, &why)) {
        mesh_remark(r, "its materials", file, ", which cannot be read");
    } else {
        /* Read the colors of all materials of the file: newmtl NAME, then Kd R G B */
        struct mesh_reader lines = {.at = text, .end = text + size};
        struct mesh_material *material = NULL;
        char word[MESH_WORD_MAX];

        while (lines.at < lines.end) {
            double color[4] = {0, 0, 0, 1};

            if (!mesh_next_word(&lines, word)) {
                /* an empty line */
            } else if (!strcmp(word, "newmtl")) {
                material = mesh_next_word(&lines, word) ? mtl_find_material(r, word, true) : NULL;
            } else if (!strcmp(word, "Kd") && material && mesh_read_numbers(&lines, color)) {
                material->tint = mesh_find_tint(r->mesh, color);
            } else if (!strcmp(word, "map_Kd") && mesh_next_word(&lines, word)) {
                mesh_remark(r, "the texture", word, "");
            }
            mesh_skip_line(&lines);
        }
        free(text);
    }
}

int mesh_read_material_line(void *reader, const char *keyword, const char *word, int tint)
{
    struct mesh_reader *r = reader;

    if (!strcmp(keyword, "mtllib")) {
        mesh_read_library(r, word);
    } else if (!strcmp(keyword, "usemtl")) {
        const struct mesh_material *material = *word ? mtl_find_material(r, word, false) : NULL;

        tint = material ? material->tint : -1;
    }
    return tint;
}
