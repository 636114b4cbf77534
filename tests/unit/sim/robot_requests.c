/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is asked of a whole robot happens to it: pushes by their momentum, faults, parameters that
 * host and requests see alike; and to take requests changes nothing by itself.
 */
#include "boards/icub/protocol.h"
#include "tests/tunables.h"
#include "tests/unit/sim/robot_requests_scene.h"

#include <unistd.h>

/* A script: what happens before each tick. */
struct play {
    struct witness w;
    void (*act)(struct play *play, int64_t tick);
    double number[8];
    uint64_t count;
    struct request_answer answer[16];
    size_t answers;
};

static struct play play;

static void turn(void *context, int64_t time_ns)
{
    struct requests *requests = simulator_requests(play.w.simulator);

    (void)context;
    while (requests && play.answers < 16 && requests_answer(requests, &play.answer[play.answers])) {
        play.answers++;
    }
    play.act(&play, time_ns / play.w.tick_ns);
}

static void perform(const struct scene *scene, uint64_t ticks, bool asked,
                    void (*act)(struct play *play, int64_t tick))
{
    const struct simulator_observer observer = {&play, turn};
    struct arena arena;
    struct rig rig;

    memset(&play, 0, sizeof play);
    play.act = act;
    open_scene(scene, &play.w, &arena, &rig, &observer, ticks, asked);
    play.act = act;
    simulator_run(play.w.simulator);
    turn(&play, (int64_t)ticks * rig.tick_ns);
    close_scene(&play.w, &arena);
}

static void expect(size_t index, enum request_verdict verdict)
{
    assert_true(index < play.answers);
    assert_string_equal(request_verdict_text(play.answer[index].verdict),
                        request_verdict_text(verdict));
}

/* ---- nothing asked, nothing changed ---- */

static void note_all(struct play *p, int64_t tick)
{
    if (tick > (int64_t)p->count) {
        note(&p->w, &p->w.first[p->count]);
        p->number[0] += (double)p->w.first[p->count].count;
        p->count++;
    }
}

TEST(a_run_without_requests_is_the_same_bit_for_bit)
{
    enum { TICKS = 250 };
    static const struct scene scenes[] = {
        {.rig = "coman", .task = "squat", .clock = LOOP_CLOCK_FREE},
        {.rig = "coman-sensors",
         .task = "squat",
         .clock = LOOP_CLOCK_LOCKSTEP,
         .timed = true,
         .fault = {"bus left_leg error_burst 0.02", "bus right_arm late 0.0023"}},
    };
    static struct pass plain[TICKS];

    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; i++) {
        perform(&scenes[i], TICKS, false, note_all);
        memcpy(plain, play.w.first, sizeof plain);
        perform(&scenes[i], TICKS, true, note_all);
        assert_memory_equal(plain, play.w.first, sizeof plain);
        assert_int_equal(play.count, TICKS);
        assert_true(play.number[0] > TICKS); /* frames */
    }
}

/* ---- pushes ---- */

static void ask_push(size_t body, double x, double y, int64_t duration_ns)
{
    struct loop_request request = {
        .kind = REQUEST_PUSH, .index = body, .force_n = {x, y, 0.0}, .duration_ns = duration_ns};

    assert_true(requests_ask(simulator_requests(play.w.simulator), &request));
}

static void push_two(struct play *p, int64_t tick)
{
    const struct rig *rig = simulator_configuration(p->w.simulator)->rig;
    double position[3], momentum[3];

    plant_center_of_mass(simulator_plant(p->w.simulator), position, momentum);
    if (tick == 5) {
        p->number[0] = momentum[0];
        p->number[1] = momentum[1];
        ask_push(0, 50.0, 0.0, 20000000);
        ask_push(rig->robot->nbody - 1, 0.0, -20.0, 4500000); /* ends with the fifth tick */
        ask_push(rig->robot->nbody + rig->nfree, 1.0, 0.0, 0);
        ask_push(0, NAN, 0.0, 0);
        ask_push(0, 1.0, 0.0, -1);
    }
    if (tick == 60) {
        p->number[2] = momentum[0] - p->number[0];
        p->number[3] = momentum[1] - p->number[1];
    }
}

TEST(pushes_give_their_momentum_and_end_in_virtual_time)
{
    const struct scene scene = {
        .rig = "coman", .clock = LOOP_CLOCK_FREE, .no_contact = true, .falls = true};

    perform(&scene, 60, true, push_two);
    expect(0, REQUEST_OK);
    expect(1, REQUEST_OK);
    expect(2, REQUEST_RANGE);
    expect(3, REQUEST_RANGE);
    expect(4, REQUEST_RANGE);
    assert_true(fabs(play.number[2] - 50.0 * 0.020) < 1e-3);
    assert_true(fabs(play.number[3] + 20.0 * 0.005) < 1e-3);
}

