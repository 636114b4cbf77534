/* SPDX-License-Identifier: Apache-2.0 */
/* The client for controllers against a gateway of the test's own, which says what a script says. */
#include "client/coman_hil_client.h"
#include "tests/test.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <unistd.h>

enum { TEXT_MAX = 1 << 19, SHORT_MS = 2000, LONG_MS = 20000 };

/* A bus of an icub board with a motor and an F/T board, one of a board with two axes in a frame,
 * which also has a checksum and a counter. */
static const char table[] =
    "rig r\njoint L-Elb arm\njoint Knee leg\njoint Ankle leg\nsensor hand arm\nwhat is new\n"
    "bus arm can0 icub 6f0 6ff 0\n"
    "name 9 force_idle\nname 80 open_loop\nname 8 direct\n"
    "frame 001 c 490d000000 0 0 -1 0|0@1+\n"
    "setup 0 0\n"
    "frame 200 c 0700 0 0 -1 0|0@1+\n"
    "setup 1 1\n"
    "frame 001 c 8909 0 0 -1 0|0@1+\n"
    "switch L-Elb off 0 2 0|0@1+ 0\n"
    "frame 001 c 8900 0 0 -1 0|0@1+\n"
    "switch L-Elb voltage 0 3 8|8@1+ 80\n"
    "switch L-Elb position 0 3 8|8@1+ 8\n"
    "frame 001 c f20000 0 0 -1 0|0@1+\n"
    "set L-Elb voltage 4 8|16@1- 0.036 0 -48 48 open_loop\n"
    "frame 001 c be00000000 0 0 -1 0|0@1+\n"
    "set L-Elb position 5 8|32@1- 0.001 0 -10 10 direct\n"
    "frame 001 c d3 0 0 -1 0|0@1+\n"
    "ask L-Elb position 6\n"
    "report 010 c 0 1FFFFFFF ff d3\n"
    "value L-Elb position_gain 0 8|16@1- 1 0\n"
    "value L-Elb position_gain 0 24|16@1- 1 0\n"
    "value L-Elb position_gain 0 40|16@1- 1 0\n"
    "report 111 c 8 1FFFFFFF - -\n"
    "value L-Elb position 1 32|32@1- 0.001 0\n"
    "report 114 c 0 1FFFFFFF - -\n"
    "value L-Elb current 2 16|16@1- 0.001 0\n"
    "report 113 c 0 1FFFFFFF - -\n"
    "value L-Elb faults 3 16|8@1+ 1 0\n"
    "value L-Elb mode 3 24|8@1+ 1 0\n"
    "report 31A c 0 1FFFFFFF - -\n"
    "value hand fx 4 0|16@1+ 0.03125 -1024\n"
    "value hand fy 4 16|16@1+ 0.03125 -1024\n"
    "value hand fz 4 32|16@1+ 0.03125 -1024\n"
    "messages arm\n"
    "message 001 c 8 b_COMMAND\n"
    "signal 0|8@1+ 1 0 -2 8 command\n"
    "signal 8|16@1- 0.0750187546886722 0 242 3 SET_OPEN_LOOP_pwm_1\n"
    "signal 31|16@0- 1 0 3 5 SET_GAIN_value\n"
    "message 6F0 c 6 STEP\n"
    "signal 0|32@1+ 1 0 -1 6 tick\n"
    "message 114 c 8 b_CURRENT\n"
    "signal 16|16@1- 1 0 -1 8 L_Elb_current\n"
    "bus leg can1 made ffffffff 6ff 0\n"
    /* only the constant, checksum and counter of a message */
    "frame 00000240 c 5a00000000000000 2 7 3 48|4@1+\n"
    "frame 00000240 c 5a00000000000000 2 7 3 48|4@1+\n"
    "set Knee torque 1 8|16@1- 0.01 0 -300 300 on\n"
    "set Ankle torque 1 39|16@0- 0.01 0 -300 300 on\n"
    "frame 00000100 f - 0 0 -1 0|0@1+\n"
    "switch Knee torque 0 2 520|8@1+ 5\n"
    "frame 120 r - 0 0 -1 0|0@1+\n"
    "cycle 3 Ankle\n"
    /* bits 8 to 15 of the identifier are values, byte 0 tells the axes apart */
    "report 00000020 c 4 1FFF00FF ff 00\n"
    "value Knee motor_position 0 8|16@1- 0.001 0\n"
    "value Knee position_in_turn 0 520|8@1+ 0.01 0\n"
    "report 00000020 c 4 1FFF00FF ff 01\n"
    "value Ankle motor_position 1 8|16@1- 0.001 0\n"
    "messages leg\n"
    "message 00000240 c 8 TORQUES\n"
    "signal 8|16@1- 0.01 0 -1 8 knee\n"
    "signal 48|4@1+ 1 0 -1 8 count\n"
    "signal 56|8@1+ 1 0 -1 8 sum\n";

