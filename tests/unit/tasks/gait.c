/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plan of a walk: its closed forms against a fine integration of xi' = omega (xi - r), and
 * where the feet go when the world does what the plan says.
 */
#include "tasks/gait.h"

#include "base/array.h"
#include "tests/test.h"

static const double omega = 4.8;

/* ---- the divergent component of motion ---- */

static struct dcm_plan plan_of_two_steps(void)
{
    const double at[4][2] = {{0, 0}, {0.02, 0.07}, {0.1, -0.07}, {0.1, 0}};
    struct dcm_plan plan = {.omega = omega};

    dcm_add(&plan, 0.3, at[0], at[1]);
    dcm_add(&plan, 0.5, at[1], at[1]);
    dcm_add(&plan, 0.2, at[1], at[2]);
    dcm_add(&plan, 0.5, at[2], at[2]);
    dcm_add(&plan, 0.4, at[2], at[3]);
    return plan;
}

TEST(the_planned_dcm_obeys_its_equation_and_comes_to_rest)
{
    struct dcm_plan plan = plan_of_two_steps();
    double zmp[2], dcm[2], end[2];

    while (plan.nline > 0) {
        enum { STEPS = 20000 };
        double dt = plan.line[0].duration_s / STEPS, xi[2];

        /* Midpoint rule through the first line, then the plan without it */
        dcm_evaluate(&plan, 0, zmp, xi, end);
        for (int i = 0; i < STEPS; i++) {
            dcm_evaluate(&plan, (i + 0.5) * dt, zmp, dcm, end);
            for (int k = 0; k < 2; k++) {
                double half = xi[k] + 0.5 * dt * omega * (xi[k] - (zmp[k]));

                xi[k] += dt * omega * (half - zmp[k]);
            }
        }
        for (int k = 0; k < 2; k++) {
            assert_true(fabs(xi[k] - end[k]) < 1e-8);
        }
        memmove(plan.line, plan.line + 1, --plan.nline * sizeof *plan.line);
    }
    assert_true(fabs(end[0] - 0.1) < 1e-15 && fabs(end[1]) < 1e-15);
}

TEST(a_plan_begins_at_the_dcm_that_there_is)
{
    struct dcm_plan plan = plan_of_two_steps();
    const double there[2] = {-0.01, 0.02};
    double zmp[2], dcm[2], end[2];

    dcm_begin_at(&plan, there);
    dcm_evaluate(&plan, 0, zmp, dcm, end);
    assert_true(fabs(dcm[0] - there[0]) < 1e-15 && fabs(dcm[1] - there[1]) < 1e-15);
}

TEST(the_dcm_diverges_from_a_zero_moment_point_at_rest)
{
    const double zmp[2] = {0.1, 0}, dcm[2] = {0.11, -0.01};
    double after[2];

    dcm_advance(omega, 0.5, zmp, dcm, after);
    assert_true(fabs(after[0] - (0.1 + 0.01 * exp(2.4))) < 1e-15);
    assert_true(fabs(after[1] + 0.01 * exp(2.4)) < 1e-15);
}

/* ---- tasks/gait.h ---- */

static const struct gait_config config = {
    .swing_s = 0.6,
    .transfer_s = 0.15,
    .start_s = 0.8,
    .clearance_m = 0.04,
    .width_m = 0.145,
    .least_width_m = 0.11,
    .zmp_ahead_m = 0.025,
    .zmp_inward_m = 0.005,
    .reach_ahead_m = 0.25,
    .reach_back_m = 0.2,
    .reach_out_m = 0.15,
    .adjust = 1,
    .ankle_m = 0.03,
    .lower_m_s = 0.1,
    .lower_m = 0.04,
    .press_n = 40,
    .ground_follow = 1,
    .tilt_s = 0.05,
    .sole_front_m = 0.13,
    .sole_back_m = -0.06,
    .sole_side_m = 0.045,
    .sole_margin_m = 0.01,
    .catch_swing_s = 0.3,
    .catch_reach_m = 0.3,
    .catch_clearance_m = 0.03,
};

