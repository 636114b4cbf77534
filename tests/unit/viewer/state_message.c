/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The state that a client is sent, read by the table of docs/page.md: of a run that is over, with a
 * row of signals and boards that the test has made up, each value another.
 */
#include "viewer/private.h"

#include "base/array.h"
#include "rt/clock.h"
#include "rt/histogram.h"
#include "tests/test.h"

#include <sys/socket.h>
#include <unistd.h>

enum {
    TICKS = 400,
    TWISTS = 6,
    POSE = 7,
    LARGEST = 1 << 16,
    BODY = 28,
    JOINT = 8,
    CONTACT = 28,
    BUS = 24,
    BOARD = 12
};

/* What only the joint KNEE, the contacts FEET and the free body have a column for. */
static const char *const columns[] = {
    "time",        "q_other",     "torque_LKneeSag_nm", "fx_RFoot_n", "fy_RFoot_n", "fz_RFoot_n",
    "mx_RFoot_nm", "my_RFoot_nm", "mz_RFoot_nm",        "fx_LFoot_n", "fy_LFoot_n", "fz_LFoot_n",
    "mx_LFoot_nm", "my_LFoot_nm", "mz_LFoot_nm",        "crate_x_m",  "crate_y_m",  "crate_z_m",
    "crate_qw",    "crate_qx",    "crate_qy",           "crate_qz"};
enum { KNEE = 2, RIGHT = 3, LEFT = 9, CRATE = 15 };

static struct arena arena;
static struct rig rig;
static struct plant_free_body crate = {
    .name = "crate",
    .inertia = {.mass = 1.0, .I = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}},
    .position = {5.0, 0.0, 9.0},
    .quaternion = {1.0}};
static struct simulator *simulator;
static struct viewer *viewer;
static struct viewer_client *client;
static int far_end;

/* A row of signals is followed by values that are nobody's. */
static double row[UINT16_MAX + 8];
static struct board_state *board;
static uint8_t *state; /* the last one that came */

/* ---- the run, and a client ---- */

FIXTURE(open_run)
{
    static const char *const fault[] = {"supply sag 1 manual", "motor LElbj jam 0.1..",
                                        "supply sag 2 manual"};
    static struct simulator_config config;
    const struct rig *loaded;
    struct realtime_report report;
    struct error error;
    char notice[256];

    if (arena_init(&arena, (size_t)1 << 30, &error) ||
        rig_load(HIL_SOURCE_DIR "/config/rigs/coman.yaml", &arena, &loaded, &error)) {
        return -1;
    }
    rig = *loaded;
    rig.free = &crate;
    rig.nfree = 1;
    config = (struct simulator_config){.rig = &rig,
                                       .clock = LOOP_CLOCK_FREE,
                                       .hold = RIG_HOLD_ALWAYS,
                                       .transport = TRANSPORT_LOCAL,
                                       .task = "squat",
                                       .fault = fault,
                                       .nfault = ARRAY_COUNT(fault),
                                       .ticks = TICKS,
                                       .row_period_ns = rig.tick_ns};
    if (simulator_create(&config, &arena, &simulator, notice, &error) ||
        simulator_start(simulator, &report, &error)) {
        return -1;
    }
    simulator_run(simulator);
    simulator_end_views(simulator);
    return 0;
}

FIXTURE(close_run)
{
    simulator_destroy(simulator);
    arena_fini(&arena);
    return 0;
}

/* A viewer of the run, whose rows and boards are the test's, and a client that watches. */
FIXTURE(open_client)
{
    struct error error;
    int pair[2];

    viewer = calloc(1, sizeof *viewer);
    state = calloc(1, LARGEST);
    board = calloc(rig.boards.nboard, sizeof *board);
    if (!viewer || !state || !board || socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair) ||
        arena_init(&viewer->arena, (size_t)16 << 20, &error)) {
        return -1;
    }
    viewer->config.simulator = simulator;
    viewer->rig = &rig;
    viewer->signal = columns;
    viewer->nsignal = ARRAY_COUNT(columns);
    viewer->histogram = arena_alloc(&viewer->arena, 1, sizeof *viewer->histogram);
    viewer->now_ns = 1000 * CLOCK_SECOND;
    pthread_mutex_init(&viewer->events_lock, NULL);
    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        viewer->client[i] = (struct viewer_client){.socket = -1, .control = -1};
    }
    client = &viewer->client[0];
    client->socket = pair[0];
    client->mode = CLIENT_SOCKET;
    client->right = RIGHT_LOOK;
    client->outbox = malloc(VIEWER_OUTBOX);
    client->watch = (struct viewer_watch){.on = true, .period_ns = 100 * CLOCK_MS};
    far_end = pair[1];
    if (!client->outbox || viewer_create_state(viewer, &error)) {
        return -1;
    }
    for (size_t i = 0; i < ARRAY_COUNT(row); i++) {
        row[i] = i < ARRAY_COUNT(columns) ? 0.0 : 9.0;
    }
    viewer->view.signal = row;
    viewer->view.board = board;
    return 0;
}

