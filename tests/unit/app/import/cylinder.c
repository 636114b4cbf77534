/* SPDX-License-Identifier: Apache-2.0 */
/* Hydraulic drives of an import: triangles, supply and what is refused, against HyQ's published
 * ones and the law of cosines. */
#include "app/import/drive.h"

#include "app/import/import.h"
#include "model/hydraulics/hydraulic.h"

#include "tests/unit/arena_fixture.h"

#define HYQ HIL_SOURCE_DIR "/config/drives/hyq.yaml"

static const double pi = 3.14159265358979323846;
static const char *drives[] = {HYQ};
static struct import_notes notes;
static struct import_robot made;
static struct error error;

/* A pendulum whose joint has that range, with HyQ's cylinder. */
static enum error_code import_pendulum(const char *type, double lower, double upper)
{
    const struct import_options options = {.drive = drives, .ndrive = 1};
    static struct import_model model;
    char text[1024];
    double supply_v;

    snprintf(
        text, sizeof text,
        "<robot name='r'><link name='base'/><link name='leg'><inertial><origin xyz='0 0 -0.2'/>"
        "<mass value='3'/><inertia ixx='0.1' iyy='0.1' izz='0.1' ixy='0' ixz='0' iyz='0'/>"
        "</inertial></link>\n<joint name='j' type='%s'><parent link='base'/><child "
        "link='leg'/><axis xyz='0 1 0'/><limit lower='%.17g' upper='%.17g' effort='60' "
        "velocity='4'/></joint></robot>",
        type, lower, upper);
    notes = (struct import_notes){0};
    return import_model_text("x.urdf", text, strlen(text), &options, &arena, &model, &notes, &made,
                             &supply_v, &error);
}

static const struct robot_joint *import_joint(double lower, double upper)
{
    assert_no_error(import_pendulum("revolute", lower, upper), error.text);
    assert_true(made.robot->joint[0].hydraulic.present && !made.robot->joint[0].sea.present);
    return &made.robot->joint[0];
}

/* Between the pins at an angle of the joint, by the law of cosines. */
static double length_at(const struct robot_hydraulic *c, double q)
{
    return sqrt(c->base * c->base + c->arm * c->arm - 2.0 * c->base * c->arm * cos(q + c->offset));
}

static double lever_at(const struct robot_hydraulic *c, double q)
{
    return (length_at(c, q + 1e-6) - length_at(c, q - 1e-6)) / 2e-6;
}

TEST_WITH(the_stroke_covers_the_range_with_room_at_both_ends, open_arena, close_arena)
{
    for (double width = 0.05; width < 2.55; width += 0.125) {
        for (double lower = -4.0; lower < 2.0; lower += 0.7) {
            const struct robot_joint *joint = import_joint(lower, lower + width);
            const struct robot_hydraulic *c = &joint->hydraulic;
            double least = 1.0, most = 0.0, longest = 0.0, shortest = 1.0;

            for (int i = 0; i <= 100; i++) {
                const double q = lower + width * i / 100, x = length_at(c, q) - c->closed;
                const double lever = fabs(lever_at(c, q));

                least = fmin(least, x);
                most = fmax(most, x);
                longest = fmax(longest, lever);
                shortest = fmin(shortest, lever);
            }
            assert_true(least > 0.0499 * 0.080 && most < 0.9501 * 0.080);
            assert_true(fabs(least - (0.080 - most)) < 1e-9);
            assert_true(shortest > 0.25 * longest);
            assert_true(c->closed > 0.080);
            if (width > 0.5) {
                assert_true(most - least > 0.8999 * 0.080);
            }

            /* Piston force at 160 bar on the longest lever; both ends have the same */
            assert_true(fabs(joint->torque_limit / (3217.0 * longest) - 1.0) < 2e-3);
            assert_true(fabs(fabs(lever_at(c, lower)) - fabs(lever_at(c, lower + width))) < 1e-6);
        }
    }
}

/* HyQ's own triangles: 45 mm for 120 degrees with 77.94 mm of the stroke, and the way they push. */
TEST_WITH(the_triangles_are_like_those_of_hyq, open_arena, close_arena)
{
    const struct robot *hyq;

    assert_no_error(
        robot_load(HIL_SOURCE_DIR "/config/robots/hyq.yaml", NULL, &arena, &hyq, &error),
        error.text);
    for (size_t j = 0; j < hyq->njoint; j++) {
        const double lower = hyq->joint[j].lower, upper = hyq->joint[j].upper;
        const struct robot_joint *joint = import_joint(lower, upper);

        assert_true(hydraulic_direction(&joint->hydraulic, lower, upper) ==
                    hydraulic_direction(&hyq->joint[j].hydraulic, lower, upper));
        if (upper - lower > 2.0) {
            assert_true(fabs(joint->hydraulic.arm * 77.94 / 72.0 - 0.045) < 5e-4);
            assert_true(fabs(joint->hydraulic.base - 0.3219) < 0.005);
        }
    }
}

