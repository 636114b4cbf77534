/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Clients of the control socket that are slow, wrong or mean. Each is told what was wrong and cut
 * off when it goes on; none has any influence on the run, nor on the others.
 */
#include "tests/unit/control/control_bench.h"

#include <fcntl.h>

static struct bench bench;
static struct bench_client hostile;

enum { STORM_TICKS = 1000, STORM_STEP = 50 };

static uint32_t random_below(uint64_t *state, uint32_t limit)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(*state >> 33) % limit;
}

static void open_bench(int64_t patience_ns)
{
    bench_open(&bench,
               &(struct bench_options){.clock = LOOP_CLOCK_FREE, .patience_ns = patience_ns});
    client_open(&hostile, bench.path);
    assert_true(hostile.socket >= 0);
}

/* whatever happened, the good client is served, and the loop runs its ticks */
static void close_bench(void)
{
    json_t *answer;

    client_close(&hostile);
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":10}");
    answer = client_ask(&bench.client, "{\"cmd\":\"status\"}");
    assert_int_equal(whole_of(answer, "tick"), 10);
    json_decref(answer);
    bench_do(&bench, "{\"cmd\":\"stop\"}");
    bench_close(&bench);
}

static void assert_told(const char *code, const char *words)
{
    json_t *answer = client_hear(&hostile);

    assert_true(json_is_false(json_object_get(answer, "ok")));
    assert_string_equal(string_of(answer, "code"), code);
    if (!strstr(string_of(answer, "error"), words)) {
        fail_msg("found \"%s\", expected \"%s\"", string_of(answer, "error"), words);
    }
    json_decref(answer);
}

static void assert_logged(const char *words)
{
    char text[256];
    bool found = false;
    uint64_t key;

    for (int i = 0; i < 2000 && !found; i++) {
        while (control_next_event(bench.control, &key, text, sizeof text)) {
            found = found || strstr(text, words);
        }
        usleep(1000);
    }
    assert_true(found);
}

TEST(a_wrong_line_is_told_and_the_next_is_served)
{
    json_t *answer;

    open_bench(0);
    assert_true(
        client_say(&hostile, "{\"cmd\":\"hello\"}\n\n{\"cmd\": helo}\n{\"cmd\":\"hello\"}\n"));
    answer = client_hear(&hostile);
    assert_true(is_ok(answer));
    json_decref(answer);
    assert_told("input", "line 3, column 12 (byte 12): found invalid token near 'helo'");
    answer = client_hear(&hostile);
    assert_true(is_ok(answer));
    json_decref(answer);
    close_bench();
    assert_int_equal(bench.counters.refused_requests, 1);
    assert_int_equal(bench.counters.cut_junk, 0);
}

TEST(garbage_is_cut_off)
{
    unsigned char junk[8192];
    uint64_t random = 1;
    int lines = 0;
    json_t *answer;

    open_bench(0);
    for (size_t i = 0; i < sizeof junk; i++) {
        junk[i] = i % 100 == 99 ? '\n' : (unsigned char)random_below(&random, 256);
    }
    client_send(&hostile, junk, sizeof junk);
    while ((answer = client_hear(&hostile))) {
        assert_true(json_is_false(json_object_get(answer, "ok")));
        json_decref(answer);
        lines++;
    }
    assert_int_equal(lines, CONTROL_JUNK_MAX);
    assert_true(client_is_cut(&hostile));
    assert_logged("is disconnected: line ");
    close_bench();
    assert_int_equal(bench.counters.cut_junk, 1);
}

TEST(an_endless_line_is_cut_off)
{
    static char flood[CONTROL_LINE];

    open_bench(0);
    memset(flood, 'x', sizeof flood);
    for (int i = 0; i < CONTROL_JUNK_MAX && client_send(&hostile, flood, sizeof flood); i++) {
        assert_told("input", "line 1: found more than 65535 bytes");
    }
    assert_true(client_is_cut(&hostile));
    close_bench();
    assert_int_equal(bench.counters.cut_junk, 1);
}

