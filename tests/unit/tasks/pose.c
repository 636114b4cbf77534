/* SPDX-License-Identifier: Apache-2.0 */
/* The settings of the task pose, and the references that it gives the servo; without boards. */

#include "tasks/task.h"
#include "tasks/task_private.h"
#include "tests/test.h"

enum { AXES = 2 };

static const struct host_axis axes[AXES] = {
    {.joint = "Knee",
     .address = 1,
     .joint_ticks_per_rad = 1e4,
     .motor_ticks_per_rad = 1e4,
     .torque_address = -1,
     .lower_rad = -0.1,
     .upper_rad = 1.5},
    {.joint = "Hip",
     .address = 2,
     .joint_ticks_per_rad = 1e4,
     .motor_ticks_per_rad = 1e4,
     .torque_address = -1,
     .lower_rad = -1,
     .upper_rad = 0.2},
};
static const double initial[AXES] = {0.5, 0.3}; /* the second one beyond its range */
static const struct servo_gains gains[AXES];
static struct arena arena;
static struct local_bus *bus;
static struct can_port *port;
static struct task *task;

FIXTURE(set_up)
{
    const struct local_bus_config local = {.name = "can0", .max_nodes = 2, .inbox = 64};
    struct task_config config = {
        .host = {.nbus = 1,
                 .port = &port,
                 .naxis = AXES,
                 .axis = axes,
                 .supply_v = 48,
                 .period_ns = 1000000},
        .initial_rad = initial,
        .servo = {.gains = gains, .command_period_ns = 1000000},
    };
    struct error error;

    assert_ok(arena_init(&arena, 8u << 20, &error));
    assert_ok(local_bus_create(&local, &arena, &bus, &error));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &port, &error));
    assert_no_error(task_create("pose", &config, &arena, &task, &error), error.text);
    return 0;
}

FIXTURE(tear_down)
{
    port->ops->close(port);
    local_bus_destroy(bus);
    arena_fini(&arena);
    return 0;
}

/* Steps of a millisecond; no reference moves faster than the rate allows. */
static void run_steps(int from_ms, int to_ms, double rate)
{
    for (int ms = from_ms; ms < to_ms; ms++) {
        double before[AXES];

        for (size_t i = 0; i < AXES; i++) {
            before[i] = servo_wanted(task->servo, i);
        }
        assert_int_equal(task->ops->step(task, ms * 1e-3), TASK_RUNNING);
        for (size_t i = 0; i < AXES; i++) {
            assert_true(fabs(servo_wanted(task->servo, i) - before[i]) <= rate * 1e-3 + 1e-12);
        }
    }
}

TEST_WITH(has_a_setting_a_joint_within_its_limits, set_up, tear_down)
{
    const struct task_setting *setting;

    assert_int_equal(task_settings(task, &setting), 1 + AXES);
    assert_string_equal(setting[0].name, "pose.rate_rad_s");
    assert_string_equal(setting[1].name, "pose.Knee_rad");
    assert_true(setting[1].min == -0.1 && setting[1].max == 1.5);
    assert_true(setting[2].min == -1 && setting[2].max == 0.3); /* the initial angle is allowed */
    assert_true(task_get(task, 1) == 0.5 && task_get(task, 2) == 0.3);
    assert_false(task_set(task, 1, 1.6));
    assert_false(task_set(task, 1, NAN));
    assert_true(task_is_endless(task));
}

TEST_WITH(goes_to_the_initial_pose_and_stays, set_up, tear_down)
{
    task->ops->start(task);
    run_steps(0, 3000, 0.5);
    assert_true(servo_wanted(task->servo, 0) == 0.5 && servo_wanted(task->servo, 1) == 0.3);
}

TEST_WITH(moves_smoothly_to_what_is_set, set_up, tear_down)
{
    task->ops->start(task);
    run_steps(0, 3000, 0.5);
    assert_true(task_set(task, 1, 1.5));
    assert_true(task_set(task, 0, 0.25));
    run_steps(3000, 7000, 0.25);
    assert_true(servo_wanted(task->servo, 0) > 1.3 && servo_wanted(task->servo, 0) < 1.5);
    run_steps(7000, 9000, 0.25);
    assert_true(servo_wanted(task->servo, 0) == 1.5 && servo_wanted(task->servo, 1) == 0.3);
}

TEST_WITH(does_not_jump_after_a_pause, set_up, tear_down)
{
    double before;

    task->ops->start(task);
    run_steps(0, 1000, 0.5);
    before = servo_wanted(task->servo, 0);
    assert_true(task_set(task, 1, -0.1));
    assert_int_equal(task->ops->step(task, 60), TASK_RUNNING);
    assert_true(fabs(servo_wanted(task->servo, 0) - before) <= 0.5 * 0.1 + 1e-12);
}
