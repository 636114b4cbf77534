/* SPDX-License-Identifier: Apache-2.0 */
/* The place of the control socket: who may use it, whose it is, what is replaced and what never. */
#include "control/socket.h"
#include "tests/test.h"

#include <errno.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

static char folder[] = "/tmp/coman-hil-control-XXXXXX";
static char path[64];
static struct error error;

FIXTURE(make_folder)
{
    unsetenv("RUNTIME_DIRECTORY");
    unsetenv("XDG_RUNTIME_DIR");
    snprintf(path, sizeof path, "%s/control", mkdtemp(folder));
    return 0;
}

FIXTURE(remove_folder)
{
    unlink(path);
    return rmdir(folder);
}

static void open_path(struct control_socket *socket)
{
    assert_ok(control_socket_open(path, socket, &error));
}

/* a socket as a killed process leaves it */
static void leave_stale(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int dead = socket(AF_UNIX, SOCK_STREAM, 0);

    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    assert_int_equal(bind(dead, (const struct sockaddr *)&address, sizeof address), 0);
    close(dead);
}

TEST(is_its_owners_alone_whatever_the_mask)
{
    mode_t mask = umask(0);
    struct control_socket socket;
    struct stat found;

    open_path(&socket);
    umask(mask);
    assert_int_equal(stat(path, &found), 0);
    assert_true(S_ISSOCK(found.st_mode));
    assert_int_equal(found.st_mode & 07777, 0600);
    control_socket_close(&socket);
    assert_int_equal(stat(path, &found), -1);
    control_socket_close(&socket);
}

TEST(a_stale_socket_is_replaced)
{
    struct control_socket socket;
    int client;

    leave_stale();
    assert_int_equal(control_socket_connect(path, &client, &error), ERROR_SYSTEM);
    open_path(&socket);
    assert_ok(control_socket_connect(path, &client, &error));
    close(client);
    control_socket_close(&socket);
}

TEST(a_living_one_is_not)
{
    struct control_socket first, second;
    int client;

    open_path(&first);
    assert_int_equal(control_socket_open(path, &second, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "a running process listens at"));
    assert_int_equal(second.descriptor, -1);
    assert_ok(control_socket_connect(path, &client, &error));
    close(client);
    control_socket_close(&first);
}

TEST(other_files_are_left_alone)
{
    struct control_socket socket;
    FILE *file = fopen(path, "w");

    fclose(file);
    assert_int_equal(control_socket_open(path, &socket, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "that is no socket"));
    assert_int_equal(access(path, F_OK), 0);
    assert_int_equal(unlink(path), 0);
    /* a link that leads to a socket is no socket either */
    assert_int_equal(symlink("/nowhere", path), 0);
    assert_int_equal(control_socket_open(path, &socket, &error), ERROR_INPUT);
    assert_int_equal(unlink(path), 0);
}

TEST(only_ones_own_is_removed_at_the_end)
{
    struct control_socket first, second;

    open_path(&first);
    assert_int_equal(unlink(path), 0);
    open_path(&second);
    control_socket_close(&first);
    assert_int_equal(access(path, F_OK), 0);
    control_socket_close(&second);
    assert_int_equal(access(path, F_OK), -1);
}

TEST(rejects_paths_that_cannot_be)
{
    struct control_socket socket;
    char text[200];

    memset(text, 'a', sizeof text);
    text[0] = '/';
    text[108] = '\0';
    assert_int_equal(control_socket_open(text, &socket, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "found a path of 108 bytes"));
    assert_non_null(strstr(error.text, "expected 1 to 107"));
    assert_int_equal(control_socket_open("", &socket, &error), ERROR_INPUT);
    assert_int_equal(control_socket_open("/nowhere/at/all", &socket, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "/nowhere/at/all"));
}

TEST(the_peer_is_known)
{
    struct control_socket socket;
    int client, served;
    pid_t pid;
    uid_t uid;

    open_path(&socket);
    assert_ok(control_socket_connect(path, &client, &error));
    served = accept(socket.descriptor, NULL, NULL);
    assert_true(control_socket_peer(served, &pid, &uid));
    assert_int_equal(pid, getpid());
    assert_int_equal(uid, geteuid());
    assert_false(control_socket_peer(-1, &pid, &uid));
    close(served);
    close(client);
    control_socket_close(&socket);
}

/* with another user's eyes: a child that gives its rights away */
TEST(strangers_are_told_from_the_owner)
{
    struct control_socket socket;
    int client, served, pipes[2];
    char go = 0;
    pid_t pid, child;
    uid_t uid;

    if (geteuid() != 0) {
        print_message("SKIP: needs root to become somebody else\n");
        skip();
    }
    open_path(&socket);
    assert_int_equal(chmod(path, 0666), 0);
    assert_int_equal(chmod(folder, 0755), 0);
    assert_int_equal(pipe(pipes), 0);
    child = fork();
    if (child == 0) {
        if (setuid(65534) == 0 && control_socket_connect(path, &client, &error) == ERROR_NONE) {
            (void)!read(pipes[0], &go, 1);
        }
        _exit(0);
    }
    while ((served = accept(socket.descriptor, NULL, NULL)) < 0) {
        assert_int_equal(errno, EAGAIN);
        usleep(1000);
    }
    assert_false(control_socket_peer(served, &pid, &uid));
    assert_int_equal(uid, 65534);
    assert_int_equal(pid, child);
    assert_int_equal(write(pipes[1], &go, 1), 1);
    close(served);
    close(pipes[0]);
    close(pipes[1]);
    control_socket_close(&socket);
}