struct ideal {
    struct gait gait;
    double fastest_jump; /* of the planned DCM, m/s */
    double highest_m;
    double rise_m;   /* of the ground under the next foothold */
    double pitch;    /* of the ground */
    bool bottomless; /* the foot in the air meets no ground */
};

static void ideal_start(struct ideal *ideal)
{
    const struct gait_foothold foot[BODY_SIDES] = {{.p = {0, -0.0725, 0}}, {.p = {0, 0.0725, 0}}};
    const double com[2] = {0.025, 0};

    memset(ideal, 0, sizeof *ideal);
    gait_start(&ideal->gait, &config, omega, foot, com);
}

/* What is measured where the world does what the plan says, but for a DCM that is off, and for the
 * ground, on which the foot in the air comes down wherever it is. */
static struct gait_measured ideal_measure(const struct ideal *ideal, const double off[2])
{
    const struct gait_reference *now = &ideal->gait.now;
    struct gait_measured measured = {
        .dcm = {now->dcm[0] + off[0], now->dcm[1] + off[1]},
        .foot = {now->foot[0], now->foot[1]},
        .touches = {true, true},
        .flat = {true, true},
        .force_n = {config.press_n, config.press_n},
    };
    int swing = BODY_SIDES - 1 - now->stance;

    for (int i = 0; i < BODY_SIDES; i++) {
        measured.foot[i].pitch = ideal->pitch;
    }
    if (now->phase == GAIT_SWING && !ideal->gait.landed) {
        double *height = &measured.foot[swing].p[2];
        double ground = now->foot[now->stance].p[2] + ideal->rise_m;

        *height += now->height_m;
        measured.touches[swing] = !ideal->bottomless && *height < ground + 1e-5;
        measured.flat[swing] = measured.touches[swing];
    }
    return measured;
}

static void ideal_walk(struct ideal *ideal, const struct gait_command *command, double seconds,
                       const double off[2])
{
    struct gait *gait = &ideal->gait;

    for (int i = 0; i < (int)(seconds * 1000); i++) {
        struct gait_measured measured = ideal_measure(ideal, off);
        double before[2] = {gait->now.dcm[0], gait->now.dcm[1]};

        gait_update(gait, command, &measured, 0.001);
        ideal->fastest_jump =
            fmax(ideal->fastest_jump,
                 hypot(gait->now.dcm[0] - before[0], gait->now.dcm[1] - before[1]) / 0.001);
        ideal->highest_m = fmax(ideal->highest_m, gait->now.height_m);
    }
}

TEST(a_walk_starts_keeps_its_speed_and_stops_side_by_side)
{
    const struct gait_command walk = {.step = true, .forward_m_s = 0.2}, stand = {0};
    const double off[2] = {0};
    const struct gait_reference *now;
    struct ideal ideal;
    double from, began;
    unsigned steps;

    ideal_start(&ideal);
    now = &ideal.gait.now;
    ideal_walk(&ideal, &stand, 1, off);
    assert_int_equal(now->phase, GAIT_STAND);
    assert_true(fabs(now->com[0] - 0.025) < 1e-12 && fabs(now->com[1]) < 1e-12);

    /* Twenty steps */
    ideal_walk(&ideal, &walk, 3, off);
    from = now->com[0];
    steps = ideal.gait.steps;
    began = ideal.gait.elapsed_s;
    ideal_walk(&ideal, &walk, 20 * 0.75, off);
    assert_int_equal(ideal.gait.steps - steps, 20);
    assert_true(fabs(ideal.gait.elapsed_s - began) < 0.025);
    assert_true(fabs(now->com[0] - from - 0.2 * 15) < 0.01);
    assert_true(fabs(ideal.highest_m - config.clearance_m) < 1e-9);
    assert_true(ideal.fastest_jump < 1);

    /* Stop */
    ideal_walk(&ideal, &stand, 5, off);
    assert_int_equal(now->phase, GAIT_STAND);
    assert_true(fabs(now->foot[0].p[0] - now->foot[1].p[0]) < 1e-9);
    assert_true(fabs(now->foot[1].p[1] - now->foot[0].p[1] - config.width_m) < 1e-9);
    assert_true(fabs(now->com[0] - now->foot[0].p[0] - 0.025) < 1e-3);
}

