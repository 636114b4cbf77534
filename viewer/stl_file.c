/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the mesh files for the page. A surface's file has the number of vertices and of triangles
 * (u32), then x y z of each vertex (f32, m), then the vertex indices of each triangle (u32), all
 * little-endian. Meshes of visuals are binary STL files. They are sent unchanged, but only if their
 * size matches their number of triangles. This check prevents an untrusted robot file from exposing
 * other files. */
#include "viewer/private.h"

#include "base/input_file.h"
#include "base/text.h"

#include <stdlib.h>
#include <unistd.h>

const struct viewer_file *viewer_mesh_file(struct viewer *viewer, size_t surface)
{
    const struct contact_surface *of = &viewer->rig->contact.surface[surface];
    struct viewer_file *file = surface < VIEWER_MESHES ? &viewer->mesh[surface] : NULL;
    uint8_t *data, *to;
    size_t size;

    if (!file || of->shape != CONTACT_MESH || file->data) {
        return file && file->data ? file : NULL;
    }
    size = 8 + 12 * of->mesh->nvertex + 12 * of->mesh->nface;
    data = to = malloc(size);
    if (!data) {
        return NULL;
    }
    to = put_u32(to, (uint32_t)of->mesh->nvertex);
    to = put_u32(to, (uint32_t)of->mesh->nface);
    for (size_t i = 0; i < 3 * of->mesh->nvertex; i++) {
        to = put_f32(to, of->mesh->vertex[i / 3][i % 3]);
    }
    for (size_t i = 0; i < 3 * of->mesh->nface; i++) {
        to = put_u32(to, (uint32_t)of->mesh->face[i / 3][i % 3]);
    }
    *file = (struct viewer_file){"application/octet-stream", data, size, false};
    return file;
}

enum { STL_HEADER = 84, STL_FACE = 50 };

size_t viewer_visual_source(const struct robot *robot, size_t visual)
{
    const int first = TEXT_FIND(robot->visual, visual, file, robot->visual[visual].file);

    return first < 0 ? visual : (size_t)first;
}

/* Reads up to size bytes; returns the number of bytes read. */
static size_t file_read(int fd, uint8_t *data, size_t size)
{
    size_t filled = 0;
    ssize_t got = 1;

    while (got > 0 && filled < size) {
        got = read(fd, data + filled, size - filled);
        filled += got > 0 ? (size_t)got : 0;
    }
    return filled;
}

/* Checks whether header and size belong to a complete binary STL file. */
static bool stl_is_whole(const uint8_t *header, size_t had, size_t size)
{
    return had >= STL_HEADER && size - STL_HEADER == (uint64_t)get_u32_le(header + 80) * STL_FACE;
}

static enum error_code visual_refuse(const char *path, size_t size, struct error *error)
{
    return error_set(error, ERROR_INPUT,
                     "%.200s: found %zu bytes, expected a binary STL file: 84 and 50 for each "
                     "triangle",
                     path, size);
}

/* Opens a regular file with at most `most` bytes. */
static enum error_code visual_open(const char *path, size_t most, int *fd, size_t *size,
                                   struct error *error)
{
    enum error_code code = input_file_open(path, fd, size, error);

    if (!code && *size > most) {
        close(*fd);
        code = error_set(error, ERROR_INPUT,
                         "%.200s: found more, expected at most %d MB for all visuals", path,
                         VIEWER_VISUAL_BYTES >> 20);
    }
    return code;
}

enum error_code viewer_check_visual(const struct robot_visual *visual, struct error *error)
{
    uint8_t header[STL_HEADER];
    size_t size, had;
    int fd;

    if (visual->missing) {
        return error_set(error, ERROR_INPUT, "%.200s", visual->missing);
    }
    if (!visual->file) {
        return ERROR_NONE;
    }
    if (visual_open(visual->file, VIEWER_VISUAL_BYTES, &fd, &size, error)) {
        return error->code;
    }
    had = file_read(fd, header, sizeof header);
    close(fd);
    return stl_is_whole(header, had, size) ? ERROR_NONE : visual_refuse(visual->file, size, error);
}

const struct viewer_file *viewer_visual_file(struct viewer *viewer, size_t visual,
                                             struct error *error)
{
    const char *path = viewer->rig->robot->visual[visual].file;
    struct viewer_file *file = &viewer->visual[visual];
    uint8_t *data;
    size_t size;
    int fd;

    if (!path || file->data) {
        return path ? file : NULL;
    }
    if (visual_open(path, VIEWER_VISUAL_BYTES - viewer->visual_bytes, &fd, &size, error)) {
        return NULL;
    }
    data = malloc(size + 1);
    if (!data) {
        error_set(error, ERROR_MEMORY, "%.200s: no memory for it", path);
    } else if (file_read(fd, data, size) != size || !stl_is_whole(data, size, size)) {
        free(data);
        visual_refuse(path, size, error);
    } else {
        *file = (struct viewer_file){"model/stl", data, size, false};
        viewer->visual_bytes += size;
    }
    close(fd);
    return file->data ? file : NULL;
}
