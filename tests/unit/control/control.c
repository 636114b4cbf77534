/* SPDX-License-Identifier: Apache-2.0 */
/* The control socket on a running simulator: what each request does and answers. */
#include "tests/tunables.h"
#include "tests/unit/control/control_bench.h"

#include "boards/foc/protocol.h"

static struct bench bench;

static void assert_refused(const char *request, const char *code, const char *words)
{
    json_t *answer = client_ask(&bench.client, request);

    assert_true(json_is_false(json_object_get(answer, "ok")));
    assert_string_equal(string_of(answer, "code"), code);
    if (!strstr(string_of(answer, "error"), words)) {
        fail_msg("%s: found \"%s\", expected \"%s\"", request, string_of(answer, "error"), words);
    }
    json_decref(answer);
}

static json_t *ask(const char *request)
{
    json_t *answer = client_ask(&bench.client, request);

    if (!is_ok(answer)) {
        fail_msg("%s: %s", request, string_of(answer, "error"));
    }
    return answer;
}

static void stop_and_close(void)
{
    bench_do(&bench, "{\"cmd\":\"stop\"}");
    bench_close(&bench);
    assert_int_equal(bench.end, LOOP_END_STOPPED);
}

TEST(hello_says_who_it_is)
{
    json_t *answer;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE});
    answer = ask("{\"cmd\":\"hello\",\"id\":\"first\"}");
    assert_string_equal(string_of(answer, "id"), "first");
    assert_string_equal(string_of(answer, "program"), "coman-hil");
    assert_string_equal(string_of(answer, "rig"), "coman");
    assert_int_equal(whole_of(answer, "protocol"), CONTROL_PROTOCOL);
    assert_int_equal(whole_of(answer, "pid"), getpid());
    json_decref(answer);
    stop_and_close();
}

static void assert_counts(const json_t *object, const char *const *names, int64_t expected)
{
    for (; *names; names++) {
        if (!json_is_integer(json_object_get(object, *names)) ||
            whole_of(object, *names) != expected) {
            fail_msg("%s is not %lld", *names, (long long)expected);
        }
    }
}

#define NAMES(...) ((const char *const[]){__VA_ARGS__, NULL})

/* a board that nobody plays is silent from the first tick on, and was never heard */
TEST(status_tells_of_external_boards)
{
    json_t *answer, *board;

    bench_open(&bench, &(struct bench_options){.rig = "coman-rest-bus", .clock = LOOP_CLOCK_FREE});
    answer = ask("{\"cmd\":\"status\"}");
    assert_int_equal(json_array_size(json_object_get(answer, "external")), 0);
    json_decref(answer);
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":5}");
    answer = ask("{\"cmd\":\"status\"}");
    assert_int_equal(json_array_size(json_object_get(answer, "external")), 3);
    board = json_array_get(json_object_get(answer, "external"), 2);
    assert_string_equal(string_of(board, "board"), "hip_yaw");
    assert_string_equal(string_of(board, "bus"), "left_hip");
    assert_true(json_is_true(json_object_get(board, "silent")));
    assert_true(json_is_null(json_object_get(board, "heard_s")));
    json_decref(answer);
    stop_and_close();
}

/* A board that has sent before the first tick is heard at its beginning, 0 s. */
TEST(status_tells_when_an_external_board_was_heard)
{
    const struct bus_frame feedback = {.id = 0x100 | 2 << 4 | FOC_FEEDBACK, .len = 8};
    json_t *answer, *external;
    size_t bus = 0;

    bench_open(&bench, &(struct bench_options){
                           .rig = "coman-rest-bus", .clock = LOOP_CLOCK_FREE, .guest = true});
    while (strcmp(bench.rig->bus[bus].name, "left_hip") != 0) {
        assert_true(++bus < bench.rig->nbus);
    }
    assert_int_equal(can_send(bench.ports.port[bus], &feedback, 1), 1);
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":5}");
    answer = ask("{\"cmd\":\"status\"}");
    external = json_object_get(answer, "external");
    assert_true(json_is_null(json_object_get(json_array_get(external, 0), "heard_s")));
    assert_string_equal(string_of(json_array_get(external, 1), "board"), "hip_lat");
    assert_true(json_is_real(json_object_get(json_array_get(external, 1), "heard_s")));
    assert_true(number_of(json_array_get(external, 1), "heard_s") == 0.0);
    assert_true(json_is_false(json_object_get(json_array_get(external, 1), "silent")));
    json_decref(answer);
    stop_and_close();
}

