/* SPDX-License-Identifier: Apache-2.0 */
/* Claims and releases the path of the control socket for a server, and finds it for a client. */
#include "control/socket.h"

#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum {
    BACKLOG = 16,
    INSTANCES_MAX = 16, /* largest number of runs of one rig with default paths */
    LOCK_TRIES = 100,   /* number of attempts to lock, 10 ms apart */
};

static const char service_directory[] = "/run/coman-hil"; /* directory of services and of root */

/* Makes the address of a path. Returns ERROR_INPUT if the path is empty or too long. */
static enum error_code make_address(const char *path, struct sockaddr_un *address,
                                    struct error *error)
{
    size_t length = strlen(path);

    _Static_assert(sizeof address->sun_path == CONTROL_PATH_SIZE, "the size of a socket's path");
    *address = (struct sockaddr_un){.sun_family = AF_UNIX};
    if (length == 0 || length >= sizeof address->sun_path) {
        return error_set(error, ERROR_INPUT,
                         "control socket: found a path of %zu bytes, \"%.40s...\", expected 1 to "
                         "%zu",
                         length, path, sizeof address->sun_path - 1);
    }
    memcpy(address->sun_path, path, length);
    return ERROR_NONE;
}

/* ---- taking a path ---- */

/* Opens and locks the directory of a path, so that no other server can start there. Returns the
 * descriptor of the directory, or -1 with an error. */
static int lock_directory(const char *path, struct error *error)
{
    const struct timespec pause = {.tv_nsec = 10000000};
    const char *slash = strrchr(path, '/');
    char directory[CONTROL_PATH_SIZE];
    int descriptor;

    snprintf(directory, sizeof directory, "%.*s",
             slash == path ? 1
             : slash       ? (int)(slash - path)
                           : 1,
             slash ? path : ".");
    descriptor = open(directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) {
        error_set_errno(error, errno, "control socket: cannot open the directory of %s", path);
        return -1;
    }
    for (int i = 0; i < LOCK_TRIES; i++) {
        if (flock(descriptor, LOCK_EX | LOCK_NB) == 0) {
            return descriptor;
        }
        nanosleep(&pause, NULL);
    }
    error_set_errno(error, errno, "control socket: cannot lock the directory of %s", path);
    close(descriptor);
    return -1;
}

/* Returns 0 if a process listens at the address, else the errno of connect. */
static int socket_probe_listener(const struct sockaddr_un *address)
{
    int descriptor = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), reason = 0;

    if (descriptor < 0) {
        return errno;
    }
    /* EAGAIN: a process listens, but its backlog is full */
    if (connect(descriptor, (const struct sockaddr *)address, sizeof *address) && errno != EAGAIN) {
        reason = errno;
    }
    close(descriptor);
    return reason;
}

/* Removes the socket of a dead process at the address. Sets *taken if a living process listens
 * there. */
static enum error_code clear_place(const struct sockaddr_un *address, bool *taken,
                                   struct error *error)
{
    const char *path = address->sun_path;
    struct stat found;
    int reason;

    if (lstat(path, &found)) {
        return errno == ENOENT ? ERROR_NONE
                               : error_set_errno(error, errno, "control socket: %s", path);
    }
    if (!S_ISSOCK(found.st_mode)) {
        return error_set(error, ERROR_INPUT,
                         "control socket: found a file at %s that is no socket, expected nothing",
                         path);
    }
    reason = socket_probe_listener(address);
    if (reason != ECONNREFUSED && reason != ENOENT) {
        *taken = true;
        return error_set(
            error, ERROR_SYSTEM,
            "control socket: a running process listens at %s already: give another path", path);
    }
    if (unlink(path) && errno != ENOENT) {
        return error_set_errno(error, errno, "control socket: cannot remove the stale %s", path);
    }
    return ERROR_NONE;
}

/* Binds and listens. The mode is set before bind, so that other users can never connect. */
static enum error_code listen_there(const struct sockaddr_un *address,
                                    struct control_socket *socket_out, struct error *error)
{
    struct stat made;
    int descriptor = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);

    if (descriptor < 0) {
        return error_set_errno(error, errno, "control socket: cannot open a socket");
    }
    if (fchmod(descriptor, S_IRUSR | S_IWUSR) ||
        bind(descriptor, (const struct sockaddr *)address, sizeof *address)) {
        error_set_errno(error, errno, "control socket: cannot make %s", address->sun_path);
        close(descriptor);
        return ERROR_SYSTEM;
    }
    errno = EPERM; /* errno if the mode lets other users in; a failed call sets another errno */
    if (lstat(address->sun_path, &made) || (made.st_mode & (S_IRWXG | S_IRWXO)) != 0 ||
        listen(descriptor, BACKLOG)) {
        error_set_errno(error, errno, "control socket: cannot keep %s to its owner",
                        address->sun_path);
        unlink(address->sun_path);
        close(descriptor);
        return ERROR_SYSTEM;
    }
    socket_out->descriptor = descriptor;
    socket_out->device = made.st_dev;
    socket_out->inode = made.st_ino;
    memcpy(socket_out->path, address->sun_path, sizeof socket_out->path);
    return ERROR_NONE;
}

