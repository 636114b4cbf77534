/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tasks that must notice what happens to them, by the sensors of the boards alone: a robot that is
 * pushed over while it squats or before, a box that is pulled out of the grip. What would be done
 * without the trouble is the control.
 */
#include "tasks/task.h"
#include "tests/unit/sim/robot_requests_scene.h"

struct trouble {
    struct witness w;
    int64_t at; /* tick of the push, 0 = none */
    bool on_box;
    double force_n[3];
    int64_t ticks;
    struct task_runner_status task;
    int64_t ended; /* tick */
};

static struct trouble trouble;

static void watch(void *context, int64_t time_ns)
{
    struct trouble *t = context;
    struct simulator *simulator = t->w.simulator;
    const struct rig *rig = simulator_configuration(simulator)->rig;
    int64_t tick = time_ns / t->w.tick_ns;
    struct request_answer answer;

    while (requests_answer(simulator_requests(simulator), &answer)) {
        assert_int_equal(answer.verdict, REQUEST_OK);
    }
    if (t->at > 0 && tick == t->at) {
        struct loop_request request = {.kind = REQUEST_PUSH,
                                       .index = t->on_box ? rig->robot->nbody : 0,
                                       .duration_ns = t->ticks * t->w.tick_ns};

        memcpy(request.force_n, t->force_n, sizeof request.force_n);
        assert_true(requests_ask(simulator_requests(simulator), &request));
    }
    task_runner_read(simulator_task_runner(simulator), &t->task);
    if (t->task.status != TASK_RUNNING && t->ended == 0) {
        t->ended = tick;
        simulator_stop(simulator);
    }
}

static void perform(const struct scene *scene, uint64_t ticks)
{
    const struct simulator_observer observer = {&trouble, watch};
    struct trouble wanted = trouble;
    struct arena arena;
    struct rig rig;

    open_scene(scene, &trouble.w, &arena, &rig, &observer, ticks, true);
    trouble.at = wanted.at;
    simulator_run(trouble.w.simulator);
    print_message("# tick %d: %d %s\n", (int)trouble.ended, (int)trouble.task.status,
                  trouble.task.message);
    close_scene(&trouble.w, &arena);
}

static void squat_with(int64_t at, double x, double y, int64_t ticks)
{
    const struct scene scene = {.rig = "coman", .task = "squat", .clock = LOOP_CLOCK_FREE};

    memset(&trouble, 0, sizeof trouble);
    trouble.at = at;
    trouble.force_n[0] = x;
    trouble.force_n[1] = y;
    trouble.ticks = ticks;
    perform(&scene, 25000);
}

/* The task has failed soon after the push, for this reason. */
static void expect_failure(int64_t soon, const char *reason)
{
    assert_int_equal(trouble.task.status, TASK_FAILED);
    assert_in_range(trouble.ended, trouble.at, trouble.at + soon);
    if (!strstr(trouble.task.message, reason)) {
        fail_msg("\"%s\" does not say \"%s\"", trouble.task.message, reason);
    }
}

/* Forward it lands on its hands; otherwise its waist fights the push first. */
TEST(a_squat_notices_a_fall)
{
    squat_with(6000, 200, 0, 300);
    expect_failure(1000, "the robot fell: the feet carry");
    squat_with(6000, -200, 0, 300);
    expect_failure(1000, "over-current");
    squat_with(6000, 0, 200, 300);
    expect_failure(1000, "over-current");
}

/* It lies there when it is to be weighed, at 2 s. */
TEST(a_squat_notices_a_fall_before_it_begins)
{
    squat_with(600, 140, 0, 300);
    expect_failure(2000, "the robot fell: the feet carry");
}

static void grasp_with(int64_t at, double x, double y, int64_t ticks)
{
    const struct scene scene = {.rig = "grasp", .task = "grasp", .clock = LOOP_CLOCK_FREE};

    memset(&trouble, 0, sizeof trouble);
    trouble.at = at;
    trouble.on_box = true;
    trouble.force_n[0] = x;
    trouble.force_n[1] = y;
    trouble.ticks = ticks;
    perform(&scene, 5000);
}

TEST(a_grasp_notices_a_lost_grip)
{
    const char *worst;

    grasp_with(0, 0, 0, 0);
    assert_int_equal(trouble.task.status, TASK_DONE);
    worst = strstr(trouble.task.message, "worst motor error ");
    assert_non_null(worst); /* it has moved, and never strayed */
    assert_in_range(strtol(worst + strlen("worst motor error "), NULL, 10), 5, 50);
    grasp_with(2700, 0, 60, 100); /* to the left: the right wrist loses touch */
    expect_failure(200, "the grip is lost: the wrists press with");
    grasp_with(2200, 100, 0, 200); /* pulled out forward while it is lifted */
    expect_failure(400, "the grip is lost: the wrists press with");
}
