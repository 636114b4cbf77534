/* SPDX-License-Identifier: Apache-2.0 */
#include "app/cli/cli.h"

#include "base/whole_file.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Removes a regular file; does not remove a pipe with a reader. Returns false with errno on
 * failure. */
static bool remove_file(const char *path)
{
    struct stat info;

    if (!path || lstat(path, &info) || !S_ISREG(info.st_mode)) {
        return true;
    }
    return unlink(path) == 0 || errno == ENOENT;
}

/* Writes NAME='VALUE', with each ' in the value as '\''; writes nothing for NULL or "". */
static void put_entry(const char *name, const char *value, FILE *out)
{
    if (!value || !*value) {
        return;
    }
    fprintf(out, "%s='", name);
    for (; *value; value++) {
        if (*value == '\'') {
            fputs("'\\''", out);
        } else {
            putc(*value, out);
        }
    }
    fputs("'\n", out);
}

/* Returns whether a file was written by --ready, is empty, or is not a regular file. */
static bool may_be_removed(const char *path)
{
    static const char begin[] = "pid='";
    char text[sizeof begin - 1];
    struct stat info;
    ssize_t size;
    int fd;

    if (!path || lstat(path, &info) || !S_ISREG(info.st_mode)) {
        return true;
    }
    fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
        return false;
    }
    size = read(fd, text, sizeof text);
    close(fd);
    return size == 0 || (size == (ssize_t)sizeof text && !memcmp(text, begin, sizeof text));
}

enum error_code ready_begin(const char *path, struct error *error)
{
    if (!may_be_removed(path)) {
        return error_set(error, ERROR_INPUT,
                         "--ready: found %s, which no run has written, expected the name of a new "
                         "file",
                         path);
    }
    return remove_file(path) ? ERROR_NONE
                             : error_set_errno(error, errno, "--ready: cannot remove %s", path);
}

enum error_code ready_write(const char *path, const struct ready *ready, struct error *error)
{
    struct whole_file file;
    enum error_code code;
    char number[16];

    if (!path) {
        return ERROR_NONE;
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }

    /* Only the owner may read it, because the page's address contains its token */
    if (!file.in_place && fchmod(fileno(file.out), S_IRUSR | S_IWUSR)) {
        code = error_set_errno(error, errno, "cannot write %s", path);
    }
    snprintf(number, sizeof number, "%ld", (long)getpid());
    put_entry("pid", number, file.out);
    put_entry("clock", ready->clock, file.out);
    put_entry("control", ready->control, file.out);
    if (ready->gateway_host) {
        snprintf(number, sizeof number, "%u", ready->gateway_port);
        put_entry("gateway_host", ready->gateway_host, file.out);
        put_entry("gateway_port", number, file.out);
    }
    put_entry("tables", ready->tables, file.out);
    put_entry("page", ready->page, file.out);
    put_entry("page_view", ready->page_view, file.out);
    return whole_file_close(&file, code, error);
}

void ready_end(const char *path)
{
    remove_file(path);
}