/* Opens the socket at a path while its directory is locked. Sets *taken if a living process listens
 * there. */
static enum error_code open_at(const char *path, struct control_socket *socket, bool *taken,
                               struct error *error)
{
    struct sockaddr_un address;
    enum error_code code = make_address(path, &address, error);
    int lock;

    *taken = false;
    if (code) {
        return code;
    }
    lock = lock_directory(path, error);
    if (lock < 0) {
        return ERROR_SYSTEM;
    }
    code = clear_place(&address, taken, error);
    if (!code) {
        code = listen_there(&address, socket, error);
    }
    close(lock);
    return code;
}

enum error_code control_socket_open(const char *path, struct control_socket *socket,
                                    struct error *error)
{
    bool taken;

    *socket = (struct control_socket){.descriptor = -1};
    return open_at(path, socket, &taken, error);
}

void control_socket_close(struct control_socket *socket)
{
    struct error ignored;
    struct stat found;
    int lock;

    if (socket->descriptor < 0) {
        return;
    }
    lock = lock_directory(socket->path, &ignored);
    if (lstat(socket->path, &found) == 0 && S_ISSOCK(found.st_mode) &&
        found.st_dev == socket->device && found.st_ino == socket->inode) {
        unlink(socket->path);
    }
    if (lock >= 0) {
        close(lock);
    }
    close(socket->descriptor);
    socket->descriptor = -1;
}

/* ---- default paths ---- */

/* Returns whether a path is a directory (not a link) that belongs to this user and to which no
 * other user can write. */