/* ---- allocations ---- */

static atomic_int allocations;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);

void *__wrap_malloc(size_t size)
{
    allocations++;
    return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    allocations++;
    return __real_calloc(count, size);
}

void *__wrap_realloc(void *memory, size_t size)
{
    allocations++;
    return __real_realloc(memory, size);
}

/* What getaddrinfo fails with; 0 = it does not. */
static int address_reason;

int __real_getaddrinfo(const char *node, const char *service, const struct addrinfo *hints,
                       struct addrinfo **found);
int __wrap_getaddrinfo(const char *node, const char *service, const struct addrinfo *hints,
                       struct addrinfo **found);

int __wrap_getaddrinfo(const char *node, const char *service, const struct addrinfo *hints,
                       struct addrinfo **found)
{
    errno = EMFILE;
    return address_reason ? address_reason : __real_getaddrinfo(node, service, hints, found);
}

/* ---- the gateway ---- */

/* Each STEP is answered with the next of the answers. Behind them stands NULL, and then NULL when
 * the connection is closed, or a text when it stays. */
static struct gateway {
    const char *const *answer;
    int listener;
    pthread_t thread;
    pthread_mutex_t mutex;
    char heard[TEXT_MAX];
} gateway = {.mutex = PTHREAD_MUTEX_INITIALIZER};

static void say(int client, const char *text)
{
    assert_int_equal(send(client, text, strlen(text), MSG_NOSIGNAL), strlen(text));
}

/* Keeps what the client says until it has said the word; false = it has gone. */
static bool hear(int client, const char *word)
{
    static size_t length;
    const char *begin;
    ssize_t size = 1;

    pthread_mutex_lock(&gateway.mutex);
    length = strlen(gateway.heard);
    begin = gateway.heard + length;
    pthread_mutex_unlock(&gateway.mutex);
    while (!strstr(begin, word)) {
        char text[512];

        size = recv(client, text, sizeof text - 1, 0);
        if (size <= 0 || length + (size_t)size >= TEXT_MAX) {
            return false;
        }
        pthread_mutex_lock(&gateway.mutex);
        memcpy(gateway.heard + length, text, (size_t)size);
        length += (size_t)size;
        gateway.heard[length] = '\0';
        pthread_mutex_unlock(&gateway.mutex);
    }
    return true;
}

static void *serve(void *context)
{
    const int client = accept(gateway.listener, NULL, NULL);

    say(client, "< hi >");
    if (hear(client, "< open all >")) {
        say(client, "< ok >");
    }
    for (int part = 0; part < 2 && hear(client, "< tell "); part++) {
        for (const char *row = table; part == 0 && *row; row += strcspn(row, "\n") + 1) {
            char text[256];

            snprintf(text, sizeof text, "\n< row %.*s >", (int)strcspn(row, "\n"), row);
            say(client, text);
        }
        say(client, "\n< ok >");
    }
    if (hear(client, "< rawmode >")) {
        say(client, "< ok >");
    }
    while (*gateway.answer && hear(client, "< send 6F0")) {
        say(client, *gateway.answer++);
    }
    if (!*gateway.answer && gateway.answer[1]) {
        while (hear(client, "never")) {
        }
    }
    close(client);
    return context;
}

