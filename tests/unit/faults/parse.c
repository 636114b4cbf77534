/* SPDX-License-Identifier: Apache-2.0 */
/* Lines of faults as people write them, right and wrong. */
#include "tests/unit/faults/lines.h"

static void assert_refused(const char *text, enum error_code code, const char *message)
{
    struct fault fault;
    struct error error = {0};

    if (fault_parse(text, &names, &fault, &error) != code || !strstr(error.text, message)) {
        fail_msg("\"%s\" gave \"%s\", expected \"%s\"", text, error.text, message);
    }
}

TEST(reads_what_is_broken_how_and_when)
{
    struct fault fault = parse("motor LKneeSag jam 2.0..2.5");

    assert_int_equal(fault.target, FAULT_MOTOR);
    assert_int_equal(fault.kind, FAULT_JAM);
    assert_int_equal(fault.index, 1);
    assert_int_equal(fault.from_ns, 2 * SECOND);
    assert_int_equal(fault.to_ns, 5 * SECOND / 2);
    assert_string_equal(fault.text, "motor LKneeSag jam 2.0..2.5");
    assert_string_equal(fault.name, "");
}

TEST(window_may_be_open_missing_or_manual)
{
    struct fault fault = parse("motor LHipSag short 0.25..");

    assert_int_equal(fault.from_ns, SECOND / 4);
    assert_int_equal(fault.to_ns, INT64_MAX);
    fault = parse("motor LHipSag open_phase");
    assert_int_equal(fault.from_ns, 0);
    assert_int_equal(fault.to_ns, INT64_MAX);
    fault = parse("knee: motor LHipSag spring_break manual");
    assert_int_equal(fault.from_ns, INT64_MAX);
    assert_string_equal(fault.name, "knee");
}

TEST(sensors_are_numbered_through)
{
    struct fault fault = parse("sensor LKneeSag.motor_encoder stuck 3..");

    assert_int_equal(fault.index, SENSOR_JOINT_CHANNELS + SENSOR_MOTOR_ENCODER);
    assert_int_equal(fault.channels, 1);
    fault = parse("sensor hand.link_encoder off");
    assert_int_equal(fault.index, 2 * SENSOR_JOINT_CHANNELS);
    fault = parse("sensor l_leg_ft off");
    assert_int_equal(fault.index, 4 * SENSOR_JOINT_CHANNELS);
    assert_int_equal(fault.channels, 6);
    fault = parse("sensor r.leg.ft.ty off");
    assert_int_equal(fault.index, 4 * SENSOR_JOINT_CHANNELS + 6 + 4);
    assert_int_equal(fault.channels, 1);
    fault = parse("sensor r.leg.ft off");
    assert_int_equal(fault.index, 4 * SENSOR_JOINT_CHANNELS + 6);
    fault = parse("sensor imu.accel_z off");
    assert_int_equal(fault.index, 4 * SENSOR_JOINT_CHANNELS + 2 * 6 + 5);
    fault = parse("sensor imu.quat_z off");
    assert_int_equal(fault.index, 4 * SENSOR_JOINT_CHANNELS + 2 * 6 + 12);
    fault = parse("sensor imu off");
    assert_int_equal(fault.channels, 13);
}

TEST(what_a_drive_measures_is_a_fault_of_its_sensor)
{
    struct fault fault = parse("motor LKneeSag over_temperature 3..");

    assert_int_equal(fault.target, FAULT_SENSOR);
    assert_int_equal(fault.kind, FAULT_WRONG);
    assert_int_equal(fault.index, SENSOR_JOINT_CHANNELS + SENSOR_TEMPERATURE);
    assert_int_equal(fault.channels, 1);
    assert_true(fault.value[0] == 0.0);
    assert_true(fault.value[1] == 200.0);
    fault = parse("motor LKneeSag over_current");
    assert_int_equal(fault.index, SENSOR_JOINT_CHANNELS + SENSOR_CURRENT);
    assert_true(fault.value[1] == 1000.0);
}

