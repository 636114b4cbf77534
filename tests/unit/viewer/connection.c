/* SPDX-License-Identifier: Apache-2.0 */
/* Clients of the page that take nothing, ask nothing, or do both slowly: when they are cut, and as
 * what that counts. In virtual time. */
#include "viewer/private.h"

#include "rt/clock.h"
#include "tests/test.h"

#include <sys/socket.h>
#include <unistd.h>

#define PATIENCE_NS (10 * CLOCK_SECOND)

static struct viewer *viewer;
static struct viewer_client *client;
static int far_end;

/* A client with a token on a socket that holds little. */
FIXTURE(set_up)
{
    const int small = 4096;
    int pair[2];

    viewer = calloc(1, sizeof *viewer);
    if (!viewer || socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair)) {
        return -1;
    }
    setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &small, sizeof small);
    viewer->now_ns = 1000 * CLOCK_SECOND;
    client = &viewer->client[0];
    *client = (struct viewer_client){.socket = pair[0],
                                     .control = -1,
                                     .mode = CLIENT_SOCKET,
                                     .right = RIGHT_LOOK,
                                     .since_ns = viewer->now_ns,
                                     .taken_ns = viewer->now_ns,
                                     .outbox = malloc(VIEWER_OUTBOX)};
    far_end = pair[1];
    return client->outbox ? 0 : -1;
}

FIXTURE(tear_down)
{
    free(client->outbox);
    if (client->socket >= 0) {
        close(client->socket);
    }
    close(far_end);
    free(viewer);
    return 0;
}

/* Sends more than the socket holds; some of it waits. */
static void fill_socket(void)
{
    static const uint8_t message[100000];

    assert_true(client_send_message(viewer, client, WEBSOCKET_BINARY, message, sizeof message));
    assert_true(client_waiting(client) > 0);
}

static void pass_time(int64_t time_ns)
{
    viewer->now_ns += time_ns;
    client_flush(viewer, client);
    client_check(viewer, client);
}

TEST_WITH(who_takes_nothing_for_ten_seconds_is_cut_and_counted, set_up, tear_down)
{
    fill_socket();
    pass_time(PATIENCE_NS);
    assert_true(client->socket >= 0);
    assert_int_equal(viewer->counters.cut_slow, 0);
    pass_time(1);
    assert_int_equal(client->socket, -1);
    assert_int_equal(viewer->counters.cut_slow, 1);
    assert_int_equal(viewer->counters.cut_silent + viewer->counters.cut_junk, 0);
}

TEST_WITH(who_takes_a_little_now_and_then_stays, set_up, tear_down)
{
    static uint8_t some[8192];

    fill_socket();
    for (int i = 0; i < 5; i++) {
        pass_time(PATIENCE_NS - CLOCK_SECOND);
        assert_true(client->socket >= 0 && client_waiting(client) > 0);
        assert_true(read(far_end, some, sizeof some) > 0);
        pass_time(CLOCK_SECOND / 2); /* there is room: more has been taken */
    }
    assert_int_equal(viewer->counters.cut_slow, 0);
    pass_time(PATIENCE_NS + 1);
    assert_int_equal(viewer->counters.cut_slow, 1);
}

/* A browser that draws reads a long file in pieces */
TEST_WITH(who_reads_a_file_has_two_minutes_for_each_piece, set_up, tear_down)
{
    static uint8_t file[200000], some[8192];

    client->mode = CLIENT_CLOSING;
    client->body = file;
    client->body_size = sizeof file;
    client_flush(viewer, client);
    assert_true(client_waiting(client) > 0);
    for (int i = 0; i < 3; i++) {
        pass_time(12 * PATIENCE_NS - CLOCK_SECOND);
        assert_true(client->socket >= 0 && client_waiting(client) > 0);
        assert_true(read(far_end, some, sizeof some) > 0);
        pass_time(CLOCK_SECOND / 2);
    }
    pass_time(12 * PATIENCE_NS);
    assert_true(client->socket >= 0);
    pass_time(1);
    assert_int_equal(client->socket, -1);
    assert_int_equal(viewer->counters.cut_slow, 1);
}

TEST_WITH(who_is_sent_nothing_may_be_quiet, set_up, tear_down)
{
    pass_time(100 * PATIENCE_NS);
    assert_true(client->socket >= 0);
    fill_socket(); /* the time before counts for nothing */
    pass_time(PATIENCE_NS);
    assert_true(client->socket >= 0);
}

TEST_WITH(who_gives_no_token_is_cut_as_silent, set_up, tear_down)
{
    client->right = RIGHT_NONE;
    pass_time(PATIENCE_NS);
    assert_true(client->socket >= 0);
    pass_time(1);
    assert_int_equal(client->socket, -1);
    assert_int_equal(viewer->counters.cut_silent, 1);
    assert_int_equal(viewer->counters.cut_slow, 0);
}