static uint16_t listen_at_any_port(void)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;

    gateway.listener = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(gateway.listener, (struct sockaddr *)&address, size), 0);
    assert_int_equal(listen(gateway.listener, 1), 0);
    assert_int_equal(getsockname(gateway.listener, (struct sockaddr *)&address, &size), 0);
    return ntohs(address.sin_port);
}

/* ---- the client ---- */

static char folder[64];

FIXTURE(make_folder)
{
    strcpy(folder, "/tmp/hil-client-XXXXXX");
    assert_non_null(mkdtemp(folder));
    return 0;
}

FIXTURE(remove_folder)
{
    static const char *const names[] = {"r.joints", "ready"};
    char path[128];

    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
    }
    return rmdir(folder);
}

static void open_client(struct hil_client *client, const char *const *answer, bool lockstep,
                        int timeout_ms)
{
    struct hil_client_options options = {.lockstep = lockstep, .timeout_ms = timeout_ms};

    gateway.answer = answer;
    gateway.heard[0] = '\0';
    options.port = listen_at_any_port();
    assert_int_equal(pthread_create(&gateway.thread, NULL, serve, NULL), 0);
    if (hil_client_open(client, &options)) {
        fail_msg("%s", client->message);
    }
}

/* Closes, after which all is in gateway.heard. */
static void close_client(struct hil_client *client)
{
    hil_client_close(client);
    pthread_join(gateway.thread, NULL);
    close(gateway.listener);
}

/* ---- tests ---- */

TEST(an_address_without_memory_is_no_wrong_address)
{
    static const struct {
        int reason;
        enum hil_client_code code;
        const char *text;
    } known[] = {
        {EAI_MEMORY, HIL_CLIENT_SYSTEM, "host: no memory"},
        {EAI_SYSTEM, HIL_CLIENT_SYSTEM, "host: Too many open files"},
        {EAI_NONAME, HIL_CLIENT_INPUT, "host: found \"::7\", expected an address"},
    };
    const struct hil_client_options options = {.host = "::7", .port = 1};

    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        struct hil_client client;

        address_reason = known[i].reason;
        assert_int_equal(hil_client_open(&client, &options), known[i].code);
        assert_string_equal(client.message, known[i].text);
        hil_client_close(&client);
    }
    address_reason = 0;
}

