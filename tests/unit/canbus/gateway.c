/* SPDX-License-Identifier: Apache-2.0 */
/* The gateway with clients on real sockets of the loopback interface, in front of a port that the
 * test holds in its hands. */
#include "canbus/gateway.h"
#include "tests/test.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

enum { QUEUE = 4096, PATIENCE_MS = 10000 };

/* What the bus gives and what it is given */
struct hand_port {
    struct can_port port;
    pthread_mutex_t lock;
    int event;
    _Atomic int asked;   /* for its descriptor */
    size_t given, taken; /* frames to be received */
    struct bus_frame in[QUEUE];
    size_t nout;
    struct bus_frame out[QUEUE];
};

static size_t hand_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct hand_port *hand = (struct hand_port *)port;
    uint64_t count;
    size_t n = 0;

    pthread_mutex_lock(&hand->lock);
    while (n < max && hand->taken < hand->given) {
        frames[n++] = hand->in[hand->taken++ % QUEUE];
    }
    if (hand->taken == hand->given) {
        (void)!read(hand->event, &count, sizeof count);
    }
    pthread_mutex_unlock(&hand->lock);
    return n;
}

static size_t hand_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct hand_port *hand = (struct hand_port *)port;
    size_t n = 0;

    pthread_mutex_lock(&hand->lock);
    while (n < count && hand->nout < QUEUE && frame_valid(&frames[n])) {
        hand->out[hand->nout++] = frames[n++];
    }
    pthread_mutex_unlock(&hand->lock);
    return n;
}

static int hand_descriptor(const struct can_port *port)
{
    struct hand_port *hand = (struct hand_port *)(uintptr_t)port;

    hand->asked++;
    return hand->event;
}

static const struct can_port_ops hand_ops = {
    .name = "hand", .receive = hand_receive, .send = hand_send, .descriptor = hand_descriptor};

static void give(struct hand_port *hand, const struct bus_frame *frame)
{
    uint64_t one = 1;

    pthread_mutex_lock(&hand->lock);
    hand->in[hand->given++ % QUEUE] = *frame;
    pthread_mutex_unlock(&hand->lock);
    (void)!write(hand->event, &one, sizeof one);
}

static size_t sent_to_bus(struct hand_port *hand)
{
    size_t count;

    pthread_mutex_lock(&hand->lock);
    count = hand->nout;
    pthread_mutex_unlock(&hand->lock);
    return count;
}

struct fixture {
    struct arena arena;
    struct hand_port hand[2];
    struct gateway *gateway;
};

/* Knows one word; its answer is not terminated. */
static const char *tell(void *context, const char *word, size_t *size)
{
    *size = *(const size_t *)context;
    return strcmp(word, "7") != 0 ? NULL : "bus torso\njoint J\nmore";
}

FIXTURE(start)
{
    static struct fixture f;
    static struct gateway_bus bus[2];
    static size_t told = 18;
    struct gateway_config config = {.nbus = 2, .bus = bus, .tell = tell, .context = &told};

    memset(&f, 0, sizeof f);
    for (int i = 0; i < 2; i++) {
        f.hand[i].port = (struct can_port){.ops = &hand_ops};
        f.hand[i].event = eventfd(0, EFD_NONBLOCK);
        pthread_mutex_init(&f.hand[i].lock, NULL);
        bus[i].port = &f.hand[i].port;
    }
    bus[0].name = "torso";
    bus[0].alias = "can0";
    bus[1].name = "left_leg";
    *test_state = &f;
    return arena_init(&f.arena, (size_t)64 << 20, NULL) ||
           gateway_start(&config, &f.arena, &f.gateway, NULL);
}

FIXTURE(stop)
{
    struct fixture *f = *test_state;

    gateway_stop(f->gateway);
    close(f->hand[0].event);
    close(f->hand[1].event);
    arena_fini(&f->arena);
    return 0;
}

/* ---- a client ---- */

static int join(const struct fixture *f)
{
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons(gateway_port(f->gateway)),
                                  .sin_addr = {htonl(INADDR_LOOPBACK)}};
    int client = socket(AF_INET, SOCK_STREAM, 0);

    assert_int_equal(connect(client, (const struct sockaddr *)&address, sizeof address), 0);
    return client;
}

static void say(int client, const char *text)
{
    assert_int_equal(send(client, text, strlen(text), MSG_NOSIGNAL), strlen(text));
}

