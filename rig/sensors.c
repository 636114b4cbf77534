/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the section `sensors` of a rig: its schema, and the error models of the sensors on the
 * boards. */
#include "boards/protocol.h"
#include "rig/builder_private.h"

#include <float.h>

#define AT(type, member) offsetof(struct type, member)

static const struct yaml_field channel_fields[] = {
    YAML_NUMBER("gain_error", false, sensor_error, gain_error, -1.0, 10.0),
    YAML_NUMBER("offset", false, sensor_error, offset, -1e6, 1e6),
    YAML_NUMBER("noise_rms", false, sensor_error, noise_rms, 0.0, 1e6),
    YAML_NUMBER("drift_per_sqrt_s", false, sensor_error, drift_per_sqrt_s, 0.0, 1e6),
    YAML_NUMBER("ramp_per_s", false, sensor_error, ramp_per_s, -1e6, 1e6),
    YAML_NUMBER("full_scale", false, sensor_error, full_scale, DBL_MIN, 1e9),
    YAML_NUMBER("lsb", false, sensor_error, lsb, DBL_MIN, 1e6),
    YAML_SECONDS("latency_s", false, sensor_error, latency_ns, 0.0,
                 1e-9 * (double)SENSING_LATENCY_MAX_NS),
    YAML_NUMBER("bandwidth_hz", false, sensor_error, bandwidth_hz, 0.1, 1e6),
    YAML_NUMBER("hysteresis", false, sensor_error, hysteresis, 0.0, 0.2),
    YAML_NUMBER("instability_rms", false, sensor_error, instability_rms, 0.0, 1e6),
    YAML_NUMBER("instability_s", false, sensor_error, instability_s, 1e-3, 1e6),
    YAML_NUMBER("offset_per_k", false, sensor_error, offset_per_k, -1e6, 1e6),
    YAML_NUMBER("gain_per_k", false, sensor_error, gain_per_k, -1.0, 1.0),
};
YAML_TABLE(channel, "a channel of a sensor", sensor_error, .unmarked = true);

static const struct yaml_field winding_fields[] = {
    YAML_NUMBER("ambient_c", false, sensor_thermal, ambient_c, -60.0, 100.0),
    YAML_NUMBER("k_per_w", true, sensor_thermal, k_per_w, 1e-6, 1e4),
    YAML_NUMBER("time_constant_s", true, sensor_thermal, time_constant_s, 1e-3, 1e6),
};
static const struct sensor_thermal winding_defaults = {.ambient_c = 25.0};
YAML_TABLE(winding, "a winding that heats", sensor_thermal, .unmarked = true,
           .defaults = &winding_defaults);

static const struct yaml_field warm_up_fields[] = {
    YAML_NUMBER("rise_k", true, sensor_warm_up, rise_k, -100.0, 200.0),
    YAML_NUMBER("time_constant_s", true, sensor_warm_up, time_constant_s, 1e-3, 1e6),
};
YAML_TABLE(warm_up, "the warming of a sensor", sensor_warm_up, .unmarked = true);

static const struct yaml_field joint_fields[] = {
    YAML_SECTION("link_encoder_rad", false, raw_joint_sensors, sensor.link_encoder, channel_schema),
    YAML_SECTION("motor_encoder_rad", false, raw_joint_sensors, sensor.motor_encoder,
                 channel_schema),
    YAML_SECTION("current_a", false, raw_joint_sensors, sensor.current, channel_schema),
    YAML_SECTION("torque_nm", false, raw_joint_sensors, sensor.torque, channel_schema),
    YAML_SECTION("temperature_c", false, raw_joint_sensors, sensor.temperature, channel_schema),
    YAML_SECTION("winding", false, raw_joint_sensors, sensor.thermal, winding_schema),
    YAML_SECTION("warm_up", false, raw_joint_sensors, sensor.warm_up, warm_up_schema),
    YAML_NUMBERS("eccentricity_rad", false, raw_joint_sensors, sensor.eccentricity_rad, 2, 0.0,
                 0.1),
    YAML_NUMBER("crosstalk", false, raw_joint_sensors, sensor.crosstalk, 0.0, 1.0),
    {"motor_encoder_from_start", YAML_BOOL, false,
     .offset = AT(raw_joint_sensors, sensor.incremental)},
};
YAML_TABLE(joint, "the sensors of a joint", raw_joint_sensors,
           .name_offset = AT(raw_joint_sensors, sensor.name));