TEST(a_controller_in_lockstep_says_what_the_firmware_understands)
{
    static const char *const answers[] = {
        "\n< frame 6FF 0.002000 020000000000 arm >",
        "\n< frame 6FF 0.004000 040000000000 arm >",
        "\n< frame 6FF 0.009000 090000000000 arm >",
        "\n< frame 6FF 0.014000 0E0000000000 arm >",
        "\n< frame 113 0.019000 0000005000000000 arm >\n< frame 6FF 0.019 130000000000 arm >",
        "\n< frame 111 0.023000 00000000F4010000 arm >\n< frame 114 0.023 0000E803 arm >"
        "\n< frame 113 0.023000 0000085000000000 arm >\n< frame 31A 0.02 0080007C0081 arm >"
        "\n< frame 6FF 0.023000 170000000200 arm >",
        NULL,
        "open"};
    static const char *const names[] = {"L-Elb"};
    struct hil_client_joint elbow;
    struct hil_client_wrench hand;
    struct hil_client client;
    int joint, before;

    open_client(&client, answers, true, LONG_MS);
    before = allocations;
    joint = hil_client_find_joint(&client, "L-Elb");
    assert_int_equal(hil_client_enable(&client, names, 1, HIL_CLIENT_VOLTAGE), HIL_CLIENT_OK);
    assert_int_equal(hil_client_command(&client, joint, HIL_CLIENT_VOLTAGE, 12.0), HIL_CLIENT_OK);
    assert_int_equal(hil_client_step(&client, 4), HIL_CLIENT_OK);
    assert_int_equal(hil_client_read(&client, joint, &elbow), HIL_CLIENT_OK);
    assert_int_equal(hil_client_read_wrench(&client, 0, &hand), HIL_CLIENT_OK);
    assert_int_equal(client.tick, 23);
    assert_int_equal(client.flags, 2);
    assert_int_equal(allocations, before);

    assert_float_equal(elbow.position_rad, 0.5, 1e-12);
    assert_float_equal(elbow.current_a, 1.0, 1e-12);
    assert_true(isnan(elbow.torque_nm) && isnan(elbow.motor_position_rad));
    assert_string_equal(elbow.mode, "open_loop");
    assert_true(elbow.is_on && elbow.faults == 8);
    assert_int_equal(elbow.time_ns, 23000000);
    assert_string_equal(hil_client_sensor_name(&client, 0), "hand");
    assert_float_equal(hand.force_n[0], 0.0, 1e-9);
    assert_float_equal(hand.force_n[1], -32.0, 1e-9);
    assert_float_equal(hand.force_n[2], 8.0, 1e-9);
    assert_true(isnan(hand.moment_nm[0]));
    assert_float_equal(hil_client_signal(&client, "arm", "b_CURRENT", "L_Elb_current"), 1000.0,
                       0.0);
    assert_true(isnan(hil_client_signal(&client, "arm", "b_CURRENT", "none")));
    close_client(&client);

    /* Reports in two stages, off, on, 0 V, 12 V of 48 V = 333 of 1333; the other bus has a cyclic
     * frame */
    assert_non_null(strstr(
        gateway.heard,
        "< send 001 5 49 0d 00 00 00 arm >< send 6F0 6 00 00 00 00 02 00 arm >"
        "< send 200 2 07 00 arm >< send 6F0 6 02 00 00 00 02 00 arm >"
        "< sendrtr 120 0 leg >< send 6F0 6 04 00 00 00 05 00 arm >"
        "< send 001 2 89 09 arm >< sendrtr 120 0 leg >< send 6F0 6 09 00 00 00 05 00 arm >"
        "< send 001 2 89 50 arm >< send 001 3 f2 00 00 arm >< sendrtr 120 0 leg >"
        "< send 6F0 6 0e 00 00 00 05 00 arm >"
        "< send 001 3 f2 4d 01 arm >< sendrtr 120 0 leg >< send 6F0 6 13 00 00 00 04 00 arm >"));
}

TEST(a_step_joins_a_run_on_its_way_and_sees_that_others_move_it)
{
    static const char *const answers[] = {
        "< frame 6FF 0.1 640000000400 arm >",
        "< frame 6FF 0.1 000000000000 arm >< frame 6FF 0.1 650000000000 arm >",
        "< frame 6FF 0.1 800000000400 arm >",
        "< frame 6FF 0.1 640000000800 arm >",
        NULL,
        NULL};
    struct hil_client client;

    open_client(&client, answers, true, LONG_MS);
    assert_int_equal(hil_client_step(&client, 1), HIL_CLIENT_OK);
    assert_int_equal(client.tick, 0x65);
    assert_int_equal(hil_client_step(&client, 1), HIL_CLIENT_MOVED);
    assert_int_equal(client.tick, 0x80);
    assert_non_null(strstr(client.message, "tick 128"));
    assert_int_equal(hil_client_step(&client, 1), HIL_CLIENT_STOPPED);
    assert_int_equal(hil_client_step(&client, 1), HIL_CLIENT_CONNECTION);
    close_client(&client);
}