/* Exactly this comes next; "" = the connection ends */
static void hears(int client, const char *expected)
{
    char text[512];
    size_t length = strlen(expected), have = 0;

    while (have < length || length == 0) {
        struct pollfd fd = {.fd = client, .events = POLLIN};
        ssize_t count;

        if (poll(&fd, 1, PATIENCE_MS) != 1) {
            fail_msg("waited for \"%s\"", expected);
        }
        count = recv(client, text + have, length ? length - have : sizeof text, 0);
        if (length == 0) {
            if (count <= 0) {
                return;
            }
            continue;
        }
        assert_true(count > 0);
        have += (size_t)count;
    }
    text[have] = '\0';
    assert_string_equal(text, expected);
}

static int join_raw(const struct fixture *f, const char *bus)
{
    int client = join(f);
    char text[64];

    hears(client, "< hi >");
    snprintf(text, sizeof text, "< open %s >", bus);
    say(client, text);
    hears(client, "< ok >");
    say(client, "< rawmode >");
    hears(client, "< ok >");
    return client;
}

static void wait_for_frames(struct hand_port *hand, size_t count)
{
    for (int ms = 0; ms < PATIENCE_MS && sent_to_bus(hand) < count; ms++) {
        usleep(1000);
    }
    assert_int_equal(sent_to_bus(hand), count);
}

TEST_WITH(frames_go_both_ways, start, stop)
{
    struct fixture *f = *test_state;
    struct bus_frame frame = frame_make(0x70f, 1, (const uint8_t[]){0xff});
    int client = join_raw(f, "torso");

    say(client, "< send 70F 1 ff >");
    wait_for_frames(&f->hand[0], 1);
    assert_int_equal(f->hand[0].out[0].id, 0x70f);
    assert_int_equal(f->hand[0].out[0].data[0], 0xff);
    frame.time_ns = INT64_C(1500000000);
    give(&f->hand[0], &frame);
    hears(client, "\n< frame 70F 1.500000 FF >");
    assert_int_equal(sent_to_bus(&f->hand[1]), 0);
    close(client);
}

TEST_WITH(a_bus_has_two_names_and_clients_hear_each_other, start, stop)
{
    struct fixture *f = *test_state;
    int first = join_raw(f, "torso"), second = join_raw(f, "can0"), other = join_raw(f, "left_leg");

    say(first, "< send 123 2 1 2 >");
    hears(second, "\n< frame 123 0.000000 0102 >");
    say(other, "< echo >");
    hears(other, "< echo >"); /* and nothing before it */
    wait_for_frames(&f->hand[0], 1);
    close(first);
    close(second);
    close(other);
}

TEST_WITH(commands_may_come_in_pieces_and_in_heaps, start, stop)
{
    struct fixture *f = *test_state;
    int client = join_raw(f, "torso");
    const char *text = "< send 1 0 >< send 2 1 aa >\n junk < send 3 0 >";

    for (const char *c = text; *c; c++) {
        say(client, (const char[]){*c, '\0'});
        usleep(200);
    }
    wait_for_frames(&f->hand[0], 3);
    assert_int_equal(f->hand[0].out[2].id, 3);
    close(client);
}

TEST_WITH(wrong_commands_are_answered_and_too_many_end_it, start, stop)
{
    struct fixture *f = *test_state;
    int client = join(f);

    hears(client, "< hi >");
    say(client, "< send 1 0 >");
    hears(client, "< error no bus is open >");
    say(client, "< open nothing >");
    hears(client, "< error no such bus: nothing >");
    say(client, "< open tor<s\302\265 >");
    hears(client, "< error no such bus: tor?s?? >");
    say(client, "< open torso >");
    hears(client, "< ok >");
    say(client, "< open torso >");
    hears(client, "< error a bus is open already >");
    say(client, "< subscribe 0 0 123 >");
    hears(client, "< error not offered here, use rawmode >");
    say(client, "< dance >");
    hears(client, "< error unknown command >");
    say(client, "< send 123 9 >");
    hears(client, "< error wrong arguments >");
    for (int i = 0; i < GATEWAY_JUNK_MAX; i++) {
        (void)!send(client, "< dance >", 9, MSG_NOSIGNAL);
    }
    hears(client, "");
    close(client);
    assert_int_equal(sent_to_bus(&f->hand[0]), 0);
}

TEST_WITH(a_run_tells_its_clients_rows_by_a_word, start, stop)
{
    int client = join_raw(*test_state, "torso");

    say(client, "< tell 7 >");
    hears(client, "\n< row bus torso >\n< row joint J >\n< ok >");
    say(client, "< tell >");
    hears(client, "< error wrong arguments >");
    say(client, "< tell 8 >");
    hears(client, "< error nothing to tell about this word >");
    close(client);
}

