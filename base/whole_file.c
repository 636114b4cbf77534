/* SPDX-License-Identifier: Apache-2.0 */
/* Files under a temporary name until they are complete. */
#include "base/whole_file.h"

#include <errno.h>
#include <sys/stat.h>
#include <unistd.h>

enum error_code whole_file_open(struct whole_file *file, const char *path, struct error *error)
{
    struct stat there;

    file->path = path;
    file->in_place = stat(path, &there) == 0 && !S_ISREG(there.st_mode);
    if ((size_t)snprintf(file->partial, sizeof file->partial, file->in_place ? "%s" : "%s.part",
                         path) >= sizeof file->partial) {
        return error_set(error, ERROR_INPUT, "the file's name %.40s... is too long", path);
    }
    file->out = fopen(file->partial, "we");
    return file->out ? ERROR_NONE : error_set_errno(error, errno, "cannot write %s", file->partial);
}

enum error_code whole_file_close(struct whole_file *file, enum error_code code, struct error *error)
{
    bool failed = ferror(file->out) != 0;

    /* Data may only now reach the disk, and the name is given last */
    failed = fclose(file->out) != 0 || failed;
    if (!failed && !code && !file->in_place) {
        failed = rename(file->partial, file->path) != 0;
    }
    if (failed && !code) {
        code = error_set_errno(error, errno, "cannot write %s", file->path);
    }
    if (code && !file->in_place) {
        unlink(file->partial);
    }
    return code;
}