/* A position for a loop that does nothing is an error; each of the gains makes it one that does. */
TEST(a_loop_without_gains_is_named)
{
    static const char *const gains[] = {"D300000000000000", "D301000000000000", "D300000100000000",
                                        "D300000000010000"};
    static const char *const names[] = {"L-Elb"};

    for (size_t i = 0; i < sizeof gains / sizeof *gains; i++) {
        char reply[160];
        const char *answers[] = {
            "< frame 6FF 0.002 020000000000 arm >",
            "< frame 6FF 0.004 040000000000 arm >",
            "< frame 111 0.009 00000000F4010000 arm >< frame 6FF 0.009 090000000000 arm >",
            reply,
            "< frame 6FF 0.0 100000000000 arm >",
            NULL,
            NULL};
        struct hil_client client;

        snprintf(reply, sizeof reply,
                 "< frame 010 0.009 %s arm >< frame 6FF 0.011 0B0000000000 arm >", gains[i]);
        open_client(&client, answers, true, LONG_MS);
        assert_int_equal(hil_client_enable(&client, names, 1, HIL_CLIENT_POSITION),
                         i == 0 ? HIL_CLIENT_BOARD : HIL_CLIENT_CONNECTION);
        assert_int_equal(
            strstr(client.message, "L-Elb: the position loop of its board has gains of 0") != NULL,
            i == 0);
        hil_client_close(&client);
        close_client(&client);
        assert_non_null(strstr(gateway.heard, "< send 001 1 d3 arm >"));
    }
}

TEST(silence_refusals_and_noise_are_errors)
{
    static const struct {
        const char *answer[3];
        enum hil_client_code code;
        const char *message;
    } rows[] = {
        {{"< frame 111 0.1 0000000000000000 arm >", NULL, "open"},
         HIL_CLIENT_TIMEOUT,
         "tick 0: no answer to STEP within 2000 ms: is the run's clock lockstep"},
        {{"< error the bus\nrefuses it >", NULL, "open"},
         HIL_CLIENT_CONNECTION,
         "the gateway says: the bus?refuses it"},
        {{"< error no such bus: arm >", NULL, "open"},
         HIL_CLIENT_CONNECTION,
         "the gateway says: no such bus: arm"},
        {{"<< frame >< >< frame 6FF 0.1 01 arm >< frame 6FF x 0100000000000000000000 none >"
          "< frame 6FF -1.0 010000000000 arm >",
          NULL, "open"},
         HIL_CLIENT_TIMEOUT,
         "no answer"},
        {{NULL}, HIL_CLIENT_CONNECTION, "closed"},
    };

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct hil_client client;

        open_client(&client, rows[i].answer, true, SHORT_MS);
        assert_int_equal(hil_client_step(&client, 1), rows[i].code);
        assert_non_null(strstr(client.message, rows[i].message));
        close_client(&client);
    }
}

/* Computes CRC-8 SAE J1850 of seven bytes: polynomial 0x1d, from 0xff, inverted at the end. */
static unsigned crc8(const unsigned *byte)
{
    unsigned sum = 0xff;

    for (int bit = 0; bit < 56; bit++) {
        const unsigned top = (sum >> 7 ^ byte[bit / 8] >> (7 - bit % 8)) & 1;

        sum = (sum << 1 & 0xff) ^ (top ? 0x1d : 0);
    }
    return sum ^ 0xff;
}

/* Checks counter and checksum of all frames of torques, the last one apart. Returns the knee's
 * torque in the last frame of set points. */
static unsigned check_torques(const char *heard)
{
    unsigned b[8], count = 0, torque = 0;

    for (; (heard = strstr(heard, "< send 00000240 8 ")); heard++) {
        assert_int_equal(sscanf(heard, "< send 00000240 8 %x %x %x %x %x %x %x %x", &b[0], &b[1],
                                &b[2], &b[3], &b[4], &b[5], &b[6], &b[7]),
                         8);
        assert_int_equal(b[0], 0x5a);
        if (strstr(heard + 1, "< send 00000240")) {
            torque = b[1] != 0x64 ? b[1] | b[2] << 8 : torque;
            assert_int_equal(b[6], count++ & 0xf);
            assert_int_equal(b[7], crc8(b));
        } else {
            assert_true(b[1] == 0 && b[6] == 9 && b[7] == 7);
        }
    }
    assert_true(count > 5);
    return torque;
}

