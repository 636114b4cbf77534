/* SPDX-License-Identifier: Apache-2.0 */
/* What a service manager hears, on a real socket of the kind that it opens. */
#include "app/cli/cli.h"
#include "tests/test.h"

#include <unistd.h>

enum { MS = 1000000 };

struct manager {
    int socket;
    char path[108];
};

static inline void start(struct manager *manager)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};

    snprintf(manager->path, sizeof manager->path, "/tmp/hil-notify-%ld", (long)getpid());
    unlink(manager->path);
    memcpy(address.sun_path, manager->path, sizeof address.sun_path);
    manager->socket = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    if (manager->socket < 0 ||
        bind(manager->socket, (const struct sockaddr *)&address, sizeof address)) {
        fail();
    }
    setenv("NOTIFY_SOCKET", manager->path, 1);
    setenv("WATCHDOG_USEC", "2000000", 1);
    unsetenv("WATCHDOG_PID");
}

static inline void stop(struct manager *manager)
{
    close(manager->socket);
    unlink(manager->path);
}

static void assert_hears(const struct manager *manager, const char *expected)
{
    char text[512];
    ssize_t count = recv(manager->socket, text, sizeof text - 1, 0);

    text[count > 0 ? count : 0] = '\0';
    assert_string_equal(text, expected);
}

BENCH(start, struct manager, stop)

TEST_ON(says_ready_after_the_first_tick_only, start, manager)
{
    struct notify notify;
    struct notify_health health = {0};

    notify_open(&notify);
    assert_int_equal(notify.watchdog_ns, INT64_C(2000000000));
    notify_watch(&notify, &health, 0);
    assert_hears(manager, "");
    health.ready = true;
    health.beat = 1;
    notify_watch(&notify, &health, 1);
    assert_hears(manager, "READY=1");
    assert_hears(manager, "WATCHDOG=1");
    health.beat = 2;
    notify_watch(&notify, &health, 2);
    assert_hears(manager, "");
    notify_close(&notify);
}

TEST_ON(feeds_the_watchdog_while_the_loop_lives, start, manager)
{
    struct notify notify;
    struct notify_health health = {.ready = true, .beat = 5};

    notify_open(&notify);
    notify_watch(&notify, &health, 0);
    assert_hears(manager, "READY=1");
    assert_hears(manager, "WATCHDOG=1");
    /* before half of the time nothing, then nothing as long as the beat stands still */
    health.beat = 6;
    notify_watch(&notify, &health, INT64_C(999) * MS);
    assert_hears(manager, "");
    notify_watch(&notify, &health, INT64_C(1000) * MS);
    assert_hears(manager, "WATCHDOG=1");
    notify_watch(&notify, &health, INT64_C(2000) * MS);
    notify_watch(&notify, &health, INT64_C(9000) * MS);
    assert_hears(manager, "");
    health.beat = 7;
    notify_watch(&notify, &health, INT64_C(9001) * MS);
    assert_hears(manager, "WATCHDOG=1");
    notify_close(&notify);
}

TEST_ON(says_how_it_is_and_that_it_ends, start, manager)
{
    struct notify notify;
    struct notify_health health = {.ready = true};
    char text[512];

    notify_open(&notify);
    notify_status(&notify, "12.000 s");
    assert_hears(manager, "STATUS=12.000 s");
    notify_watch(&notify, &health, 0);
    assert_hears(manager, "READY=1");
    notify_reloading(&notify);
    assert_true(recv(manager->socket, text, sizeof text, 0) > 0);
    assert_memory_equal(text, "RELOADING=1\nMONOTONIC_USEC=", 27);
    notify_watch(&notify, &health, 0);
    assert_hears(manager, "READY=1");
    notify_stopping(&notify);
    assert_hears(manager, "STOPPING=1");
    notify_close(&notify);
}

TEST_ON(leaves_nothing_in_the_environment, start, manager)
{
    struct notify notify;

    notify_open(&notify);
    assert_null(getenv("NOTIFY_SOCKET"));
    assert_null(getenv("WATCHDOG_USEC"));
    notify_close(&notify);
}

TEST_ON(is_silent_without_a_manager_or_with_a_strange_one, start, manager)
{
    static const char *const strange[] = {
        "", "/", "relative", "@",
        "/tmp/a-path-that-is-far-too-long-for-a-unix-socket-and-so-"
        "cannot-be-the-address-of-any-service-manager-at-all-ever"};
    struct notify notify;

    for (size_t i = 0; i < sizeof strange / sizeof strange[0]; i++) {
        setenv("NOTIFY_SOCKET", strange[i], 1);
        notify_open(&notify);
        assert_int_equal(notify.descriptor, -1);
        notify_status(&notify, "x");
        notify_close(&notify);
    }
    unsetenv("NOTIFY_SOCKET");
    notify_open(&notify);
    notify_stopping(&notify);
    assert_hears(manager, "");
}

TEST_ON(ignores_a_watchdog_of_another_process_or_no_number, start, manager)
{
    static const char *const strange[] = {"", "x", "12x", "-5", "99999999999999999999"};
    struct notify notify;

    for (size_t i = 0; i < sizeof strange / sizeof strange[0]; i++) {
        setenv("NOTIFY_SOCKET", "@hil-none", 1);
        setenv("WATCHDOG_USEC", strange[i], 1);
        notify_open(&notify);
        assert_int_equal(notify.watchdog_ns, 0);
        notify_close(&notify);
    }
    setenv("NOTIFY_SOCKET", "@hil-none", 1);
    setenv("WATCHDOG_USEC", "1000", 1);
    setenv("WATCHDOG_PID", "1", 1);
    notify_open(&notify);
    assert_int_equal(notify.watchdog_ns, 0);
    notify_close(&notify);
}