TEST(boards_have_a_name_or_an_address)
{
    assert_int_equal(parse("board left_leg/0x01 off").index, 0);
    assert_int_equal(parse("board left_leg/1 off 1..1.2").index, 0);
    assert_int_equal(parse("board left_leg/13 stuck").index, 1);
    assert_int_equal(parse("board ankle garbage").index, 1);
}

TEST(a_board_may_have_the_address_0)
{
    static const int addresses[] = {0, 255};
    struct fault_names others = names;
    struct fault fault;
    struct error error;

    others.board_address = addresses;
    assert_ok(fault_parse("board left_leg/0 off", &others, &fault, &error));
    assert_int_equal(fault.index, 0);
    assert_ok(fault_parse("board left_leg/255 off", &others, &fault, &error));
    assert_int_equal(fault.index, 1);
    assert_int_equal(fault_parse("board left_leg/256 off", &others, &fault, &error), ERROR_INPUT);
    assert_int_equal(fault_parse("board torso/0 off", &others, &fault, &error), ERROR_INPUT);
}

TEST(parameters_have_keys_defaults_and_a_first)
{
    struct fault fault = parse("sensor LKneeSag.torque wrong gain=1.1 offset=-0.5 1..2");

    assert_true(fault.value[0] == 1.1 && fault.value[1] == -0.5);
    fault = parse("sensor LKneeSag.torque wrong offset=2");
    assert_true(fault.value[0] == 1.0 && fault.value[1] == 2.0);
    fault = parse("bus left_leg loss 0.1");
    assert_true(fault.value[0] == 0.1);
    assert_int_equal(fault.id, -1);
    fault = parse("bus torso loss p=1 id=0x6f0 1..1.1");
    assert_int_equal(fault.id, 0x6f0);
    assert_int_equal(parse("bus torso loss p=1 id=0").id, 0);
    assert_int_equal(parse("bus torso loss p=1 id=0x1fffffff").id, 0x1fffffff);
    fault = parse("sensor imu.gyro_x stuck 0.0000000012..0.0000000027");
    assert_int_equal(fault.from_ns, 1); /* to the nearest nanosecond */
    assert_int_equal(fault.to_ns, 3);
    fault = parse("sensor imu.gyro_x stuck 0.0000000006..0.0000000022");
    assert_int_equal(fault.from_ns, 1);
    assert_int_equal(fault.to_ns, 2);
    assert_int_equal(parse("motor LKneeSag jam 1e9..").from_ns, 1000000000 * SECOND);
    assert_int_equal(parse("motor LKneeSag jam 0..1e9").to_ns, 1000000000 * SECOND);
    fault = parse("board ankle intermittent");
    assert_true(fault.value[0] == 0.5 && fault.value[1] == 0.02);
    fault = parse("supply sag 30 1..1.05");
    assert_int_equal(fault.target, FAULT_SUPPLY);
    assert_true(fault.value[0] == 30.0);
    fault = parse("valve lf_kfe leak 1e-5 2..");
    assert_int_equal(fault.target, FAULT_VALVE);
    assert_int_equal(fault.index, 3);
    assert_true(fault.value[0] == 1e-5);
    fault = parse("hydraulic_supply pump_loss");
    assert_int_equal(fault.target, FAULT_HYDRAULIC_SUPPLY);
    assert_true(fault.value[0] == 1.0);
}

TEST(refuses_what_it_does_not_know_and_names_the_nearest)
{
    assert_refused("", ERROR_INPUT, "expected sensor, board, motor, bus, supply, valve or");
    assert_refused("engine LKneeSag jam", ERROR_INPUT, "found \"engine\"");
    assert_refused("motor LKneeSga jam", ERROR_INPUT, "\"LKneeSag\"");
    assert_refused("motor LKneeSag jamm", ERROR_INPUT, "\"jam\"");
    assert_refused("motor LKneeSag", ERROR_INPUT, "open_phase, short, jam, spring_break");
    assert_refused("motor", ERROR_INPUT, "what is broken");
    assert_refused("sensor LKneeSag off", ERROR_INPUT, "JOINT.CHANNEL");
    assert_refused("sensor LKneeSag.torqe off", ERROR_INPUT, "\"torque\"");
    assert_refused("sensor l_leg_ft.fw off", ERROR_INPUT, "fx");
    assert_refused("board left_leg/2 off", ERROR_INPUT, "a board");
    assert_refused("bus left_leg wrong", ERROR_INPUT, "a kind of fault");
    assert_refused("sensor l_leg_ft loss 0.1", ERROR_INPUT, "a kind of fault");
}