TEST(a_turn_keeps_the_feet_beside_each_other)
{
    const struct gait_command turn = {.step = true, .turn_rad_s = 0.3};
    const double off[2] = {0};
    const struct gait_foothold *foot;
    struct ideal ideal;

    ideal_start(&ideal);
    ideal_walk(&ideal, &turn, 25, off);
    foot = ideal.gait.now.foot;
    assert_true(ideal.gait.now.yaw > 6 && ideal.gait.now.yaw < 7.5);
    assert_true(hypot(foot[0].p[0] - foot[1].p[0], foot[0].p[1] - foot[1].p[1]) < 0.2);
    assert_true(hypot(foot[0].p[0] + foot[1].p[0], foot[0].p[1] + foot[1].p[1]) / 2 < 0.05);
}

/* Swing and transfer keep their ratio, the speed stays, and the planned DCM does not jump: by less
 * than 3 mm in the tick of the change, where the plan's own way in a tick is less than 0.4 mm. */
TEST(a_step_takes_the_time_that_is_asked_for)
{
    struct gait_command walk = {.step = true, .forward_m_s = 0.2, .step_s = 0.75};
    static const double step_s[] = {0.5, 0.9, 0.75};
    const double off[2] = {0};
    struct ideal ideal;

    ideal_start(&ideal);
    ideal_walk(&ideal, &walk, 5, off);
    assert_true(ideal.gait.config.swing_s == config.swing_s);
    assert_true(ideal.fastest_jump < 1);
    for (size_t i = 0; i < ARRAY_COUNT(step_s); i++) {
        double from;
        unsigned steps;

        walk.step_s = step_s[i];
        ideal_walk(&ideal, &walk, 9, off);
        from = ideal.gait.now.com[0];
        steps = ideal.gait.steps;
        ideal_walk(&ideal, &walk, 10 * step_s[i], off);
        assert_int_equal(ideal.gait.steps - steps, 10);
        assert_true(fabs(ideal.gait.now.com[0] - from - 2 * step_s[i]) < 0.01);
        assert_true(fabs(ideal.gait.config.swing_s / ideal.gait.config.transfer_s - 4) < 1e-9);
    }
    print_message("# the planned DCM moves at %.2f m/s at most\n", ideal.fastest_jump);
    assert_true(ideal.fastest_jump < 3);
}

/* An error that the ankles can take out moves no foothold, a greater one does, within reach. */
TEST(a_foothold_follows_a_great_error_of_the_dcm)
{
    const struct gait_command walk = {.step = true};
    const double none[2] = {0}, small[2] = {0.02, 0}, great[2] = {0.06, 0}, huge[2] = {0.5, 0};
    struct ideal ideal;

    ideal_start(&ideal);
    ideal_walk(&ideal, &walk, 0.9, none);
    assert_int_equal(ideal.gait.now.phase, GAIT_SWING);
    ideal_walk(&ideal, &walk, 0.2, small);
    assert_true(fabs(ideal.gait.next.p[0]) < 1e-9);
    ideal_walk(&ideal, &walk, 0.1, great);
    assert_true(ideal.gait.next.p[0] > 0.05);
    ideal_walk(&ideal, &walk, 0.1, huge);
    assert_true(ideal.gait.next.p[0] > 0.2 && ideal.gait.next.p[0] < 0.25 + 1e-9);
}

