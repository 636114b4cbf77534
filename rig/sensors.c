/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the section `sensors` of a rig: its schema, and the errors of the boards' sensors. */
#include "rig/sensors.h"

#include "base/array.h"
#include "boards/protocol.h"
#include "rig/builder_private.h"

#include <float.h>
#include <math.h>
#include <string.h>

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
    {"bandwidth_hz", YAML_REAL, false, AT(bandwidth_hz), .min = 0.1, .max = 1e6},
    {"hysteresis", YAML_REAL, false, AT(hysteresis), .min = 0.0, .max = 0.2},
    {"instability_rms", YAML_REAL, false, AT(instability_rms), .min = 0.0, .max = 1e6},
    {"instability_s", YAML_REAL, false, AT(instability_s), .min = 1e-3, .max = 1e6},
    {"offset_per_k", YAML_REAL, false, AT(offset_per_k), .min = -1e6, .max = 1e6},
    {"gain_per_k", YAML_REAL, false, AT(gain_per_k), .min = -1.0, .max = 1.0},
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

#define STRUCT raw_warm_up
static const struct yaml_field warm_up_fields[] = {
    {"rise_k", YAML_REAL, true, AT(rise_k), .min = -100.0, .max = 200.0},
    {"time_constant_s", YAML_REAL, true, AT(time_constant_s), .min = 1e-3, .max = 1e6},
};
#undef STRUCT
static const struct yaml_schema warm_up_schema = {
    .what = "the warming of a sensor",
    .size = sizeof(struct raw_warm_up),
    .fields = warm_up_fields,
    .field_count = ARRAY_COUNT(warm_up_fields),
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
    {"warm_up", YAML_MAP, false, AT(warm_up), .schema = &warm_up_schema,
     .given_offset = AT(warm_up_given)},
    {"eccentricity_rad", YAML_REALS, false, AT(eccentricity_rad), .count = 2, .min = 0.0,
     .max = 0.1, .given_offset = AT(eccentricity_given)},
    {"crosstalk", YAML_REAL, false, AT(crosstalk), .min = 0.0, .max = 1.0,
     .given_offset = AT(crosstalk_given)},
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

#define STRUCT raw_tool
static const struct yaml_field tool_fields[] = {
    {"mass_kg", YAML_REAL, true, AT(mass_kg), .min = 1e-6, .max = 1e3},
    {"com_m", YAML_REALS, true, AT(com_m), .count = 3, .min = -10.0, .max = 10.0},
    {"inertia_kg_m2", YAML_REALS, false, AT(inertia_kg_m2), .count = 6, .min = -1e3, .max = 1e3},
};
#undef STRUCT
static const struct yaml_schema tool_schema = {
    .what = "what hangs beyond a force-torque sensor",
    .size = sizeof(struct raw_tool),
    .fields = tool_fields,
    .field_count = ARRAY_COUNT(tool_fields),
};

#define STRUCT raw_ft_sensors
static const struct yaml_field ft_fields[] = {
    CHANNEL("force_n", force, force_given),
    CHANNEL("torque_nm", torque, torque_given),
    {"crosstalk", YAML_REAL, false, AT(crosstalk), .min = 0.0, .max = 1.0,
     .given_offset = AT(crosstalk_given)},
    {"warm_up", YAML_MAP, false, AT(warm_up), .schema = &warm_up_schema,
     .given_offset = AT(warm_up_given)},
    {"tool", YAML_MAP, false, AT(tool), .schema = &tool_schema, .given_offset = AT(tool_given)},
};
#undef STRUCT
static const struct yaml_schema ft_schema = {
    .what = "a force-torque sensor",
    .size = sizeof(struct raw_ft_sensors),
    .fields = ft_fields,
    .field_count = ARRAY_COUNT(ft_fields),
    .name_offset = offsetof(struct raw_ft_sensors, name),
};

#define STRUCT raw_ahrs
static const struct yaml_field ahrs_fields[] = {
    {"accel_per_s", YAML_REAL, true, AT(accel_per_s), .min = 0.0, .max = 10.0},
    {"magnetic_per_s", YAML_REAL, false, AT(magnetic_per_s), .min = 0.0, .max = 10.0},
    {"bias_per_s2", YAML_REAL, false, AT(bias_per_s2), .min = 0.0, .max = 100.0},
};
#undef STRUCT
static const struct yaml_schema ahrs_schema = {
    .what = "the attitude filter of the inertial sensor",
    .size = sizeof(struct raw_ahrs),
    .fields = ahrs_fields,
    .field_count = ARRAY_COUNT(ahrs_fields),
};

#define STRUCT raw_imu_sensors
static const struct yaml_field imu_fields[] = {
    {"gyro_rad_s", YAML_MAP, false, AT(gyro), .schema = &channel_schema},
    {"accel_m_s2", YAML_MAP, false, AT(accel), .schema = &channel_schema},
    {"magnetic_t", YAML_MAP, false, AT(magnetic), .schema = &channel_schema},
    {"orientation", YAML_MAP, false, AT(orientation), .schema = &channel_schema},
    {"gyro_misalignment_rad", YAML_REALS, false, AT(gyro_misalignment_rad), .count = 3, .min = -0.5,
     .max = 0.5},
    {"accel_misalignment_rad", YAML_REALS, false, AT(accel_misalignment_rad), .count = 3,
     .min = -0.5, .max = 0.5},
    {"warm_up", YAML_MAP, false, AT(warm_up), .schema = &warm_up_schema},
    {"ahrs", YAML_MAP, false, AT(ahrs), .schema = &ahrs_schema, .given_offset = AT(ahrs_given)},
};
#undef STRUCT
static const struct yaml_schema imu_schema = {
    .what = "the inertial sensor",
    .size = sizeof(struct raw_imu_sensors),
    .fields = imu_fields,
    .field_count = ARRAY_COUNT(imu_fields),
};

#define STRUCT raw_clocks
static const struct yaml_field clocks_fields[] = {
    {"period_s", YAML_REAL, true, AT(period_s), .min = 1e-6,
     .max = 1e-9 * (double)SENSING_LATENCY_MAX_NS},
    {"drift_ppm", YAML_REAL, false, AT(drift_ppm), .min = 0.0, .max = SENSING_CLOCK_DRIFT_MAX_PPM},
};
#undef STRUCT
static const struct yaml_schema clocks_schema = {
    .what = "the sampling clocks of the boards",
    .size = sizeof(struct raw_clocks),
    .fields = clocks_fields,
    .field_count = ARRAY_COUNT(clocks_fields),
};

#define STRUCT raw_sensors
static const struct yaml_field sensors_fields[] = {
    {"every_joint", YAML_MAP, false, AT(every_joint), .schema = &joint_schema},
    {"joints", YAML_DICT, false, AT(joint), AT(njoint), .schema = &joint_schema},
    {"every_ft", YAML_MAP, false, AT(every_ft), .schema = &ft_schema},
    {"fts", YAML_DICT, false, AT(ft), AT(nft), .schema = &ft_schema},
    {"imu", YAML_MAP, false, AT(imu), .schema = &imu_schema},
    {"clocks", YAML_MAP, false, AT(clocks), .schema = &clocks_schema},
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
        .bandwidth_hz = raw->bandwidth_hz,
        .hysteresis = raw->hysteresis,
        .instability_rms = raw->instability_rms,
        .instability_s = raw->instability_s,
        .offset_per_k = raw->offset_per_k,
        .gain_per_k = raw->gain_per_k,
    };
}

