/* SPDX-License-Identifier: Apache-2.0 */
/* The keys of the section `walk` of a rig's tasks: one for each number of struct walk_config. */
#include "rig/schema.h"

#include "base/array.h"

#include <float.h>

#define STRUCT raw_walk
#define AT(member) offsetof(struct STRUCT, member)
#define WALK(key, low, high)                                                                       \
    {                                                                                              \
#key, YAML_REAL, true, AT(config.key), .min = low, .max = high                             \
    }
#define BALANCE(key, low, high)                                                                    \
    {                                                                                              \
#key, YAML_REAL, true, AT(config.balance.key), .min = low, .max = high                     \
    }
#define ESTIMATE(key, low, high)                                                                   \
    {                                                                                              \
#key, YAML_REAL, true, AT(config.balance.estimate.key), .min = low, .max = high            \
    }
#define GAIT(key, low, high)                                                                       \
    {                                                                                              \
#key, YAML_REAL, true, AT(config.balance.gait.key), .min = low, .max = high                \
    }
/* Number of a feature that a walk lacks when it is not given: 0 */
#define CATCH(key, low, high)                                                                      \
    {                                                                                              \
#key, YAML_REAL, false, AT(config.balance.gait.key), .min = low, .max = high               \
    }
#define SERVO(key, high)                                                                           \
    {                                                                                              \
#key, YAML_REAL, true, AT(servo.key), .min = 0.0, .max = high                              \
    }

static const struct yaml_field walk_fields[] = {
    WALK(begin_s, 0.0, 1e3),
    {"steps", YAML_INT, true, AT(config.steps), .min = 0, .max = 1e9},
    {"distance_m", YAML_REAL, false, AT(config.distance_m), .min = 0.0, .max = 1e6},
    WALK(forward_m_s, -2.0, 2.0),
    WALK(left_m_s, -2.0, 2.0),
    WALK(turn_rad_s, -2.0, 2.0),
    ESTIMATE(attitude_per_s, 0.0, 1e3),
    {"lean_per_s", YAML_REAL, false, AT(config.balance.estimate.lean_per_s), .min = 0.0,
     .max = 1.0},
    ESTIMATE(com_per_s, 0.0, 200.0),
    {"com_walking_per_s", YAML_REAL, false, AT(config.balance.estimate.com_walking_per_s),
     .min = 0.0, .max = 200.0},
    {"com_walking_m_s", YAML_REAL, false, AT(config.balance.estimate.com_walking_m_s), .min = 0.0,
     .max = 2.0},
    ESTIMATE(loaded_n, 1.0, 1e4),
    GAIT(swing_s, 0.05, 10.0),
    GAIT(transfer_s, 0.01, 10.0),
    GAIT(start_s, 0.1, 10.0),
    GAIT(clearance_m, 0.0, 0.5),
    GAIT(width_m, 0.01, 2.0),
    GAIT(least_width_m, 0.0, 2.0),
    GAIT(zmp_ahead_m, -1.0, 1.0),
    GAIT(zmp_inward_m, -1.0, 1.0),
    GAIT(reach_ahead_m, 0.0, 2.0),
    GAIT(reach_back_m, 0.0, 2.0),
    GAIT(reach_out_m, 0.0, 2.0),
    GAIT(adjust, 0.0, 1.0),
    GAIT(ankle_m, 0.0, 1.0),
    GAIT(lower_m_s, 0.001, 10.0),
    GAIT(lower_m, 0.0, 1.0),
    GAIT(press_n, 1.0, 1e4),
    GAIT(ground_follow, 0.0, 1.0),
    GAIT(tilt_s, 0.0, 10.0),
    SERVO(kp_v_per_rad, 1e6),
    SERVO(kd_v_s_per_rad, 1e6),
    SERVO(kw_v_s_per_rad, 1e6),
    SERVO(load_v_per_nm, 1e4),
    SERVO(torque_limit_nm, 1e4),
    {"others", YAML_LIST, false, AT(other), AT(nother), .schema = &gains_schema},
    BALANCE(ankle_roll_kp_v_per_rad, 0.0, 1e6),
    BALANCE(pelvis_height_m, 0.01, 10.0),
    BALANCE(lean_rad, -1.0, 1.0),
    GAIT(sole_front_m, 0.0, 1.0),
    GAIT(sole_back_m, -1.0, 0.0),
    GAIT(sole_side_m, 0.0, 1.0),
    GAIT(sole_margin_m, 0.0, 1.0),
    CATCH(catch_swing_s, 0.0, 10.0),
    CATCH(catch_margin_m, -1.0, 1.0),
    CATCH(catch_reach_m, 0.0, 2.0),
    CATCH(catch_clearance_m, 0.0, 0.5),
    BALANCE(touch_n, 0.0, 1e4),
    BALANCE(touch_s, 0.0, 1.0),
    BALANCE(flat_n, 1.0, 1e4),
    BALANCE(height_s, 0.0, 10.0),
    BALANCE(dcm_gain, 1.0, 10.0),
    BALANCE(cop_pitch_rad_s_nm, 0.0, 1.0),
    BALANCE(cop_roll_rad_s_nm, 0.0, 1.0),
    BALANCE(land_turn_rad_s_nm, 0.0, 10.0),
    BALANCE(cop_leak_per_s, 0.0, 100.0),
    BALANCE(force_m_s_n, 0.0, 0.1),
    BALANCE(force_leak_per_s, 0.0, 100.0),
    BALANCE(swing_follow, 0.0, 1.0),
    BALANCE(carry_s, 0.0, 1.0),
    BALANCE(swing_torque, 0.0, 4.0),
    BALANCE(ankle_follow, 0.0, 1.0),
};

const struct yaml_schema task_walk_schema = {
    .what = "the walk",
    .size = sizeof(struct raw_walk),
    .fields = walk_fields,
    .field_count = ARRAY_COUNT(walk_fields),
};
