/* SPDX-License-Identifier: Apache-2.0 */
/* Robots imported from texts of URDF and MJCF, which are put together here. Include after cmocka.h.
 */
#ifndef TESTS_UNIT_APP_IMPORT_TEXT_H
#define TESTS_UNIT_APP_IMPORT_TEXT_H

#include "app/import/import.h"

#include "tests/unit/arena_fixture.h"

#define INERTIA "<inertia ixx='0.1' iyy='0.1' izz='0.1' ixy='0' ixz='0' iyz='0'/>"
#define LINK(name)                                                                                 \
    "<link name='" name "'><inertial><mass value='1'/>" INERTIA "</inertial></link>\n"
#define HOLLOW(name) "<link name='" name "'/>\n"
#define JOINT(name, type, parent, child, rest)                                                     \
    "<joint name='" name "' type='" type "'><parent link='" parent "'/><child link='" child        \
    "'/>" rest "</joint>\n"
#define LIMIT "<limit lower='-1' upper='2' effort='10' velocity='3'/>"
#define ROBOT(body) "<robot name='r'>\n" body "</robot>\n"

#define MJCF(before, body, after)                                                                  \
    "<mujoco>\n" before "<worldbody>\n<body name='a'><inertial mass='1' pos='0 0 0' "              \
    "diaginertia='1 1 1'/>\n" body "</body></worldbody>" after "</mujoco>"

static struct import_model model;
static struct import_notes notes;
static struct import_robot made;
static struct error error;
static struct import_options options;

static inline enum error_code import_text(const char *text)
{
    double supply_v;

    notes = (struct import_notes){0};
    return import_model_text("x.urdf", text, strlen(text), &options, &arena, &model, &notes, &made,
                             &supply_v, &error);
}

static inline void import_good(const char *text)
{
    assert_no_error(import_text(text), error.text);
}

/* Refused as wrong input whose message begins with its place and has the words. */
static inline void import_bad(const char *text, const char *place, const char *words)
{
    if (import_text(text) != ERROR_INPUT || strncmp(error.text, place, strlen(place)) != 0 ||
        !strstr(error.text, words)) {
        fail_msg("expected \"%s... %s\", found \"%s\"", place, words, error.text);
    }
}

/* Whether the report has a note of that line with those words. */
static inline bool noted(enum import_fate fate, int line, const char *words)
{
    for (size_t i = 0; i < notes.count; i++) {
        if (notes.note[i].fate == fate && notes.note[i].line == line &&
            strstr(notes.note[i].text, words)) {
            return true;
        }
    }
    return false;
}

/* With the options as they are by default. */
FIXTURE(open_default)
{
    options = (struct import_options){0};
    return open_arena(test_state);
}

#endif
