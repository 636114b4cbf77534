/* SPDX-License-Identifier: Apache-2.0 */
/* COMAN from its robot file, in the arena of the test. */
#ifndef TESTS_UNIT_MODEL_COMAN_H
#define TESTS_UNIT_MODEL_COMAN_H

#include "model/robot.h"

#include "tests/unit/arena_fixture.h"

#define COMAN HIL_SOURCE_DIR "/config/robots/coman.yaml"

/* NULL: without a variant. */
static inline const struct robot *load_coman(const char *variant)
{
    const struct robot *robot;
    struct error error;

    assert_no_error(robot_load(COMAN, variant, &arena, &robot, &error), error.text);
    return robot;
}

#endif
