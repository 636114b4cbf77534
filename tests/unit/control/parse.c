/* SPDX-License-Identifier: Apache-2.0 */
/* Requests of the control socket from text: what each command takes, how what is wrong is told. */
#include "control/parse.h"
#include "tests/test.h"

static struct control_request request;
static struct error error;

static enum error_code parse(const char *text)
{
    control_request_clear(&request);
    memset(&error, 0, sizeof error);
    return control_parse(text, strlen(text), 12, &request, &error);
}

static void assert_refused(const char *text, const char *words)
{
    assert_int_equal(parse(text), ERROR_INPUT);
    if (!strstr(error.text, words)) {
        fail_msg("%s: found \"%s\", expected \"%s\"", text, error.text, words);
    }
}

FIXTURE(clear)
{
    control_request_clear(&request);
    return 0;
}

TEST(reads_every_key)
{
    assert_int_equal(parse("{\"id\":7,\"cmd\":\"set\",\"name\":\"supply_v\",\"value\":40.5}"), 0);
    assert_int_equal(request.command, CONTROL_SET);
    assert_string_equal(request.name, "supply_v");
    assert_true(request.value == 40.5);
    assert_int_equal(json_integer_value(request.id), 7);

    assert_int_equal(parse("{\"cmd\":\"push\",\"body\":\"Waist\",\"force_n\":[1,-2,0.5],"
                           "\"duration_s\":0.25}"),
                     0);
    assert_string_equal(request.name, "Waist");
    assert_true(request.force_n[0] == 1 && request.force_n[1] == -2 && request.force_n[2] == 0.5);
    assert_true(request.moment_nm[0] == 0 && request.time_s == 0.25);
    assert_null(request.id);

    assert_int_equal(parse("{\"cmd\":\"list\",\"what\":\"faults\",\"match\":\"l*\"}"), 0);
    assert_int_equal(request.list, CONTROL_LIST_FAULTS);
    assert_string_equal(request.match, "l*");

    assert_int_equal(parse("{\"cmd\":\"fault\",\"name\":\"lossy\",\"on\":false}"), 0);
    assert_false(request.on);
    assert_int_equal(parse(" {\"cmd\":\"wait\",\"time_s\":2}\r"), 0);
    assert_true(request.wait_time && request.time_s == 2.0);
}

TEST(what_is_optional_has_a_default)
{
    assert_int_equal(parse("{\"cmd\":\"step\"}"), 0);
    assert_int_equal(request.count, 1);
    assert_int_equal(parse("{\"cmd\":\"checkpoint\"}"), 0);
    assert_int_equal(request.count, 1);
    assert_int_equal(parse("{\"cmd\":\"subscribe\",\"signals\":[\"*\"]}"), 0);
    assert_true(request.period_ms == 10.0);
    assert_int_equal(json_array_size(request.signals), 1);
}

TEST(syntax_errors_have_line_column_and_byte)
{
    assert_refused("{\"cmd\": status}", "line 12, column 14 (byte 14): found invalid token near "
                                        "'status'");
    assert_refused("", "line 12, column 0 (byte 0): found '[' or '{' expected near end of file");
    assert_refused("{\"cmd\":\"stop\"", "expected near end of file");
    assert_refused("{\"cmd\":\"stop\"} x", "end of file expected near 'x'");
    assert_refused("{\"cmd\":\"\xff\xfe\"}", "unable to decode byte 0xff");
    assert_refused("{\"cmd\":\"a\\u0000b\"}", "\\u0000 is not allowed");
    assert_refused("{\"cmd\":\"status\",\"cmd\":\"stop\"}", "duplicate object key near '\"cmd\"'");
    assert_refused("{\"id\":1e999}", "real number overflow");
    assert_refused("{\"id\":99999999999999999999}", "too big integer");
    assert_refused("[1]", "line 12: found an array, expected a JSON object");
}

TEST(nesting_beyond_all_bounds_is_refused)
{
    static char deep[60000];

    memset(deep, '[', sizeof deep - 1);
    assert_refused(deep, "maximum parsing depth reached");
}

TEST(rejects_unknown_words_and_names_the_nearest)
{
    assert_refused("{\"cmd\":\"stauts\"}", "found unknown command \"stauts\", expected \"status\"");
    assert_refused("{\"cmd\":\"fly\"}", "expected one that list commands has");
    assert_refused("{\"cmd\":\"push\",\"body\":\"a\",\"force\":[0,0,0]}",
                   "push: found unknown key \"force\", expected one of id, cmd, body, force_n, "
                   "moment_nm, duration_s; the nearest is force_n");
    assert_refused("{\"cmd\":\"status\",\"now\":true}", "expected one of id, cmd");
    assert_refused("{\"cmd\":\"list\",\"what\":\"fault\"}", "the nearest is faults");
    assert_refused("{\"command\":\"status\"}", "key \"cmd\": found none");
    assert_refused("{\"cmd\":\"set\",\"name\":\"a\"}", "set: found no key \"value\", expected one");
}