TEST(without_lockstep_it_writes_and_receives)
{
    static const char *const answers[] = {"\n< frame 00003220 2.500000 00E80300 leg >"
                                          "\n< frame 00000020 2.6 01D00700 leg >",
                                          NULL, "open"};
    const struct hil_client_value step[] = {{"tick", 7.0}};
    const struct hil_client_value knee[] = {{"knee", 1.0}}, all[] = {{"count", 9.0}, {"sum", 7.0}};
    const char *names[] = {"Knee"};
    struct hil_client_joint state;
    struct hil_client client;

    open_client(&client, answers, false, LONG_MS);
    assert_int_equal(hil_client_receive(&client, 0), HIL_CLIENT_OK);
    assert_int_equal(hil_client_receive(&client, 20), HIL_CLIENT_TIMEOUT);
    assert_int_equal(hil_client_send(&client, "arm", "STEP", step, 1), HIL_CLIENT_OK);
    assert_int_equal(hil_client_write(&client), HIL_CLIENT_OK);
    assert_int_equal(hil_client_receive(&client, 20000), HIL_CLIENT_OK);
    assert_int_equal(hil_client_read(&client, 1, &state), HIL_CLIENT_OK);
    assert_float_equal(state.motor_position_rad, 1.0, 1e-12);
    /* 0x32 counts in the identifier, the turn nearest to the motor */
    assert_float_equal(state.position_rad, 0.5, 1e-12);
    assert_int_equal(state.time_ns, INT64_C(2500000000));
    hil_client_read(&client, 2, &state);
    assert_float_equal(state.motor_position_rad, 2.0, 1e-12);

    /* Boards that report no mode are on once they have reported; the others are named */
    assert_int_equal(hil_client_find_tripped(&client, 0), -1);
    assert_int_equal(hil_client_enable(&client, names, 1, HIL_CLIENT_TORQUE), HIL_CLIENT_OK);
    assert_int_equal(hil_client_enable(&client, NULL, 0, HIL_CLIENT_VOLTAGE), HIL_CLIENT_BOARD);
    assert_string_equal(client.message, "the board of Knee takes no voltage");
    names[0] = "L-Elb";
    assert_int_equal(hil_client_enable(&client, names, 1, HIL_CLIENT_VOLTAGE), HIL_CLIENT_BOARD);
    assert_non_null(strstr(client.message, "L-Elb does not switch on: mode \"\""));
    assert_int_equal(hil_client_enable(&client, names, 1, HIL_CLIENT_POSITION), HIL_CLIENT_BOARD);
    assert_non_null(strstr(client.message, "L-Elb: its board has reported no position to hold"));
    assert_int_equal(hil_client_find_tripped(&client, -7), -1);
    assert_int_equal(hil_client_command(&client, 1, HIL_CLIENT_TORQUE, 3.0), HIL_CLIENT_OK);
    assert_int_equal(hil_client_write(&client), HIL_CLIENT_OK);
    names[0] = "Knee";
    assert_int_equal(hil_client_enable(&client, names, 1, HIL_CLIENT_OFF), HIL_CLIENT_OK);
    assert_int_equal(hil_client_send(&client, "leg", "TORQUES", knee, 1), HIL_CLIENT_OK);
    assert_int_equal(hil_client_send(&client, "leg", "TORQUES", all, 2), HIL_CLIENT_OK);
    assert_int_equal(hil_client_write(&client), HIL_CLIENT_OK);
    assert_int_equal(hil_client_step(&client, 1), HIL_CLIENT_INPUT);
    close_client(&client);

    /* The mode is in bits of the identifier. Each frame of torques has the next counter and its
     * checksum, except the last one, which the caller gives */
    assert_non_null(strstr(gateway.heard, "< fdsend 00000500 1 0 leg >"));
    assert_int_equal(check_torques(gateway.heard), 0x012c);
}