TEST_WITH(a_command_without_an_end_is_cut_off, start, stop)
{
    struct fixture *f = *test_state;
    char text[1024];
    int client = join(f), good = join_raw(f, "torso");

    hears(client, "< hi >");
    memset(text, 'x', sizeof text);
    text[0] = '<';
    (void)!send(client, text, sizeof text, MSG_NOSIGNAL);
    hears(client, "");
    say(good, "< echo >");
    hears(good, "< echo >");
    close(client);
    close(good);
}

TEST_WITH(a_slow_client_is_cut_off_and_the_others_do_not_notice, start, stop)
{
    struct fixture *f = *test_state;
    int slow = join_raw(f, "left_leg"), good = join_raw(f, "torso");
    struct bus_frame frame = {.id = 0x7ff, .flags = FRAME_FD, .len = 64};
    struct gateway_counters counters;

    /* Far more than its buffers and ours hold, while it reads nothing */
    for (int round = 0; round < 60000; round++) {
        while (true) {
            bool full;

            pthread_mutex_lock(&f->hand[1].lock);
            full = f->hand[1].given - f->hand[1].taken >= QUEUE;
            pthread_mutex_unlock(&f->hand[1].lock);
            if (!full) {
                break;
            }
            usleep(100);
        }
        give(&f->hand[1], &frame);
    }
    say(good, "< send 5 0 >< echo >");
    hears(good, "< echo >");
    wait_for_frames(&f->hand[0], 1);
    hears(slow, "");
    gateway_stop(f->gateway);
    gateway_counters(f->gateway, &counters);
    f->gateway = NULL;
    assert_int_equal(counters.cut_slow, 1);
    close(slow);
    close(good);
}

TEST_WITH(more_clients_than_places_are_refused, start, stop)
{
    struct fixture *f = *test_state;
    int client[GATEWAY_CLIENTS], extra;

    for (int i = 0; i < GATEWAY_CLIENTS; i++) {
        client[i] = join(f);
        hears(client[i], "< hi >");
    }
    extra = join(f);
    hears(extra, "< error all places are taken >");
    hears(extra, "");
    close(extra);
    /* A place that is given up is given out again */
    close(client[3]);
    for (int attempt = 0; attempt < 100; attempt++) {
        char text[8] = "";

        extra = join(f);
        if (recv(extra, text, 6, MSG_WAITALL) == 6) {
            break;
        }
        close(extra);
        extra = -1;
        usleep(10000);
    }
    assert_true(extra >= 0);
    close(extra);
    for (int i = 0; i < GATEWAY_CLIENTS; i++) {
        if (i != 3) {
            close(client[i]);
        }
    }
}

TEST_WITH(who_opens_no_bus_yields_its_place, start, stop)
{
    struct fixture *f = *test_state;
    int silent[GATEWAY_CLIENTS], good;

    for (int i = 0; i < GATEWAY_CLIENTS; i++) {
        silent[i] = join(f);
        hears(silent[i], "< hi >");
    }
    usleep(1100000);
    good = join_raw(f, "torso");
    hears(silent[0], "< error no bus was opened in time >");
    hears(silent[0], "");
    say(good, "< echo >");
    hears(good, "< echo >");
    close(good);
    for (int i = 0; i < GATEWAY_CLIENTS; i++) {
        close(silent[i]);
    }
}

TEST_WITH(who_opens_no_bus_is_disconnected_in_the_end, start, stop)
{
    struct fixture *f = *test_state;
    int silent = join(f), good = join_raw(f, "torso");
    struct gateway_counters counters;

    hears(silent, "< hi >");
    usleep(9000000);
    hears(silent, "< error no bus was opened in time >");
    hears(silent, "");
    say(good, "< echo >");
    hears(good, "< echo >");
    gateway_stop(f->gateway);
    gateway_counters(f->gateway, &counters);
    f->gateway = NULL;
    assert_int_equal(counters.cut_silent, 1);
    close(silent);
    close(good);
}

TEST_WITH(what_has_no_time_is_as_new_as_the_newest, start, stop)
{
    struct fixture *f = *test_state;
    struct bus_frame frame = frame_make(0x111, 0, NULL), other = frame_make(0x222, 0, NULL);
    int first = join_raw(f, "torso"), second = join_raw(f, "torso");

    frame.time_ns = INT64_C(2500000000);
    give(&f->hand[0], &frame);
    give(&f->hand[0], &other);
    hears(first, "\n< frame 111 2.500000  >\n< frame 222 2.500000  >");
    say(second, "< send 333 0 >");
    hears(first, "\n< frame 333 2.500000  >");
    close(first);
    close(second);
}

