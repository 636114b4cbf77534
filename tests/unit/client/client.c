/* SPDX-License-Identifier: Apache-2.0 */
/* The client for controllers against a gateway of the test's own, which says what a script says. */
#include "client/coman_hil_client.h"
#include "tests/test.h"

#include <errno.h>
#include <math.h>
#include <netdb.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

enum { TEXT_MAX = 1 << 19, SHORT_MS = 2000, LONG_MS = 20000 };

/* An icub board with a motor and an F/T board on one bus, a compact FD board on another. */
static const char arm[] =
    "BU_: host simulator b s\n\n"
    "BO_ 1 b_COMMAND: 8 host\n"
    " SG_ command M : 0|8@1+ (1,0) [0|255] \"\" b\n"
    " SG_ SET_CONTROL_MODE_mode_1 m137 : 8|8@1+ (1,0) [0|255] \"\" b\n"
    " SG_ SET_OPEN_LOOP_pwm_1 m242 : 8|16@1- (0.0750187546886722,0) [-2458|2458] \"%\" b\n"
    " SG_ SET_DESIRED_TORQUE_torque_1 m172 : 8|32@1- (1,0) [0|0] \"\" b\n"
    " SG_ SET_COMMAND_POSITION_position_1 m190 : 8|32@1- (0.001,0) [0|0] \"rad\" b\n"
    " SG_ SET_BROADCAST_POLICY_mask_0 m73 : 8|32@1+ (1,0) [0|0] \"\" b\n"
    " SG_ SET_GAIN_value m3 : 31|16@0- (1,0) [-32768|32767] \"\" b\n\n"
    "BO_ 16 b_REPLY: 8 b\n"
    " SG_ command M : 0|8@1+ (1,0) [0|255] \"\" host\n"
    " SG_ GET_POSITION_PID_kp_1 m211 : 8|16@1- (1,0) [0|0] \"\" host\n"
    " SG_ GET_POSITION_PID_ki_1 m211 : 24|16@1- (1,0) [0|0] \"\" host\n"
    " SG_ GET_POSITION_PID_kd_1 m211 : 40|16@1- (1,0) [0|0] \"\" host\n\n"
    "BO_ 273 b_POSITION: 8 b\n"
    " SG_ L_Elb_position : 32|32@1- (0.001,0) [0|0] \"rad\" host\n\n"
    "BO_ 276 b_CURRENT: 8 b\n"
    " SG_ Lcur : 16|16@1- (1,0) [0|0] \"mA\" host\n\n"
    "BO_ 275 bS: 8 b\n"
    " SG_ L_Elb_fault : 16|8@1+ (1,0) [0|0] \"\" host\n"
    " SG_ L_Elb_mode : 24|8@1+ (1,0) [0|0] \"\" host\n\n"
    "BO_ 794 s_FORCE: 6 s\n"
    " SG_ fx : 0|16@1+ (0.03125,-1024) [-1024|1024] \"N\" host\n"
    " SG_ fy : 16|16@1+ (0.03125,-1024) [-1024|1024] \"N\" host\n"
    " SG_ fz : 32|16@1+ (0.03125,-1024) [-1024|1024] \"N\" host\n\n"
    "BO_ 512 s_COMMAND: 8 host\n"
    " SG_ command M : 0|8@1+ (1,0) [0|255] \"\" s\n"
    " SG_ SET_TRANSMIT_MODE_mode m7 : 8|8@1+ (1,0) [0|255] \"\" s\n\n"
    "BO_ 1776 STEP: 6 host\n"
    " SG_ tick : 0|32@1+ (1,0) [0|0] \"\" simulator\n"
    " SG_ ticks : 32|16@1+ (1,0) [0|0] \"\" simulator\n\n"
    "BO_ 1791 DONE: 6 simulator\n"
    " SG_ tick : 0|32@1+ (1,0) [0|0] \"\" host\n\n"
    "CM_ \"Rig r, bus arm on can0: protocol icub, supply 48 V. A number\";\n"
    "CM_ BU_ host \"the controller\";\n"
    "CM_ BU_ b \"address 1, motors L-Elb\";\n"
    "CM_ BU_ s \"address 13, F/T hand\";\n"
    "CM_ SG_ 1 SET_CONTROL_MODE_mode_1 \"L-Elb\";\n"
    "CM_ SG_ 1 SET_OPEN_LOOP_pwm_1 \"L-Elb\";\n"
    "CM_ SG_ 1 SET_DESIRED_TORQUE_torque_1 \"L-Elb\";\n"
    "CM_ SG_ 1 SET_COMMAND_POSITION_position_1 \"L-Elb\";\n"
    "CM_ SG_ 273 L_Elb_position \"L-Elb\";\n"
    "CM_ SG_ 276 Lcur \"L-Elb\";\n"
    "CM_ SG_ 275 L_Elb_fault \"L-Elb\";\n"
    "CM_ SG_ 275 L_Elb_mode \"L-Elb\";\n"
    "BA_ \"SystemNodeLongSymbol\" BU_ s \"strain\";\n"
    "BA_ \"SystemMessageLongSymbol\" BO_ 512 \"strain_COMMAND\";\n"
    "BA_ \"SystemMessageLongSymbol\" BO_ 794 \"strain_FORCE\";\n"
    "BA_ \"SystemMessageLongSymbol\" BO_ 275 \"b_STATUS\";\n"
    "BA_ \"SystemSignalLongSymbol\" SG_ 276 Lcur \"L_Elb_current\";\n"
    "BA_ \"FrameLength\" SG_ 1 SET_CONTROL_MODE_mode_1 2;\n"
    "BA_ \"FrameLength\" SG_ 1 SET_OPEN_LOOP_pwm_1 3;\n"
    "BA_ \"FrameLength\" SG_ 1 SET_DESIRED_TORQUE_torque_1 5;\n"
    "BA_ \"FrameLength\" SG_ 1 SET_COMMAND_POSITION_position_1 5;\n"
    "BA_ \"FrameLength\" SG_ 1 SET_BROADCAST_POLICY_mask_0 5;\n"
    "BA_ \"FrameLength\" SG_ 1 SET_GAIN_value 5;\n"
    "BA_ \"FrameLength\" SG_ 512 SET_TRANSMIT_MODE_mode 2;\n"
    "VAL_ 1 SET_CONTROL_MODE_mode_1 9 \"force_idle\" 80 \"open_loop\" 6 \"current\" 8 \"direct\" "
    ";\n"
    "VAL_ 275 L_Elb_mode 9 \"force_idle\" 80 \"open_loop\" ;\n";

