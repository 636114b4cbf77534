/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The path of the control socket: how a server (control/control.h) claims and releases it, and how
 * a client (`coman-hil ctl`) finds it. Not RT-safe.
 *
 * Only the owner and root may connect: the file has mode 0600, and the peer of every connection is
 * checked (SO_PEERCRED). A server replaces the socket of a dead process. It never replaces the
 * socket of a living process or any other file. A lock on the directory serializes servers that
 * start at the same time.
 *
 * The default path is the first of these that applies:
 *
 *   $RUNTIME_DIRECTORY/control         a service manager sets it (/run/coman-hil/RIG/control)
 *   $XDG_RUNTIME_DIR/coman-hil/RIG.sock  if the directory is this user's (not after su or sudo)
 *   /run/coman-hil/RIG.sock            root
 *   /run/user/UID/coman-hil/RIG.sock   other users
 *   /tmp/coman-hil-UID/RIG.sock        otherwise
 *
 * A server uses only a directory to which no other user can write. A second run of the same rig
 * gets RIG-2.sock, and so on. A client searches all these paths.
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
    dev_t device; /* device and inode identify the file */
    ino_t inode;
};

/* Listens at path. Returns ERROR_INPUT if the path is too long or another file is there. Returns
 * ERROR_SYSTEM if the system refuses, or if a living process listens there. */
enum error_code control_socket_open(const char *path, struct control_socket *socket,
                                    struct error *error);

/* Listens at the first free default path for this name. Returns the error of the last path tried.
 * Also returns ERROR_SYSTEM if the directory belongs to another user, or if other users can write
 * to it. */
enum error_code control_socket_open_default(const char *name, struct control_socket *socket,
                                            struct error *error);

/* Closes the socket and removes its file, unless another file has replaced it. */
void control_socket_close(struct control_socket *socket);

/* Finds the process at the other end of a connection. Returns false if it is unknown, or if its
 * user is neither this user nor root. */
bool control_socket_peer(int connection, pid_t *pid, uid_t *uid);

/* Connects to the server at path; the descriptor is blocking. */
enum error_code control_socket_connect(const char *path, int *descriptor, struct error *error);

/* Finds the sockets with a listening process in the user's default directories, newest first. If
 * there are none, searches /run/coman-hil. Returns the number of sockets. */
size_t control_socket_find(char found[CONTROL_FOUND_MAX][CONTROL_PATH_SIZE]);

#endif
