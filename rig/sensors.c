/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the section `sensors` of a rig: its schema, and the errors of the boards' sensors. */
#include "rig/sensors.h"

#include "base/count.h"
#include "rig/builder_private.h"

#include <float.h>
#include <math.h>

#define AT(member) offsetof(struct STRUCT, member)

#define STRUCT raw_channel
static const struct yaml_field channel_fields[] = {
    {"gain_error", YAML_REAL, false, AT(gain_error), .min = -1.0, .max = 10.0},
    {"offset", YAML_REAL, false, AT(offset), .min = -1e6, .max = 1e6},
    {"noise_rms", YAML_REAL, false, AT(noise_rms), .min = 0.0, .max = 1e6},
    {"drift_per_sqrt_s", YAML_REAL, false, AT(drift_per_sqrt_s), .min = 0.0, .max = 1e6},
    {"ramp_per_s", YAML_REAL, false, AT(ramp_per_s), .min = -1e6, .max = 1e6},
    {"full_scale", YAML_REAL, false, AT(full_scale), .min = DBL_MIN, .max = 1e9},
    {"lsb", YAML_REAL, false, AT(lsb), .min = DBL_MIN, .max = 1e6},
    {"latency_s", YAML_REAL, false, AT(latency_s), .min = 0.0,
     .max = 1e-9 * (double)SENSING_LATENCY_MAX_NS},
};
#undef STRUCT
static const struct yaml_schema channel_schema = {
    .what = "a channel of a sensor",
    .size = sizeof(struct raw_channel),
    .fields = channel_fields,
    .field_count = ARRAY_COUNT(channel_fields),
};

#define STRUCT raw_winding
static const struct yaml_field winding_fields[] = {
    {"ambient_c", YAML_REAL, false, AT(ambient_c), .min = -60.0, .max = 100.0},
    {"k_per_w", YAML_REAL, true, AT(k_per_w), .min = 1e-6, .max = 1e4},
    {"time_constant_s", YAML_REAL, true, AT(time_constant_s), .min = 1e-3, .max = 1e6},
};
#undef STRUCT
static const struct raw_winding winding_defaults = {.ambient_c = 25.0};
static const struct yaml_schema winding_schema = {
    .what = "a winding that heats",
    .size = sizeof(struct raw_winding),
    .fields = winding_fields,
    .field_count = ARRAY_COUNT(winding_fields),
    .defaults = &winding_defaults,
};

#define CHANNEL(key, member, given)                                                                \
    {                                                                                              \
        key, YAML_MAP, false, AT(member), .schema = &channel_schema, .given_offset = AT(given)     \
    }

#define STRUCT raw_joint_sensors
static const struct yaml_field joint_fields[] = {
    CHANNEL("link_encoder_rad", link_encoder, link_given),
    CHANNEL("motor_encoder_rad", motor_encoder, motor_given),
    CHANNEL("current_a", current, current_given),
    CHANNEL("torque_nm", torque, torque_given),
    CHANNEL("temperature_c", temperature, temperature_given),
    {"winding", YAML_MAP, false, AT(winding), .schema = &winding_schema,
     .given_offset = AT(winding_given)},
    {"motor_encoder_from_start", YAML_BOOL, false, .offset = AT(incremental),
     .given_offset = AT(incremental_given)},
};
#undef STRUCT
static const struct yaml_schema joint_schema = {
    .what = "the sensors of a joint",
    .size = sizeof(struct raw_joint_sensors),
    .fields = joint_fields,
    .field_count = ARRAY_COUNT(joint_fields),
    .name_offset = offsetof(struct raw_joint_sensors, name),
};

#define STRUCT raw_ft_sensors
static const struct yaml_field ft_fields[] = {
    CHANNEL("force_n", force, force_given),
    CHANNEL("torque_nm", torque, torque_given),
    {"crosstalk", YAML_REAL, false, AT(crosstalk), .min = 0.0, .max = 1.0,
     .given_offset = AT(crosstalk_given)},
};
#undef STRUCT
static const struct yaml_schema ft_schema = {
    .what = "a force-torque sensor",
    .size = sizeof(struct raw_ft_sensors),
    .fields = ft_fields,
    .field_count = ARRAY_COUNT(ft_fields),
    .name_offset = offsetof(struct raw_ft_sensors, name),
};

#define STRUCT raw_imu_sensors
static const struct yaml_field imu_fields[] = {
    {"gyro_rad_s", YAML_MAP, false, AT(gyro), .schema = &channel_schema},
    {"accel_m_s2", YAML_MAP, false, AT(accel), .schema = &channel_schema},
    {"magnetic_t", YAML_MAP, false, AT(magnetic), .schema = &channel_schema},
    {"orientation", YAML_MAP, false, AT(orientation), .schema = &channel_schema},
};
#undef STRUCT
static const struct yaml_schema imu_schema = {
    .what = "the inertial sensor",
    .size = sizeof(struct raw_imu_sensors),
    .fields = imu_fields,
    .field_count = ARRAY_COUNT(imu_fields),
};

#define STRUCT raw_sensors
static const struct yaml_field sensors_fields[] = {
    {"every_joint", YAML_MAP, false, AT(every_joint), .schema = &joint_schema},
    {"joints", YAML_DICT, false, AT(joint), AT(njoint), .schema = &joint_schema},
    {"every_ft", YAML_MAP, false, AT(every_ft), .schema = &ft_schema},
    {"fts", YAML_DICT, false, AT(ft), AT(nft), .schema = &ft_schema},
    {"imu", YAML_MAP, false, AT(imu), .schema = &imu_schema},
};
#undef STRUCT
const struct yaml_schema rig_sensors_schema = {
    .what = "the sensors",
    .size = sizeof(struct raw_sensors),
    .fields = sensors_fields,
    .field_count = ARRAY_COUNT(sensors_fields),
};