/* Up to twenty names are listed where none is near. */
TEST(a_short_list_of_names_is_told_in_full)
{
    static const char *const twenty_one[] = {"b00", "b01", "b02", "b03", "b04", "b05", "b06",
                                             "b07", "b08", "b09", "b10", "b11", "b12", "b13",
                                             "b14", "b15", "b16", "b17", "b18", "b19", "b20"};
    struct fault_names many = names;
    struct fault fault;
    struct error error;

    many.bus = twenty_one;
    for (many.nbus = 1; many.nbus <= 21; many.nbus++) {
        char last[32];

        snprintf(last, sizeof last, "%s%s", many.nbus == 1 ? ": " : ", ",
                 twenty_one[many.nbus - 1]);
        assert_int_equal(fault_parse("bus somewhere_else off", &many, &fault, &error), ERROR_INPUT);
        assert_int_equal(strstr(error.text, last) != NULL, many.nbus <= 20);
        assert_int_equal(strstr(error.text, "b00") != NULL, many.nbus <= 20);
    }
}

TEST(refuses_wrong_numbers_and_windows)
{
    assert_refused("bus left_leg loss", ERROR_INPUT, "expected p");
    assert_refused("bus left_leg loss 1.5", ERROR_INPUT, "p=0 to 1");
    assert_refused("bus left_leg loss nan", ERROR_INPUT, "p=0 to 1");
    assert_refused("bus left_leg loss 0.1 0.2", ERROR_INPUT, "once");
    assert_refused("bus left_leg loss q=0.2", ERROR_INPUT, "p=");
    assert_refused("bus left_leg loss 0.2 id=-1", ERROR_INPUT, "id=0 to id=0x1fffffff");
    assert_refused("bus left_leg loss 0.2 id=0x20000000", ERROR_INPUT, "id=0 to id=0x1fffffff");
    assert_refused("bus left_leg loss 0.2 xy=1", ERROR_INPUT, "expected p=, ");
    assert_refused("sensor LKneeSag.torque wrong id=1", ERROR_INPUT, "expected gain=");
    assert_refused("motor LKneeSag jam 1.1e9..", ERROR_INPUT, "FROM..TO");
    assert_refused("motor LKneeSag jam 1..1.1e9", ERROR_INPUT, "FROM..TO");
    assert_refused("motor LKneeSag jam 2..2", ERROR_INPUT, "FROM before TO");
    assert_refused("motor LKneeSag jam 3", ERROR_INPUT, "FROM..TO");
    assert_refused("motor LKneeSag jam 3..2", ERROR_INPUT, "FROM before TO");
    assert_refused("motor LKneeSag jam -1..2", ERROR_INPUT, "FROM..TO");
    assert_refused("motor LKneeSag jam ..", ERROR_INPUT, "FROM..TO");
    assert_refused("motor LKneeSag jam 1..2 manual", ERROR_INPUT, "nothing after");
    assert_refused("bad/name: motor LKneeSag jam", ERROR_INPUT, "a name");
    assert_refused("sensor imu.gyro_x slow 0", ERROR_INPUT, "period=");
}