TEST(status_is_that_of_the_tick)
{
    json_t *answer;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE, .task = "squat"});
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":250}");
    answer = ask("{\"cmd\":\"status\",\"id\":3}");
    assert_int_equal(whole_of(answer, "id"), 3);
    assert_int_equal(whole_of(answer, "tick"), 250);
    assert_true(number_of(answer, "time_s") == 0.25);
    assert_true(json_is_true(json_object_get(answer, "paused")));
    assert_string_equal(string_of(answer, "clock"), "free");
    assert_string_equal(string_of(json_object_get(answer, "task"), "name"), "squat");
    assert_int_equal(json_array_size(json_object_get(answer, "buses")), bench.rig->nbus);
    assert_int_equal(json_object_size(json_object_get(answer, "joints")), bench.rig->robot->njoint);
    /* by then it stands: the feet carry the weight, 278 N and what still swings */
    assert_in_range((uint64_t)(number_of(json_object_get(answer, "contacts"), "LFoot") +
                               number_of(json_object_get(answer, "contacts"), "RFoot")),
                    200, 360);
    json_decref(answer);
    stop_and_close();
}

/* A run of its own, on which nobody but this client acts. */
TEST(status_says_what_is_simulated_and_that_nothing_is_lost)
{
    json_t *answer, *buses;
    char hash[20];

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE, .task = "squat"});
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":100}");
    json_decref(ask("{\"cmd\":\"status\"}"));
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":100}");
    answer = ask("{\"cmd\":\"status\"}");
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)bench.rig->robot->hash);
    assert_string_equal(string_of(answer, "rig"), "coman");
    assert_string_equal(string_of(answer, "file"), bench.rig->file);
    assert_string_equal(string_of(answer, "robot_hash"), hash);
    assert_true(json_is_null(json_object_get(answer, "recording")));
    assert_true(json_is_false(json_object_get(answer, "clamped")));
    assert_true(json_is_number(json_object_get(answer, "speed")));
    assert_true(number_of(answer, "tick_s") == 1e-3);
    assert_true(number_of(answer, "elapsed_s") > 0.0);
    assert_counts(answer, NAMES("overruns", "lost_ticks"), 0);
    assert_int_equal(json_array_size(json_object_get(answer, "faults")), 0);
    assert_string_equal(string_of(json_object_get(answer, "task"), "status"), "running");
    assert_true(json_is_string(json_object_get(json_object_get(answer, "task"), "message")));

    /* Each joint's angle by its name */
    for (size_t j = 0; j < bench.rig->robot->njoint; j++) {
        assert_true(json_is_number(
            json_object_get(json_object_get(answer, "joints"), bench.rig->robot->joint[j].name)));
    }

    /* Boards and task have both sent, and the bus had room: less than its bits in 0.1 s */
    buses = json_object_get(answer, "buses");
    for (size_t b = 0; b < bench.rig->nbus; b++) {
        const json_t *bus = json_array_get(buses, b);

        assert_string_equal(string_of(bus, "name"), bench.rig->bus[b].name);
        assert_string_equal(string_of(bus, "state"), "up");
        assert_true(whole_of(bus, "rx_frames") > 0 && whole_of(bus, "tx_frames") > 0);
        assert_counts(bus, NAMES("rx_dropped", "tx_dropped"), 0);
        assert_true(number_of(bus, "load") > 0.0 && number_of(bus, "load") < 1.0);
    }
    assert_counts(json_object_get(answer, "control"),
                  NAMES("refused_requests", "turned_away", "cut_junk", "cut_slow", "cut_silent",
                        "cut_idle", "rows", "missed_rows"),
                  0);
    assert_true(whole_of(json_object_get(answer, "control"), "clients") >= 1);
    assert_true(whole_of(json_object_get(answer, "control"), "requests") >= 4);
    json_decref(answer);
    stop_and_close();
}