FIXTURE(close_client)
{
    close(client->socket);
    close(far_end);
    free(client->outbox);
    pthread_mutex_destroy(&viewer->events_lock);
    arena_fini(&viewer->arena);
    free(viewer);
    free(state);
    free(board);
    return 0;
}

/* ---- reading a state ---- */

static size_t u16_at(size_t at)
{
    return get_u16_le(state + at);
}

static float f32_at(size_t at)
{
    uint32_t bits = get_u32_le(state + at);
    float value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

static void assert_f32(size_t at, double expected)
{
    if (f32_at(at) != (float)expected) {
        fail_msg("byte %zu: %g, not %g", at, (double)f32_at(at), expected);
    }
}

/* Where the parts begin: the counts of those before are in the header. */
static size_t part_at(size_t part)
{
    static const size_t size[] = {BODY, JOINT, CONTACT, BUS, BOARD};
    size_t at = 80;

    for (size_t i = 0; i < part; i++) {
        at += i < ARRAY_COUNT(size) ? size[i] * u16_at(64 + 2 * i) : (u16_at(74) + 31) / 32 * 4;
    }
    return at;
}

enum { OF_BODIES, OF_JOINTS, OF_CONTACTS, OF_BUSES, OF_BOARDS, OF_FAULTS, OF_SIGNALS };

/* Lets time pass and reads the state that comes; false when none does. */
static bool hear_state(int64_t later_ns)
{
    uint8_t header[4];
    size_t size;

    viewer->now_ns += later_ns;
    viewer_send_states(viewer);
    if (read(far_end, header, sizeof header) != sizeof header) {
        return false;
    }
    assert_int_equal(header[0], 0x82); /* a whole binary message, */
    assert_int_equal(header[1], 126);  /* with its size in the next two bytes */
    size = (size_t)header[2] << 8 | header[3];
    assert_int_equal(read(far_end, state, size), size);
    assert_int_equal(state[0], 1);
    assert_int_equal(state[1], VIEWER_PROTOCOL);
    assert_int_equal(part_at(OF_SIGNALS) + u16_at(76) * sizeof(float), size);
    return true;
}

/* ---- */

TEST_WITH(the_header_is_that_of_the_last_tick, open_client, close_client)
{
    const struct loop_stats *stats = simulator_stats(simulator);

    client->watch.skipped = 5;
    assert_true(hear_state(0));
    assert_int_equal(u16_at(2), 2); /* the base is held, nothing else */
    assert_int_equal(get_u32_le(state + 4), 5);
    assert_int_equal(get_u32_le(state + 8), TICKS);
    assert_int_equal(get_u32_le(state + 16), TICKS * rig.tick_ns);
    assert_int_equal(get_u32_le(state + 40), stats->overrun_total);
    assert_int_equal(get_u32_le(state + 44), stats->lost_ticks);
    assert_int_equal(u16_at(64), rig.robot->nbody + 1);
    assert_int_equal(u16_at(66), rig.robot->njoint);
    assert_int_equal(u16_at(68), 0);
    assert_int_equal(u16_at(70), rig.nbus);
    assert_int_equal(u16_at(72), rig.boards.nboard);
    assert_int_equal(u16_at(74), 3);
    assert_int_equal(u16_at(76), 0);
    viewer->ended = true;
    assert_true(hear_state(CLOCK_SECOND));
    assert_int_equal(u16_at(2), 2 + 4);
}

/* A body's origin is that of the joint which moves it, so as far from its parent's as at rest. */
TEST_WITH(bodies_hang_together_by_their_joints, open_client, close_client)
{
    const struct robot *robot = rig.robot;

    for (size_t k = 0; k < POSE; k++) {
        row[CRATE + k] = 10.0 + (double)k;
    }
    assert_true(hear_state(0));
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        size_t child = part_at(OF_BODIES) + (j + 1) * BODY;
        size_t parent = part_at(OF_BODIES) + (size_t)robot->body[j + 1].parent * BODY;
        double distance = 0.0, rest = 0.0, turn = 0.0;

        for (size_t k = 0; k < 3; k++) {
            double d = (double)f32_at(child + 4 * k) - (double)f32_at(parent + 4 * k);

            distance += d * d;
            rest += joint->origin[k] * joint->origin[k];
        }
        for (size_t k = 3; k < POSE; k++) {
            turn += (double)f32_at(child + 4 * k) * (double)f32_at(child + 4 * k);
        }
        assert_true(fabs(sqrt(distance) - sqrt(rest)) < 1e-6);
        assert_true(fabs(turn - 1.0) < 1e-6);
    }
    for (size_t k = 0; k < POSE; k++) {
        assert_f32(part_at(OF_BODIES) + robot->nbody * BODY + 4 * k, 10.0 + (double)k);
    }
}