/* Returns the warming of a sensor. */
static struct sensor_warm_up sensor_warm_up_of(const struct raw_warm_up *raw)
{
    return (struct sensor_warm_up){raw->rise_k, raw->time_constant_s};
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
    to->warm_up = raw->warm_up_given ? sensor_warm_up_of(&raw->warm_up) : to->warm_up;
    to->crosstalk = raw->crosstalk_given ? raw->crosstalk : to->crosstalk;
    if (raw->eccentricity_given) {
        memcpy(to->eccentricity_rad, raw->eccentricity_rad, sizeof to->eccentricity_rad);
    }
    to->incremental = raw->incremental_given ? raw->incremental : to->incremental;
}

/* Replaces the errors of a force-torque sensor that raw gives. */
static void sensors_apply_ft(const struct raw_ft_sensors *raw, struct sensor_ft *to)
{
    to->force = raw->force_given ? sensor_error_of(&raw->force) : to->force;
    to->torque = raw->torque_given ? sensor_error_of(&raw->torque) : to->torque;
    to->crosstalk = raw->crosstalk_given ? raw->crosstalk : to->crosstalk;
    to->warm_up = raw->warm_up_given ? sensor_warm_up_of(&raw->warm_up) : to->warm_up;
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

/* Sets the clocks: those of the boards that carry the joints and sensors, numbered by their order
 * in the rig and named as they are; torque boards show what the joint's motor board has sampled,
 * and what no board carries has the first one's. */
static enum error_code sensors_assign_clocks(struct rig_builder *b, struct sensor_joint *joint,
                                             struct sensor_ft *ft)
{
    const struct boards_config *boards = &b->rig->boards;
    const char **name = arena_alloc(b->arena, boards->nboard + 1, sizeof *name);

    if (!name) {
        return rig_no_memory(b);
    }
    name[0] = "none"; /* a rig without boards has a clock all the same */
    b->rig->sensing.clocks.name = name;
    for (size_t i = 0; i < boards->nboard; i++) {
        const struct board_config *board = &boards->board[i];
        const size_t most = b->rig->bus[board->bus].protocol->axes_max;

        name[i] = board->name;

        for (size_t a = 0; a < most && board->kind == BOARD_MOTOR; a++) {
            if (board->axis[a].joint >= 0) {
                joint[board->axis[a].joint].clock = i;
            }
        }
        if (board->kind == BOARD_FT) {
            ft[board->ft].clock = i;
        } else if (board->kind == BOARD_INERTIAL) {
            b->rig->sensing.imu.clock = i;
        }
    }
    return ERROR_NONE;
}

/* Checks that a channel has what its errors need: a low pass below half the rate of the ticks, a
 * full scale for hysteresis, both numbers of instability. */
static enum error_code sensors_check_channel(struct rig_builder *b, const struct raw_channel *raw)
{
    const double half_hz = 0.5e9 / (double)b->rig->tick_ns;

    if (raw->bandwidth_hz >= half_hz) {
        return yaml_error(b->error, &raw->mark,
                          "found bandwidth_hz %g, expected less than half the rate of the ticks, "
                          "%g",
                          raw->bandwidth_hz, half_hz);
    }
    if (raw->hysteresis > 0.0 && raw->full_scale == 0.0) {
        return yaml_error(b->error, &raw->mark,
                          "found hysteresis without full_scale, expected both");
    }
    if ((raw->instability_rms > 0.0) != (raw->instability_s > 0.0)) {
        return yaml_error(b->error, &raw->mark,
                          "found one of instability_rms and instability_s, expected both or none");
    }
    return ERROR_NONE;
}

/* Checks the channels of a joint, or of all. */
static enum error_code sensors_check_joint(struct rig_builder *b,
                                           const struct raw_joint_sensors *raw)
{
    const struct raw_channel *const channel[] = {&raw->link_encoder, &raw->motor_encoder,
                                                 &raw->current, &raw->torque, &raw->temperature};
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < ARRAY_COUNT(channel) && !code; i++) {
        code = sensors_check_channel(b, channel[i]);
    }
    return code;
}

