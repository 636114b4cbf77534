/* SPDX-License-Identifier: Apache-2.0 */
#include <sys/socket.h>
#include <unistd.h>

#include "control/ctl_client.h"
#include "tests/test.h"

/* A server that refuses a client and closes at once has said why, though nothing can be sent. */
TEST(the_reason_of_a_refusal_is_read_though_nothing_can_be_sent)
{
    static const char refusal[] = "{\"ok\":false,\"error\":\"too many clients\"}\n";
    static struct ctl_client client;
    volatile sig_atomic_t interrupted = 0;
    json_t *request = json_pack("{s:s}", "cmd", "status");
    struct error error;
    char *line;
    int pair[2];

    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    client.socket = pair[0];
    client.interrupted = &interrupted;
    assert_int_equal(write(pair[1], refusal, strlen(refusal)), (ssize_t)strlen(refusal));
    close(pair[1]);
    assert_ok(ctl_send(&client, request, &error));
    assert_int_equal(ctl_read_line(&client, &line, &error), CTL_LINE);
    assert_non_null(strstr(line, "too many clients"));
    assert_int_equal(ctl_read_line(&client, &line, &error), CTL_END);
    ctl_close(&client);
    json_decref(request);
}
