/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A walk is led while it goes: start, speed, heading, time and length of a step, stop and start
 * again, through the requests that the control socket makes, against where the plant's pelvis is.
 */
#include "base/array.h"
#include "sim/simulator.h"
#include "tests/test.h"
#include "tests/tunables.h"

enum { PELVIS = 0, MOMENTS = 8 };

struct order {
    int64_t tick;
    const char *name; /* NULL: back to the start */
    double value;
};

struct lead {
    enum loop_clock clock;
    const char *setting[4];
    const struct order *order; /* of the ticks in which they are asked, in their order */
    size_t norder;
    int64_t look[MOMENTS]; /* ticks at which the pelvis is noted */
    int64_t seconds;

    struct simulator *simulator;
    size_t asked, answered, looked;
    enum request_verdict verdict[16];
    double x[MOMENTS], y[MOMENTS], yaw[MOMENTS];
    uint64_t hash;
    struct task_runner_status status;
};

static double value_of(const struct lead *lead, const char *name)
{
    const struct requests *requests = simulator_requests(lead->simulator);
    int index = requests_find(requests, name);

    assert_true(index >= 0);
    return requests_value(requests, (size_t)index);
}

static void lead_on(void *context, int64_t now_ns)
{
    struct lead *lead = context;
    struct requests *requests = simulator_requests(lead->simulator);
    const struct body_motion *pelvis = plant_motion(simulator_plant(lead->simulator));
    int64_t tick = now_ns / 1000000;
    struct request_answer answer;

    while (requests_answer(requests, &answer)) {
        lead->verdict[lead->answered++] = answer.verdict;
    }
    while (lead->asked < lead->norder && lead->order[lead->asked].tick <= tick) {
        const struct order *order = &lead->order[lead->asked++];
        struct loop_request request = {.kind = REQUEST_RESET};

        if (order->name) {
            int index = requests_find(requests, order->name);

            assert_true(index >= 0);
            request = (struct loop_request){
                .kind = REQUEST_SET, .index = (size_t)index, .value = order->value};
        }
        assert_true(requests_ask(requests, &request));
    }
    if (lead->looked < MOMENTS && lead->look[lead->looked] == tick) {
        lead->x[lead->looked] = pelvis->p[0];
        lead->y[lead->looked] = pelvis->p[1];
        lead->yaw[lead->looked++] = atan2(pelvis->R[3], pelvis->R[0]);
    }
}

static enum error_code try_to_open(struct lead *lead, const char *task, struct arena *arena,
                                   struct simulator_observer *observer, struct error *error)
{
    struct simulator_config config = {
        .clock = lead->clock,
        .transport = TRANSPORT_LOCAL,
        .ticks = (uint64_t)lead->seconds * 1000,
        .task = task,
        .setting = lead->setting,
        .observer = observer,
        .requests = true,
    };
    char notice[256];

    while (config.nsetting < ARRAY_COUNT(lead->setting) && lead->setting[config.nsetting]) {
        config.nsetting++;
    }
    assert_ok(arena_init(arena, (size_t)1 << 29, error));
    assert_ok(rig_load(HIL_SOURCE_DIR "/config/rigs/walk-flat.yaml", arena, &config.rig, error));
    config.hold = config.rig->hold;
    return simulator_create(&config, arena, &lead->simulator, notice, error);
}

static void perform(struct lead *lead)
{
    struct simulator_observer observer = {lead, lead_on};
    struct realtime_report report;
    struct arena arena CLOSED_BY(arena_fini);
    struct error error;

    assert_ok(try_to_open(lead, "walk", &arena, &observer, &error));
    assert_ok(simulator_start(lead->simulator, &report, &error));
    simulator_run(lead->simulator);
    task_runner_read(simulator_task_runner(lead->simulator), &lead->status);
    lead->hash = plant_hash(simulator_plant(lead->simulator));
    simulator_destroy(lead->simulator);
}

/* ---- a walk that is led ---- */

static const struct order tour[] = {
    {4000, "walk.on", 1},         {10000, "walk.forward_m_s", 0.2},
    {12000, "walk.step_s", 0.65}, {12000, "walk.heading_rad", 0.8},
    {21000, "walk.on", 0},        {25000, "walk.on", 1},
    {25000, "walk.step_s", 0.75}, {25000, "walk.step_length_m", -0.075},
};