static const char leg[] = "BO_ 32 ALL_MODE: 5 host\n"
                          " SG_ mode : 0|8@1+ (1,0) [0|0] \"\" n\n"
                          " SG_ slots : 8|32@1+ (1,0) [0|0] \"\" n\n"
                          "BO_ 65 ALL_COMMAND_1: 8 host\n"
                          " SG_ Knee_set_point : 16|16@1- (0.002,0) [0|0] \"V\" n\n"
                          "BO_ 288 n_TELEMETRY_FD: 64 n\n"
                          " SG_ Knee_motor_position : 256|32@1- (1e-05,0) [0|0] \"rad\" host\n"
                          "CM_ \"Rig r, bus leg on can1: protocol compact, supply 48 V.\";\n"
                          "CM_ BU_ n \"address 1, motors Knee\";\n"
                          "CM_ SG_ 65 Knee_set_point \"Knee\";\n"
                          "CM_ SG_ 288 Knee_motor_position \"Knee\";\n"
                          "BA_ \"VFrameFormat\" BO_ 288 14;\n"
                          "VAL_ 32 mode 0 \"off\" 1 \"voltage\" 2 \"current\" ;\n";

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

/* ---- tables ---- */

static char folder[64];

static void write_table(const char *name, const char *text)
{
    char path[128];
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", folder, name);
    file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "VERSION \"\"\n%s", text);
    fclose(file);
}