static void push_askew(struct play *p, int64_t tick)
{
    char text[256];
    uint64_t key;

    if (tick == 5) {
        struct loop_request request = {
            .kind = REQUEST_PUSH, .index = 0, .force_n = {3.0, -4.0, 12.0}, .duration_ns = 1000000};

        assert_true(requests_ask(simulator_requests(p->w.simulator), &request));
    }
    while (tick == 8 && simulator_next_event(p->w.simulator, &key, text, sizeof text)) {
        p->count += strstr(text, "body Waist pushed with 13.0 N") != NULL;
    }
}

/* A push for half a second that is renewed at each tick, and let go. */
static void push_as_a_hand_does(struct play *p, int64_t tick)
{
    char text[256];
    uint64_t key;

    if (tick >= 5 && tick <= 55) {
        struct loop_request request = {.kind = REQUEST_PUSH,
                                       .index = 0,
                                       .force_n = {tick < 55 ? (double)tick - 4.0 : 0.0},
                                       .duration_ns = 500000000};

        assert_true(requests_ask(simulator_requests(p->w.simulator), &request));
    }
    while (tick == 60 && simulator_next_event(p->w.simulator, &key, text, sizeof text)) {
        p->count += strstr(text, "body Waist pushed with") != NULL;
        p->count += strstr(text, "body Waist pushed with 1.0 N") ? 100 : 0;
        p->count += strstr(text, "body Waist pushed with 11.0 N") ? 1000 : 0;
        p->count += strstr(text, "body Waist let go, pushed with 50.0 N at most") ? 10000 : 0;
    }
}

TEST(a_push_that_goes_on_is_told_once_and_at_its_end)
{
    const struct scene scene = {
        .rig = "coman", .clock = LOOP_CLOCK_FREE, .no_contact = true, .falls = true};

    perform(&scene, 62, true, push_as_a_hand_does);
    assert_int_equal(play.count, 11102);
}

TEST(the_log_tells_how_hard_a_push_is)
{
    const struct scene scene = {
        .rig = "coman", .clock = LOOP_CLOCK_FREE, .no_contact = true, .falls = true};

    perform(&scene, 10, true, push_askew); /* 3, 4 and 12 N are 13 N */
    assert_int_equal(play.count, 1);
}

/* ---- faults ---- */

static void sag(struct play *p, int64_t tick)
{
    double supply = simulator_measured(p->w.simulator)->supply_v;

    if (tick == 5 || tick == 10) {
        struct loop_request request = {.kind = REQUEST_FAULT, .index = 0, .on = tick == 5};

        p->number[0] = supply;
        assert_true(requests_ask(simulator_requests(p->w.simulator), &request));
    }
    if (tick == 7) {
        p->number[1] = supply; /* the request was carried out before tick 6 */
    } else if (tick == 12) {
        p->number[2] = supply;
    }
}

TEST(a_fault_counts_for_the_tick_that_comes)
{
    const struct scene scene = {.rig = "coman",
                                .clock = LOOP_CLOCK_FREE,
                                .no_contact = true,
                                .fault = {"supply sag 10 manual"}};

    perform(&scene, 20, true, sag);
    expect(0, REQUEST_OK);
    expect(1, REQUEST_OK);
    assert_true(fabs(play.number[1] - (play.number[2] - 10.0)) < 1e-9);
    assert_true(fabs(play.number[0] - play.number[1]) < 1e-9); /* at tick 10 it was still there */
}

/* ---- tunables ---- */

static void ask_set(const char *name, double value)
{
    struct requests *requests = simulator_requests(play.w.simulator);
    int index = requests_find(requests, name);
    struct loop_request request = {.kind = REQUEST_SET, .index = (size_t)index, .value = value};

    if (index < 0) {
        fail_msg("there is no %s", name);
    }
    assert_true(requests_ask(requests, &request));
}

static double value_of(const char *name)
{
    struct requests *requests = simulator_requests(play.w.simulator);

    assert_true(requests_find(requests, name) >= 0);
    return requests_value(requests, (size_t)requests_find(requests, name));
}

/* The board and axis that drive a joint */
static const struct board_config *board_of(const char *joint, unsigned *axis)
{
    const struct rig *rig = simulator_configuration(play.w.simulator)->rig;

    for (size_t b = 0; b < rig->boards.nboard; b++) {
        const struct board_config *board = &rig->boards.board[b];

        for (*axis = 0; board->kind == BOARD_MOTOR && *axis < 2; (*axis)++) {
            int j = board->axis[*axis].joint;

            if (j >= 0 && strcmp(rig->robot->joint[j].name, joint) == 0) {
                return board;
            }
        }
    }
    fail_msg("no board drives %s", joint);
    return NULL;
}