TEST(messages_by_name_are_encoded_as_the_tables_say)
{
    static const char *const answers[] = {NULL, "open"};
    const struct hil_client_value gain = {"SET_GAIN_value", -2.0}, ask = {"command", 72.0},
                                  wrong = {"none", 1.0}, far = {"SET_OPEN_LOOP_pwm_1", 1e9};
    struct hil_client client;

    open_client(&client, answers, false, LONG_MS);
    assert_int_equal(hil_client_send(&client, "arm", "b_COMMAND", &gain, 1), HIL_CLIENT_OK);
    assert_int_equal(hil_client_send(&client, "arm", "b_COMMAND", &ask, 1), HIL_CLIENT_OK);
    assert_int_equal(hil_client_send(&client, "arm", "b_COMMAND", &far, 1), HIL_CLIENT_OK);
    assert_int_equal(hil_client_send(&client, "arm", "b_COMMAND", &wrong, 1), HIL_CLIENT_INPUT);
    assert_int_equal(hil_client_send(&client, "arm", "b_COMMANDS", &gain, 1), HIL_CLIENT_INPUT);
    assert_int_equal(hil_client_send(&client, "foot", "b_COMMAND", &gain, 1), HIL_CLIENT_INPUT);
    assert_int_equal(hil_client_write(&client), HIL_CLIENT_OK);
    assert_int_equal(hil_client_command(&client, 0, HIL_CLIENT_VOLTAGE, 1.0), HIL_CLIENT_INPUT);
    assert_int_equal(hil_client_command(&client, 99, HIL_CLIENT_VOLTAGE, 1.0), HIL_CLIENT_INPUT);
    assert_int_equal(hil_client_enable(&client, NULL, 0, HIL_CLIENT_QUANTITIES), HIL_CLIENT_INPUT);
    assert_int_equal(hil_client_find_joint(&client, "LElb"), -1);
    assert_null(hil_client_joint_name(&client, -1));
    close_client(&client);
    assert_non_null(strstr(gateway.heard, "< send 001 5 03 00 00 ff fe arm >"
                                          "< send 001 1 48 arm >< send 001 3 f2 ff 7f arm >"));
}

TEST_WITH(wrong_tables_are_named_with_file_and_line, make_folder, remove_folder)
{
    static const struct {
        const char *text, *message;
    } rows[] = {
        {"frame 001 c 00 0 0 -1 0|0@1+", "r.joints:1: expected a row"},
        {"bus a can0 p", "r.joints:1: "},
        {"joint J a\nbus a can0 p 6f0 6ff 0\nframe 001 c 00 0 0 -1 545|1@1+", "r.joints:3: "},
        {"bus a can0 p 6f0 6ff 0\nframe 001 c 00 0 64 -1 0|0@1+", "r.joints:2: "},
        {"bus a can0 p 6f0 6ff 0\nsetup 0 0", "r.joints:2: "},
        {"bus a can0 p 6f0 6ff 0\nframe 001 c 00 0 0 -1 0|0@1+\nsetup 4096 0", "r.joints:3: "},
        {"joint J a\nbus a can0 p 6f0 6ff 0\nframe 001 c 00 0 0 -1 0|0@1+\n"
         "set J speed 0 0|8@1+ 1 0 0 0 on",
         "r.joints:4: "},
        {"joint J a\nbus a can0 p 6f0 6ff 0\nframe 001 c 00 0 0 -1 0|0@1+\n"
         "set J torque 0 0|8@1+ 0 0 0 0 on",
         "r.joints:4: "},
        {"joint J a\nbus a can0 p 6f0 6ff 0\nframe 001 c 00 0 0 -1 0|0@1+\n"
         "set K torque 0 0|8@1+ 1 0 0 0 on",
         "r.joints:4: "},
        {"bus a can0 p 6f0 6ff 0\nmessages b", "r.joints:2: "},
        {"bus a can0 p 6f0 6ff 0\nmessages a\nmessage 001 c 65 M", "r.joints:3: "},
        {"bus a can0 p 6f0 6ff 0\nmessages a\nmessage 001 c 8 M\nsignal 60|8@1+ 1 0 -1 8 s",
         "r.joints:4: "},
        {"", "found no bus, expected a client table"},
    };
    char path[128];
    const struct hil_client_options options = {.table = path, .timeout_ms = 1}, none = {0};
    struct hil_client client;

    snprintf(path, sizeof path, "%s/r.joints", folder);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        FILE *file = fopen(path, "w");

        assert_non_null(file);
        fputs(rows[i].text, file);
        fclose(file);
        assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_TABLES);
        if (!strstr(client.message, rows[i].message)) {
            fail_msg("found \"%s\", expected \"%s\"", client.message, rows[i].message);
        }
        hil_client_close(&client);
    }
    assert_int_equal(unlink(path), 0);
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_TABLES);
    assert_non_null(strstr(client.message, "r.joints: No such file"));
    assert_int_equal(hil_client_open(&client, &none), HIL_CLIENT_TABLES);
    assert_non_null(strstr(client.message, "options.table: expected the file RIG.joints"));
}

