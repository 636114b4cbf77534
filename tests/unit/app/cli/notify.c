/* SPDX-License-Identifier: Apache-2.0 */
/* What a service manager hears, on a real socket of the kind that it opens. */
#include "app/cli/notify.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { MS = 1000000 };

struct manager {
    int socket;
    char path[108];
};

static int start(void **state)
{
    static struct manager manager;
    struct sockaddr_un address = {.sun_family = AF_UNIX};

    snprintf(manager.path, sizeof manager.path, "/tmp/hil-notify-%ld", (long)getpid());
    unlink(manager.path);
    memcpy(address.sun_path, manager.path, sizeof address.sun_path);
    manager.socket = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    if (manager.socket < 0 ||
        bind(manager.socket, (const struct sockaddr *)&address, sizeof address)) {
        return -1;
    }
    setenv("NOTIFY_SOCKET", manager.path, 1);
    setenv("WATCHDOG_USEC", "2000000", 1);
    unsetenv("WATCHDOG_PID");
    *state = &manager;
    return 0;
}

static int stop(void **state)
{
    struct manager *manager = *state;

    close(manager->socket);
    unlink(manager->path);
    return 0;
}

static void assert_hears(const struct manager *manager, const char *expected)
{
    char text[512];
    ssize_t count = recv(manager->socket, text, sizeof text - 1, 0);

    text[count > 0 ? count : 0] = '\0';
    assert_string_equal(text, expected);
}

static void says_ready_after_the_first_tick_only(void **state)
{
    struct notify notify;
    struct notify_health health = {0};

    notify_open(&notify);
    assert_int_equal(notify.watchdog_ns, INT64_C(2000000000));
    notify_watch(&notify, &health, 0);
    assert_hears(*state, "");
    health.ready = true;
    health.beat = 1;
    notify_watch(&notify, &health, 1);
    assert_hears(*state, "READY=1");
    assert_hears(*state, "WATCHDOG=1");
    health.beat = 2;
    notify_watch(&notify, &health, 2);
    assert_hears(*state, "");
    notify_close(&notify);
}

static void feeds_the_watchdog_while_the_loop_lives(void **state)
{
    struct notify notify;
    struct notify_health health = {.ready = true, .beat = 5};

    notify_open(&notify);
    notify_watch(&notify, &health, 0);
    assert_hears(*state, "READY=1");
    assert_hears(*state, "WATCHDOG=1");
    /* before half of the time nothing, then nothing as long as the beat stands still */
    health.beat = 6;
    notify_watch(&notify, &health, INT64_C(999) * MS);
    assert_hears(*state, "");
    notify_watch(&notify, &health, INT64_C(1000) * MS);
    assert_hears(*state, "WATCHDOG=1");
    notify_watch(&notify, &health, INT64_C(2000) * MS);
    notify_watch(&notify, &health, INT64_C(9000) * MS);
    assert_hears(*state, "");
    health.beat = 7;
    notify_watch(&notify, &health, INT64_C(9001) * MS);
    assert_hears(*state, "WATCHDOG=1");
    notify_close(&notify);
}

static void says_how_it_is_and_that_it_ends(void **state)
{
    struct notify notify;
    struct notify_health health = {.ready = true};
    char text[512];

    notify_open(&notify);
    notify_status(&notify, "12.000 s");
    assert_hears(*state, "STATUS=12.000 s");
    notify_watch(&notify, &health, 0);
    assert_hears(*state, "READY=1");
    notify_reloading(&notify);
    assert_true(recv(((struct manager *)*state)->socket, text, sizeof text, 0) > 0);
    assert_memory_equal(text, "RELOADING=1\nMONOTONIC_USEC=", 27);
    notify_watch(&notify, &health, 0);
    assert_hears(*state, "READY=1");
    notify_stopping(&notify);
    assert_hears(*state, "STOPPING=1");
    notify_close(&notify);
}

static void leaves_nothing_in_the_environment(void **state)
{
    struct notify notify;

    (void)state;
    notify_open(&notify);
    assert_null(getenv("NOTIFY_SOCKET"));
    assert_null(getenv("WATCHDOG_USEC"));
    notify_close(&notify);
}

static void is_silent_without_a_manager_or_with_a_strange_one(void **state)
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
    assert_hears(*state, "");
}

static void ignores_a_watchdog_of_another_process_or_no_number(void **state)
{
    static const char *const strange[] = {"", "x", "12x", "-5", "99999999999999999999"};
    struct notify notify;

    (void)state;
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(says_ready_after_the_first_tick_only, start, stop),
        cmocka_unit_test_setup_teardown(feeds_the_watchdog_while_the_loop_lives, start, stop),
        cmocka_unit_test_setup_teardown(says_how_it_is_and_that_it_ends, start, stop),
        cmocka_unit_test_setup_teardown(leaves_nothing_in_the_environment, start, stop),
        cmocka_unit_test_setup_teardown(is_silent_without_a_manager_or_with_a_strange_one, start,
                                        stop),
        cmocka_unit_test_setup_teardown(ignores_a_watchdog_of_another_process_or_no_number, start,
                                        stop),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