TEST(a_walk_does_what_it_is_told)
{
    struct lead lead = {.clock = LOOP_CLOCK_LOCKSTEP,
                        .setting = {"walk.on=0", "walk.forward_m_s=0.1"},
                        .order = tour,
                        .norder = ARRAY_COUNT(tour),
                        .look = {4000, 8000, 10000, 20000, 24000, 25000, 33000},
                        .seconds = 34};
    double along;

    perform(&lead);
    assert_int_equal(lead.answered, lead.norder);
    for (size_t i = 0; i < lead.norder; i++) {
        assert_int_equal(lead.verdict[i], REQUEST_OK);
    }
    print_message("# %s\n", lead.status.message);
    for (size_t i = 0; i < lead.looked; i++) {
        print_message("# %zu: %.3f %.3f m, %.3f rad\n", i, lead.x[i], lead.y[i], lead.yaw[i]);
    }
    assert_int_equal(lead.status.status, TASK_RUNNING);

    /* It stands until it is told, walks at 0.1 m/s, then turns to the heading and keeps it */
    assert_true(fabs(lead.x[0]) < 0.05);
    assert_true(lead.x[1] - lead.x[0] > 0.05);
    assert_true(fabs(lead.x[2] - lead.x[1] - 0.2) < 0.08);
    assert_true(fabs(lead.yaw[2]) < 0.1);
    assert_true(fabs(lead.yaw[3] - 0.8) < 0.1);

    /* Stops within three steps, stands still, and walks backward along its heading: eight seconds
     * at 0.1 m/s, less the beginning */
    assert_true(hypot(lead.x[5] - lead.x[4], lead.y[5] - lead.y[4]) < 0.002);
    along = (lead.x[6] - lead.x[5]) * cos(0.8) + (lead.y[6] - lead.y[5]) * sin(0.8);
    assert_true(along < -0.3 && along > -0.8);
    assert_true(fabs(lead.yaw[6] - 0.8) < 0.15);
}

TEST(orders_take_effect_at_the_same_tick_every_time)
{
    static const struct order order[] = {{3000, "walk.on", 1}, {5000, "walk.turn_rad_s", 0.2}};
    struct lead lead[3];

    for (size_t i = 0; i < ARRAY_COUNT(lead); i++) {
        lead[i] = (struct lead){.clock = LOOP_CLOCK_LOCKSTEP,
                                .setting = {"walk.on=0"},
                                .order = order,
                                .norder = i < 2 ? 2 : 1,
                                .seconds = 9};
        perform(&lead[i]);
    }
    assert_true(lead[0].hash == lead[1].hash);
    assert_true(lead[0].hash != lead[2].hash);
}

/* ---- settings ---- */

static const struct order back[] = {
    {20, "walk.forward_m_s", 0.2},
    {20, "walk.step_s", 0.8},
    {40, "walk.step_length_m", 0.1},
    {60, "walk.forward_m_s", 0.6},
    {60, "walk.on", 0.5},
    {60, "walk.step_s", NAN},
    {80, NULL, 0},
};

static void note_settings(void *context, int64_t now_ns)
{
    struct lead *lead = context;

    /* Until time goes back, and thereafter */
    if (lead->answered < lead->norder) {
        lead_on(context, now_ns);
    }
    if (lead->answered == 2) {
        lead->x[0] = value_of(lead, "walk.step_length_m");
    } else if (lead->answered == 6) {
        lead->x[1] = value_of(lead, "walk.forward_m_s");
    } else if (lead->answered == 7) {
        lead->x[2] = value_of(lead, "walk.forward_m_s");
        lead->x[3] = value_of(lead, "walk.step_s");
    }
}

TEST(settings_are_checked_and_go_back_with_time)
{
    struct lead lead = {.clock = LOOP_CLOCK_FREE,
                        .order = back,
                        .norder = ARRAY_COUNT(back),
                        .look = {-1},
                        .seconds = 1};
    struct simulator_observer observer = {&lead, note_settings};
    struct realtime_report report;
    struct arena arena CLOSED_BY(arena_fini);
    struct error error;

    assert_ok(try_to_open(&lead, "walk", &arena, &observer, &error));
    assert_ok(simulator_start(lead.simulator, &report, &error));
    simulator_run(lead.simulator);
    for (size_t i = 0; i < lead.norder; i++) {
        assert_int_equal(lead.verdict[i], i >= 3 && i < 6 ? REQUEST_RANGE : REQUEST_OK);
    }
    assert_true(fabs(lead.x[0] - 0.16) < 1e-12);
    assert_true(fabs(lead.x[1] - 0.125) < 1e-12);
    assert_true(fabs(lead.x[2] - 0.15) < 1e-12);
    assert_true(fabs(lead.x[3] - 0.45) < 1e-12);
    simulator_destroy(lead.simulator);
}

TEST(wrong_settings_are_refused_by_name)
{
    static const struct {
        const char *task, *setting, *says;
    } wrong[] = {
        {"walk", "walk.forward=0", "walk.forward_m_s"},
        {"walk", "walk.forward_m_s", "NAME=VALUE"},
        {"walk", "walk.forward_m_s=fast", "expected -0.44"},
        {"walk", "walk.forward_m_s=1", "0.555556 m/s"},
        {"walk", "walk.on=0.5", "a whole number"},
        {"stand", "walk.on=1", "has none"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        struct lead lead = {.clock = LOOP_CLOCK_FREE, .setting = {wrong[i].setting}, .seconds = 1};
        struct arena arena CLOSED_BY(arena_fini);
        struct error error;

        if (try_to_open(&lead, wrong[i].task, &arena, NULL, &error) != ERROR_INPUT) {
            fail_msg("%s is taken", wrong[i].setting);
        }
        if (!strstr(error.text, wrong[i].says)) {
            fail_msg("%s: %s", wrong[i].setting, error.text);
        }
    }
}