/* On a step up the foot stays where it met the ground, while the plan keeps its time. */
TEST(a_foot_that_meets_the_ground_early_stays_there)
{
    const struct gait_command walk = {.step = true, .forward_m_s = 0.1};
    const double off[2] = {0};
    struct ideal ideal;
    const struct gait_reference *now = &ideal.gait.now;
    double at[3];

    ideal_start(&ideal);
    ideal.rise_m = 0.02;
    ideal_walk(&ideal, &walk, 0.8 + 0.35, off);
    assert_int_equal(now->phase, GAIT_SWING);
    assert_false(ideal.gait.landed);
    for (int i = 0; i < 200 && !ideal.gait.landed; i++) {
        ideal_walk(&ideal, &walk, 0.001, off);
    }
    assert_true(ideal.gait.landed && now->progress > 0.6 && now->progress < 0.9);
    memcpy(at, now->foot[BODY_RIGHT].p, sizeof at);
    assert_true(fabs(at[2] - 0.02) < 1e-3);

    /* Pressed on with what is asked for it neither sinks nor rises, and carries when it is time */
    ideal_walk(&ideal, &walk, 0.8 + 0.6 + 0.002 - 0.8 - 0.35, off);
    assert_memory_equal(at, now->foot[BODY_RIGHT].p, sizeof at);
    assert_int_equal(ideal.gait.steps, 1);
    assert_true(ideal.fastest_jump < 1);
}

/* On a step down the foot is lowered, while the plan waits; not for ever. */
TEST(a_foot_that_misses_the_ground_is_lowered)
{
    const struct gait_command walk = {.step = true};
    const double off[2] = {0};
    struct ideal ideal;
    const struct gait_reference *now = &ideal.gait.now;
    double dcm[2];

    ideal_start(&ideal);
    ideal.rise_m = -0.02;
    ideal_walk(&ideal, &walk, 0.8 + 0.6 + 0.001, off);
    memcpy(dcm, now->dcm, sizeof dcm);
    ideal_walk(&ideal, &walk, 0.15, off);
    assert_int_equal(ideal.gait.steps, 0);
    assert_true(fabs(now->height_m + 0.015) < 2e-4);
    assert_true(hypot(now->dcm[0] - dcm[0], now->dcm[1] - dcm[1]) < 1e-3);
    ideal_walk(&ideal, &walk, 0.06, off);
    assert_int_equal(ideal.gait.steps, 1);
    assert_true(fabs(now->foot[BODY_RIGHT].p[2] + 0.02) < 1e-3);

    ideal_start(&ideal);
    ideal.bottomless = true;
    ideal_walk(&ideal, &walk, 0.8 + 0.6 + 0.39, off);
    assert_int_equal(ideal.gait.steps, 0);
    ideal_walk(&ideal, &walk, 0.02, off);
    assert_int_equal(ideal.gait.steps, 1);
}

/* A slope is felt by the soles and expected under the next foothold. */
TEST(footholds_are_expected_in_the_plane_of_the_standing_sole)
{
    const struct gait_command walk = {.step = true, .forward_m_s = 0.2};
    const double off[2] = {0};
    struct ideal ideal;
    const struct gait_reference *now = &ideal.gait.now;

    ideal_start(&ideal);
    ideal.pitch = -0.1; /* uphill */
    ideal_walk(&ideal, &walk, 0.8 + 4 * 0.75 + 0.3, off);
    assert_int_equal(now->phase, GAIT_SWING);
    assert_true(fabs(now->foot[now->stance].pitch + 0.1) < 0.01);
    assert_true(fabs(ideal.gait.next.pitch + 0.1) < 0.01);
    assert_true(fabs(ideal.gait.next.p[2] - now->foot[now->stance].p[2] - 0.15 * tan(0.1)) < 2e-3);
}