/* Checks the channels of a force-torque sensor, or of all. */
static enum error_code sensors_check_ft(struct rig_builder *b, const struct raw_ft_sensors *raw)
{
    enum error_code code = sensors_check_channel(b, &raw->force);

    return code ? code : sensors_check_channel(b, &raw->torque);
}

/* Checks the channels of all sensors. */
static enum error_code sensors_check_channels(struct rig_builder *b)
{
    const struct raw_sensors *raw = &b->raw->sensors;
    const struct raw_channel *const imu[] = {&raw->imu.gyro, &raw->imu.accel, &raw->imu.magnetic,
                                             &raw->imu.orientation};
    enum error_code code = sensors_check_joint(b, &raw->every_joint);

    for (size_t i = 0; i < raw->njoint && !code; i++) {
        code = sensors_check_joint(b, &raw->joint[i]);
    }
    code = code ? code : sensors_check_ft(b, &raw->every_ft);
    for (size_t i = 0; i < raw->nft && !code; i++) {
        code = sensors_check_ft(b, &raw->ft[i]);
    }
    for (size_t i = 0; i < ARRAY_COUNT(imu) && !code; i++) {
        code = sensors_check_channel(b, imu[i]);
    }
    return code;
}

/* Returns the inertial sensor. */
static struct sensor_imu sensors_imu_of(const struct raw_imu_sensors *raw)
{
    struct sensor_imu imu = {
        .gyro = sensor_error_of(&raw->gyro),
        .accel = sensor_error_of(&raw->accel),
        .magnetic = sensor_error_of(&raw->magnetic),
        .orientation = sensor_error_of(&raw->orientation),
        .warm_up = sensor_warm_up_of(&raw->warm_up),
        .ahrs = {.on = raw->ahrs_given,
                 .accel_per_s = raw->ahrs.accel_per_s,
                 .magnetic_per_s = raw->ahrs.magnetic_per_s,
                 .bias_per_s2 = raw->ahrs.bias_per_s2},
    };

    memcpy(imu.gyro_misalignment_rad, raw->gyro_misalignment_rad, sizeof imu.gyro_misalignment_rad);
    memcpy(imu.accel_misalignment_rad, raw->accel_misalignment_rad,
           sizeof imu.accel_misalignment_rad);
    return imu;
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
        .imu = sensors_imu_of(&raw->imu),
        .clocks = {.period_ns = llround(raw->clocks.period_s * 1e9),
                   .drift_ppm = raw->clocks.drift_ppm},
        .tick_ns = b->rig->tick_ns,
        .seed = b->rig->seed,
    };
    code = sensors_assign_clocks(b, joint, ft);
    return code ? code : sensors_check_channels(b);
}