TEST(a_line_that_is_too_long_is_passed_over)
{
    static char flood[CONTROL_LINE + 5000];
    json_t *answer;

    open_bench(0);
    memset(flood, 'x', sizeof flood);
    flood[sizeof flood - 1] = '\n';
    assert_true(client_send(&hostile, flood, sizeof flood));
    assert_true(client_say(&hostile, "{\"cmd\":\"hello\"}\n{nonsense}\n"));
    assert_told("input", "line 1: found more than 65535 bytes");
    answer = client_hear(&hostile);
    assert_true(is_ok(answer));
    json_decref(answer);
    assert_told("input", "line 3, column 9 (byte 9)");
    close_bench();
}

TEST(deep_nesting_is_refused)
{
    static char deep[CONTROL_LINE - 1];
    json_t *answer;

    open_bench(0);
    memset(deep, '[', sizeof deep);
    deep[sizeof deep - 1] = '\n';
    assert_true(client_send(&hostile, deep, sizeof deep));
    assert_told("input", "maximum parsing depth reached");
    answer = client_ask(&hostile, "{\"cmd\":\"hello\"}");
    assert_true(is_ok(answer));
    json_decref(answer);
    close_bench();
}

TEST(single_bytes_make_a_request)
{
    const char text[] = "{\"id\":\"slow\",\"cmd\":\"hello\"}\n";
    json_t *answer;

    open_bench(0);
    for (size_t i = 0; i < sizeof text - 1; i++) {
        assert_true(client_send(&hostile, text + i, 1));
        usleep(200);
    }
    answer = client_hear(&hostile);
    assert_true(is_ok(answer));
    assert_string_equal(string_of(answer, "id"), "slow");
    json_decref(answer);
    close_bench();
}

TEST(half_a_line_and_silence_is_cut_off)
{
    open_bench(BENCH_QUICK);
    assert_true(client_say(&hostile, "{\"cmd\":\"hel"));
    assert_told("input", "found half a line and then nothing");
    assert_true(client_is_cut(&hostile));
    assert_logged("it stopped in the middle of a line");
    close_bench();
    assert_int_equal(bench.counters.cut_silent, 1);
}

TEST(silence_alone_is_allowed)
{
    json_t *answer;

    open_bench(CLOCK_MS);
    usleep(50000);
    answer = client_ask(&hostile, "{\"cmd\":\"hello\"}");
    assert_true(is_ok(answer));
    json_decref(answer);
    close_bench();
    assert_int_equal(bench.counters.cut_silent + bench.counters.cut_slow, 0);
}

/* asks and asks, and never reads: its requests stay in its own queue until it is cut off */
TEST(a_flood_that_is_not_read_is_cut_off)
{
    const char text[] = "{\"cmd\":\"list\",\"what\":\"signals\"}\n";
    bool refused = false;

    open_bench(BENCH_QUICK);
    assert_int_equal(fcntl(hostile.socket, F_SETFL, O_NONBLOCK), 0);
    for (int i = 0; i < 100000 && !refused; i++) {
        ssize_t sent = send(hostile.socket, text, sizeof text - 1, MSG_NOSIGNAL);

        refused = sent < 0 && errno == EPIPE;
        if (sent < 0 && errno == EAGAIN) {
            usleep(1000);
        }
    }
    assert_true(refused);
    assert_logged("it does not drain its answers");
    close_bench();
    assert_int_equal(bench.counters.cut_slow, 1);
}

TEST(a_flood_that_is_read_is_served_whole)
{
    enum { REQUESTS = 3000 };
    json_t *answer;

    open_bench(0);
    for (int i = 0; i < REQUESTS; i += 100) {
        for (int k = i; k < i + 100; k++) {
            char text[64];

            snprintf(text, sizeof text, "{\"id\":%d,\"cmd\":\"hello\"}\n", k);
            assert_true(client_say(&hostile, text));
        }
        for (int k = i; k < i + 100; k++) {
            answer = client_hear(&hostile);
            assert_true(is_ok(answer));
            assert_int_equal(whole_of(answer, "id"), k);
            json_decref(answer);
        }
    }
    close_bench();
}

