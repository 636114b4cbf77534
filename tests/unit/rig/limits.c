/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Both sides of every limit that a rig file or a robot file has; see tests/unit/schema_limits.h.
 */
#include "model/description/yaml.h"
#include "rig/schema.h"

#include "tests/unit/schema_limits.h"

static const struct limit rig_limits[] = {
    {"name", 1, 63},
    {"description", 1, 400},
    {"robot.springs[].Ks_nm_rad", 0, 1e9},
    {"robot.springs[].Ds_nm_s_rad", 0, 1e9},
    {"robot.added_mass_kg", -1e3, 1e3},
    {"tick_s", 1e-5, 0.1},
    {"substep_s", 1e-7, 1},
    {"tolerance", 1e-13, 0.1},
    {"supply_v", DBL_MIN, 1e4},
    {"initial.base_xyz_m", -1e3, 1e3},
    {"initial.base_height_m", -1e3, 1e3},
    {"initial.base_rpy_rad", -7, 7},
    {"scene.transition_velocity_m_s", 1e-6, 10},
    {"scene.materials[].young_pa", 1, 1e12},
    {"scene.materials[].thickness_m", 1e-6, 1},
    {"scene.materials[].backing_pa_per_m", 0, 1e12},
    {"scene.materials[].dissipation_s_per_m", 0, 1e4},
    {"scene.materials[].static_friction", 0, 100},
    {"scene.materials[].dynamic_friction", 0, 100},
    {"scene.materials[].viscous_s_per_m", 0, 100},
    {"scene.bodies[].name", 1, 63},
    {"scene.bodies[].mass_kg", DBL_MIN, 1e6},
    {"scene.bodies[].com_m", -1e3, 1e3},
    {"scene.bodies[].inertia_kg_m2", -1e9, 1e9},
    {"scene.bodies[].box_m", 1e-6, 1e3},
    {"scene.bodies[].sphere_radius_m", 1e-6, 1e3},
    {"*.xyz_m", -1e3, 1e3},
    {"*.rpy_rad", -7, 7},
    {"scene.bodies[].velocity_m_s", -1e3, 1e3},
    {"scene.bodies[].rate_rad_s", -1e3, 1e3},
    {"scene.surfaces[].name", 1, 63},
    {"scene.surfaces[].radius_m", 1e-6, 1e3},
    {"scene.surfaces[].length_m", 0, 1e3},
    {"scene.surfaces[].half_extents_m", 1e-6, 1e3},
    {"scene.surfaces[].cells", 1, 200},
    {"motors.joint_ticks_per_rev", 1, 1e9},
    {"motors.motor_ticks_per_link_rev", 1, 1e9},
    {"motors.torque_full_scale_nm", 1, 65535},
    {"*.current_limit_a", DBL_MIN, 1e3},
    {"motors.temperature_limit_c", 0, 125},
    {"motors.command_timeout_s", 0, 60},
    {"motors.rotor_poles", 2, 126},
    {"motors.status_period_s", 0, 10},
    {"motors.boot_s", 0, 60},
    {"motors.switches[].negative_limit_rad", -1e3, 1e3},
    {"motors.switches[].positive_limit_rad", -1e3, 1e3},
    {"motors.switches[].home_rad", -1e3, 1e3},
    {"buses[].name", 1, 63},
    {"buses[].interface", 1, 15},
    {"protocol", 1, 400},
    {"buses[].protocol", 1, 400},
    {"buses[].bitrate", 10e3, 1e6},
    {"buses[].data_bitrate", 10e3, 8e6},
    {"buses[].sample_point", 0.5, 0.95},
    {"buses[].restart_ms", 0, 6e4},
    {"buses[].boards[].name", 1, 63},
    {"buses[].boards[].address", 1, 31},
    {"buses[].boards[].full_scale_n", 1, 65535},
    {"buses[].boards[].full_scale_nm", 1, 65535},
    {"buses[].boards[].period_s", 0.001, 0.255},
    {"buses[].boards[].external_timeout_s", 0.001, 60},
    {"wire.queue", 1, 4096},
    {"wire.restart_s", 0, 3600},
    {"lockstep.step_id", 0, 2047},
    {"lockstep.done_id", 0, 2047},
    {"lockstep.partner_timeout_s", 0.01, 3600},
    {"realtime.priority", 0, 99},
    {"realtime.cpu", -1, 1023},
    {"realtime.stop_after", 1, 1e9},
    {"record.directory", 1, 4000},
    {"page.listen", 1, 80},
    {"*.kp_v_per_rad", 0, 1e6},
    {"*.ki_v_per_rad_s", 0, 1e6},
    {"*.kd_v_s_per_rad", 0, 1e6},
    {"*.kw_v_s_per_rad", 0, 1e6},
    {"*.trim_per_s", 0, 1e3},
    {"*.limit_v", DBL_MIN, 1e4},
    {"*.load_v_per_nm", 0, 1e4},
    {"tasks.servo.command_period_s", 1e-5, 1},
    {"*.sway_damping_per_s", 0, 1e3},
    {"tasks.squat.thigh_m", 0.01, 10},
    {"tasks.squat.shank_m", 0.01, 10},
    {"tasks.squat.depth_m", 0, 10},
    {"tasks.squat.period_s", 0.1, 1e3},
    {"tasks.squat.cycles", 1, 1e6},
    {"tasks.grasp.settle_s", 0.1, 1e3},
    {"tasks.grasp.path[].name", 1, 31},
    {"tasks.grasp.path[].until_s", DBL_MIN, 1e3},
    {"tasks.grasp.path[].arm_rad", -7, 7},
    {"tasks.grasp.hold_s", 0, 1e3},
    {"tasks.grasp.least_press_n", 0, 1e6},
    {"tasks.grasp.least_carry_n", 0, 1e6},
    {"tasks.hold.duration_s", 0, 1e6},
    {"tasks.hold.tolerance_rad", 1e-6, 10},
    {"tasks.walk.steps", 0, 1e9},
    {"tasks.walk.distance_m", 0, 1000000},
    {"tasks.walk.begin_s", 0, 1000},
    {"tasks.walk.forward_m_s", -2, 2},
    {"tasks.walk.left_m_s", -2, 2},
    {"tasks.walk.turn_rad_s", -2, 2},
    {"tasks.walk.attitude_per_s", 0, 1000},
    {"tasks.walk.lean_per_s", 0, 1},
    {"tasks.walk.com_per_s", 0, 200},
    {"tasks.walk.com_walking_per_s", 0, 200},
    {"tasks.walk.com_walking_m_s", 0, 2},
    {"tasks.walk.loaded_n", 1, 10000},
    {"tasks.walk.swing_s", 0.05, 10},
    {"tasks.walk.transfer_s", 0.01, 10},
    {"tasks.walk.start_s", 0.1, 10},
    {"tasks.walk.clearance_m", 0, 0.5},
    {"tasks.walk.width_m", 0.01, 2},
    {"tasks.walk.least_width_m", 0, 2},
    {"tasks.walk.zmp_ahead_m", -1, 1},
    {"tasks.walk.zmp_inward_m", -1, 1},
    {"tasks.walk.reach_ahead_m", 0, 2},
    {"tasks.walk.reach_back_m", 0, 2},
    {"tasks.walk.reach_out_m", 0, 2},
    {"tasks.walk.adjust", 0, 1},
    {"tasks.walk.ankle_m", 0, 1},
    {"tasks.walk.lower_m_s", 0.001, 10},
    {"tasks.walk.lower_m", 0, 1},
    {"tasks.walk.press_n", 1, 1e4},
    {"tasks.walk.ground_follow", 0, 1},
    {"tasks.walk.tilt_s", 0, 10},
    {"tasks.walk.torque_limit_nm", 0, 1e4},
    {"tasks.walk.touch_n", 0, 1e4},
    {"tasks.walk.touch_s", 0, 1},
    {"tasks.walk.flat_n", 1, 1e4},
    {"tasks.walk.height_s", 0, 10},
    {"tasks.walk.land_turn_rad_s_nm", 0, 10},
    {"tasks.walk.pelvis_height_m", 0.01, 10},
    {"tasks.walk.lean_rad", -1, 1},
    {"tasks.walk.sole_front_m", 0, 1},
    {"tasks.walk.sole_back_m", -1, 0},
    {"tasks.walk.sole_side_m", 0, 1},
    {"tasks.walk.sole_margin_m", 0, 1},
    {"tasks.walk.catch_swing_s", 0, 10},
    {"tasks.walk.catch_margin_m", -1, 1},
    {"tasks.walk.catch_reach_m", 0, 2},
    {"tasks.walk.catch_clearance_m", 0, 0.5},
    {"tasks.walk.dcm_gain", 1, 10},
    {"tasks.walk.cop_pitch_rad_s_nm", 0, 1},
    {"tasks.walk.cop_roll_rad_s_nm", 0, 1},
    {"tasks.walk.cop_leak_per_s", 0, 100},
    {"tasks.walk.force_m_s_n", 0, 0.1},
    {"tasks.walk.force_leak_per_s", 0, 100},
    {"tasks.walk.swing_follow", 0, 1},
    {"tasks.walk.carry_s", 0, 1},
    {"tasks.walk.swing_torque", 0, 4},
    {"tasks.walk.ankle_follow", 0, 1},
    {"tasks.walk.ankle_roll_kp_v_per_rad", 0, 1e6},
    {"*.gain_error", -1, 10},
    {"*.offset", -1e6, 1e6},
    {"*.noise_rms", 0, 1e6},
    {"*.drift_per_sqrt_s", 0, 1e6},
    {"*.ramp_per_s", -1e6, 1e6},
    {"*.full_scale", DBL_MIN, 1e9},
    {"*.lsb", DBL_MIN, 1e6},
    {"*.latency_s", 0, 1},
    {"*.bandwidth_hz", 0.1, 1e6},
    {"*.hysteresis", 0, 0.2},
    {"*.instability_rms", 0, 1e6},
    {"*.instability_s", 1e-3, 1e6},
    {"*.offset_per_k", -1e6, 1e6},
    {"*.gain_per_k", -1, 1},
    {"*.rise_k", -100, 200},
    {"*.eccentricity_rad", 0, 0.1},
    {"*.tool.mass_kg", 1e-6, 1e3},
    {"*.tool.com_m", -10, 10},
    {"*.tool.inertia_kg_m2", -1e3, 1e3},
    {"sensors.imu.gyro_misalignment_rad", -0.5, 0.5},
    {"sensors.imu.accel_misalignment_rad", -0.5, 0.5},
    {"sensors.imu.ahrs.accel_per_s", 0, 10},
    {"sensors.imu.ahrs.magnetic_per_s", 0, 10},
    {"sensors.imu.ahrs.bias_per_s2", 0, 100},
    {"sensors.clocks.period_s", 1e-6, 1},
    {"sensors.clocks.drift_ppm", 0, 1e4},
    {"*.ambient_c", -60, 100},
    {"*.k_per_w", 1e-6, 1e4},
    {"*.time_constant_s", 0.001, 1e6},
    {"*.crosstalk", 0, 1},
    {"seed", 0, 9e15},
    {"voltage_delay_s", 0, 0.1},
    {"supply_ohm", 0, 1e3},
    {"supply_capacitance_f", 1e-4, 1e3},
    {"brake_chopper.on_v", DBL_MIN, 1e4},
    {"brake_chopper.off_v", DBL_MIN, 1e4},
    {"brake_chopper.ohm", 1e-3, 1e6},
};