TEST_WITH(one_connection_has_every_bus, start, stop)
{
    struct fixture *f = *test_state;
    struct bus_frame frame = frame_make(0x111, 1, (const uint8_t[]){7});
    int all = join_raw(f, "all"), leg = join_raw(f, "left_leg");

    /* What it sends goes to the bus that it names, by either name, and to nobody else */
    say(all, "< send 1 0 left_leg >< send 2 1 5 can0 >");
    wait_for_frames(&f->hand[0], 1);
    wait_for_frames(&f->hand[1], 1);
    assert_int_equal(f->hand[0].out[0].id, 2);
    assert_int_equal(f->hand[1].out[0].id, 1);
    hears(leg, "\n< frame 001 0.000000  >");

    /* What it receives is named, also what another client sends */
    give(&f->hand[0], &frame);
    hears(all, "\n< frame 111 0.000000 07 torso >");
    say(leg, "< send 3 0 >");
    hears(all, "\n< frame 003 0.000000  left_leg >");

    /* Elsewhere no bus may be named, here one must */
    say(all, "< send 1 0 >");
    hears(all, "< error the last word must be the bus >");
    say(all, "< send 1 0 arm >");
    hears(all, "< error no such bus: arm >");
    say(leg, "< send 1 0 left_leg >");
    hears(leg, "< error wrong arguments >");
    say(leg, "< send 1 1 1 2 >");
    hears(leg, "< error wrong arguments >");
    close(all);
    close(leg);
}

/* So that a loop, which sends on the bus, need not signal a gateway without clients. */
TEST_WITH(no_port_is_waited_on_before_a_client_hears_it, start, stop)
{
    struct fixture *f = *test_state;
    struct bus_frame frame = frame_make(0x111, 0, NULL);
    int client;

    assert_int_equal(f->hand[0].asked, 0);
    client = join_raw(f, "torso");
    give(&f->hand[0], &frame);
    hears(client, "\n< frame 111 0.000000  >");
    assert_true(f->hand[0].asked > 0);
    close(client);
}

TEST_WITH(a_frame_that_the_bus_does_not_take_is_told_and_no_junk, start, stop)
{
    enum { TOO_MANY = 4 * GATEWAY_JUNK_MAX };
    struct fixture *f = *test_state;
    struct gateway_counters counters;
    int client = join_raw(f, "torso");

    for (int i = 0; i < QUEUE; i++) {
        say(client, "< send 123 0 >");
    }
    wait_for_frames(&f->hand[0], QUEUE);
    for (int i = 0; i < TOO_MANY; i++) {
        say(client, "< send 123 0 >");
        hears(client, "< error the bus refuses the frame >");
    }
    say(client, "< echo >");
    hears(client, "< echo >");
    gateway_stop(f->gateway);
    gateway_counters(f->gateway, &counters);
    f->gateway = NULL;
    assert_int_equal(counters.to_bus, QUEUE);
    assert_int_equal(counters.not_taken, TOO_MANY);
    assert_int_equal(counters.cut_junk, 0);
    close(client);
}

TEST_WITH(a_step_is_passed_on_and_refused_without_the_lockstep_clock, start, stop)
{
    struct fixture *f = *test_state;
    const struct gateway_bus bus = {.name = "torso", .port = &f->hand[0].port};
    const struct gateway_config config = {
        .nbus = 1, .bus = &bus, .lockstep = {.step_id = 0x6f0, .done_id = 0x6ff}};
    int client;

    gateway_stop(f->gateway);
    assert_ok(gateway_start(&config, &f->arena, &f->gateway, NULL));
    client = join_raw(f, "torso");
    say(client, "< send 6F0 5 0 0 0 0 2 >< send 6F0 6 0 0 0 0 2 0 >");
    hears(client, "< error STEP without effect: the clock of this run is not lockstep >");
    wait_for_frames(&f->hand[0], 2);
    close(client);
}

TEST_WITH(refuses_hosts_and_ports_that_cannot_be_had, start, stop)
{
    struct fixture *f = *test_state;
    struct gateway *second = NULL;
    struct gateway_config config = {.host = "localhost"};
    struct error error;

    assert_int_equal(gateway_start(&config, &f->arena, &second, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "numeric address"));
    config = (struct gateway_config){.port = gateway_port(f->gateway)};
    assert_int_equal(gateway_start(&config, &f->arena, &second, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "(0: any free one): Address already in use"));
    config = (struct gateway_config){.nbus = 1, .bus = &(struct gateway_bus){.name = "all"}};
    assert_int_equal(gateway_start(&config, &f->arena, &second, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "all"));
    assert_null(second);
}