/* rows are left out and counted, the loop waits for nobody */
TEST(rows_that_are_not_taken_are_counted)
{
    enum { TICKS = 3000 };
    int64_t rows = 0, missed = 0, last = 0;
    json_t *line;

    open_bench(0);
    line = client_ask(&hostile, "{\"cmd\":\"subscribe\",\"signals\":[\"*\"],\"period_ms\":1}");
    assert_true(is_ok(line));
    json_decref(line);
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":3000}");
    /* now it reads: the next row after a gap says how long the gap was */
    assert_true(client_say(&hostile, "{\"cmd\":\"hello\",\"id\":1}\n"));
    while (!(line = client_hear(&hostile)) || json_object_get(line, "values")) {
        assert_non_null(line);
        missed += whole_of(line, "missed");
        rows++;
        assert_int_equal(whole_of(line, "tick"), rows + missed);
        last = whole_of(line, "tick");
        json_decref(line);
    }
    json_decref(line);
    bench_do(&bench, "{\"cmd\":\"step\",\"count\":1}");
    line = client_hear(&hostile);
    missed += whole_of(line, "missed");
    rows++;
    assert_true(last < TICKS);
    assert_int_equal(whole_of(line, "tick"), TICKS + 1);
    assert_int_equal(rows + missed, TICKS + 1);
    json_decref(line);
    line = client_ask(&hostile, "{\"cmd\":\"unsubscribe\"}");
    assert_int_equal(whole_of(line, "rows"), rows);
    assert_int_equal(whole_of(line, "missed"), missed);
    json_decref(line);
    client_close(&hostile);
    bench_do(&bench, "{\"cmd\":\"stop\"}");
    bench_close(&bench);
    assert_true(bench.counters.missed_rows > 0);
}

static struct bench_client many[CONTROL_CLIENTS + 2];

/* Opens clients; each sends a line, unless NULL, and hears its answer. */
static void open_many(int count, const char *line)
{
    for (int i = 0; i < count; i++) {
        client_open(&many[i], bench.path);
        if (line) {
            json_t *answer = client_ask(&many[i], line);

            assert_true(is_ok(answer));
            json_decref(answer);
        }
    }
}

/* Clients that say nothing, or have had their answers, lock nobody out. The first to be silent is
 * disconnected, and hears why. */
TEST(idle_clients_make_room_for_new_ones)
{
    static const char *const lines[] = {NULL, "{\"cmd\":\"hello\"}", "{\"cmd\":\"status\"}"};
    json_t *answer;

    for (size_t k = 0; k < sizeof lines / sizeof *lines; k++) {
        open_bench(0);
        client_close(&hostile);
        open_many(CONTROL_CLIENTS, lines[k]);
        client_open(&hostile, bench.path);
        answer = client_ask(&hostile, "{\"cmd\":\"status\"}");
        assert_true(is_ok(answer));
        json_decref(answer);
        answer = client_ask(&many[CONTROL_CLIENTS - 1], "{\"cmd\":\"hello\"}");
        assert_true(is_ok(answer));
        json_decref(answer);
        for (int i = 0; i < CONTROL_CLIENTS; i++) {
            client_close(&many[i]);
        }
        client_close(&bench.client);
        answer = client_ask(&hostile, "{\"cmd\":\"stop\"}");
        assert_true(is_ok(answer));
        json_decref(answer);
        client_close(&hostile);
        bench_close(&bench);
        assert_true(bench.counters.cut_idle >= 1);
        assert_int_equal(bench.counters.refused, 0);
    }
}

/* When every client is busy, one more may pause, resume and stop, and nothing else. */
TEST(busy_clients_leave_a_place_for_what_is_urgent)
{
    struct bench_client *late = &many[CONTROL_CLIENTS];
    json_t *answer;

    open_bench(0);
    client_close(&hostile);
    client_close(&bench.client);
    open_many(CONTROL_CLIENTS, "{\"cmd\":\"subscribe\",\"signals\":[\"q_*\"]}");
    client_open(late, bench.path);
    answer = client_ask(late, "{\"cmd\":\"status\",\"id\":7}");
    assert_string_equal(string_of(answer, "code"), "busy");
    assert_int_equal(whole_of(answer, "id"), 7);
    json_decref(answer);
    answer = client_ask(late, "{\"cmd\":\"resume\"}");
    assert_true(is_ok(answer));
    json_decref(answer);
    answer = client_ask(late, "{\"cmd\":\"pause\"}");
    assert_true(is_ok(answer));
    json_decref(answer);

    /* The next one takes that place, and stops the run */
    client_open(&many[CONTROL_CLIENTS + 1], bench.path);
    answer = client_ask(&many[CONTROL_CLIENTS + 1], "{\"cmd\":\"stop\"}");
    assert_true(is_ok(answer));
    json_decref(answer);
    answer = client_hear(late);
    assert_string_equal(string_of(answer, "code"), "busy");
    json_decref(answer);
    for (int i = 0; i < CONTROL_CLIENTS + 2; i++) {
        client_close(&many[i]);
    }
    bench_close(&bench);
}