/* A joint whose torque is no signal has none. */
TEST_WITH(joints_have_their_angle_and_their_torque, open_client, close_client)
{
    const struct plant_sensors *sensors = plant_sensors(simulator_plant(simulator));
    bool found = false;

    row[KNEE] = -12.5;
    assert_true(hear_state(0));
    for (size_t j = 0; j < rig.robot->njoint; j++) {
        size_t at = part_at(OF_JOINTS) + JOINT * j;
        bool knee = strcmp(rig.robot->joint[j].name, "LKneeSag") == 0;

        found = found || knee;
        assert_f32(at, sensors->motor[j].q);
        assert_f32(at + 4, knee ? -12.5 : 0.0);
    }
    assert_true(found);
}

TEST_WITH(contacts_are_those_that_touch, open_client, close_client)
{
    size_t at;

    for (size_t k = 0; k < TWISTS; k++) {
        row[LEFT + k] = 100.0 + (double)k;
    }
    row[RIGHT + 1] = 0.5e-3; /* less than what counts as touch, */
    row[RIGHT + 3] = 7.0;    /* whatever the moment */
    assert_true(hear_state(0));
    assert_int_equal(u16_at(68), 1);
    at = part_at(OF_CONTACTS);
    assert_string_equal(rig_contact_name(&rig, u16_at(at)), "LFoot");
    assert_int_equal(u16_at(at + 2), 0);
    for (size_t k = 0; k < TWISTS; k++) {
        assert_f32(at + 4 + 4 * k, 100.0 + (double)k);
    }
}

TEST_WITH(buses_have_their_counts_and_their_load, open_client, close_client)
{
    struct simulator_status status;

    assert_true(simulator_read(simulator, &status));
    assert_true(hear_state(0));
    for (size_t b = 0; b < rig.nbus; b++) {
        const struct bus_status *bus = &status.bus[b];
        size_t at = part_at(OF_BUSES) + BUS * b;

        assert_true(bus->bits > 0);
        assert_int_equal(get_u32_le(state + at), bus->rx_frames);
        assert_int_equal(get_u32_le(state + at + 4), bus->tx_frames);
        assert_int_equal(get_u32_le(state + at + 8), bus->rx_dropped);
        assert_int_equal(get_u32_le(state + at + 12), bus->tx_dropped);
        assert_f32(at + 16, (double)bus->bits / ((double)status.time_ns * 1e-9) /
                                (double)rig.bus[b].bitrate);
        assert_int_equal(get_u32_le(state + at + 20), CAN_PORT_UP);
    }
}

TEST_WITH(ticks_have_their_mean_their_percentile_and_their_greatest, open_client, close_client)
{
    const struct histogram *work = &simulator_stats(simulator)->work;

    assert_int_equal(work->count, TICKS);
    assert_true(work->max > 0);
    assert_true(hear_state(0));
    assert_f32(52, (double)work->sum / TICKS * 1e-3);
    assert_f32(56, (double)histogram_percentile(work, 0.99) * 1e-3);
    assert_f32(60, (double)work->max * 1e-3);
}

