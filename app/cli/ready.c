/* SPDX-License-Identifier: Apache-2.0 */
#include "app/cli/cli.h"

#include "base/whole_file.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

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

/* Reads the process id from a file of --ready. Returns 0 if the file is empty or missing, and -1 if
 * no run has written it or it cannot be read. */
static long ready_read_owner(const char *path)
{
    char text[32] = "";
    struct stat info;
    ssize_t size;
    long pid = -1;
    int fd;

    if (lstat(path, &info) || !S_ISREG(info.st_mode)) {
        return 0;
    }
    fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    size = fd < 0 ? -1 : read(fd, text, sizeof text - 1);
    if (fd >= 0) {
        close(fd);
    }
    return size == 0 ? 0 : sscanf(text, "pid='%ld'", &pid) == 1 && pid > 0 ? pid : -1;
}

/* Refuses a link, a file that no run has written, and a file of a run that still exists. */
static enum error_code ready_check(const char *path, struct error *error)
{
    const long owner = ready_read_owner(path);
    struct stat link, there;

    if (!lstat(path, &link) && S_ISLNK(link.st_mode) &&
        (stat(path, &there) || S_ISREG(there.st_mode))) {
        return error_set(error, ERROR_INPUT,
                         "--ready: found the symbolic link %s, expected the name of a new file",
                         path);
    }
    if (owner < 0) {
        return error_set(
            error, ERROR_INPUT,
            "--ready: found %s, which no run has written, expected the name of a new file", path);
    }
    if (owner > 0 && owner != getpid() && (!kill((pid_t)owner, 0) || errno == EPERM)) {
        return error_set(error, ERROR_INPUT,
                         "--ready: found %s of process %ld, which is running, expected the name of "
                         "a new file: stop that run, or choose another name",
                         path, owner);
    }
    return ERROR_NONE;
}

enum error_code ready_begin(const char *path, struct error *error)
{
    struct stat info;

    if (!path || lstat(path, &info)) {
        return ERROR_NONE;
    }
    if (ready_check(path, error)) {
        return error->code;
    }
    return S_ISREG(info.st_mode) && unlink(path) && errno != ENOENT
               ? error_set_errno(error, errno, "--ready: cannot remove %s", path)
               : ERROR_NONE;
}

enum error_code ready_write(const char *path, const struct ready *ready, struct error *error)
{
    struct whole_file file;
    enum error_code code;
    char number[16];

    if (!path) {
        return ERROR_NONE;
    }
    /* Check again, because another run may have written the file since ready_begin */
    code = ready_check(path, error);
    code = code ? code : whole_file_open(&file, path, error);
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
    put_entry("page", ready->page, file.out);
    put_entry("page_view", ready->page_view, file.out);
    return whole_file_close(&file, code, error);
}

void ready_end(const char *path)
{
    if (path && ready_read_owner(path) == getpid()) {
        unlink(path);
    }
}
