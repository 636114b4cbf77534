/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the couplings of a robot file: joints that follow others. */
#include "model/description/yaml.h"

#include <math.h>

/* Smallest absolute multiplier. Below it, a joint practically does not follow; a fine lead screw
 * has 1e-4 m/rad. */
#define LEAST_MULTIPLIER 1e-6

/* Finds the two joints of a coupling and checks their roles. */
static enum error_code build_coupled_joints(struct robot_builder *b, size_t i)
{
    const struct yaml_names joints = YAML_NAMES(b->robot->joint, b->robot->njoint, name);
    const struct coupling_yaml *given = &b->file.coupling[i];
    struct robot_coupling *coupling = &b->robot->coupling[i];
    enum error_code code;

    if ((code =
             yaml_find_name(joints, "joint", given->follower, yaml_place(&given->mark, "follower"),
                            &coupling->follower, b->error)) ||
        (code = yaml_find_name(joints, "joint", given->leader, yaml_place(&given->mark, "leader"),
                               &coupling->leader, b->error))) {
        return code;
    }
    if (coupling->follower == coupling->leader) {
        return yaml_error(b->error, yaml_place(&given->mark, "leader"),
                          "found joint \"%s\" as its own leader, expected another joint",
                          given->leader);
    }
    if (robot_joint_is_driven(&b->robot->joint[coupling->follower])) {
        return yaml_error(b->error, yaml_place(&given->mark, "follower"),
                          "found follower \"%s\" with a drive of its own, expected none: its "
                          "leader moves it",
                          given->follower);
    }

    /* Check a coupling against earlier couplings: a joint follows only one joint, and no leader is
     * a follower */
    const struct robot_coupling *own = &b->robot->coupling[i];

    for (size_t k = 0; k < i; k++) {
        const struct robot_coupling *before = &b->robot->coupling[k];
        const int line = b->file.coupling[k].mark.line;

        if (before->follower == own->follower) {
            return yaml_error(b->error, yaml_place(&given->mark, "follower"),
                              "found joint \"%s\" as a follower again, expected one leader (it "
                              "follows \"%s\" in line %d)",
                              given->follower, b->file.coupling[k].leader, line);
        }
        if (before->follower == own->leader) {
            return yaml_error(b->error, yaml_place(&given->mark, "leader"),
                              "found leader \"%s\", which follows \"%s\" itself (line %d), "
                              "expected a joint that follows none: name \"%s\"",
                              given->leader, b->file.coupling[k].leader, line,
                              b->file.coupling[k].leader);
        }
        if (before->leader == own->follower) {
            return yaml_error(b->error, yaml_place(&given->mark, "follower"),
                              "found follower \"%s\", which \"%s\" follows (line %d), expected a "
                              "joint that leads none",
                              given->follower, b->file.coupling[k].follower, line);
        }
    }
    return ERROR_NONE;
}

/* Checks the numbers of a coupling and the units in their keys, which are the follower's. */
static enum error_code check_coupling_numbers(struct robot_builder *b,
                                              const struct coupling_yaml *given,
                                              const struct robot_coupling *coupling)
{
    static const char *const keys[][3] = {{"stiffness_nm_rad", "damping_nm_s_rad", "offset_rad"},
                                          {"stiffness_n_m", "damping_n_s_m", "offset_m"}};
    const enum joint_type type = b->robot->joint[coupling->follower].type;
    const char *const *key = keys[type];

    if (robot_count_keys(&given->mark, key, 2) < 2 ||
        robot_count_keys(&given->mark, keys[1 - type], 3) > 0) {
        return yaml_error(
            b->error, &given->mark,
            "found a coupling of %s joint \"%s\", expected the keys %s, %s and, if not 0, %s",
            type == JOINT_REVOLUTE ? "revolute" : "prismatic", given->follower, key[0], key[1],
            key[2]);
    }
    if (fabs(coupling->multiplier) < LEAST_MULTIPLIER) {
        return yaml_error(b->error, yaml_place(&given->mark, "multiplier"),
                          "found multiplier %g, expected %g or more, positive or negative",
                          coupling->multiplier, LEAST_MULTIPLIER);
    }
    return ERROR_NONE;
}

enum error_code robot_build_couplings(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    enum error_code code = ERROR_NONE;

    if (file->ncoupling > ROBOT_COUPLINGS_MAX) {
        return yaml_error(b->error, &file->coupling[ROBOT_COUPLINGS_MAX].mark,
                          "found %zu couplings, expected at most %d", file->ncoupling,
                          ROBOT_COUPLINGS_MAX);
    }
    robot->coupling = arena_alloc(b->arena, file->ncoupling, sizeof *robot->coupling);
    if (!robot->coupling) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < file->ncoupling && !code; i++) {
        robot->coupling[i] = file->coupling[i].coupling;
        code = build_coupled_joints(b, i);
        code = code ? code : check_coupling_numbers(b, &file->coupling[i], &robot->coupling[i]);
    }
    robot->ncoupling = file->ncoupling;
    return code;
}