TEST_WITH(a_range_that_is_too_wide_is_refused_at_its_place, open_arena, close_arena)
{
    assert_int_equal(import_pendulum("revolute", -1.5, 1.5), ERROR_INPUT);
    assert_non_null(strstr(error.text,
                           "x.urdf:2: found joint \"j\", which turns by 3 rad, with the "
                           "hydraulic drive hyq, expected at most some 2.6 rad"));
    assert_int_equal(import_pendulum("revolute", -3.0, 3.0), ERROR_INPUT);
    assert_int_equal(import_pendulum("continuous", 0.0, 0.0), ERROR_INPUT);
    assert_non_null(strstr(error.text, "x.urdf:2: found joint"));
}

/* One cylinder: 80 mm of 2.0106 and 1.2252 cm2. */
TEST_WITH(the_supply_is_of_the_size_of_the_cylinders, open_arena, close_arena)
{
    const struct robot_hydraulic_supply *s;
    double area[2] = {0.25 * pi * 0.016 * 0.016, 0.25 * pi * (0.016 * 0.016 - 0.010 * 0.010)};

    import_joint(-1.0, 1.0);
    s = &made.robot->hydraulic_supply;
    assert_true(s->pressure == 1.6e7 && s->relief == 1.6e7);
    assert_true(fabs(s->pump - 0.5 * 0.080 * (area[0] + area[1]) - 1.6e-6) < 1e-12);
    assert_true(fabs(s->relief_flow * 0.005 * 1.6e7 - s->pump) < 1e-12);

    /* Its gas, p V^1.4 constant, gives the oil of one stroke between both pressures */
    assert_true(fabs(s->accumulator * (1.0 - pow(s->precharge / s->pressure, 1.0 / 1.4)) -
                     0.080 * area[0]) < 1e-12);
}

TEST_WITH(the_report_tells_what_was_assumed, open_arena, close_arena)
{
    bool drive = false, supply = false;

    import_joint(0.3, 2.3);
    for (size_t i = 0; i < notes.count; i++) {
        const struct import_note *note = &notes.note[i];

        drive |= note->fate == IMPORT_ASSUMED && note->line == 2 &&
                 strstr(note->text, "drive of joint \"j\": hyq of the catalogue on a triangle") &&
                 strstr(note->text, "pushing negatively");
        supply |= note->fate == IMPORT_ASSUMED && note->line == 2 &&
                  strstr(note->text, "hydraulic supply: 160 bar, a pump of 0.873 l/min");
    }
    assert_true(drive && supply);
}

/* kp is the velocity gain times kw, a fifth of the frequency on the oil at most; 16/s at most. */
TEST_WITH(gains_follow_the_frequency_on_the_oil, open_arena, close_arena)
{
    const struct robot_joint *joint = import_joint(-1.0, 1.0);
    const struct robot_hydraulic *c = &joint->hydraulic;
    const double x = length_at(c, 0.0) - c->closed, lever = lever_at(c, 0.0);
    const double V[2] = {2e-6 + c->A1 * x, 2e-6 + c->A2 * (0.080 - x)};
    const double oil = 1.4e9 * lever * lever * (c->A1 * c->A1 / V[0] + c->A2 * c->A2 / V[1]);
    struct import_gains slow = import_cylinder_gains(made.robot, 0, 0.0, oil / 900.0);
    struct import_gains fast = import_cylinder_gains(made.robot, 0, 0.0, oil / 1e6);

    assert_true(fabs(slow.kp_v_per_rad / slow.kw_v_s_per_rad - 6.0) < 1e-3);
    assert_true(fabs(slow.ki_v_per_rad_s / slow.kp_v_per_rad - 1.2) < 1e-3);
    assert_true(fabs(fast.kp_v_per_rad / fast.kw_v_s_per_rad - 16.0) < 1e-9);
    assert_true(slow.kd_v_s_per_rad == 0.0 && slow.load_v_per_nm == 0.0);
    assert_true(slow.kw_v_s_per_rad ==
                hydraulic_speed_constant(c, &made.robot->hydraulic_supply, -1.0, 1.0));
}
