/* SPDX-License-Identifier: Apache-2.0 */
/* Messages of the page's clients: which are understood, and what may be asked without the right to
 * control. */
#include "viewer/message.h"
#include "tests/test.h"

static struct viewer_message message;
static struct error error;

static enum error_code parse(const char *text)
{
    viewer_message_clear(&message);
    return viewer_message_parse(text, strlen(text), &message, &error);
}

FIXTURE(clear)
{
    viewer_message_clear(&message);
    return 0;
}

TEST_WITH(a_watch_has_a_rate_and_signals, NULL, clear)
{
    assert_int_equal(parse("{\"id\":3,\"cmd\":\"watch\",\"rate_hz\":30,\"trace\":true,"
                           "\"signals\":[\"q_*\"]}"),
                     0);
    assert_int_equal(message.command, VIEWER_WATCH);
    assert_true(message.rate_hz == 30 && message.trace);
    assert_int_equal(json_array_size(message.signals), 1);
    assert_int_equal(json_integer_value(message.id), 3);
    assert_int_equal(parse("{\"cmd\":\"watch\",\"rate_hz\":0}"), 0);
    assert_int_equal(parse("{\"cmd\":\"watch\"}"), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"watch\",\"rate_hz\":61}"), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"watch\",\"rate_hz\":1,\"signals\":[1]}"), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"watch\",\"rate_hz\":1,\"signals\":{}}"), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"watch\",\"rate_hz\":1,\"trace\":1}"), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"watch\",\"rate_hz\":1,\"treace\":true}"), ERROR_INPUT);
}

TEST_WITH(a_frame_is_one_that_a_bus_can_carry, NULL, clear)
{
    assert_int_equal(parse("{\"cmd\":\"send\",\"bus\":\"torso\",\"frame_id\":257,"
                           "\"data\":\"0a FF 00\"}"),
                     0);
    assert_int_equal(message.frame.id, 257);
    assert_int_equal(message.frame.len, 3);
    assert_int_equal(message.frame.data[1], 0xff);
    assert_int_equal(parse("{\"cmd\":\"send\",\"bus\":\"a\",\"frame_id\":4096,\"extended\":true,"
                           "\"data\":\"\"}"),
                     0);
    assert_int_equal(message.frame.flags, FRAME_EXTENDED);
    assert_int_equal(parse("{\"cmd\":\"send\",\"bus\":\"a\",\"frame_id\":1,\"fd\":true,"
                           "\"data\":\"010203040506070809\"}"),
                     0);
    assert_int_equal(message.frame.len, 12);
    assert_int_equal(parse("{\"cmd\":\"send\",\"bus\":\"a\",\"frame_id\":4096,\"data\":\"\"}"),
                     ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"send\",\"bus\":\"a\",\"frame_id\":1.5,\"data\":\"\"}"),
                     ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"send\",\"bus\":\"a\",\"frame_id\":1,\"data\":\"0\"}"),
                     ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"send\",\"bus\":\"a\",\"frame_id\":1,\"data\":\"0 1\"}"),
                     ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"send\",\"bus\":\"a\",\"frame_id\":1,"
                           "\"data\":\"000102030405060708\"}"),
                     ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"send\",\"frame_id\":1,\"data\":\"\"}"), ERROR_INPUT);
}

TEST_WITH(only_questions_are_harmless, NULL, clear)
{
    static const char *const harmless[] = {
        "{\"cmd\":\"status\"}", "{\"cmd\":\"hello\"}", "{\"cmd\":\"statistics\"}",
        "{\"cmd\":\"list\",\"what\":\"faults\"}", "{\"cmd\":\"get\",\"name\":\"supply_v\"}"};
    static const char *const others[] = {
        "{\"cmd\":\"pause\"}",
        "{\"cmd\":\"stop\"}",
        "{\"cmd\":\"push\",\"body\":\"Waist\"}",
        "{\"cmd\":\"fault\",\"name\":\"a\",\"on\":true}",
        "{\"cmd\":\"set\",\"name\":\"supply_v\",\"value\":1}",
        "{\"cmd\":\"subscribe\",\"signals\":[\"q_*\"]}",
        "{\"cmd\":\"reset\"}",
        "{\"cmd\":\"wait\",\"tick\":1}",
    };

    for (size_t i = 0; i < sizeof harmless / sizeof harmless[0]; i++) {
        assert_int_equal(parse(harmless[i]), 0);
        assert_int_equal(message.command, VIEWER_CONTROL);
        assert_true(message.harmless);
    }
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        assert_int_equal(parse(others[i]), 0);
        assert_int_equal(message.command, VIEWER_CONTROL);
        assert_false(message.harmless);
    }
}

TEST_WITH(a_message_is_one_line_and_one_request, NULL, clear)
{
    /* A second line would be a second request at the control socket */
    assert_int_equal(parse("{\"cmd\":\"status\"}\n{\"cmd\":\"stop\"}"), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\r\"status\"}"), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"status\",\"cmd\":\"stop\"}"), ERROR_INPUT);
    assert_int_equal(parse("[]"), ERROR_INPUT);
    assert_int_equal(parse(""), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"enter\"}"), ERROR_INPUT);
    assert_int_equal(parse("{\"cmd\":\"enter\",\"token\":\"x\"}"), 0);
    assert_int_equal(message.command, VIEWER_ENTER);
}