static bool directory_is_own(const char *path)
{
    struct stat found;

    return lstat(path, &found) == 0 && S_ISDIR(found.st_mode) && found.st_uid == geteuid() &&
           (found.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

enum { USER_DIRECTORIES = 3 };

/* Lists the directories for sockets of manual runs in order of preference, and returns their
 * number. The caller checks whether they are usable. XDG_RUNTIME_DIR may be unset, or may belong to
 * another user (su, sudo). A login provides /run/user/UID. /tmp exists even in a container. */
static int user_directories(char directory[USER_DIRECTORIES][CONTROL_PATH_SIZE])
{
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    unsigned user = geteuid();
    int count = 0;

    if (runtime && runtime[0] == '/' && directory_is_own(runtime) &&
        snprintf(directory[count], CONTROL_PATH_SIZE, "%s/coman-hil", runtime) <
            CONTROL_PATH_SIZE) {
        count++;
    }
    if (user == 0) {
        snprintf(directory[count++], CONTROL_PATH_SIZE, "%s", service_directory);
        return count;
    }
    snprintf(directory[count], CONTROL_PATH_SIZE, "/run/user/%u", user);
    if (directory_is_own(directory[count])) {
        snprintf(directory[count++], CONTROL_PATH_SIZE, "/run/user/%u/coman-hil", user);
    }
    snprintf(directory[count++], CONTROL_PATH_SIZE, "/tmp/coman-hil-%u", user);
    return count;
}

/* Finds the directory of the service manager: the first entry of RUNTIME_DIRECTORY, a list
 * separated by colons. Returns false if there is none. */
static bool manager_directory(char directory[CONTROL_PATH_SIZE])
{
    const char *given = getenv("RUNTIME_DIRECTORY");
    size_t length = given ? strcspn(given, ":") : 0;

    if (length == 0 || length >= CONTROL_PATH_SIZE - sizeof "/control") {
        return false;
    }
    snprintf(directory, CONTROL_PATH_SIZE, "%.*s", (int)length, given);
    return true;
}

enum error_code control_socket_open_default(const char *name, struct control_socket *socket,
                                            struct error *error)
{
    char directory[USER_DIRECTORIES][CONTROL_PATH_SIZE], path[2 * CONTROL_PATH_SIZE];
    enum error_code code = ERROR_NONE;
    bool taken = true;

    *socket = (struct control_socket){.descriptor = -1};
    if (manager_directory(directory[0])) {
        snprintf(path, sizeof path, "%s/control", directory[0]);
        return control_socket_open(path, socket, error);
    }
    user_directories(directory);

    /* Create the user's directory. Refuse a directory that others can write to, because they could
     * impersonate the simulator. */
    if (mkdir(directory[0], geteuid() == 0 ? 0755 : 0700) && errno != EEXIST) {
        return error_set_errno(error, errno, "control socket: cannot make %s", directory[0]);
    }
    if (!directory_is_own(directory[0])) {
        return error_set(error, ERROR_SYSTEM,
                         "control socket: found %s, which is no directory that only you can write "
                         "to, expected one, or none",
                         directory[0]);
    }

    /* Listen at the first free name: RIG.sock, RIG-2.sock, ... */
    for (int i = 1; taken && i <= INSTANCES_MAX; i++) {
        if (i == 1) {
            snprintf(path, sizeof path, "%s/%.63s.sock", directory[0], name);
        } else {
            snprintf(path, sizeof path, "%s/%.63s-%d.sock", directory[0], name, i);
        }
        code = open_at(path, socket, &taken, error);
    }
    return code;
}

/* ---- connections ---- */

bool control_socket_peer(int connection, pid_t *pid, uid_t *uid)
{
    struct ucred peer;
    socklen_t size = sizeof peer;

    if (getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &size) || size != sizeof peer) {
        *pid = -1;
        *uid = (uid_t)-1;
        return false;
    }
    *pid = peer.pid;
    *uid = peer.uid;
    return peer.uid == 0 || peer.uid == geteuid();
}

enum error_code control_socket_connect(const char *path, int *descriptor, struct error *error)
{
    struct sockaddr_un address;
    enum error_code code = make_address(path, &address, error);
    int made, reason;

    if (code) {
        return code;
    }
    made = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (made >= 0 && connect(made, (const struct sockaddr *)&address, sizeof address) == 0) {
        *descriptor = made;
        return ERROR_NONE;
    }
    reason = errno;
    if (made >= 0) {
        close(made);
    }
    return error_set_errno(error, reason, "cannot connect to the control socket %s", path);
}

/* ---- finding them ---- */

struct candidate {
    char path[CONTROL_PATH_SIZE];
    struct timespec since;
};

/* Adds the sockets that match a pattern and on which a process listens. */
static void add_candidates(const char *pattern, struct candidate *list, size_t *count)
{
    glob_t found;

    if (glob(pattern, GLOB_NOSORT, NULL, &found)) {
        return;
    }
    for (size_t i = 0; i < found.gl_pathc && *count < CONTROL_FOUND_MAX; i++) {
        struct sockaddr_un address;
        struct stat file;

        if (make_address(found.gl_pathv[i], &address, NULL) == ERROR_NONE &&
            stat(found.gl_pathv[i], &file) == 0 && S_ISSOCK(file.st_mode) &&
            socket_probe_listener(&address) == 0) {
            memcpy(list[*count].path, address.sun_path, CONTROL_PATH_SIZE);
            list[(*count)++].since = file.st_mtim;
        }
    }
    globfree(&found);
}

static int newest_first(const void *a, const void *b)
{
    const struct timespec *x = &((const struct candidate *)a)->since;
    const struct timespec *y = &((const struct candidate *)b)->since;

    return x->tv_sec != y->tv_sec ? (x->tv_sec < y->tv_sec) - (x->tv_sec > y->tv_sec)
                                  : (x->tv_nsec < y->tv_nsec) - (x->tv_nsec > y->tv_nsec);
}

size_t control_socket_find(char found[CONTROL_FOUND_MAX][CONTROL_PATH_SIZE])
{
    struct candidate list[CONTROL_FOUND_MAX];
    char directory[USER_DIRECTORIES][CONTROL_PATH_SIZE], pattern[2 * CONTROL_PATH_SIZE];
    int directories = user_directories(directory);
    size_t count = 0;

    /* Search all directories, because the simulator may have used any of them */
    for (int i = 0; i < directories; i++) {
        if (directory_is_own(directory[i]) && strcmp(directory[i], service_directory) != 0) {
            snprintf(pattern, sizeof pattern, "%.*s/*.sock", CONTROL_PATH_SIZE - 1, directory[i]);
            add_candidates(pattern, list, &count);
        }
    }
    if (count == 0) {
        add_candidates("/run/coman-hil/*.sock", list, &count);
        add_candidates("/run/coman-hil/*/control", list, &count);
    }
    qsort(list, count, sizeof *list, newest_first);
    for (size_t i = 0; i < count; i++) {
        memcpy(found[i], list[i].path, CONTROL_PATH_SIZE);
    }
    return count;
}