TEST(statistics_count_every_tick)
{
    json_t *answer, *phases;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE});
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":400}");
    answer = ask("{\"cmd\":\"statistics\"}");
    phases = json_object_get(answer, "phases");
    assert_int_equal(json_object_size(phases), PHASE_COUNT);
    assert_int_equal(whole_of(json_object_get(phases, "plant"), "count"), 400);
    assert_int_equal(whole_of(json_object_get(phases, "publish"), "count"), 400);
    assert_true(number_of(json_object_get(phases, "plant"), "min_us") <=
                number_of(json_object_get(phases, "plant"), "median_us"));
    assert_true(number_of(json_object_get(phases, "plant"), "p99_us") <=
                number_of(json_object_get(phases, "plant"), "max_us"));
    assert_int_equal(whole_of(answer, "overruns"), 0);
    assert_counts(answer, NAMES("overruns", "late_ticks", "lost_ticks", "events_lost"), 0);
    assert_counts(answer, NAMES("tick"), 400);
    assert_true(number_of(answer, "time_s") == 0.4);
    assert_true(json_is_integer(json_object_get(answer, "pauses")));
    assert_true(json_is_integer(json_object_get(answer, "pause_ticks")));
    assert_counts(json_object_get(answer, "lockstep"),
                  NAMES("steps", "mismatches", "malformed", "silences"), 0);
    assert_int_equal(json_object_size(json_object_get(answer, "overruns_by")), PHASE_COUNT);
    assert_counts(json_object_get(answer, "overruns_by"), NAMES("plant", "publish"), 0);

    /* In order, with the mean between the ends; a tick's work is all of its phases */
    for (int i = 0; i < 2; i++) {
        const json_t *of = i ? json_object_get(answer, "work") : json_object_get(phases, "plant");

        assert_counts(of, NAMES("count"), 400);
        assert_true(number_of(of, "min_us") > 0.0);
        assert_true(number_of(of, "min_us") <= number_of(of, "median_us"));
        assert_true(number_of(of, "median_us") <= number_of(of, "p99_us"));
        assert_true(number_of(of, "p99_us") <= number_of(of, "max_us"));
        assert_true(number_of(of, "min_us") <= number_of(of, "mean_us"));
        assert_true(number_of(of, "mean_us") <= number_of(of, "max_us"));
    }
    assert_true(number_of(json_object_get(answer, "work"), "min_us") >=
                number_of(json_object_get(phases, "plant"), "min_us"));
    assert_true(json_is_integer(json_object_get(json_object_get(answer, "wakeup"), "count")));
    json_decref(answer);
    stop_and_close();
}

TEST(lists_have_patterns)
{
    json_t *answer, *list;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE});
    answer = ask("{\"cmd\":\"list\",\"what\":\"signals\",\"match\":\"q_?Knee*\"}");
    list = json_object_get(answer, "signals");
    assert_int_equal(json_array_size(list), 2);
    json_decref(answer);
    answer = ask("{\"cmd\":\"list\",\"what\":\"bodies\"}");
    assert_int_equal(json_array_size(json_object_get(answer, "bodies")), bench.rig->robot->nbody);
    json_decref(answer);
    answer = ask("{\"cmd\":\"list\",\"what\":\"tunables\"}");
    assert_int_equal(json_array_size(json_object_get(answer, "tunables")),
                     requests_tunables(simulator_requests(bench.simulator)));
    json_decref(answer);
    answer = ask("{\"cmd\":\"list\",\"what\":\"commands\"}");
    list = json_object_get(answer, "commands");
    assert_int_equal(json_array_size(list), 19);
    assert_string_equal(json_string_value(json_array_get(list, 0)), "hello");
    json_decref(answer);
    stop_and_close();
}

TEST(tunables_are_set_and_read_back)
{
    json_t *answer;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE});
    bench_do(&bench, "{\"cmd\":\"set\",\"name\":\"joint.LKneeSag.position_kp\",\"value\":123}");
    answer = ask("{\"cmd\":\"get\",\"name\":\"joint.LKneeSag.position_kp\"}");
    assert_true(number_of(answer, "value") == 123.0);
    json_decref(answer);
    assert_refused("{\"cmd\":\"set\",\"name\":\"joint.LKneeSag.position_kp\",\"value\":1.5}",
                   "input", "found 1.5, expected a whole number");
    assert_refused("{\"cmd\":\"set\",\"name\":\"supply_v\",\"value\":1e9}", "input",
                   "found 1000000000, expected");
    assert_refused("{\"cmd\":\"set\",\"name\":\"suply_v\",\"value\":1}", "input",
                   "the nearest is \"supply_v\"");
    assert_refused("{\"cmd\":\"get\",\"name\":\"joint.LKneSag.position_kp\"}", "input",
                   "the nearest is \"joint.LKneeSag.position_kp\"");
    stop_and_close();
}