TEST(half_closed_connections_get_their_answers)
{
    json_t *answer;

    open_bench(0);
    /* the last line needs no end */
    assert_true(client_say(&hostile, "{\"cmd\":\"hello\",\"id\":1}\n{\"cmd\":\"hello\",\"id\":2}"));
    assert_int_equal(shutdown(hostile.socket, SHUT_WR), 0);
    for (int i = 1; i <= 2; i++) {
        answer = client_hear(&hostile);
        assert_int_equal(whole_of(answer, "id"), i);
        assert_true(is_ok(answer));
        json_decref(answer);
    }
    assert_true(client_is_cut(&hostile));
    close_bench();
}

TEST(those_who_leave_in_the_middle_are_forgotten)
{
    static const char *const parting[] = {
        "{\"cmd\":\"sta",
        "{\"cmd\":\"wait\",\"tick\":1000000000}\n",
        "{\"cmd\":\"subscribe\",\"signals\":[\"*\"],\"period_ms\":1}\n",
        "{\"cmd\":\"list\",\"what\":\"tunables\"}\n{\"cmd\":\"list\",\"what\":\"tunables\"}\n",
    };

    open_bench(0);
    for (int i = 0; i < 100; i++) {
        client_close(&hostile);
        client_open(&hostile, bench.path);
        client_say(&hostile, parting[i % 4]);
    }
    close_bench();
}

/* ---- everybody at once ---- */

struct attacker {
    const char *path;
    atomic_bool *stop;
    int number;
    pthread_t thread;
    struct bench_client client;
};

static void attack_with_garbage(struct attacker *a, uint64_t *random)
{
    unsigned char junk[512];

    for (size_t i = 0; i < sizeof junk; i++) {
        junk[i] = (unsigned char)(random_below(random, 20) ? random_below(random, 256) : '\n');
    }
    while (!atomic_load(a->stop) && client_send(&a->client, junk, sizeof junk)) {
    }
}

static void attack_with_questions(struct attacker *a, uint64_t *random)
{
    static const char *const questions[] = {
        "{\"cmd\":\"status\"}",
        "{\"cmd\":\"statistics\"}",
        "{\"cmd\":\"list\",\"what\":\"tunables\"}",
        "{\"cmd\":\"list\",\"what\":\"faults\"}",
        "{\"cmd\":\"get\",\"name\":\"supply_v\"}",
        "{\"cmd\":\"subscribe\",\"signals\":[\"q_*\",\"fz_*\"],\"period_ms\":1}",
        "{\"cmd\":\"unsubscribe\"}",
        "{\"cmd\":\"wait\",\"tick\":1}",
        "{\"cmd\":\"set\",\"name\":\"nothing\",\"value\":1}",
    };

    for (int i = 0; i < 200 && !atomic_load(a->stop); i++) {
        json_t *answer = client_ask(&a->client, questions[random_below(random, 9)]);

        if (!answer) {
            return;
        }
        json_decref(answer);
    }
}

static void attack_by_not_reading(struct attacker *a, uint64_t *random)
{
    (void)random;
    client_say(&a->client, "{\"cmd\":\"subscribe\",\"signals\":[\"*\"],\"period_ms\":1}\n");
    for (int i = 0; i < 100 && !atomic_load(a->stop); i++) {
        client_say(&a->client, "{\"cmd\":\"status\"}\n");
        usleep(1000);
    }
}

static void attack_by_leaving(struct attacker *a, uint64_t *random)
{
    client_say(&a->client, random_below(random, 2) ? "{\"cmd\":\"wait\",\"tick\":99999999}\n"
                                                   : "{\"cmd\":\"stat");
}

