/* SPDX-License-Identifier: Apache-2.0 */
/* Arrows of contact against sums over points that press: the wrench is made of them, and the center
 * of pressure is their mean, weighted with what each presses. */
#include "sim/contact_arrows.h"

#include "base/vec3.h"
#include "tests/test.h"

enum { POINTS = 4 };

static const struct contact_shown foot = {.signal = 2, .body = 1};

static struct contact_arrows contacts_on(const double normal[3])
{
    struct contact_arrows contacts = {
        .ncontact = 1,
        .contact = &foot,
        .has_ground = true,
        .ground_point = {0.3, -0.2, 0.1},
        .arrow_m_per_n = 1e-3,
    };

    memcpy(contacts.ground_normal, normal, sizeof contacts.ground_normal);
    return contacts;
}

/* A row: two other signals, the foot's wrench; the pose of another body, the foot's. */
struct row {
    double value[8], pose[2 * RECORDER_POSE];
    double center[3]; /* where it should be */
    double force[3];
};

/* Points of the plane, each with a force that presses and rubs. */
static void row_fill(struct row *row, const struct contact_arrows *contacts)
{
    static const double press_n[POINTS] = {40.0, 90.0, 25.0, 160.0};
    static const double rub[POINTS][2] = {{0.4, 0.1}, {-0.3, 0.2}, {0.1, -0.5}, {0.2, 0.3}};
    static const double place[POINTS][2] = {
        {0.1, 0.04}, {0.1, -0.05}, {-0.05, 0.05}, {-0.06, -0.04}};
    static const double up[3] = {0.0, 1.0, 0.0};
    const double *normal = contacts->ground_normal;
    double a[3], b[3], sum = 0.0, *origin = row->pose + RECORDER_POSE;

    memset(row, 0, sizeof *row);
    vec3_cross(up, normal, a);
    vec3_add_scaled((const double[3]){0}, 1.0 / vec3_norm(a), a, a);
    vec3_cross(normal, a, b);
    vec3_add_scaled(contacts->ground_point, 0.07, normal, origin);
    vec3_add_scaled(origin, 0.02, a, origin);
    for (int i = 0; i < POINTS; i++) {
        double at[3], force[3] = {0}, arm[3];

        vec3_add_scaled(contacts->ground_point, place[i][0], a, at);
        vec3_add_scaled(at, place[i][1], b, at);
        vec3_add_scaled(force, press_n[i], normal, force);
        vec3_add_scaled(force, press_n[i] * rub[i][0], a, force);
        vec3_add_scaled(force, press_n[i] * rub[i][1], b, force);
        vec3_sub(at, origin, arm);
        vec3_add_scaled(row->value + 2, 1.0, force, row->value + 2);
        vec3_add_cross(arm, force, row->value + 5);
        vec3_add_scaled(row->center, press_n[i], at, row->center);
        sum += press_n[i];
    }
    vec3_add_scaled((const double[3]){0}, 1.0 / sum, row->center, row->center);
    memcpy(row->force, row->value + 2, sizeof row->force);
}

static void assert_near(const double x[3], const double y[3])
{
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(x[k] - y[k]) < 1e-12);
    }
}

TEST(the_center_of_pressure_is_the_mean_of_what_presses)
{
    static const double normals[2][3] = {{0.0, 0.0, 1.0}, {0.6, 0.0, 0.8}};
    struct contact_arrow arrow[CONTACT_ARROWS];

    for (int i = 0; i < 2; i++) {
        struct contact_arrows contacts = contacts_on(normals[i]);
        struct row row;
        double force;

        row_fill(&row, &contacts);
        assert_int_equal(contact_arrows_find(&contacts, row.value, row.pose, arrow), 1);
        assert_near(arrow[0].at, row.center);
        force = vec3_norm(row.force);
        assert_true(fabs(arrow[0].length_m - 1e-3 * force) < 1e-12);
        vec3_add_scaled((const double[3]){0}, 1.0 / force, row.force, row.force);
        assert_near(arrow[0].along, row.force);
    }
}

/* A force through a point that is the nearest of its axis to the body: found again. */
TEST(away_from_the_ground_it_is_on_the_axis)
{
    struct contact_arrows contacts = contacts_on((const double[3]){0.0, 0.0, 1.0});
    const double force[3] = {30.0, 40.0, 0.0}, arm[3] = {0.08, -0.06, 0.1};
    struct contact_arrow arrow[CONTACT_ARROWS];
    struct row row = {.pose = {[RECORDER_POSE + 2] = 1.0}};
    double at[3];

    memcpy(row.value + 2, force, sizeof force);
    vec3_cross(arm, force, row.value + 5);
    assert_int_equal(contact_arrows_find(&contacts, row.value, row.pose, arrow), 1);
    vec3_add_scaled(row.pose + RECORDER_POSE, 1.0, arm, at);
    assert_near(arrow[0].at, at);
}