FIXTURE(make_folder)
{
    strcpy(folder, "/tmp/hil-client-XXXXXX");
    assert_non_null(mkdtemp(folder));
    write_table("r-arm.dbc", arm);
    write_table("r-leg.dbc", leg);
    return 0;
}

FIXTURE(remove_folder)
{
    static const char *const names[] = {"r-arm.dbc", "r-leg.dbc", "ready"};
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
    struct hil_client_options options = {
        .tables = folder, .lockstep = lockstep, .timeout_ms = timeout_ms};

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

TEST_WITH(an_address_without_memory_is_no_wrong_address, make_folder, remove_folder)
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
    const struct hil_client_options options = {.tables = folder, .host = "::7", .port = 1};

    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        struct hil_client client;

        address_reason = known[i].reason;
        assert_int_equal(hil_client_open(&client, &options), known[i].code);
        assert_string_equal(client.message, known[i].text);
        hil_client_close(&client);
    }
    address_reason = 0;
}

TEST_WITH(a_controller_in_lockstep_says_what_the_firmware_understands, make_folder, remove_folder)
{
    static const char *const answers[] = {
        "\n< frame 6FF 0.002000 020000000000 arm >",
        "\n< frame 6FF 0.007000 070000000000 arm >",
        "\n< frame 6FF 0.012000 0C0000000000 arm >",
        "\n< frame 113 0.017000 0000005000000000 arm >\n< frame 6FF 0.017 110000000000 arm >",
        "\n< frame 111 0.021000 00000000F4010000 arm >\n< frame 114 0.021 0000E803 arm >"
        "\n< frame 113 0.021000 0000085000000000 arm >\n< frame 31A 0.02 0080007C0081 arm >"
        "\n< frame 6FF 0.021000 150000000200 arm >",
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
    assert_int_equal(client.tick, 21);
    assert_int_equal(client.flags, 2);
    assert_int_equal(allocations, before);

    assert_float_equal(elbow.position_rad, 0.5, 1e-12);
    assert_float_equal(elbow.current_a, 1.0, 1e-12);
    assert_true(isnan(elbow.torque_nm) && isnan(elbow.motor_position_rad));
    assert_string_equal(elbow.mode, "open_loop");
    assert_true(elbow.is_on && elbow.faults == 8);
    assert_int_equal(elbow.time_ns, 21000000);
    assert_string_equal(hil_client_sensor_name(&client, 0), "hand");
    assert_float_equal(hand.force_n[0], 0.0, 1e-9);
    assert_float_equal(hand.force_n[1], -32.0, 1e-9);
    assert_float_equal(hand.force_n[2], 8.0, 1e-9);
    assert_true(isnan(hand.moment_nm[0]));
    assert_float_equal(hil_client_signal(&client, "arm", "b_CURRENT", "L_Elb_current"), 1000.0,
                       0.0);
    assert_true(isnan(hil_client_signal(&client, "arm", "b_CURRENT", "none")));
    close_client(&client);

    /* Byte 0 with the bit of axis 1: reports, off, on, 0 V, 12 V of 48 V = 333 of 1333 */
    assert_non_null(strstr(gateway.heard,
                           "< send 001 5 49 0d 00 00 00 arm >< send 200 2 07 00 arm >"
                           "< send 6F0 6 00 00 00 00 02 00 arm >"
                           "< send 6F0 6 02 00 00 00 05 00 arm >"
                           "< send 001 2 89 09 arm >< send 6F0 6 07 00 00 00 05 00 arm >"
                           "< send 001 2 89 50 arm >< send 001 3 f2 00 00 arm >"
                           "< send 6F0 6 0c 00 00 00 05 00 arm >"
                           "< send 001 3 f2 4d 01 arm >< send 6F0 6 11 00 00 00 04 00 arm >"));
}

TEST_WITH(a_step_joins_a_run_on_its_way_and_sees_that_others_move_it, make_folder, remove_folder)
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
TEST_WITH(a_loop_without_gains_is_named, make_folder, remove_folder)
{
    static const char *const gains[] = {"D300000000000000", "D301000000000000", "D300000100000000",
                                        "D300000000010000"};
    static const char *const names[] = {"L-Elb"};

    for (size_t i = 0; i < sizeof gains / sizeof *gains; i++) {
        char reply[160];
        const char *answers[] = {"< frame 6FF 0.002 020000000000 arm >",
                                 "< frame 6FF 0.007 070000000000 arm >",
                                 reply,
                                 "< frame 6FF 0.0 0E0000000000 arm >",
                                 NULL,
                                 NULL};
        struct hil_client client;

        snprintf(reply, sizeof reply,
                 "< frame 010 0.009 %s arm >< frame 6FF 0.009 090000000000 arm >", gains[i]);
        open_client(&client, answers, true, LONG_MS);
        assert_int_equal(hil_client_enable(&client, names, 1, HIL_CLIENT_POSITION),
                         i == 0 ? HIL_CLIENT_BOARD : HIL_CLIENT_CONNECTION);
        assert_int_equal(strstr(client.message, "L-Elb: its loop has gains of 0") != NULL, i == 0);
        hil_client_close(&client);
        close_client(&client);
        assert_non_null(strstr(gateway.heard, "< send 001 1 d3 arm >"));
    }
}

TEST_WITH(silence_refusals_and_noise_are_errors, make_folder, remove_folder)
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
         "the gateway says: no such bus: arm; the tables are of rig r"},
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