TEST(faults_are_switched_and_seen)
{
    static const char *const lines[] = {"silent: board left_leg/1 off manual"};
    json_t *answer, *list;

    bench_open(&bench,
               &(struct bench_options){.clock = LOOP_CLOCK_FREE, .fault = lines, .nfault = 1});
    bench_do(&bench, "{\"cmd\":\"step\"}");
    bench_do(&bench, "{\"cmd\":\"fault\",\"name\":\"silent\",\"on\":true}");
    bench_do(&bench, "{\"cmd\":\"step\"}");
    answer = ask("{\"cmd\":\"status\"}");
    list = json_object_get(answer, "faults");
    assert_int_equal(json_array_size(list), 1);
    assert_string_equal(json_string_value(json_array_get(list, 0)), "silent");
    json_decref(answer);
    bench_do(&bench, "{\"cmd\":\"fault\",\"name\":\"silent\",\"on\":false}");
    bench_do(&bench, "{\"cmd\":\"step\"}");
    answer = ask("{\"cmd\":\"list\",\"what\":\"faults\"}");
    list = json_object_get(answer, "faults");
    assert_true(json_is_false(json_object_get(json_array_get(list, 0), "active")));
    assert_string_equal(string_of(json_array_get(list, 0), "line"), lines[0]);
    json_decref(answer);
    assert_refused("{\"cmd\":\"fault\",\"name\":\"silence\",\"on\":true}", "input",
                   "the nearest is \"silent\"");
    stop_and_close();
}

TEST(going_back_repeats_what_followed)
{
    uint64_t there, pushed;
    json_t *answer, *list;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE, .task = "squat"});
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":500}");
    assert_refused("{\"cmd\":\"restore\",\"slot\":2}", "empty", "no checkpoint");
    bench_do(&bench, "{\"cmd\":\"checkpoint\",\"slot\":2}");
    there = bench_do(&bench, "{\"cmd\":\"step\",\"count\":100}");
    bench_do(&bench, "{\"cmd\":\"restore\",\"slot\":2}");
    bench_do(&bench, "{\"cmd\":\"push\",\"body\":\"Waist\",\"force_n\":[30,0,0],"
                     "\"duration_s\":0.02}");
    pushed = bench_do(&bench, "{\"cmd\":\"step\",\"count\":100}");
    assert_true(pushed != there);
    bench_do(&bench, "{\"cmd\":\"restore\",\"slot\":2}");
    assert_true(bench_do(&bench, "{\"cmd\":\"step\",\"count\":100}") == there);
    answer = ask("{\"cmd\":\"list\",\"what\":\"checkpoints\"}");
    list = json_object_get(answer, "checkpoints");
    assert_int_equal(json_array_size(list), 2);
    assert_int_equal(whole_of(json_array_get(list, 1), "slot"), 2);
    assert_int_equal(whole_of(json_array_get(list, 1), "tick"), 500);
    json_decref(answer);
    bench_do(&bench, "{\"cmd\":\"reset\"}");
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":500}");
    assert_true(bench_do(&bench, "{\"cmd\":\"step\",\"count\":100}") == there);
    assert_refused("{\"cmd\":\"push\",\"body\":\"Wist\"}", "input", "the nearest is \"Waist\"");
    stop_and_close();
}

/* the answer to a step may come between rows, or after them */
static json_t *hear_row(void)
{
    json_t *line = client_hear(&bench.client);

    if (json_object_get(line, "id")) {
        json_decref(line);
        line = client_hear(&bench.client);
    }
    return line;
}