/* Of the keys of a drive, wherever it stands */
#define DRIVE_LIMITS                                                                               \
    {"*.J_kg_m2", 1e-12, 1e9}, {"*.Dm_nm_s_rad", 0, 1e9}, {"*.Ks_nm_rad", 0, 1e9},                 \
        {"*.Ds_nm_s_rad", 0, 1e9}, {"*.N", 1e-6, 1e9}, {"*.NKt_nm_a", 1e-12, 1e9},                 \
        {"*.NKw_v_s_rad", 0, 1e9}, {"*.R_ohm", 0, 1e9}, {"*.L_h", 1e-12, 1e9},                     \
        {"*.deflection_rad", 1e-6, 1e9}, {"*.stop_Ks_nm_rad", 0, 1e9},                             \
        {"*.stop_Ds_nm_s_rad", 0, 1e9}, {"*.coulomb_nm", 0, 1e6}, {"*.breakaway_nm", 0, 1e6},      \
        {"*.stribeck_rad_s", 1e-6, 1e6}, {"*.stribeck_exponent", 0.25, 16},                        \
        {"*.load_motor", 0, 0.95}, {"*.load_external", 0, 0.95}, {"*.load_motor_stribeck", 0, 10}, \
        {"*.load_external_stribeck", 0, 10}, {"*.load_motor_per_nm", 0, 1e3},                      \
        {"*.load_external_per_nm", 0, 1e3}, {"*.backlash_rad", 0, 1}, {"*.hysteresis_nm", 0, 1e6}, \
        {"*.hysteresis_nm_rad", 1e-6, 1e6}, {"*.winding_k_w", 1e-6, 1e6},                          \
        {"*.housing_k_w", 1e-6, 1e6}, {"*.winding_j_k", 1e-3, 1e9}, {"*.housing_j_k", 1e-3, 1e9},  \
        {"*.ambient_c", -60, 200}, {"*.R_per_k", 0, 0.01}, {"*.NKt_per_k", -0.01, 0},              \
        {"*.dead_time_s", 0, 1e-3}, {"*.pwm_hz", 1, 1e7}, {"*.diode_v", 0, 10},                    \
        {"*.switching_s", 0, 1e-3}, {"*.bridge_ohm", 0, 1e6}, {"*.per_turn", 1e-6, 1e6},           \
        {"*.rad", 0, 1}, {"*.nm", 0, 1e6}, {"*.bore_m", 1e-4, 10}, {"*.rod_m", 0, 10},             \
        {"*.stroke_m", 1e-4, 100}, {"*.dead_volume_m3", 1e-9, 1}, {"*.base_m", 1e-4, 100},         \
        {"*.arm_m", 1e-4, 100}, {"*.offset_rad", -10, 10}, {"*.closed_m", 1e-4, 100},              \
        {"*.valve_hz", 1, 1e4}, {"*.valve_damping", 0.05, 0.99}, {"*.valve_v", 1e-3, 1e4},         \
        {"*.valve_flow_m3_s", 1e-9, 10}, {"*.valve_drop_pa", 1e3, 1e9},                            \
        {"*.bulk_modulus_pa", 1e6, 1e11}, {"*.valve_lap", 0, 0.5}, {"*.leakage_m3_s_pa", 0, 1e-6}, \
        {"*.viscous_n_s_m", 0, 1e9}, {"*.coulomb_n", 0, 1e9}, {"*.coulomb_m_s", 1e-6, 10},         \
    {                                                                                              \
        "*.phase_rad", -1e3, 1e3                                                                   \
    }