TEST(runs_of_one_rig_get_places_of_their_own)
{
    struct control_socket first, second;
    char found[CONTROL_FOUND_MAX][CONTROL_PATH_SIZE], place[128];

    setenv("XDG_RUNTIME_DIR", folder, 1);
    assert_ok(control_socket_open_default("coman", &first, &error));
    assert_ok(control_socket_open_default("coman", &second, &error));
    snprintf(place, sizeof place, "%s/coman-hil/coman.sock", folder);
    assert_string_equal(first.path, place);
    snprintf(place, sizeof place, "%s/coman-hil/coman-2.sock", folder);
    assert_string_equal(second.path, place);

    /* the newest that lives comes first */
    assert_true(control_socket_find(found) >= 2);
    assert_string_equal(found[0], second.path);
    control_socket_close(&second);
    assert_true(control_socket_find(found) >= 1);
    assert_string_equal(found[0], first.path);
    control_socket_close(&first);
    snprintf(place, sizeof place, "%s/coman-hil", folder);
    assert_int_equal(rmdir(place), 0);
    unsetenv("XDG_RUNTIME_DIR");
}

/* ---- without a runtime directory of one's own: containers, su ---- */

enum { NOBODY = 65534 };

static char fallback[64];

/* Runs body in a process of a user without a login; true when it came to its end. */
static bool nobody_succeeds(bool (*body)(void))
{
    pid_t child = fork();
    int status;

    if (child == 0) {
        _exit(setgid(NOBODY) == 0 && setuid(NOBODY) == 0 && body() ? 0 : 1);
    }
    return waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static bool server_and_client_meet(void)
{
    static char found[CONTROL_FOUND_MAX][CONTROL_PATH_SIZE];
    struct control_socket socket;
    bool met;

    if (control_socket_open_default("coman", &socket, &error)) {
        return false;
    }
    met = strncmp(socket.path, fallback, strlen(fallback)) == 0 && control_socket_find(found) > 0 &&
          strcmp(found[0], socket.path) == 0;
    /* a client that logs in with a runtime directory finds it too */
    setenv("XDG_RUNTIME_DIR", "/proc/self", 1);
    met = met && control_socket_find(found) > 0 && strcmp(found[0], socket.path) == 0;
    control_socket_close(&socket);
    return met;
}

static bool server_refuses(void)
{
    struct control_socket socket;

    return control_socket_open_default("coman", &socket, &error) == ERROR_SYSTEM &&
           strstr(error.text, fallback) && socket.descriptor < 0;
}

static bool nothing_is_found(void)
{
    static char found[CONTROL_FOUND_MAX][CONTROL_PATH_SIZE];
    size_t count = control_socket_find(found);

    for (size_t i = 0; i < count; i++) {
        if (!strncmp(found[i], fallback, strlen(fallback))) {
            return false;
        }
    }
    return true;
}

TEST(both_ends_agree_without_a_runtime_directory)
{
    struct control_socket trap;
    char place[128];

    if (geteuid() != 0) {
        print_message("SKIP: needs root to become somebody else\n");
        skip();
    }
    snprintf(fallback, sizeof fallback, "/tmp/coman-hil-%d", NOBODY);
    if (access(fallback, F_OK) == 0) {
        print_message("SKIP: %s is in use\n", fallback);
        skip();
    }
    assert_true(nobody_succeeds(server_and_client_meet));
    assert_int_equal(rmdir(fallback), 0);

    /* another user's directory in the environment, as su leaves it, is none */
    setenv("XDG_RUNTIME_DIR", folder, 1);
    assert_true(nobody_succeeds(server_and_client_meet));
    assert_int_equal(rmdir(fallback), 0);
    unsetenv("XDG_RUNTIME_DIR");

    /* a directory that somebody else has made is no place for a server, nor for a client */
    assert_int_equal(mkdir(fallback, 0777), 0);
    assert_int_equal(chmod(fallback, 0777), 0);
    snprintf(place, sizeof place, "%s/coman.sock", fallback);
    assert_ok(control_socket_open(place, &trap, &error));
    assert_int_equal(chmod(place, 0666), 0);
    assert_true(nobody_succeeds(server_refuses));
    assert_true(nobody_succeeds(nothing_is_found));

    /* nor one of one's own that others can write to */
    assert_int_equal(chown(fallback, NOBODY, NOBODY), 0);
    assert_true(nobody_succeeds(server_refuses));
    assert_true(nobody_succeeds(nothing_is_found));
    control_socket_close(&trap);
    assert_int_equal(rmdir(fallback), 0);

    /* nor a link to a good one */
    assert_int_equal(symlink(folder, fallback), 0);
    assert_int_equal(lchown(fallback, NOBODY, NOBODY), 0);
    assert_true(nobody_succeeds(server_refuses));
    assert_int_equal(unlink(fallback), 0);
}

TEST(a_service_has_its_own_place)
{
    struct control_socket socket;
    char list[128];

    snprintf(list, sizeof list, "%s:/somewhere/else", folder);
    setenv("RUNTIME_DIRECTORY", list, 1);
    assert_ok(control_socket_open_default("coman", &socket, &error));
    assert_string_equal(socket.path, path);
    control_socket_close(&socket);
    unsetenv("RUNTIME_DIRECTORY");
}

TEST_GROUP(make_folder, remove_folder)