TEST_WITH(without_lockstep_it_writes_and_receives, make_folder, remove_folder)
{
    static const char *const answers[] = {
        "\n< fdframe 120 1 2.500000 "
        "0000000000000000000000000000000000000000000000000000000000000000A08601000000000000000000"
        "0000000000000000000000000000000000000000 leg >",
        NULL, "open"};
    const struct hil_client_value step[] = {{"tick", 7.0}};
    struct hil_client_joint knee;
    struct hil_client client;
    int joint;

    open_client(&client, answers, false, LONG_MS);
    joint = hil_client_find_joint(&client, "Knee");
    assert_int_equal(hil_client_receive(&client, 0), HIL_CLIENT_OK);
    assert_int_equal(hil_client_receive(&client, 20), HIL_CLIENT_TIMEOUT);
    assert_int_equal(hil_client_send(&client, "arm", "STEP", step, 1), HIL_CLIENT_OK);
    assert_int_equal(hil_client_write(&client), HIL_CLIENT_OK);
    assert_int_equal(hil_client_receive(&client, 20000), HIL_CLIENT_OK);
    assert_int_equal(hil_client_read(&client, joint, &knee), HIL_CLIENT_OK);
    assert_float_equal(knee.motor_position_rad, 1.0, 1e-12);
    assert_int_equal(knee.time_ns, INT64_C(2500000000));

    /* A board that does not answer is named, and its motor counts as one that is not on */
    assert_int_equal(hil_client_find_tripped(&client, 0), -1);
    assert_int_equal(hil_client_enable(&client, NULL, 0, HIL_CLIENT_CURRENT), HIL_CLIENT_BOARD);
    assert_non_null(strstr(client.message, "L-Elb does not switch on: mode \"\""));
    assert_int_equal(hil_client_find_tripped(&client, -7), 0);
    assert_int_equal(hil_client_find_tripped(&client, 1), 1);
    assert_int_equal(hil_client_find_tripped(&client, 2), -1);
    assert_int_equal(hil_client_command(&client, joint, HIL_CLIENT_CURRENT, 3.0), HIL_CLIENT_OK);
    assert_int_equal(hil_client_write(&client), HIL_CLIENT_OK);
    assert_int_equal(hil_client_step(&client, 1), HIL_CLIENT_INPUT);
    close_client(&client);

    /* Slot 5, 3 A in mA */
    assert_non_null(strstr(gateway.heard, "< send 020 5 02 20 00 00 00 leg >"));
    assert_non_null(strstr(gateway.heard, "< send 041 8 00 00 b8 0b 00 00 00 00 leg >"));
}