static void *attack(void *context)
{
    static void (*const ways[])(struct attacker * a, uint64_t * random) = {
        attack_with_garbage, attack_with_questions, attack_by_not_reading, attack_by_leaving};
    struct attacker *a = context;
    uint64_t random = (uint64_t)a->number;

    while (!atomic_load(a->stop)) {
        client_open(&a->client, a->path);
        if (a->client.socket >= 0) {
            ways[a->number % 4](a, &random);
            client_close(&a->client);
        }
    }
    return NULL;
}

static uint64_t quiet_hash(enum loop_clock clock)
{
    bench_open(&bench,
               &(struct bench_options){
                   .clock = clock, .task = "squat", .ticks = STORM_TICKS, .without_socket = true});
    bench_close(&bench);
    assert_int_equal(bench.ticks, STORM_TICKS);
    return bench.hash;
}

TEST(a_storm_of_clients_changes_nothing)
{
    enum { ATTACKERS = 12 };
    static struct attacker attacker[ATTACKERS];
    uint64_t expected = quiet_hash(LOOP_CLOCK_FREE);
    atomic_bool stop = false;

    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE,
                                               .task = "squat",
                                               .ticks = STORM_TICKS,
                                               .patience_ns = BENCH_QUICK});
    for (int i = 0; i < ATTACKERS; i++) {
        attacker[i].path = bench.path;
        attacker[i].stop = &stop;
        attacker[i].number = i;
        assert_int_equal(pthread_create(&attacker[i].thread, NULL, attack, &attacker[i]), 0);
    }
    /* the last step would never be answered: the run ends with it */
    for (int i = 0; i < STORM_TICKS / STORM_STEP - 1; i++) {
        char text[64];

        snprintf(text, sizeof text, "{\"cmd\":\"step\",\"count\":%d}", STORM_STEP);
        bench_do(&bench, text);
    }
    atomic_store(&stop, true);
    for (int i = 0; i < ATTACKERS; i++) {
        pthread_join(attacker[i].thread, NULL);
    }
    bench_do(&bench, "{\"cmd\":\"resume\"}");
    bench_close(&bench);
    assert_int_equal(bench.ticks, STORM_TICKS);
    assert_true(bench.hash == expected);
    assert_true(bench.counters.requests > 100);
    assert_true(bench.counters.refused_requests > 10);
    assert_true(bench.counters.cut_junk > 0);
    print_message(
        "# %llu clients, %llu requests, %llu refused, %llu cut off, %llu rows, %llu "
        "missed\n",
        (unsigned long long)bench.counters.clients, (unsigned long long)bench.counters.requests,
        (unsigned long long)bench.counters.refused_requests,
        (unsigned long long)(bench.counters.cut_junk + bench.counters.cut_slow +
                             bench.counters.cut_silent),
        (unsigned long long)bench.counters.rows, (unsigned long long)bench.counters.missed_rows);
}

/* without a pause: the loop goes as fast as it can while it is looked at */
static void watch_run(enum loop_clock clock)
{
    uint64_t expected = quiet_hash(clock);
    atomic_bool stop = false;
    static struct attacker watcher[4];

    bench_open(&bench, &(struct bench_options){
                           .clock = clock, .task = "squat", .ticks = STORM_TICKS, .runs = true});
    for (int i = 0; i < 4; i++) {
        watcher[i].path = bench.path;
        watcher[i].stop = &stop;
        watcher[i].number = 4 * i + 1; /* asks */
        assert_int_equal(pthread_create(&watcher[i].thread, NULL, attack, &watcher[i]), 0);
    }
    pthread_join(bench.loop, NULL);
    atomic_store(&stop, true);
    for (int i = 0; i < 4; i++) {
        pthread_join(watcher[i].thread, NULL);
    }
    bench_finish(&bench);
    assert_int_equal(bench.ticks, STORM_TICKS);
    assert_true(bench.hash == expected);
}

TEST(a_run_that_is_watched_is_the_same_run)
{
    watch_run(LOOP_CLOCK_FREE);
}

TEST(in_lockstep_too)
{
    watch_run(LOOP_CLOCK_LOCKSTEP);
}