TEST(rejects_wrong_types_and_values_out_of_range)
{
    assert_refused("{\"cmd\":5}", "key \"cmd\": found a number, expected a string");
    assert_refused("{\"cmd\":\"status\",\"id\":{}}", "key \"id\": found an object");
    assert_refused("{\"cmd\":\"set\",\"name\":\"a\",\"value\":\"40\"}",
                   "set: key \"value\": found \"40\", expected a number");
    assert_refused("{\"cmd\":\"set\",\"name\":\"a\",\"value\":null}",
                   "set: key \"value\": found null, expected a number");
    assert_refused("{\"cmd\":\"set\",\"value\":\"40\"}",
                   "set: key \"value\": found \"40\", expected a number");
    assert_refused("{\"cmd\":\"fault\",\"name\":\"a\",\"on\":1}",
                   "found a number, expected true or "
                   "false");
    assert_refused("{\"cmd\":\"step\",\"count\":0}", "found 0, expected a whole number from 1 to");
    assert_refused("{\"cmd\":\"step\",\"count\":2.5}", "found 2.5, expected a whole number");
    assert_refused("{\"cmd\":\"checkpoint\",\"slot\":4}", "expected a whole number from 1 to 3");
    assert_refused("{\"cmd\":\"checkpoint\",\"slot\":0}", "expected a whole number from 1 to 3");
    assert_int_equal(parse("{\"cmd\":\"restore\",\"slot\":0}"), 0);
    assert_refused("{\"cmd\":\"speed\",\"factor\":1e-9}", "expected 0 or 0.001 to 1000");
    assert_refused("{\"cmd\":\"speed\",\"factor\":1001}", "expected 0 to 1000");
    assert_refused("{\"cmd\":\"push\",\"body\":\"a\",\"force_n\":[1,2]}",
                   "found an array of 2, expected an array of 3 to 3 numbers");
    assert_refused("{\"cmd\":\"push\",\"body\":\"a\",\"force_n\":[1,2,\"3\"]}", "found \"3\"");
    assert_refused("{\"cmd\":\"push\",\"body\":\"a\",\"force_n\":[1,2,1e7]}",
                   "expected -1000000 to "
                   "1000000");
    assert_refused("{\"cmd\":\"subscribe\",\"signals\":[]}",
                   "expected an array of 1 to 1024 names");
    assert_refused("{\"cmd\":\"subscribe\",\"signals\":[\"a\",null]}", "found null");
    assert_refused("{\"cmd\":\"wait\"}", "wait: found neither");
    assert_refused("{\"cmd\":\"wait\",\"tick\":1,\"time_s\":1}", "wait: found both");
}

TEST(an_id_is_kept_with_a_refusal)
{
    char text[600];

    assert_refused("{\"id\":\"a7\",\"cmd\":\"nothing\"}", "found unknown command");
    assert_string_equal(json_string_value(request.id), "a7");
    snprintf(text, sizeof text, "{\"cmd\":\"status\",\"id\":\"%0300d\"}", 0);
    assert_refused(text, "found a string of 300 bytes, expected at most 256");
    assert_null(request.id);
}

/* what a stranger writes must not make lines of its own in a log */
TEST(messages_are_one_printable_line)
{
    assert_refused("{\"cmd\":\"a\\n<3>all is well\\u001b[2J\"}", "a?<3>all is well?[2J");
}

TEST(patterns_have_stars_and_question_marks)
{
    static const struct {
        const char *pattern, *name;
        bool matches;
    } cases[] = {
        {"q_LKneeSag_rad", "q_LKneeSag_rad", true},
        {"q_LKneeSag_rad", "q_LKneeSag_ra", false},
        {"q_*_rad", "q_LKneeSag_rad", true},
        {"q_*_rad", "qm_LKneeSag_rad", false},
        {"*", "", true},
        {"", "a", false},
        {"?", "", false},
        {"?Knee*", "LKneeSag", true},
        {"*a*b", "xaxbxb", true},
        {"*a*b", "xaxbx", false},
        {"**", "abc", true},
        {"a*", "a", true},
        {"[a]", "a", false},
    };

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(control_matches(cases[i].pattern, cases[i].name), cases[i].matches);
    }
}

/* many stars against a name that almost matches: a naive matcher would take 10^30 steps */
TEST(hostile_patterns_take_no_time)
{
    char pattern[128] = "", name[4096];

    for (int i = 0; i < 30; i++) {
        strcat(pattern, "*a");
    }
    strcat(pattern, "*b");
    memset(name, 'a', sizeof name - 1);
    name[sizeof name - 1] = '\0';
    assert_false(control_matches(pattern, name));
}

TEST(texts_that_are_no_utf8_are_mended)
{
    json_t *text = control_text("caf\xc3");

    assert_string_equal(json_string_value(text), "caf?");
    json_decref(text);
    text = control_text("caf\xc3\xa9");
    assert_string_equal(json_string_value(text), "caf\xc3\xa9");
    json_decref(text);
}

TEST_GROUP(NULL, clear)