TEST(rows_come_at_every_multiple_of_the_period)
{
    json_t *answer, *row;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE, .task = "squat"});
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":3}");
    answer = ask("{\"cmd\":\"subscribe\",\"signals\":[\"q_LKneeSag_rad\",\"rx_*_frames\","
                 "\"q_?KneeSag_rad\"],\"period_ms\":5}");
    /* each once, in the order of the request */
    assert_int_equal(json_array_size(json_object_get(answer, "signals")), 2 + bench.rig->nbus);
    assert_string_equal(json_string_value(json_array_get(json_object_get(answer, "signals"), 0)),
                        "q_LKneeSag_rad");
    json_decref(answer);
    assert_true(client_say(&bench.client, "{\"cmd\":\"step\",\"count\":100,\"id\":9}\n"));
    for (int i = 1; i <= 20; i++) {
        row = hear_row();
        assert_int_equal(whole_of(row, "tick"), 5 * i);
        assert_true(fabs(number_of(row, "time_s") - 5e-3 * i) < 1e-12);
        assert_null(json_object_get(row, "missed"));
        assert_int_equal(json_array_size(json_object_get(row, "values")), 2 + bench.rig->nbus);
        json_decref(row);
    }
    answer = ask("{\"cmd\":\"unsubscribe\"}");
    if (whole_of(answer, "id") == 9) {
        json_decref(answer);
        answer = client_hear(&bench.client);
    }
    assert_int_equal(whole_of(answer, "rows"), 20);
    assert_int_equal(whole_of(answer, "missed"), 0);
    json_decref(answer);
    assert_refused("{\"cmd\":\"subscribe\",\"signals\":[\"q_LKneSag_rad\"]}", "input",
                   "the nearest is \"q_LKneeSag_rad\"");
    assert_refused("{\"cmd\":\"subscribe\",\"signals\":[\"*\"],\"period_ms\":1.5}", "input",
                   "found 1.5, expected a multiple of the tick, 1");
    stop_and_close();
}

TEST(waiting_ends_at_its_tick_and_answers_keep_their_order)
{
    struct bench_client *other = test_malloc(sizeof *other);
    json_t *answer;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE});
    client_open(other, bench.path);
    assert_true(client_say(other, "{\"cmd\":\"wait\",\"time_s\":0.05,\"id\":1}\n"
                                  "{\"cmd\":\"status\",\"id\":2}\n"
                                  "{\"cmd\":\"wait\",\"tick\":10,\"id\":3}\n"));
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":20}");
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":30}");
    for (int i = 1; i <= 3; i++) {
        answer = client_hear(other);
        assert_true(is_ok(answer));
        assert_int_equal(whole_of(answer, "id"), i);
        assert_int_equal(whole_of(answer, "tick"), 50);
        json_decref(answer);
    }
    client_close(other);
    test_free(other);
    stop_and_close();
}

TEST(a_pause_from_another_connection_cuts_a_step)
{
    struct bench_client *other = test_malloc(sizeof *other);
    json_t *answer;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE});
    client_open(other, bench.path);
    assert_true(client_say(other, "{\"cmd\":\"step\",\"count\":1000000000}\n"));
    bench_do(&bench, "{\"cmd\":\"wait\",\"tick\":100}");
    assert_refused("{\"cmd\":\"step\"}", "busy", "a step is under way");
    bench_do(&bench, "{\"cmd\":\"pause\"}");
    answer = client_hear(other);
    assert_string_equal(string_of(answer, "code"), "cut");
    assert_true(whole_of(answer, "tick") >= 100);
    json_decref(answer);
    client_close(other);
    test_free(other);
    stop_and_close();
}

TEST(what_still_waits_at_the_end_is_told)
{
    struct bench_client *other = test_malloc(sizeof *other);
    json_t *answer;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE});
    client_open(other, bench.path);
    assert_true(client_say(other, "{\"cmd\":\"hello\"}\n{\"cmd\":\"wait\",\"tick\":1000000}\n"));
    answer = client_hear(other);
    json_decref(answer);
    /* a turn of the server later the wait has begun, or its line is read at the end */
    stop_and_close();
    answer = client_hear(other);
    if (answer) {
        assert_string_equal(string_of(answer, "code"), "ended");
        json_decref(answer);
    }
    assert_null(client_hear(other));
    client_close(other);
    test_free(other);
}