static const struct yaml_field tool_fields[] = {
    YAML_NUMBER("mass_kg", true, robot_inertia, mass, 1e-6, 1e3),
    YAML_NUMBERS("com_m", true, robot_inertia, com, 3, -10.0, 10.0),
    YAML_NUMBERS("inertia_kg_m2", false, robot_inertia, I, 6, -1e3, 1e3),
};
YAML_TABLE(tool, "what hangs beyond a force-torque sensor", robot_inertia, .unmarked = true);

static const struct yaml_field ft_fields[] = {
    YAML_SECTION("force_n", false, raw_ft_sensors, sensor.force, channel_schema),
    YAML_SECTION("torque_nm", false, raw_ft_sensors, sensor.torque, channel_schema),
    YAML_NUMBER("crosstalk", false, raw_ft_sensors, sensor.crosstalk, 0.0, 1.0),
    YAML_SECTION("warm_up", false, raw_ft_sensors, sensor.warm_up, warm_up_schema),
    YAML_SECTION("tool", false, raw_ft_sensors, tool, tool_schema),
};
YAML_TABLE(ft, "a force-torque sensor", raw_ft_sensors,
           .name_offset = AT(raw_ft_sensors, sensor.name));

static const struct yaml_field ahrs_fields[] = {
    YAML_NUMBER("accel_per_s", true, ahrs_config, accel_per_s, 0.0, 10.0),
    YAML_NUMBER("magnetic_per_s", false, ahrs_config, magnetic_per_s, 0.0, 10.0),
    YAML_NUMBER("bias_per_s2", false, ahrs_config, bias_per_s2, 0.0, 100.0),
};
YAML_TABLE(ahrs, "the attitude filter of the inertial sensor", ahrs_config, .unmarked = true);

static const struct yaml_field imu_fields[] = {
    YAML_SECTION("gyro_rad_s", false, raw_imu_sensors, sensor.gyro, channel_schema),
    YAML_SECTION("accel_m_s2", false, raw_imu_sensors, sensor.accel, channel_schema),
    YAML_SECTION("magnetic_t", false, raw_imu_sensors, sensor.magnetic, channel_schema),
    YAML_SECTION("orientation", false, raw_imu_sensors, sensor.orientation, channel_schema),
    YAML_NUMBERS("gyro_misalignment_rad", false, raw_imu_sensors, sensor.gyro_misalignment_rad, 3,
                 -0.5, 0.5),
    YAML_NUMBERS("accel_misalignment_rad", false, raw_imu_sensors, sensor.accel_misalignment_rad, 3,
                 -0.5, 0.5),
    YAML_SECTION("warm_up", false, raw_imu_sensors, sensor.warm_up, warm_up_schema),
    YAML_SECTION("ahrs", false, raw_imu_sensors, sensor.ahrs, ahrs_schema),
};
YAML_TABLE(imu, "the inertial sensor", raw_imu_sensors);

static const struct yaml_field clocks_fields[] = {
    YAML_SECONDS("period_s", true, sensor_clocks, period_ns, 1e-6,
                 1e-9 * (double)SENSING_LATENCY_MAX_NS),
    YAML_NUMBER("drift_ppm", false, sensor_clocks, drift_ppm, 0.0, SENSING_CLOCK_DRIFT_MAX_PPM),
};
YAML_TABLE(clocks, "the sampling clocks of the boards", sensor_clocks, .unmarked = true);

