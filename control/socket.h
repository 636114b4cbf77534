/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The path of the control socket: how the server (control/control.h) takes and leaves it, and
 * how a client (`coman-hil ctl`) finds it. Not RT-safe.
 *
 * Only its owner and root may connect: the file is created with mode 0600, and the peer of every
 * connection is checked (SO_PEERCRED). The socket of a dead process is replaced, that of a living
 * one never, nor any other file. Servers that start at the same time take turns by a lock on the
 * directory.
 *
 * The default paths: $RUNTIME_DIRECTORY/control under a service manager that sets it
 * (/run/coman-hil/RIG/control with our unit), else coman-hil/RIG.sock in $XDG_RUNTIME_DIR when
 * that is this user's own (su and sudo leave another's), else /run/coman-hil/RIG.sock for root, and
 * for others coman-hil/RIG.sock in /run/user/UID, else /tmp/coman-hil-UID/RIG.sock: a directory
 * that only its owner can write to is used, no other. A second run of the same rig gets RIG-2.sock,
 * and so on. A client looks in all of them.
 */
#ifndef CONTROL_SOCKET_H
#define CONTROL_SOCKET_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

enum { CONTROL_PATH_SIZE = 108, CONTROL_FOUND_MAX = 64 }; /* 108: of sockaddr_un */

/* A listening socket. */
struct control_socket {
    int descriptor; /* -1 = none; non-blocking */
    char path[CONTROL_PATH_SIZE];
    dev_t device; /* of the file, to know it again */
    ino_t inode;
};

/* Listens at path. ERROR_INPUT: it is too long, or something else is there; ERROR_SYSTEM: the
 * system refuses, or a living process listens there. */
enum error_code control_socket_open(const char *path, struct control_socket *socket,
                                    struct error *error);

/* Listens at the first free default path for this name. The error is that of the last path tried.
 * ERROR_SYSTEM also: the directory is another user's, or others can write to it. */
enum error_code control_socket_open_default(const char *name, struct control_socket *socket,
                                            struct error *error);

/* Closes it and removes the file, when it is still this socket's. */
void control_socket_close(struct control_socket *socket);

/* Finds the process at the other end of a connection; false = unknown, or neither of this user
 * nor of root. */
bool control_socket_peer(int connection, pid_t *pid, uid_t *uid);

/* Connects to the server at path; a blocking descriptor. */
enum error_code control_socket_connect(const char *path, int *descriptor, struct error *error);

/* Finds the sockets in the user's default directories on which a process listens, the newest
 * first; if there is none, those in /run/coman-hil. Returns how many. */
size_t control_socket_find(char found[CONTROL_FOUND_MAX][CONTROL_PATH_SIZE]);

#endif