static void tell_board(const char *joint, uint8_t code, int16_t value, uint8_t len)
{
    unsigned axis;
    const struct board_config *board = board_of(joint, &axis);
    uint8_t data[3] = {(uint8_t)(code | (axis ? ICUB_AXIS_BIT : 0)), (uint8_t)value,
                       (uint8_t)(value >> 8)};
    struct bus_frame frame = frame_make(icub_id(ICUB_POLLING_MOTOR, 0, board->address), len, data);

    assert_int_equal(can_send(play.w.ports.port[board->bus], &frame, 1), 1);
}

/* The value in the board's answer, NAN when there is none */
static double told(const char *joint, uint8_t code)
{
    unsigned axis;
    const struct board_config *board = board_of(joint, &axis);
    struct bus_frame frame;
    double value = NAN;

    while (can_receive(play.w.ports.port[board->bus], &frame, 1)) {
        if (frame.len == 3 && (frame.data[0] & ~(unsigned)ICUB_AXIS_BIT) == code &&
            frame.id == icub_id(ICUB_POLLING_MOTOR, board->address, 0)) {
            value = (int16_t)(frame.data[1] | frame.data[2] << 8);
        }
    }
    return value;
}

static void tune(struct play *p, int64_t tick)
{
    struct loop_request checkpoint = {.kind = REQUEST_CHECKPOINT, .index = 1};
    struct loop_request restore = {.kind = REQUEST_RESTORE, .index = 1};

    switch (++p->count) {
    case 3:
        tell_board("RKneeSag", ICUB_SET_P_GAIN, 321, 3);
        break;
    case 5:
        p->number[0] = value_of("joint.RKneeSag.position_kp");
        assert_true(requests_ask(simulator_requests(p->w.simulator), &checkpoint));
        ask_set("joint.RKneeSag.position_kp", -77.0);
        ask_set("joint.RKneeSag.position_kp", 40000.0); /* no int16 */
        ask_set("joint.RKneeSag.position_kp", 1.5);
        ask_set("supply_v", 40.0);
        ask_set("sensing.noise_scale", 0.0);
        break;
    case 7:
        p->number[1] = value_of("joint.RKneeSag.position_kp");
        p->number[2] = value_of("supply_v");
        p->number[3] = simulator_measured(p->w.simulator)->supply_v;
        p->number[4] = value_of("sensing.noise_scale");
        told("RKneeSag", ICUB_GET_P_GAIN);
        tell_board("RKneeSag", ICUB_GET_P_GAIN, 0, 1);
        break;
    case 9:
        p->number[5] = told("RKneeSag", ICUB_GET_P_GAIN);
        assert_true(requests_ask(simulator_requests(p->w.simulator), &restore));
        break;
    case 11:
        p->number[6] = value_of("joint.RKneeSag.position_kp");
        p->number[7] = value_of("supply_v");
        break;
    default:
        break;
    }
    (void)tick;
}

TEST(host_and_requests_see_the_same_parameters)
{
    const struct scene scene = {
        .rig = "coman-sensors", .clock = LOOP_CLOCK_FREE, .no_contact = true};

    perform(&scene, 20, true, tune);
    expect(0, REQUEST_OK);
    expect(1, REQUEST_OK);
    expect(2, REQUEST_RANGE);
    expect(3, REQUEST_RANGE);
    expect(4, REQUEST_OK);
    expect(5, REQUEST_OK);
    expect(6, REQUEST_OK);
    assert_true(play.number[0] == 321.0);
    assert_true(play.number[1] == -77.0);
    assert_true(play.number[2] == 40.0);
    assert_true(fabs(play.number[3] - 40.0) < 0.5);
    assert_true(play.number[4] == 0.0);
    assert_true(play.number[5] == -77.0);
    assert_true(play.number[6] == 321.0);
    assert_true(play.number[7] == 48.0);
}

/* A winch of 0.1 m/s that is told 0.02 m. */
static void tighten(struct play *p, int64_t tick)
{
    const struct rig *rig = simulator_configuration(p->w.simulator)->rig;
    const struct plant_command *command = plant_command(simulator_plant(p->w.simulator));
    size_t j = 0;

    while (!rig->robot->joint[j].spring.enabled) {
        j++;
        assert_true(j < rig->robot->njoint);
    }
    p->number[tick == 110 ? 0 : tick == 400 ? 1 : 2] = command->motor[j].pretension_m;
    if (tick == 9) {
        char name[128];

        snprintf(name, sizeof name, "joint.%s.pretension_m", rig->robot->joint[j].name);
        ask_set(name, 0.02);
    }
}