TEST(odd_wrenches_show_nothing_or_at_the_body)
{
    struct contact_arrows contacts = contacts_on((const double[3]){0.0, 0.0, 1.0});
    struct contact_arrow arrow[CONTACT_ARROWS];
    struct row row = {.pose = {[RECORDER_POSE + 2] = 1.0}};

    assert_int_equal(contact_arrows_find(&contacts, row.value, row.pose, arrow), 0);
    row.value[2] = NAN;
    assert_int_equal(contact_arrows_find(&contacts, row.value, row.pose, arrow), 0);
    row.value[2] = INFINITY;
    assert_int_equal(contact_arrows_find(&contacts, row.value, row.pose, arrow), 0);

    /* Nearly a moment alone: its axis is 2 m away */
    row.value[2] = 10.0;
    row.value[6] = 20.0;
    assert_int_equal(contact_arrows_find(&contacts, row.value, row.pose, arrow), 1);
    assert_near(arrow[0].at, row.pose + RECORDER_POSE);
    row.value[6] = NAN;
    assert_int_equal(contact_arrows_find(&contacts, row.value, row.pose, arrow), 1);
    assert_near(arrow[0].at, row.pose + RECORDER_POSE);
    row.value[2] = 1e9;
    contact_arrows_find(&contacts, row.value, row.pose, arrow);
    assert_true(arrow[0].length_m < 1.0);
}

/* Each bound from both sides, of a force whose axis goes through the body's origin: on the plane
 * the arrow begins where the axis meets it, elsewhere at the origin. */
TEST(arrows_keep_each_of_their_bounds)
{
    static const struct {
        double height, force[3]; /* of the body above the plane, m; N */
        size_t count;
        bool on_plane;
        double length_m;
    } row[] = {
        {0.05, {0.0, 0.0, 3.99}, 0, false, 0.0}, /* the shortest, 4 mm */
        {0.05, {0.0, 0.0, 4.01}, 1, true, 0.00401},
        {0.05, {0.0, 0.0, 899.0}, 1, true, 0.899}, /* the longest, 0.9 m */
        {0.05, {0.0, 0.0, 901.0}, 1, true, 0.9},
        {0.05, {97.9, 0.0, 20.1}, 1, true, 0.09994}, /* a fifth of the force presses */
        {0.05, {98.1, 0.0, 19.9}, 1, false, 0.1001},
        {0.299, {0.0, 0.0, 100.0}, 1, true, 0.1}, /* near the ground: 0.3 m */
        {0.301, {0.0, 0.0, 100.0}, 1, false, 0.1},
        {0.29, {180.0, 0.0, 100.0}, 1, true, 0.2059}, /* far from the body: 0.6 m */
        {0.29, {183.0, 0.0, 100.0}, 1, false, 0.2085},
    };
    struct contact_arrows contacts = contacts_on((const double[3]){0.0, 0.0, 1.0});

    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        struct contact_arrow arrow[CONTACT_ARROWS];
        struct row at = {.pose = {[RECORDER_POSE + 2] = contacts.ground_point[2] + row[i].height}};
        const double *origin = at.pose + RECORDER_POSE;

        memcpy(at.value + 2, row[i].force, sizeof row[i].force);
        if (contact_arrows_find(&contacts, at.value, at.pose, arrow) != row[i].count) {
            fail_msg("row %zu: not %zu arrows", i, row[i].count);
        }
        if (row[i].count > 0) {
            double meets = row[i].on_plane ? row[i].height / row[i].force[2] : 0.0;

            for (int k = 0; k < 3; k++) {
                assert_true(fabs(arrow[0].at[k] - (origin[k] - meets * row[i].force[k])) < 1e-12);
            }
            assert_true(fabs(arrow[0].length_m - row[i].length_m) < 1e-4);
        }
    }
}

/* The printed orientation turns the x axis onto the force. */
TEST(arrows_are_printed_along_their_forces)
{
    static const double along[][3] = {{1.0, 0.0, 0.0},  {0.0, 1.0, 0.0},    {0.0, 0.0, 1.0},
                                      {0.0, 0.0, -1.0}, {0.48, -0.6, 0.64}, {-0.8, 0.36, -0.48},
                                      {-1.0, 0.0, 0.0}};

    for (size_t i = 0; i < sizeof along / sizeof *along; i++) {
        struct contact_arrow arrow = {.at = {0.5, -0.25, 2.0}, .length_m = 0.2};
        char text[CONTACT_ARROW_SIZE];
        double x, y, z, w, p[3];

        memcpy(arrow.along, along[i], sizeof arrow.along);
        *contact_arrows_print(&arrow, 1, text) = '\0';
        assert_int_equal(sscanf(text,
                                "{\"pose\":{\"position\":{\"x\":%lf,\"y\":%lf,\"z\":%lf},"
                                "\"orientation\":{\"x\":%lf,\"y\":%lf,\"z\":%lf,\"w\":%lf",
                                &p[0], &p[1], &p[2], &x, &y, &z, &w),
                         7);
        assert_near(p, arrow.at);
        assert_true(fabs(1.0 - 2.0 * (y * y + z * z) - along[i][0]) < 1e-5);
        assert_true(fabs(2.0 * (x * y + w * z) - along[i][1]) < 1e-5);
        assert_true(fabs(2.0 * (x * z - w * y) - along[i][2]) < 1e-5);
        assert_non_null(strstr(text, "\"shaft_length\":0.14,")); /* 0.2 m less the head */
        assert_non_null(strstr(text, "\"head_length\":0.06,"));
    }
}

TEST(the_longest_numbers_fit)
{
    static char text[CONTACT_ARROW_SIZE + 1];
    const struct contact_arrow arrow = {
        .at = {-1.23456e-300, -1.23456e-300, -1.23456e-300},
        .along = {-0.577350269189625, -0.577350269189625, -0.577350269189625},
        .length_m = 1.23456e-300,
    };
    char *end = contact_arrows_print_pressures(&arrow, 1, contact_arrows_print(&arrow, 1, text));

    assert_true(end < text + CONTACT_ARROW_SIZE);
}