static const struct yaml_field sensors_fields[] = {
    YAML_SECTION("every_joint", false, raw_sensors, every_joint, joint_schema),
    YAML_ENTRIES("joints", YAML_DICT, false, raw_sensors, joint, njoint, joint_schema),
    YAML_SECTION("every_ft", false, raw_sensors, every_ft, ft_schema),
    YAML_ENTRIES("fts", YAML_DICT, false, raw_sensors, ft, nft, ft_schema),
    YAML_SECTION("imu", false, raw_sensors, imu, imu_schema),
    YAML_SECTION("clocks", false, raw_sensors, clocks, clocks_schema),
};
const struct yaml_schema rig_sensors_schema =
    YAML_SCHEMA("the sensors", struct raw_sensors, sensors_fields);

/* ---- building ---- */

/* Assigns clocks to sensors. A joint's or sensor's clock is the clock of its board. Clocks have
 * numbers and names in the order of the boards. A torque board reports a value that the joint's
 * motor board has sampled, so that board's clock counts. A joint or sensor without a board has the
 * first clock. */
static enum error_code sensors_assign_clocks(struct rig_builder *b, struct sensor_joint *joint,
                                             struct sensor_ft *ft)
{
    const struct boards_config *boards = &b->rig->boards;
    const char **name = arena_alloc(b->arena, boards->nboard + 1, sizeof *name);

    if (!name) {
        return rig_no_memory(b);
    }
    name[0] = "none"; /* a rig without boards still needs one clock */
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

/* Checks the errors of a channel. A low pass must be below half the tick rate, hysteresis needs a
 * full scale, and instability needs both of its numbers. */
static enum error_code sensors_check_channel(struct rig_builder *b, const struct yaml_mark *section,
                                             const char *key, const struct sensor_error *channel)
{
    const double half_hz = 0.5e9 / (double)b->rig->tick_ns;
    const struct yaml_mark *mark = yaml_place(section, key);

    if (channel->bandwidth_hz >= half_hz) {
        return yaml_error(b->error, mark,
                          "found bandwidth_hz %g, expected less than half the rate of the ticks, "
                          "%g",
                          channel->bandwidth_hz, half_hz);
    }
    if (channel->hysteresis > 0.0 && channel->full_scale == 0.0) {
        return yaml_error(b->error, mark, "found hysteresis without full_scale, expected both");
    }
    if ((channel->instability_rms > 0.0) != (channel->instability_s > 0.0)) {
        return yaml_error(b->error, mark,
                          "found one of instability_rms and instability_s, expected both or none");
    }
    return ERROR_NONE;
}

/* Checks all channels of a section. The section begins with its mark. */
static enum error_code sensors_check_section(struct rig_builder *b,
                                             const struct yaml_schema *schema, const void *section)
{
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < schema->field_count && !code; i++) {
        const struct yaml_field *field = &schema->fields[i];

        if (field->schema == &channel_schema) {
            code = sensors_check_channel(b, section, field->key,
                                         (const void *)((const char *)section + field->offset));
        }
    }
    return code;
}

/* Checks the channels of all sensors. */
static enum error_code sensors_check_channels(struct rig_builder *b)
{
    const struct raw_sensors *raw = &b->raw->sensors;
    enum error_code code = sensors_check_section(b, &joint_schema, &raw->every_joint);

    for (size_t i = 0; i < raw->njoint && !code; i++) {
        code = sensors_check_section(b, &joint_schema, &raw->joint[i]);
    }
    code = code ? code : sensors_check_section(b, &ft_schema, &raw->every_ft);
    for (size_t i = 0; i < raw->nft && !code; i++) {
        code = sensors_check_section(b, &ft_schema, &raw->ft[i]);
    }
    return code ? code : sensors_check_section(b, &imu_schema, &raw->imu);
}

/* Builds the error models of the joint sensors: the common values, overridden by the values of
 * single joints. */