TEST_WITH(a_run_that_sends_nothing_is_said_to_be_paused_or_in_lockstep, make_folder, remove_folder)
{
    static const char *const answers[] = {NULL, "open"};
    struct hil_client client;

    open_client(&client, answers, false, LONG_MS);
    assert_int_equal(hil_client_enable(&client, NULL, 0, HIL_CLIENT_CURRENT), HIL_CLIENT_BOARD);
    assert_string_equal(client.message,
                        "L-Elb does not switch on: no frame has come from any board: is the run "
                        "paused, or in lockstep (options.lockstep)?");
    close_client(&client);
}

TEST_WITH(messages_by_name_are_encoded_as_the_tables_say, make_folder, remove_folder)
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
        {"BO_ 1 A: 65 host\n", "r-leg.dbc:2: expected a line \"BO_ \""},
        {"BO_ 1 A: 8 host\nBO_ 1 B: 8 host\n", "r-leg.dbc:3: "},
        {" SG_ x : 0|8@1+ (1,0) [0|0] \"\" h\n", "r-leg.dbc:2: expected a line \" SG_ \""},
        {"BO_ 1 A: 8 host\n SG_ x : 60|8@1+ (1,0) [0|0] \"\" h\n", "r-leg.dbc:3: "},
        {"BO_ 1 A: 8 host\n SG_ x : 60|8@0+ (1,0) [0|0] \"\" h\n", "r-leg.dbc:3: "},
        {"BO_ 1 A: 8 host\n SG_ x : 0|8@1+ (0,0) [0|0] \"\" h\n", "r-leg.dbc:3: "},
        {"BO_ 1 A: 8 host\n SG_ x : 0|8@1+ (nan,0) [0|0] \"\" h\n", "r-leg.dbc:3: "},
        {"CM_ SG_ 1 x \"J\";\n", "r-leg.dbc:2: expected a line \"CM_ SG_ \""},
        {"VAL_ 1 x 1 \"a\" ;\n", "r-leg.dbc:2: "},
        {"CM_ BU_ b \"address 1, motors A\n", "r-leg.dbc:2: "},
    };
    const struct hil_client_options options = {.tables = folder, .timeout_ms = 1};
    struct hil_client client;
    char text[1024];

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        snprintf(text, sizeof text, "%sCM_ \"Rig r, bus leg on can1: protocol compact\";\n",
                 rows[i].text);
        write_table("r-leg.dbc", text);
        assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_TABLES);
        if (!strstr(client.message, rows[i].message)) {
            fail_msg("found \"%s\", expected \"%s\"", client.message, rows[i].message);
        }
        hil_client_close(&client);
    }
    write_table("r-leg.dbc", "BO_ 1 A: 8 host\n");
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_TABLES);
    assert_non_null(strstr(client.message, "found no CM_ \"Rig"));
    write_table("r-leg.dbc", "CM_ \"Rig other, bus leg on can1: protocol compact\";\n");
    assert_int_equal(hil_client_open(&client, &options), HIL_CLIENT_TABLES);
    assert_non_null(strstr(client.message, "rigs r and other"));
}