/* Loads are those of a quarter of a second of wall time or more: what has just been measured
 * stays. */
TEST_WITH(loads_are_measured_four_times_a_second, open_client, close_client)
{
    double load;
    size_t at;

    client->watch.period_ns = 1;
    assert_true(hear_state(0));
    at = part_at(OF_BUSES) + 16;
    load = (double)f32_at(at);
    viewer->measured_ns /= 2; /* as if the run had gone on for as long again, */
    viewer->measured_bits[0] = 0;
    assert_true(hear_state(250 * CLOCK_MS - 1));
    assert_f32(at, load);
    assert_true(hear_state(1)); /* with all bits in its second half */
    assert_f32(at, 2.0 * load);
}

TEST_WITH(boards_tell_how_they_are, open_client, close_client)
{
    static const struct {
        struct board_state is;
        unsigned bits;
        double age_s;
    } told[] = {
        {{.in_bootloader = true, .heard_ns = -1, .naxis = 1}, 1, -1.0},
        {{.away = true, .mode = {1, 2, 3, 4}, .naxis = 2}, 2, 0.4},
        {{.faulty = true, .heard_ns = 399 * CLOCK_MS}, 4, 0.001},
        {{.external = true, .heard_ns = 401 * CLOCK_MS}, 8, 0.0},
        {{.external = true, .silent = true, .heard_ns = 400 * CLOCK_MS}, 8 + 16, 0.0},
        {{.heard_ns = 400 * CLOCK_MS}, 0, 0.0},
    };

    assert_true(rig.boards.nboard >= ARRAY_COUNT(told));
    for (size_t i = 0; i < ARRAY_COUNT(told); i++) {
        board[i] = told[i].is;
        board[i].address = (uint8_t)(20 + i);
    }
    assert_true(hear_state(0));
    for (size_t i = 0; i < ARRAY_COUNT(told); i++) {
        size_t at = part_at(OF_BOARDS) + BOARD * i;

        assert_f32(at, told[i].age_s);
        assert_int_equal(state[at + 4], 20 + i);
        assert_int_equal(state[at + 5], told[i].bits);
        assert_int_equal(state[at + 6], told[i].is.naxis);
        assert_int_equal(state[at + 7], 0);
        for (size_t k = 0; k < 4; k++) {
            assert_int_equal(state[at + 8 + k], k < BOARD_AXES_MAX ? told[i].is.mode[k] : 0);
        }
    }
}

TEST_WITH(active_faults_have_their_bit, open_client, close_client)
{
    assert_true(hear_state(0));
    assert_int_equal(get_u32_le(state + part_at(OF_FAULTS)), 2);
}

TEST_WITH(chosen_signals_come_in_their_order, open_client, close_client)
{
    row[RIGHT] = 0.25;
    row[CRATE] = -3.0;
    client->watch.nsignal = 2;
    client->watch.signal[0] = CRATE;
    client->watch.signal[1] = RIGHT;
    assert_true(hear_state(0));
    assert_int_equal(u16_at(76), 2);
    assert_f32(part_at(OF_SIGNALS), -3.0);
    assert_f32(part_at(OF_SIGNALS) + 4, 0.25);
}

TEST_WITH(states_come_at_the_rate_that_was_asked_for, open_client, close_client)
{
    assert_true(hear_state(0));
    assert_false(hear_state(100 * CLOCK_MS - 1));
    assert_true(hear_state(1));
    assert_false(hear_state(0));
    client->watch.on = false;
    assert_false(hear_state(CLOCK_SECOND));
}

/* Who watches after nobody did waits for a view of now, but not for ever: a run that stands still
 * has no other than the one before. */
TEST_WITH(an_old_view_is_shown_when_no_other_comes, open_client, close_client)
{
    viewer->awaited = true;
    viewer->views_before = simulator_view_read(simulator, &viewer->view);
    viewer->awaited_till_ns = viewer->now_ns + 200 * CLOCK_MS;
    assert_false(hear_state(200 * CLOCK_MS));
    assert_true(hear_state(1));
    viewer->awaited = true;
    viewer->views_before--; /* one has been made since then */
    assert_true(hear_state(100 * CLOCK_MS));
}

TEST_GROUP(open_run, close_run)
