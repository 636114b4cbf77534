/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The path of the control socket: how a server (control/control.h) claims and releases it, and how
 * a client (`coman-hil ctl`) finds it. Not RT-safe.
 *
 * Only the owner and root may connect: the file has mode 0600, and the peer of every connection is
 * checked (SO_PEERCRED). A server replaces the socket of a dead process, but never that of a living
 * one or any other file. A lock on the directory serializes servers that start at the same time.
 *
 * The default path is the first that applies:
 *
 *   $RUNTIME_DIRECTORY/control         a service manager sets it (/run/coman-hil/RIG/control)
 *   $XDG_RUNTIME_DIR/coman-hil/RIG.sock  if the directory is this user's (not after su or sudo)
 *   /run/coman-hil/RIG.sock            root
 *   /run/user/UID/coman-hil/RIG.sock   other users
 *   /tmp/coman-hil-UID/RIG.sock        otherwise
 *
 * Only a directory that no other user can write to is used. A second run of the same rig gets
 * RIG-2.sock, and so on. A client searches all of them.
 */
#ifndef CONTROL_SOCKET_H
#define CONTROL_SOCKET_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

enum { CONTROL_PATH_SIZE = 108, CONTROL_FOUND_MAX = 64 }; /* 108: size in sockaddr_un */

/* A listening socket. */
struct control_socket {
    int descriptor; /* -1 = none; non-blocking */
    char path[CONTROL_PATH_SIZE];
    dev_t device; /* identity of the file, to recognize it */
    ino_t inode;
};

/* Listens at path. ERROR_INPUT: too long, or another file is there; ERROR_SYSTEM: refused by the
 * system, or a living process listens there. */
enum error_code control_socket_open(const char *path, struct control_socket *socket,
                                    struct error *error);

/* Listens at the first free default path for this name. Returns the error of the last path tried.
 * ERROR_SYSTEM also when the directory belongs to another user or others can write to it. */
enum error_code control_socket_open_default(const char *name, struct control_socket *socket,
                                            struct error *error);

/* Closes the socket and removes its file, unless another file has replaced it. */
void control_socket_close(struct control_socket *socket);

/* Finds the process at the other end of a connection; false = unknown, or neither this user nor
 * root. */
bool control_socket_peer(int connection, pid_t *pid, uid_t *uid);

/* Connects to the server at path; the descriptor is blocking. */
enum error_code control_socket_connect(const char *path, int *descriptor, struct error *error);

/* Finds the sockets with a listening process in the user's default directories, the newest first;
 * if there are none, those in /run/coman-hil. Returns their number. */
size_t control_socket_find(char found[CONTROL_FOUND_MAX][CONTROL_PATH_SIZE]);

#endif