static const struct limit drive_limits[] = {
    {"name", 1, 63},
    {"description", 1, 400},
    {"supply_v", DBL_MIN, 1e6},
    {"torque_nm", DBL_MIN, 1e6},
    {"peak_torque_nm", DBL_MIN, 1e6},
    {"speed_rad_s", DBL_MIN, 1e6},
    {"pressure_pa", 1e5, 1e9},
    {"mass_kg", DBL_MIN, 1e6},
    DRIVE_LIMITS,
};

static const struct limit robot_limits[] = {
    {"name", 1, 63},
    {"description", 1, 400},
    {"gravity_m_s2", -1e3, 1e3},
    {"*.body", 1, 63},
    {"*.file", 1, 255},
    {"couplings[].follower", 1, 63},
    {"couplings[].leader", 1, 63},
    {"couplings[].multiplier", -1e3, 1e3},
    {"couplings[].offset_rad", -1e3, 1e3},
    {"couplings[].offset_m", -1e3, 1e3},
    {"couplings[].stiffness_nm_rad", 1e-9, 1e9},
    {"couplings[].stiffness_n_m", 1e-9, 1e9},
    DRIVE_LIMITS,
    {"hydraulic_supply.pressure_pa", 1e5, 1e9},
    {"hydraulic_supply.return_pa", 0, 1e8},
    {"hydraulic_supply.pump_m3_s", 0, 10},
    {"hydraulic_supply.accumulator_m3", 0, 10},
    {"hydraulic_supply.precharge_pa", 0, 1e9},
    {"hydraulic_supply.line_m3", 1e-7, 1},
    {"hydraulic_supply.relief_pa", 0, 1e9},
    {"hydraulic_supply.relief_m3_s_pa", 0, 1e-3},
    {"*.stiffness_nm_rad", 0, 1e9},
    {"*.damping_nm_s_rad", 0, 1e9},
    {"*.stiffness_n_m", 0, 1e9},
    {"*.damping_n_s_m", 0, 1e9},
    {"bodies[].name", 1, 63},
    {"bodies[].mass_kg", 1e-15, 1e6},
    {"*.com_m", -1e3, 1e3},
    {"*.inertia_kg_m2", -1e6, 1e6},
    {"*joints[].name", 1, 63},
    {"*joints[].paper_index", 0, 1e3},
    {"*joints[].parent", 1, 63},
    {"*joints[].child", 1, 63},
    {"*joints[].axis", -1, 1},
    {"*.xyz_m", -1e3, 1e3},
    {"*.rpy_rad", -1e3, 1e3},
    {"*joints[].limits.lower_rad", -1e6, 1e6},
    {"*joints[].limits.upper_rad", -1e6, 1e6},
    {"*joints[].limits.torque_nm", 0, 1e6},
    {"*joints[].limits.lower_m", -1e6, 1e6},
    {"*joints[].limits.upper_m", -1e6, 1e6},
    {"*joints[].limits.force_n", 0, 1e6},
    {"*joints[].parallel_spring.k_p_n_m", 0, 1e9},
    {"*joints[].parallel_spring.d_p_n_s_m", 0, 1e9},
    {"*joints[].parallel_spring.r_m", 1e-6, 1e3},
    {"*joints[].parallel_spring.sense", -1, 1},
    {"*passive.rest_rad", -1e9, 1e9},
    {"*passive.rest_m", -1e9, 1e9},
    {"frames[].name", 1, 63},
    {"capsules[].name", 1, 63},
    {"visuals[].name", 1, 63},
    {"visuals[].half_extents_m", DBL_MIN, 1e3},
    {"visuals[].radius_m", DBL_MIN, 1e3},
    {"visuals[].missing", 1, 400},
    {"visuals[].color", 0, 1},
    {"*.radius_m", 1e-6, 1e3},
    {"*.length_m", 0, 1e3},
    {"ft_sensors[].name", 1, 63},
    {"*.frame", 1, 63},
    {"ft_sensors[].distal.mass_kg", 0, 1e6},
    {"poses[].base_xyz_m", -1e6, 1e6},
    {"poses[].base_rpy_rad", -1e3, 1e3},
    {"poses[].joints_rad", -1e6, 1e6},
    {"poses[].joints_m", -1e6, 1e6},
    {"variants[].bodies[].name", 1, 63},
    {"variants[].bodies[].mass_kg", 1e-15, 1e6},
    {"variants[].frames[].name", 1, 63},
    {"variants[].capsules[].name", 1, 63},
    {"variants[].ft_sensors[].name", 1, 63},
    {"variants[].ft_sensors[].distal.mass_kg", 0, 1e6},
};

static void limits_of_rig_files(void **state)
{
    (void)state;
    check_schema(&rig_file_schema, rig_limits, ARRAY_COUNT(rig_limits));
}

static void limits_of_robot_files(void **state)
{
    (void)state;
    check_schema(&robot_file_schema, robot_limits, ARRAY_COUNT(robot_limits));
}

static void limits_of_drive_files(void **state)
{
    (void)state;
    check_schema(&drive_file_schema, drive_limits, ARRAY_COUNT(drive_limits));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(limits_of_drive_files, open_arena, close_arena),
        cmocka_unit_test_setup_teardown(limits_of_rig_files, open_arena, close_arena),
        cmocka_unit_test_setup_teardown(limits_of_robot_files, open_arena, close_arena),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