static enum error_code sensors_build_joints(struct rig_builder *b, struct sensor_joint *joint)
{
    const struct raw_sensors *raw = &b->raw->sensors;
    const struct robot *robot = b->robot;
    int index;

    for (size_t j = 0; j < robot->njoint; j++) {
        joint[j] = raw->every_joint.sensor;
    }
    for (size_t i = 0; i < raw->njoint; i++) {
        const struct raw_joint_sensors *own = &raw->joint[i];
        struct raw_joint_sensors merged = raw->every_joint;
        enum error_code code = rig_find(b, &own->mark, "joint", own->sensor.name,
                                        RIG_NAMES(robot->joint, robot->njoint), &index);

        if (code) {
            return code;
        }
        yaml_override(&joint_schema, &own->mark, own, &merged);
        joint[index] = merged.sensor;
    }

    /* If the plant models the winding's temperature, the sensor measures it and needs no thermal
     * model */
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_sea *sea = &robot->joint[j].sea;
        const bool warms = sea->effects && sea->effects->thermal.winding_k_w > 0.0;

        joint[j].name = robot->joint[j].name;
        if (warms || joint[j].thermal.k_per_w == 0.0) {
            joint[j].thermal = (struct sensor_thermal){0};
        } else {
            joint[j].thermal.resistance_ohm = sea->R;
        }
    }
    return ERROR_NONE;
}

/* Builds the error models of the force-torque sensors: the common values, overridden by the values
 * of single sensors. */
static enum error_code sensors_build_fts(struct rig_builder *b, struct sensor_ft *ft)
{
    const struct raw_sensors *raw = &b->raw->sensors;
    const struct robot *robot = b->robot;
    enum error_code code = ERROR_NONE;
    int index;

    for (size_t f = 0; f < robot->nft; f++) {
        ft[f] = raw->every_ft.sensor;
    }
    for (size_t i = 0; i < raw->nft; i++) {
        const struct raw_ft_sensors *own = &raw->ft[i];
        struct raw_ft_sensors merged = raw->every_ft;

        code = rig_find(b, &own->mark, "F/T sensor", own->sensor.name,
                        RIG_NAMES(robot->ft, robot->nft), &index);
        if (code) {
            return code;
        }
        yaml_override(&ft_schema, &own->mark, own, &merged);
        ft[index] = merged.sensor;
    }
    for (size_t f = 0; f < robot->nft && !code; f++) {
        ft[f].name = robot->ft[f].name;
        if (ft[f].crosstalk > 0.0 &&
            (ft[f].force.full_scale == 0.0 || ft[f].torque.full_scale == 0.0)) {
            code = yaml_error(b->error, &raw->mark,
                              "found crosstalk of %s without a full_scale of force_n and "
                              "torque_nm, expected both",
                              ft[f].name);
        }
    }
    return code;
}

enum error_code rig_build_sensors(struct rig_builder *b)
{
    const struct raw_sensors *raw = &b->raw->sensors;
    struct sensor_joint *joint = arena_alloc(b->arena, b->robot->njoint + 1, sizeof *joint);
    struct sensor_ft *ft = arena_alloc(b->arena, b->robot->nft + 1, sizeof *ft);
    enum error_code code;

    if (!joint || !ft) {
        return rig_no_memory(b);
    }
    code = sensors_build_joints(b, joint);
    code = code ? code : sensors_build_fts(b, ft);
    if (code) {
        return code;
    }
    b->rig->sensing = (struct sensing_config){
        .njoint = b->robot->njoint,
        .nft = b->robot->nft,
        .joint = joint,
        .ft = ft,
        .imu = raw->imu.sensor,
        .clocks = raw->clocks,
        .tick_ns = b->rig->tick_ns,
        .seed = b->rig->seed,
    };
    b->rig->sensing.imu.ahrs.on = yaml_has(&raw->imu.mark, "ahrs");
    code = sensors_assign_clocks(b, joint, ft);
    return code ? code : sensors_check_channels(b);
}