/* tables: what follows the port; "" = nothing. */
static void write_ready(const char *path, const char *clock, unsigned port, const char *tables)
{
    char text[128];
    FILE *file;

    snprintf(text, sizeof text, "%s.new", path);
    file = fopen(text, "w");
    assert_non_null(file);
    fprintf(file, "clock='%s'\ngateway_host='127.0.0.1'\ngateway_port='%u'\n%s", clock, port,
            tables);
    fclose(file);
    assert_int_equal(rename(text, path), 0);
}

/* Replaces the file of a run that was killed, a while after the client has found it. */
static void *start_late(void *path)
{
    usleep(30000);
    write_ready(path, "real", listen_at_any_port(), "");
    return serve(NULL);
}

TEST_WITH(the_file_of_a_killed_run_is_passed_over_and_another_clock_refused, make_folder,
          remove_folder)
{
    static const char *const answers[] = {NULL, "open"};
    char ready[128];
    struct hil_client_options options = {.tables = folder, .ready = ready, .timeout_ms = LONG_MS};
    struct hil_client client;

    snprintf(ready, sizeof ready, "%s/ready", folder);
    for (int i = 0; i < 2; i++) {
        options.lockstep = i == 1;
        gateway.answer = answers;
        gateway.heard[0] = '\0';
        write_ready(ready, "lockstep", 1, "");
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

/* Opens a client of r-arm.dbc by a file of --ready with such a line. */
static enum hil_client_code open_with_hashes(struct hil_client *client, const char *line)
{
    static const char *const answers[] = {NULL, "open"};
    char ready[128];
    struct hil_client_options options = {.tables = folder, .ready = ready, .timeout_ms = LONG_MS};
    enum hil_client_code code;

    snprintf(ready, sizeof ready, "%s/ready", folder);
    gateway.answer = answers;
    gateway.heard[0] = '\0';
    write_ready(ready, "real", listen_at_any_port(), line);
    assert_int_equal(pthread_create(&gateway.thread, NULL, serve, NULL), 0);
    code = hil_client_open(client, &options);
    close_client(client);
    return code;
}

TEST_WITH(tables_older_than_the_rig_of_the_run_are_refused, make_folder, remove_folder)
{
    /* FNV-1a of 64 bits, worked out apart from the client */
    static const char title[] = "CM_ \"Rig r, bus arm on can0: protocol icub, supply 48 V.\";\n";
    static const char hash[] = "1ceeecc88761adcc";
    char line[512], expected[256];
    struct hil_client client;

    write_table("r-arm.dbc", title);
    snprintf(line, sizeof line, "%s/r-leg.dbc", folder);
    assert_int_equal(unlink(line), 0);

    /* The same, and in the middle of those of a run with more buses than there are files */
    snprintf(line, sizeof line, "tables='arm=%s'\n", hash);
    assert_int_equal(open_with_hashes(&client, line), HIL_CLIENT_OK);
    snprintf(line, sizeof line, "tables='head=0123456789abcdef arm=%s leg=%s'\n", hash, hash);
    assert_int_equal(open_with_hashes(&client, line), HIL_CLIENT_OK);

    /* Another hash, and a bus that the run does not have */
    assert_int_equal(open_with_hashes(&client, "tables='arm=0123456789abcdef'\n"),
                     HIL_CLIENT_TABLES);
    snprintf(expected, sizeof expected,
             "%s/r-arm.dbc is older than the rig of the run, or of another rig: "
             "coman-hil dbc RIG -o %s writes it anew",
             folder, folder);
    assert_string_equal(client.message, expected);
    snprintf(line, sizeof line, "tables='leg=%s'\n", hash);
    assert_int_equal(open_with_hashes(&client, line), HIL_CLIENT_TABLES);
}

TEST_WITH(a_gateway_that_is_not_there_is_waited_for_no_longer_than_asked, make_folder,
          remove_folder)
{
    char ready[128];
    struct hil_client_options options = {.tables = folder, .ready = ready, .timeout_ms = 50};
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
    write_ready(ready, "real", 1, ""); /* of a run that was killed */
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
