/* SPDX-License-Identifier: Apache-2.0 */
/* Requests of HTTP: what a browser sends is understood, anything else has its status; and who may
 * ask at which address. */
#include "viewer/http_request.h"
#include "tests/test.h"

static struct http_request request;
static size_t used;

static int parse(const char *text)
{
    return http_request_parse(text, strlen(text), &request, &used);
}

TEST(reads_what_a_browser_sends)
{
    static const char text[] = "GET /socket?x=1 HTTP/1.1\r\nHost: 127.0.0.1:8080\r\n"
                               "Connection: keep-alive, Upgrade\r\nUPGRADE: websocket\r\n"
                               "Origin:http://127.0.0.1:8080 \r\nSec-WebSocket-Version: 13\r\n"
                               "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                               "Authorization: Bearer abc\r\n\r\nmore";

    for (size_t size = 0; size < strlen(text) - 4; size++) {
        assert_int_equal(http_request_parse(text, size, &request, &used), 0);
    }
    assert_int_equal(parse(text), 200);
    assert_int_equal(used, strlen(text) - 4);
    assert_string_equal(request.path, "/socket");
    assert_string_equal(request.host, "127.0.0.1:8080");
    assert_string_equal(request.origin, "http://127.0.0.1:8080");
    assert_string_equal(request.authorization, "Bearer abc");
    assert_true(request.upgrade);
}

TEST(an_upgrade_needs_all_its_headers)
{
    assert_int_equal(parse("GET / HTTP/1.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                           "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: short\r\n\r\n"),
                     200);
    assert_false(request.upgrade);
    assert_int_equal(parse("GET / HTTP/1.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                           "Sec-WebSocket-Version: 8\r\n"
                           "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"),
                     200);
    assert_false(request.upgrade);
}

/* A zero or another control character in a header ends the request, wherever it is: for a reader of
 * texts a zero would end the value, and hide what follows. */
TEST(control_characters_in_a_header_are_refused)
{
    /* The character goes to the place of the percent sign */
    static const char *const heads[] = {"Host: a%b", "Ho%st: a",  "X-Other: a%",
                                        "%Host: a",  "Cookie:%%", "Authorization: Bearer abc%def"};
    char text[128];

    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++) {
        const int size = snprintf(text, sizeof text, "GET / HTTP/1.1\r\n%s\r\n\r\n", heads[i]);
        char *at = strchr(text, '%');

        for (int c = 0; c <= 0x7f; c++) {
            *at = (char)c;
            if ((c < 0x20 && c != '\t') || c == 0x7f) {
                assert_int_equal(http_request_parse(text, (size_t)size, &request, &used), 400);
            }
        }
    }
    assert_int_equal(parse("GET / HTTP/1.1\r\nX-Other:\ta\xe4 b\t\r\n\r\n"), 200);
}

TEST(other_requests_have_their_status)
{
    static char big[REQUEST_SIZE_MAX + 200];
    static const struct {
        const char *text;
        int status;
    } cases[] = {
        {"POST / HTTP/1.1\r\n\r\n", 405},
        {"GET / HTTP/1.0\r\n\r\n", 505},
        {"GET http://x/ HTTP/1.1\r\n\r\n", 400},
        {"GET /a b HTTP/1.1\r\n\r\n", 400},
        {"GET / HTTP/1.1\nHost: a\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nHost : a\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nHost: a\r\nhost: b\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nno colon\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nContent-Length: 5\r\n\r\n", 413},
        {"GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", 413},
        {"\r\n\r\n", 400},
    };

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(parse(cases[i].text), cases[i].status);
    }

    /* Too long: at once as a whole, a header that matters, a path */
    memset(big, 'a', sizeof big - 1);
    assert_int_equal(parse(big), 431);
    snprintf(big, sizeof big, "GET / HTTP/1.1\r\nHost: %0300d\r\n\r\n", 1);
    assert_int_equal(parse(big), 431);
    snprintf(big, sizeof big, "GET /%0300d HTTP/1.1\r\n\r\n", 1);
    assert_int_equal(parse(big), 414);
}

static bool is_ours(const struct http_bound *bound, const char *host, const char *origin)
{
    memset(&request, 0, sizeof request);
    snprintf(request.host, sizeof request.host, "%s", host);
    snprintf(request.origin, sizeof request.origin, "%s", origin);
    return http_request_is_ours(&request, bound);
}

TEST(only_its_own_pages_may_ask_a_server_of_this_machine)
{
    const struct http_bound bound = {"127.0.0.1", 8080, .loopback = true};

    assert_true(is_ours(&bound, "127.0.0.1:8080", ""));
    assert_true(is_ours(&bound, "localhost:8080", "http://localhost:8080"));
    assert_true(is_ours(&bound, "127.0.0.1:8080", "http://127.0.0.1:8080"));

    /* A name that somebody points to this machine, another site's page, another port */
    assert_false(is_ours(&bound, "evil.example:8080", "http://evil.example:8080"));
    assert_false(is_ours(&bound, "127.0.0.1:8080", "http://evil.example"));
    assert_false(is_ours(&bound, "127.0.0.1:8080", "https://127.0.0.1:8080"));
    assert_false(is_ours(&bound, "127.0.0.1:8080", "null"));
    assert_false(is_ours(&bound, "127.0.0.1:81", ""));
    assert_false(is_ours(&bound, "127.0.0.1", ""));
    assert_false(is_ours(&bound, "192.0.2.1:8080", ""));
    assert_false(is_ours(&bound, "", ""));
    assert_false(is_ours(&bound, "127.0.0.1.evil.example:8080", ""));
}

TEST(at_all_addresses_only_numbers_are_trusted)
{
    const struct http_bound all = {"0.0.0.0", 80, .any = true}, six = {"::1", 9, .loopback = true};

    assert_true(is_ours(&all, "192.0.2.1", "http://192.0.2.1"));
    assert_true(is_ours(&all, "localhost", ""));
    assert_false(is_ours(&all, "robot.example", "http://robot.example"));
    assert_true(is_ours(&six, "[::1]:9", "http://[::1]:9"));
    assert_true(is_ours(&six, "[0:0::1]:9", ""));
    assert_false(is_ours(&six, "[::2]:9", ""));
    assert_false(is_ours(&six, "::1:9", ""));
}