/* ---- building ---- */

/* Returns the errors of a channel. */
static struct sensor_error sensor_error_of(const struct raw_channel *raw)
{
    return (struct sensor_error){
        .gain_error = raw->gain_error,
        .offset = raw->offset,
        .noise_rms = raw->noise_rms,
        .drift_per_sqrt_s = raw->drift_per_sqrt_s,
        .ramp_per_s = raw->ramp_per_s,
        .full_scale = raw->full_scale,
        .lsb = raw->lsb,
        .latency_ns = llround(raw->latency_s * 1e9),
    };
}

/* Replaces the channels that raw gives. */
static void sensors_apply_joint(const struct raw_joint_sensors *raw, const struct robot_sea *sea,
                                struct sensor_joint *to)
{
    const struct {
        bool given;
        const struct raw_channel *from;
        struct sensor_error *to;
    } channel[] = {
        {raw->link_given, &raw->link_encoder, &to->link_encoder},
        {raw->motor_given, &raw->motor_encoder, &to->motor_encoder},
        {raw->current_given, &raw->current, &to->current},
        {raw->torque_given, &raw->torque, &to->torque},
        {raw->temperature_given, &raw->temperature, &to->temperature},
    };

    for (size_t i = 0; i < ARRAY_COUNT(channel); i++) {
        if (channel[i].given) {
            *channel[i].to = sensor_error_of(channel[i].from);
        }
    }
    /* A drive that warms up in the plant has that temperature */
    if (raw->winding_given && !(sea->effects && sea->effects->thermal.winding_k_w > 0.0)) {
        to->thermal = (struct sensor_thermal){
            .ambient_c = raw->winding.ambient_c,
            .resistance_ohm = sea->R,
            .k_per_w = raw->winding.k_per_w,
            .time_constant_s = raw->winding.time_constant_s,
        };
    }
    to->incremental = raw->incremental_given ? raw->incremental : to->incremental;
}

/* Replaces the errors of a force-torque sensor that raw gives. */
static void sensors_apply_ft(const struct raw_ft_sensors *raw, struct sensor_ft *to)
{
    to->force = raw->force_given ? sensor_error_of(&raw->force) : to->force;
    to->torque = raw->torque_given ? sensor_error_of(&raw->torque) : to->torque;
    to->crosstalk = raw->crosstalk_given ? raw->crosstalk : to->crosstalk;
}

/* Checks that a sensor with crosstalk has full scales. */
static enum error_code sensors_check_crosstalk(struct rig_builder *b, const struct yaml_mark *mark,
                                               const struct sensor_ft *ft)
{
    if (ft->crosstalk > 0.0 && (ft->force.full_scale == 0.0 || ft->torque.full_scale == 0.0)) {
        return yaml_error(b->error, mark,
                          "found crosstalk of %s without a full_scale of force_n and torque_nm, "
                          "expected both",
                          ft->name);
    }
    return ERROR_NONE;
}

enum error_code rig_build_sensors(struct rig_builder *b)
{
    const struct raw_sensors *raw = &b->raw->sensors;
    const struct robot *robot = b->robot;
    struct sensor_joint *joint = arena_alloc(b->arena, robot->njoint + 1, sizeof *joint);
    struct sensor_ft *ft = arena_alloc(b->arena, robot->nft + 1, sizeof *ft);
    enum error_code code;
    int index;

    if (!joint || !ft) {
        return rig_no_memory(b);
    }

    /* Joints: the common errors, then the exceptions */
    for (size_t j = 0; j < robot->njoint; j++) {
        joint[j].name = robot->joint[j].name;
        sensors_apply_joint(&raw->every_joint, &robot->joint[j].sea, &joint[j]);
    }
    for (size_t i = 0; i < raw->njoint; i++) {
        code = rig_find(b, &raw->joint[i].mark, "joint", raw->joint[i].name,
                        RIG_NAMES(robot->joint, robot->njoint), &index);
        if (code) {
            return code;
        }
        sensors_apply_joint(&raw->joint[i], &robot->joint[index].sea, &joint[index]);
    }

    /* Force-torque sensors likewise */
    for (size_t f = 0; f < robot->nft; f++) {
        ft[f].name = robot->ft[f].name;
        sensors_apply_ft(&raw->every_ft, &ft[f]);
    }
    for (size_t i = 0; i < raw->nft; i++) {
        code = rig_find(b, &raw->ft[i].mark, "F/T sensor", raw->ft[i].name,
                        RIG_NAMES(robot->ft, robot->nft), &index);
        if (code) {
            return code;
        }
        sensors_apply_ft(&raw->ft[i], &ft[index]);
    }
    for (size_t f = 0; f < robot->nft; f++) {
        code = sensors_check_crosstalk(b, &raw->mark, &ft[f]);
        if (code) {
            return code;
        }
    }

    b->rig->sensing = (struct sensing_config){
        .njoint = robot->njoint,
        .nft = robot->nft,
        .joint = joint,
        .ft = ft,
        .gyro = sensor_error_of(&raw->imu.gyro),
        .accel = sensor_error_of(&raw->imu.accel),
        .magnetic = sensor_error_of(&raw->imu.magnetic),
        .orientation = sensor_error_of(&raw->imu.orientation),
        .tick_ns = b->rig->tick_ns,
        .seed = b->rig->seed,
    };
    return ERROR_NONE;
}