TEST(a_winch_takes_its_time)
{
    const struct scene scene = {
        .rig = "coman", .clock = LOOP_CLOCK_FREE, .no_contact = true, .springs = true};

    perform(&scene, 401, true, tighten);
    expect(0, REQUEST_OK);
    assert_true(fabs(play.number[0] - 0.1 * 0.100) < 1e-9); /* ticks 10 to 109 */
    assert_true(play.number[1] == 0.02);
}

/* Every tunable takes its own value and both its ends */
static void try_all(struct play *p, int64_t tick)
{
    const struct requests *requests = simulator_requests(p->w.simulator);
    size_t count = requests_tunables(requests), index = p->count / 2;

    (void)tick;
    if (p->count >= 2 * count) {
        return;
    }
    for (size_t i = 0; i < p->answers; i++) {
        assert_int_equal(p->answer[i].verdict, REQUEST_OK);
    }
    p->answers = 0;
    if (p->count % 2 == 0) {
        const struct tunable *tunable = requests_tunable(requests, index);
        double was = requests_value(requests, index);
        const double value[] = {tunable->min, tunable->max, was};

        assert_true(tunable->min <= was && was <= tunable->max);
        assert_int_equal(requests_find(requests, tunable->name), (int)index);
        p->number[0] = was;
        for (int i = 0; i < 3; i++) {
            struct loop_request request = {.kind = REQUEST_SET, .index = index, .value = value[i]};

            assert_true(requests_ask(simulator_requests(p->w.simulator), &request));
        }
    } else {
        assert_true(requests_value(requests, index) == p->number[0]);
    }
    p->count++;
}

TEST(every_tunable_takes_what_its_range_says)
{
    static const struct scene scenes[] = {
        {.rig = "coman", .clock = LOOP_CLOCK_FREE, .no_contact = true},
        {.rig = "coman-foc", .clock = LOOP_CLOCK_FREE, .no_contact = true},
        {.rig = "walkman", .clock = LOOP_CLOCK_FREE, .no_contact = true},
    };

    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; i++) {
        perform(&scenes[i], 2200, true, try_all);
        assert_true(play.count > 100);
        print_message("%s: %d tunables\n", scenes[i].rig, (int)play.count / 2);
    }
}

/* ---- what cannot be ---- */

static void go_back_early(struct play *p, int64_t tick)
{
    if (tick == 2) {
        ask(&p->w, REQUEST_CHECKPOINT, 1);
        ask(&p->w, REQUEST_RESTORE, 1);
        ask(&p->w, REQUEST_RESET, 0);
    }
}

TEST(there_is_no_way_back_while_it_is_recorded)
{
    char directory[] = "/tmp/requests-XXXXXX", file[64];
    const struct scene scene = {
        .rig = "coman", .clock = LOOP_CLOCK_FREE, .no_contact = true, .record = directory};

    assert_non_null(mkdtemp(directory));
    perform(&scene, 10, true, go_back_early);
    expect(0, REQUEST_OK);
    expect(1, REQUEST_RECORDING);
    expect(2, REQUEST_RECORDING);
    snprintf(file, sizeof file, "%s/candump.log", directory);
    unlink(file);
    snprintf(file, sizeof file, "%s/signals.csv", directory);
    unlink(file);
    rmdir(directory);
}

/* A task in a thread of its own: it has its own past, and needs a pace. */
TEST(a_task_beside_the_loop_cannot_go_back)
{
    const struct scene scene = {
        .rig = "coman", .task = "squat", .clock = LOOP_CLOCK_REAL, .no_contact = true};
    static const enum request_kind kinds[] = {REQUEST_CHECKPOINT, REQUEST_RESTORE, REQUEST_RESET,
                                              REQUEST_SPEED};
    struct loop_request request = {.kind = REQUEST_SPEED, .value = 1000.0};
    struct request_answer answer;
    struct witness w;
    struct arena arena;
    struct rig rig;

    open_scene(&scene, &w, &arena, &rig, NULL, 5, true);
    for (int i = 0; i < 4; i++) {
        ask(&w, kinds[i], 1);
    }
    assert_true(requests_ask(simulator_requests(w.simulator), &request));
    simulator_run(w.simulator);
    for (int i = 0; i < 5; i++) {
        assert_true(requests_answer(simulator_requests(w.simulator), &answer));
        assert_int_equal(answer.verdict, i < 3    ? REQUEST_UNAVAILABLE
                                         : i == 3 ? REQUEST_CLOCK
                                                  : REQUEST_OK);
    }
    close_scene(&w, &arena);
}
