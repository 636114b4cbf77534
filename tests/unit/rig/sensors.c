/* SPDX-License-Identifier: Apache-2.0 */
/* The sections `sensors`, `faults` and `seed` of a rig: what becomes of them, and where they are
 * wrong. */

#include "tests/unit/rig/rig_bench.h"

static void refused(const char *lines, const char *message)
{
    const struct rig *rig;
    struct error error = {0};

    if (read_toy_rig_with(lines, &rig, &error) == ERROR_NONE || !strstr(error.text, message) ||
        strncmp(error.text, rig_path, strlen(rig_path)) != 0) {
        fail_msg("\"%s\" gave \"%s\", expected \"%s\"", lines, error.text, message);
    }
}

TEST(without_the_sections_all_is_ideal)
{
    static const struct sensor_error none;
    const struct rig *rig = load_toy_rig_with("");

    assert_int_equal(rig->nfault, 0);
    assert_int_equal(rig->seed, 0);
    assert_true(rig->supply_ohm == 0.0);
    for (size_t j = 0; j < rig->sensing.njoint; j++) {
        assert_memory_equal(&rig->sensing.joint[j].torque, &none, sizeof none);
        assert_memory_equal(&rig->sensing.joint[j].link_encoder, &none, sizeof none);
        assert_true(rig->sensing.joint[j].thermal.resistance_ohm == 0.0);
    }
    assert_memory_equal(&rig->sensing.imu.gyro, &none, sizeof none);
}

TEST(what_a_joint_gives_replaces_the_channel_of_all)
{
    const struct rig *rig =
        load_toy_rig_with("seed: 9\n"
                          "supply_ohm: 0.1\n"
                          "sensors:\n"
                          "  every_joint:\n"
                          "    torque_nm: {noise_rms: 0.05, latency_s: 0.001}\n"
                          "    current_a: {lsb: 0.01}\n"
                          "    winding: {k_per_w: 2, time_constant_s: 100}\n"
                          "  joints:\n"
                          "    knee: {torque_nm: {offset: 1}, motor_encoder_from_start: true}\n"
                          "  every_ft: {force_n: {full_scale: 2000}, torque_nm: {full_scale: 40}}\n"
                          "  fts: {wrist_ft: {crosstalk: 0.01}}\n"
                          "  imu: {gyro_rad_s: {ramp_per_s: 0.1}, magnetic_t: {offset: 1e-6},\n"
                          "        orientation: {latency_s: 0.004}}\n");
    const struct sensor_joint *hip = &rig->sensing.joint[0], *knee = &rig->sensing.joint[1];

    assert_int_equal(rig->sensing.seed, 9);
    assert_true(rig->supply_ohm == 0.1);
    assert_true(hip->torque.noise_rms == 0.05 && hip->torque.latency_ns == 1000000);
    assert_true(hip->thermal.resistance_ohm == 0.6 && hip->thermal.ambient_c == 25.0);
    assert_false(hip->incremental);
    assert_true(knee->torque.noise_rms == 0.0 && knee->torque.offset == 1.0);
    assert_true(knee->torque.latency_ns == 0);
    assert_true(knee->current.lsb == 0.01 && knee->incremental);
    assert_true(rig->sensing.joint[2].thermal.resistance_ohm == 0.0); /* has no motor */
    assert_true(rig->sensing.ft[0].crosstalk == 0.0 && rig->sensing.ft[1].crosstalk == 0.01);
    assert_true(rig->sensing.ft[1].force.full_scale == 2000.0);
    assert_true(rig->sensing.imu.gyro.ramp_per_s == 0.1);
    assert_true(rig->sensing.imu.magnetic.offset == 1e-6);
    assert_true(rig->sensing.imu.orientation.latency_ns == 4000000);
}

/* Each key of the dynamics reaches its sensor; boards' clocks are numbered and named as the boards
 * are. */
TEST(dynamics_of_sensors_have_keys_of_their_own)
{
    const struct rig *rig = load_toy_rig_with(
        "sensors:\n"
        "  every_joint:\n"
        "    torque_nm: {bandwidth_hz: 200, hysteresis: 0.005, full_scale: 80, offset_per_k: "
        "0.02,\n"
        "                gain_per_k: 1e-4, instability_rms: 0.1, instability_s: 30}\n"
        "    eccentricity_rad: [0.006, 0.003]\n"
        "    crosstalk: 0.01\n"
        "    warm_up: {rise_k: 10, time_constant_s: 600}\n"
        "  joints: {knee: {eccentricity_rad: [0, 0], crosstalk: 0.02}}\n"
        "  every_ft: {warm_up: {rise_k: 5, time_constant_s: 60}}\n"
        "  imu:\n"
        "    gyro_misalignment_rad: [0.001, 0.002, 0.003]\n"
        "    accel_misalignment_rad: [0.004, 0.005, 0.006]\n"
        "    warm_up: {rise_k: 3, time_constant_s: 30}\n"
        "    ahrs: {accel_per_s: 0.2, bias_per_s2: 0.01}\n"
        "  clocks: {period_s: 0.001, drift_ppm: 50}\n");
    const struct sensing_config *s = &rig->sensing;
    const struct sensor_error *torque = &s->joint[0].torque;

    assert_true(torque->bandwidth_hz == 200.0 && torque->hysteresis == 0.005);
    assert_true(torque->offset_per_k == 0.02 && torque->gain_per_k == 1e-4);
    assert_true(torque->instability_rms == 0.1 && torque->instability_s == 30.0);
    assert_true(s->joint[0].eccentricity_rad[0] == 0.006 && s->joint[0].warm_up.rise_k == 10.0);
    assert_true(s->joint[0].eccentricity_rad[1] == 0.003);
    assert_true(s->joint[1].eccentricity_rad[0] == 0.0 && s->joint[1].warm_up.rise_k == 10.0);
    assert_true(s->joint[0].crosstalk == 0.01 && s->joint[1].crosstalk == 0.02);
    assert_true(s->ft[1].warm_up.time_constant_s == 60.0);
    assert_true(s->imu.gyro_misalignment_rad[2] == 0.003);
    assert_true(s->imu.accel_misalignment_rad[0] == 0.004 && s->imu.warm_up.rise_k == 3.0);
    assert_true(s->imu.ahrs.on && s->imu.ahrs.accel_per_s == 0.2);
    assert_true(s->imu.ahrs.magnetic_per_s == 0.0 && s->imu.ahrs.bias_per_s2 == 0.01);
    assert_true(s->clocks.period_ns == 1000000 && s->clocks.drift_ppm == 50.0);
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        assert_string_equal(s->clocks.name[i], board->name);
        if (board->kind == BOARD_MOTOR && board->axis[0].joint >= 0) {
            assert_int_equal(s->joint[board->axis[0].joint].clock, i);
        } else if (board->kind == BOARD_FT) {
            assert_int_equal(s->ft[board->ft].clock, i);
        }
    }
}