static void write_ready(const char *path, const char *clock, unsigned port)
{
    char text[128];
    FILE *file;

    snprintf(text, sizeof text, "%s.new", path);
    file = fopen(text, "w");
    assert_non_null(file);
    fprintf(file, "clock='%s'\ngateway_host='127.0.0.1'\ngateway_port='%u'\n", clock, port);
    fclose(file);
    assert_int_equal(rename(text, path), 0);
}

/* Replaces the file of a run that was killed, a while after the client has found it. */
static void *start_late(void *path)
{
    usleep(30000);
    write_ready(path, "real", listen_at_any_port());
    return serve(NULL);
}

TEST_WITH(the_file_of_a_killed_run_is_passed_over_and_another_clock_refused, make_folder,
          remove_folder)
{
    static const char *const answers[] = {NULL, "open"};
    char ready[128];
    struct hil_client_options options = {.ready = ready, .timeout_ms = LONG_MS};
    struct hil_client client;

    snprintf(ready, sizeof ready, "%s/ready", folder);
    for (int i = 0; i < 2; i++) {
        options.lockstep = i == 1;
        gateway.answer = answers;
        gateway.heard[0] = '\0';
        write_ready(ready, "lockstep", 1);
        assert_int_equal(pthread_create(&gateway.thread, NULL, start_late, ready), 0);
        if (i == 0) {
            assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_OK);
        } else {
            assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_INPUT);
            assert_non_null(strstr(client.message, "the clock of the run is real"));
        }
        close_client(&client);
    }
}

TEST_WITH(a_gateway_that_is_not_there_is_waited_for_no_longer_than_asked, make_folder,
          remove_folder)
{
    char ready[128];
    struct hil_client_options options = {.ready = ready, .timeout_ms = 50};
    struct hil_client client;
    FILE *file;

    snprintf(ready, sizeof ready, "%s/ready", folder);
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_TIMEOUT);
    assert_non_null(strstr(client.message, "is not there after 50 ms"));
    file = fopen(ready, "w");
    fputs("pid='1'\n", file);
    fclose(file);
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_CONNECTION);
    assert_non_null(strstr(client.message, "names no gateway"));
    write_ready(ready, "real", 1); /* of a run that was killed */
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_CONNECTION);
    assert_non_null(strstr(client.message, "127.0.0.1:1: nobody serves the gateway"));

    /* Nobody accepts: the connection is made, and says nothing */
    options.ready = NULL;
    options.port = listen_at_any_port();
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_TIMEOUT);
    close(gateway.listener);
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_CONNECTION);
    options.host = "robot.example";
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_INPUT);
}
