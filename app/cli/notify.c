/* SPDX-License-Identifier: Apache-2.0 */
/* The protocol of sd_notify(3): lines of KEY=VALUE in datagrams to a unix socket. */
#include "app/cli/cli.h"

#include <errno.h>
#include <stdlib.h>
#include <unistd.h>

enum { TEXT_SIZE = 512 };

/* Sends a datagram to the manager, if there is one. */
static void notify_send(const struct notify *notify, const char *text)
{
    if (notify->descriptor >= 0) {
        /* Ignores errors, because the run does not depend on the manager */
        (void)sendto(notify->descriptor, text, strlen(text), MSG_NOSIGNAL | MSG_DONTWAIT,
                     (const struct sockaddr *)&notify->address, notify->length);
    }
}

/* Sets the address for a path or, with a leading @, for a name in the abstract namespace; returns
 * false for other text. */
static bool notify_set_address(struct notify *notify, const char *path)
{
    size_t length = strlen(path);

    if ((path[0] != '/' && path[0] != '@') || length < 2 ||
        length >= sizeof notify->address.sun_path) {
        return false;
    }
    notify->address.sun_family = AF_UNIX;
    memcpy(notify->address.sun_path, path, length);
    notify->length = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
    if (path[0] == '@') {
        notify->address.sun_path[0] = '\0';
    } else {
        notify->length++;
    }
    return true;
}

/* Returns the microseconds of WATCHDOG_USEC if they are for this process, else 0. */
static int64_t notify_watchdog_us(void)
{
    const char *time = getenv("WATCHDOG_USEC"), *pid = getenv("WATCHDOG_PID");
    long long us;
    char *end;

    if (!time || (pid && strtoll(pid, NULL, 10) != (long long)getpid())) {
        return 0;
    }
    errno = 0;
    us = strtoll(time, &end, 10);
    return errno || end == time || *end || us <= 0 || us > INT64_MAX / 1000 ? 0 : us;
}

void notify_open(struct notify *notify)
{
    const char *path = getenv("NOTIFY_SOCKET");

    *notify = (struct notify){.descriptor = -1};
    if (path && notify_set_address(notify, path)) {
        notify->descriptor = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
        notify->watchdog_ns = notify_watchdog_us() * 1000;
    }
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    unsetenv("WATCHDOG_PID");
}

void notify_watch(struct notify *notify, const struct notify_health *health, int64_t now_ns)
{
    if (!notify->ready && health->ready) {
        notify->ready = true;
        notify_send(notify, "READY=1");
    }
    if (notify->watchdog_ns > 0 && now_ns >= notify->feed_ns && health->beat != notify->beat) {
        notify->beat = health->beat;
        notify->feed_ns = now_ns + notify->watchdog_ns / 2;
        notify_send(notify, "WATCHDOG=1");
    }
}

void notify_status(const struct notify *notify, const char *text)
{
    char line[TEXT_SIZE];

    snprintf(line, sizeof line, "STATUS=%s", text);
    notify_send(notify, line);
}

void notify_stopping(const struct notify *notify)
{
    notify_send(notify, "STOPPING=1");
}

void notify_reloading(struct notify *notify)
{
    char line[TEXT_SIZE];

    snprintf(line, sizeof line, "RELOADING=1\nMONOTONIC_USEC=%lld",
             (long long)(clock_now(clock_monotonic()) / 1000));
    notify_send(notify, line);
    notify->ready = false;
}

void notify_close(struct notify *notify)
{
    if (notify->descriptor >= 0) {
        close(notify->descriptor);
        notify->descriptor = -1;
    }
}