TEST(a_supply_has_the_bus_that_is_given)
{
    const struct rig *rig = load_toy_rig_with("supply_ohm: 0.1\nsupply_capacitance_f: 0.02\n"
                                              "brake_chopper: {on_v: 60, off_v: 55, ohm: 3}\n");

    assert_true(rig->supply_bus.capacitance_f == 0.02);
    assert_true(rig->supply_bus.on_v == 60.0 && rig->supply_bus.off_v == 55.0 &&
                rig->supply_bus.brake_ohm == 3.0);
    rig = load_toy_rig_with("");
    assert_true(rig->supply_bus.capacitance_f == 0.0 && rig->supply_bus.on_v == 0.0);
    refused("supply_capacitance_f: 0.02\n", "without supply_ohm, expected both");
    refused("supply_returns: true\n", "without supply_capacitance_f");
    refused("voltage_delay_s: 0.00137\n", "found a delay of 0.00137 s, expected whole ticks");
    refused("brake_chopper: {on_v: 60, off_v: 55, ohm: 3}\n", "without supply_capacitance_f");
    refused("supply_ohm: 0.1\nsupply_capacitance_f: 0.02\n"
            "brake_chopper: {on_v: 60, off_v: 60, ohm: 3}\n",
            "expected on_v above off_v above supply_v");
    refused("supply_ohm: 0.1\nsupply_capacitance_f: 0.02\nbrake_chopper: {on_v: 60, ohm: 3}\n",
            "off_v");
}

TEST(refuses_wrong_sensors)
{
    refused("sensors: {joints: {kne: {}}}\n", "\"knee\"");
    refused("sensors: {fts: {fot_ft: {}}}\n", "\"foot_ft\"");
    refused("sensors: {every_joint: {torque_nm: {noise: 1}}}\n", "noise_rms");
    refused("sensors: {every_joint: {torque_nm: {noise_rms: -1}}}\n", "-1");
    refused("sensors: {every_joint: {torque_nm: {latency_s: 2}}}\n", "2");
    refused("sensors: {every_ft: {crosstalk: 0.1}}\n", "full_scale");
    refused("sensors: {every_joint: {torque_nm: {hysteresis: 0.1}}}\n", "full_scale");
    refused("sensors: {fts: {wrist_ft: {force_n: {bandwidth_hz: 1e5}}}}\n",
            "half the rate of the ticks");
    refused("sensors: {imu: {gyro_rad_s: {instability_rms: 1}}}\n", "instability_s");
    refused("sensors: {joints: {knee: {current_a: {instability_s: 1}}}}\n", "instability_rms");
    refused("sensors: {every_joint: {eccentricity_rad: [0.5, 0]}}\n", "0.5");
    refused("sensors: {imu: {ahrs: {}}}\n", "accel_per_s");
    refused("sensors: {clocks: {drift_ppm: 50}}\n", "period_s");
}

TEST(faults_are_lines_in_their_order)
{
    const struct rig *rig =
        load_toy_rig_with("faults: [\"motor knee jam 1..2\", \"late: bus right late 0.01\"]\n");
    const char *extra[] = {"board shin off", "board left/12 stuck"};
    const bool wire[] = {false, false};
    struct faults *faults;
    struct error error;

    assert_ok(rig_faults_create(rig, extra, 2, rig->seed, wire, &arena, &faults, &error));
    assert_int_equal(faults_count(faults), 4);
    assert_int_equal(faults_at(faults, 0)->kind, FAULT_JAM);
    assert_int_equal(faults_find(faults, "late"), 1);
    assert_int_equal(faults_at(faults, 2)->index, 2);
    assert_int_equal(faults_at(faults, 3)->index, 1);
}

TEST(refuses_wrong_faults_with_their_place)
{
    const struct rig *rig = load_toy_rig_with("");
    const char *extra[] = {"motor wag jam"};
    const bool wire[] = {false, false};
    struct faults *faults;
    struct error error;

    refused("faults: [\"motor knee jam\", \"motor nee jam\"]\n", ":28: fault \"motor nee jam\"");
    refused("faults: [\"a: motor knee jam\", \"a: motor hip jam\"]\n", "name a again");
    assert_int_equal(rig_faults_create(rig, extra, 1, 0, wire, &arena, &faults, &error),
                     ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "--fault: "));
}

TEST_GROUP(open_rig_tree, close_rig_tree)