/* A robot that stands is pushed: from where it steps, and which foot goes where. */
struct push {
    double dcm[2]; /* from the point between the soles' origins */
    int stance;    /* of the step; -1: none */
};

TEST(a_robot_that_stands_steps_when_its_soles_reach_no_further)
{
    /* The center of pressure goes from -0.05 to 0.12 m, and 0.1075 m to each side */
    static const struct push push[] = {
        {{0.119, 0}, -1},
        {{-0.049, 0}, -1},
        {{0.025, 0.106}, -1},
        {{0.121, 0.02}, BODY_LEFT},
        {{0.121, -0.02}, BODY_RIGHT},
        {{-0.051, 0.01}, BODY_LEFT},
        {{0.025, 0.12}, -1},
    };
    const struct gait_command stand = {0};

    for (size_t i = 0; i < ARRAY_COUNT(push); i++) {
        struct ideal ideal;
        const struct gait_reference *now = &ideal.gait.now;
        double off[2];

        ideal_start(&ideal);
        off[0] = push[i].dcm[0] - now->dcm[0];
        off[1] = push[i].dcm[1] - now->dcm[1];
        ideal_walk(&ideal, &stand, 0.001, off);
        assert_int_equal(now->phase, push[i].stance < 0 ? GAIT_STAND : GAIT_SWING);
        if (push[i].stance >= 0) {
            assert_int_equal(now->stance, push[i].stance);
        }
    }
}

/* The DCM falls away from a center of pressure at the toes; the foot comes down where it then is,
 * the other one follows, and both stand side by side. */
TEST(a_catching_step_goes_where_the_dcm_will_be)
{
    const struct gait_command stand = {0};
    const double none[2] = {0};
    struct ideal ideal;
    const struct gait_reference *now = &ideal.gait.now;
    double dcm[2] = {0.15, 0.02}, share = 0.5, at;

    ideal_start(&ideal);
    for (int i = 0; i < 600 && (i == 0 || ideal.gait.catches); i++) {
        struct gait_measured measured = ideal_measure(&ideal, none);

        memcpy(measured.dcm, dcm, sizeof dcm);
        measured.touches[BODY_RIGHT] = now->phase == GAIT_SWING && now->progress > 0.99;
        gait_update(&ideal.gait, &stand, &measured, 0.001);
        if (ideal.gait.catches) {
            assert_true(fabs(now->zmp[0] - 0.12) < 1e-12);
            assert_true(now->share[BODY_LEFT] >= share && now->height_m <= config.clearance_m);
            share = now->share[BODY_LEFT];
            dcm_advance(omega, 0.001, now->zmp, dcm, dcm);
        }
    }
    assert_true(share == 1);
    assert_false(ideal.gait.catches);
    at = now->foot[BODY_RIGHT].p[0];
    assert_true(fabs(at - (0.12 + 0.03 * exp(omega * 0.3) - config.zmp_ahead_m)) < 0.01);
    assert_true(now->foot[BODY_RIGHT].p[1] < 0.0725 - config.least_width_m + 1e-9);

    ideal_walk(&ideal, &stand, 6, none);
    assert_int_equal(now->phase, GAIT_STAND);
    assert_int_equal(ideal.gait.steps, 2);
    assert_true(fabs(now->foot[BODY_LEFT].p[0] - now->foot[BODY_RIGHT].p[0]) < 1e-9);
    assert_true(fabs(now->foot[BODY_LEFT].p[1] - now->foot[BODY_RIGHT].p[1] - config.width_m) <
                1e-9);
}

TEST(a_robot_that_is_not_to_step_stands)
{
    const struct gait_command stand = {0};
    const double far[2] = {0.2, 0};
    struct gait_config still = config;
    struct ideal ideal;

    ideal_start(&ideal);
    still.catch_swing_s = 0;
    ideal.gait.config = still;
    ideal_walk(&ideal, &stand, 1, far);
    assert_int_equal(ideal.gait.now.phase, GAIT_STAND);
}
