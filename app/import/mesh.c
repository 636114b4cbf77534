/* SPDX-License-Identifier: Apache-2.0 */
/* Files of meshes: where they are found, how they are written. */
#include "app/import/mesh.h"

#include "base/whole_file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- where a mesh is ---- */

static bool mesh_file_exists(const char *path)
{
    struct stat status;

    return !stat(path, &status) && S_ISREG(status.st_mode);
}

/* Whether a reference climbs out of the folder that it is resolved in. */
static bool path_climbs(const char *path)
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

/* Tries folder/rest. */
static bool path_try(const char *folder, int length, const char *rest, char path[PATH_MAX])
{
    int used = snprintf(path, PATH_MAX, "%.*s/%s", length, folder, rest);

    return used > 0 && used < PATH_MAX && mesh_file_exists(path);
}

/* package://NAME/REST: in a folder that was given or above the file, as NAME/REST, and in a folder
 * of the name of the package itself, as REST. */
static bool package_find(const char *reference, const char *file,
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
    for (length = (int)strlen(file); length > 0; length--) {
        if (file[length] != '/') {
            continue;
        }
        if (path_try(file, length, reference, path) || path_try(file, length, rest, path)) {
            return true;
        }
    }
    return false;
}

enum error_code import_find_mesh(const struct import_model *model,
                                 const struct import_geometry *shape,
                                 const struct import_packages *packages, struct arena *arena,
                                 const char **found, struct error *error)
{
    static const char package[] = "package://", plain[] = "file://";
    const char *reference = shape->mesh;
    char file[PATH_MAX], path[PATH_MAX];
    bool is_package = !strncmp(reference, package, sizeof package - 1);
    bool there;

    if (!realpath(model->file, file)) {
        return error_set_file(error, errno, model->file, "cannot be found again");
    }
    if (is_package) {
        reference += sizeof package - 1;
    } else if (!strncmp(reference, plain, sizeof plain - 1)) {
        reference += sizeof plain - 1;
    } else if (strstr(reference, "://")) {
        return import_error(error, model->file, shape->line,
                            "found mesh \"%.200s\", expected package://, file:// or a path",
                            shape->mesh);
    }
    if (is_package && path_climbs(reference)) {
        return import_error(error, model->file, shape->line,
                            "found mesh \"%.200s\", expected no \"..\" in it", shape->mesh);
    }
    if (is_package) {
        there = package_find(reference, file, packages, path);
    } else {
        there = reference[0] == '/'
                    ? path_try("", 0, reference + 1, path)
                    : path_try(file, (int)(strrchr(file, '/') - file), reference, path);
    }
    if (!there) {
        return import_error(
            error, model->file, shape->line, "found no file for mesh \"%.200s\"%s", shape->mesh,
            is_package ? "; --package-path names the folder that holds the package" : "");
    }
    *found = arena_strdup(arena, path);
    return *found ? ERROR_NONE
                  : error_set(error, ERROR_MEMORY, "%.200s: no memory for a path", model->file);
}

/* ---- reading and writing ---- */

enum error_code import_read_mesh(const char *path, const double scale[3], struct arena *arena,
                                 struct import_mesh *mesh, struct error *error)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat status;
    enum error_code code;
    size_t size = 0;
    ssize_t got = 1;
    char *text = NULL;

    if (fd < 0 || fstat(fd, &status)) {
        code = error_set_file(error, errno, path, "cannot be read");
        goto done;
    }
    if (!S_ISREG(status.st_mode) || status.st_size > IMPORT_MESH_BYTES_MAX) {
        code =
            error_set(error, ERROR_INPUT, "%.200s: found %s, expected at most %d bytes", path,
                      S_ISREG(status.st_mode) ? "more" : "no regular file", IMPORT_MESH_BYTES_MAX);
        goto done;
    }
    text = malloc((size_t)status.st_size + 1);
    if (!text) {
        code = error_set(error, ERROR_MEMORY, "%.200s: no memory to read it", path);
        goto done;
    }
    while (got > 0 && size < (size_t)status.st_size) {
        got = read(fd, text + size, (size_t)status.st_size - size);
        size += got > 0 ? (size_t)got : 0;
    }
    code = import_parse_mesh(path, text, size, scale, arena, mesh, error);

done:
    free(text);
    if (fd >= 0) {
        close(fd);
    }
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