TEST(refuses_what_is_unsupported_there)
{
    assert_refused("motor hand jam", ERROR_UNSUPPORTED, "no drive");
    assert_refused("motor lf_kfe jam", ERROR_UNSUPPORTED, "expected \"valve lf_kfe\"");
    assert_refused("valve LHipSag off", ERROR_UNSUPPORTED, "expected \"motor LHipSag\"");
    assert_refused("valve lf_kfe jam", ERROR_INPUT, "off, stuck, shifted, leak");
    assert_refused("valve lf_kfe shifted 1.5", ERROR_INPUT, "share=-1 to 1");
    assert_refused("hydraulic_supply sag 3", ERROR_INPUT, "pump_loss, leak, relief_shut");
    assert_refused("bus torso error_burst 0.1", ERROR_UNSUPPORTED, "not in wire mode");
    assert_refused("bus torso id_collision", ERROR_UNSUPPORTED, "not in wire mode");
    parse("bus left_leg error_burst 0.1");
    parse("bus left_leg id_collision");
}

/* A pressure that is constant by definition, or of a robot without oil, cannot be lost. */
TEST(a_supply_without_accumulator_cannot_break)
{
    struct fault_names constant = names;
    struct fault fault;
    struct error error;

    constant.oil_store = false;
    assert_int_equal(fault_parse("hydraulic_supply leak 1e-5", &constant, &fault, &error),
                     ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "with an accumulator"));
}

/* Changes some bytes of good lines: what is refused has a message in words, and what is read is
 * read again from its own text as the same fault. */
TEST(any_text_is_refused_with_words_or_read_the_same_again)
{
    static const char alphabet[] = "sensor motor LKneeSag. jam 0.1..2=:/ left_leg\t\x01\xff bus id";
    static const char *const lines[] = {
        "motor LKneeSag jam 2.0..2.5",         "sensor imu.gyro_x wrong gain=2 offset=1 0..1",
        "knee: valve lf_kfe shifted 0.1",      "bus left_leg loss p=0.5 id=0x1a 1..",
        "supply sag volts=3 manual",           "sensor l_leg_ft delayed delay=0.5",
        "hydraulic_supply pump_loss 0.5 1..2",
    };
    uint32_t random = 1;
    size_t refused = 0, read = 0;

    for (size_t i = 0; i < 20000; i++) {
        char text[FAULT_TEXT_SIZE + 40] = "";
        struct fault fault, again;
        struct error error = {0};
        enum error_code code;
        size_t length, changes = (random >> 8) % 4;

        snprintf(text, sizeof text, "%s", lines[i % (sizeof lines / sizeof *lines)]);
        length = strlen(text);
        if (i % 4 == 0) {
            length = changes = (random >> 8) % (sizeof text - 1);
        }
        for (size_t k = 0; k < changes; k++) {
            random = random * 1664525u + 1013904223u;
            text[i % 4 == 0 ? k : (random >> 4) % length] =
                alphabet[(random >> 16) % (sizeof alphabet - 1)];
        }
        random = random * 1664525u + 1013904223u;
        code = fault_parse(text, &names, &fault, &error);
        if (code) {
            refused++;
            assert_true(code == ERROR_INPUT || code == ERROR_UNSUPPORTED);
            assert_true(strncmp(error.text, "fault", 5) == 0 && strlen(error.text) > 20);
            for (const char *c = error.text; *c; c++) {
                assert_true((unsigned char)*c >= 0x20 && *c != 0x7f);
            }
            continue;
        }
        read++;
        assert_string_equal(fault.text, text);
        assert_no_error(fault_parse(fault.text, &names, &again, &error), error.text);
        assert_memory_equal(&fault, &again, sizeof fault);
        assert_true(fault.from_ns < fault.to_ns || fault.from_ns == INT64_MAX);
        assert_true(fault.index < 1000 && fault.channels < 100);
    }
    assert_true(refused > 5000 && read > 1000);
}

TEST(help_lists_every_kind_once)
{
    char text[200];
    size_t count = faults_help(0, NULL, 0);

    assert_true(count > 20);
    for (size_t i = 0; i < count; i++) {
        faults_help(i, text, sizeof text);
        assert_non_null(strstr(text, " ... "));
        assert_non_null(strchr(text, ':'));
    }
}
