/* SPDX-License-Identifier: Apache-2.0 */
/* STRAIN and pseudo-STRAIN boards: commands of class 2 and frames of class 3, byte by byte. */
#include "tests/unit/boards/board_bench.h"

/* The F/T board: address 0x0D on bus 0, full scale 1500 1500 2000 N, 40 40 40 Nm, 5 ms. */
static void ft_ask(struct board_bench *bench, const char *request, const char *reply)
{
    bench_say(bench, 0, 0x20d, request);
    bench_expect(bench, 0, 0x2d0, reply);
}

/* Until the F/T board has sent again, at most a second. */
static void to_next_frames(struct board_bench *bench)
{
    for (int i = 0; i < 1000; i++) {
        bench_tick(bench);
        if (bench_sent(bench, 0, 0x3da)) {
            return;
        }
    }
    fail();
}

TEST_ON(strain_boards_are_silent_until_told_to_send, board_bench, bench)
{
    bench_open(bench);
    for (int i = 0; i < 100; i++) {
        bench_tick(bench);
        assert_int_equal(bench->count[0], 0);
    }
    bench_configure(bench);
    bench->board[3].transmit_at_start = true;
    bench_start(bench);
    to_next_frames(bench);
    assert_int_equal(bench->count[0], 2);
    bench_expect_frame(&bench->frame[0][0], 0x3da, "00 80 00 80 00 80");
    bench_expect_frame(&bench->frame[0][1], 0x3db, "00 80 00 80 00 80");
}

TEST_ON(force_and_torque_are_offset_binary_of_the_full_scale, bench_open, bench)
{
    bench_send(bench, 0, 0x20d, "07 00");
    bench->ft =
        (struct ft_sense){.force_n = {750.0, -750.0, 277.7}, .torque_nm = {10.0, -0.001, 0.0}};
    to_next_frames(bench);
    /* +-0.5 -> 0xC000, 0x4000; 277.7/2000*32768 = 4549.8 -> 0x91C6 */
    bench_expect(bench, 0, 0x3da, "00 C0 00 40 C6 91");
    /* 0.25 -> 0xA000; -0.001/40*32768 = -0.82 -> 0x7FFF */
    bench_expect(bench, 0, 0x3db, "00 A0 FF 7F 00 80");
}

TEST_ON(frames_come_at_the_period, board_bench, bench)
{
    static const int periods[] = {1, 2, 4, 5, 10, 255};

    for (size_t p = 0; p < sizeof periods / sizeof *periods; p++) {
        char text[16];
        int64_t last = 0;
        int count = 0;

        bench_open(bench);
        snprintf(text, sizeof text, "08 %02X", periods[p]);
        bench_send(bench, 0, 0x20d, text);
        bench_send(bench, 0, 0x20d, "07 00");
        for (int i = 0; i < 10 * periods[p]; i++) {
            bench_tick(bench);
            assert_int_equal(bench_sent(bench, 0, 0x3da), bench_sent(bench, 0, 0x3db));
            if (bench_sent(bench, 0, 0x3da)) {
                assert_int_equal(bench->sensors.time_ns - last, periods[p] * 1000000);
                last = bench->sensors.time_ns;
                count++;
            }
        }
        assert_int_equal(count, 10);
    }
}

TEST_ON(frames_that_could_not_be_sent_in_time_are_not_sent_in_a_bunch, board_bench, bench)
{
    size_t sent = 0;

    bench_configure(bench); /* 5 ms */
    bench_start(bench);
    bench_send(bench, 0, 0x20d, "07 00");
    for (int i = 0; i < 22; i++) { /* nobody asks for frames */
        bench_control(bench);
    }
    for (int i = 0; i < 8; i++) { /* those of 20 ms come late, those of 25 and 30 in time */
        bench_tick(bench);
        sent += bench_sent(bench, 0, 0x3da);
        assert_int_equal(sent, i < 2 ? 1 : i < 7 ? 2 : 3);
    }
}

TEST_ON(a_period_of_zero_is_refused, bench_open, bench)
{
    bench_send(bench, 0, 0x20d, "08 00");
    assert_int_equal(bench_counters(bench).malformed, 1);
}

TEST_ON(transmit_modes_choose_what_is_sent, bench_open, bench)
{
    static const struct {
        const char *command;
        size_t calibrated, uncalibrated;
    } modes[] = {{"07 00", 1, 0}, {"07 01", 0, 0}, {"07 03", 1, 0},
                 {"07 04", 1, 1}, {"07 02", 0, 0}, {"07 FF", 0, 0}};

    bench_send(bench, 0, 0x20d, "08 01; 15 02 00 01 00"); /* calibrated fx is 256 counts higher */
    for (size_t i = 0; i < sizeof modes / sizeof *modes; i++) {
        bench_say(bench, 0, 0x20d, modes[i].command);
        assert_int_equal(bench_sent(bench, 0, 0x3da), modes[i].calibrated);
        assert_int_equal(bench_sent(bench, 0, 0x3db), modes[i].calibrated);
        assert_int_equal(bench_sent(bench, 0, 0x3d8), modes[i].uncalibrated);
        assert_int_equal(bench_sent(bench, 0, 0x3d9), modes[i].uncalibrated);
    }
    bench_send(bench, 0, 0x20d, "15 02 03 01 00"); /* and tx */
    bench_say(bench, 0, 0x20d, "07 03");
    bench_expect(bench, 0, 0x3da, "00 80 00 80 00 80"); /* raw, without the tare */
    bench_expect(bench, 0, 0x3db, "00 80 00 80 00 80");
    bench_say(bench, 0, 0x20d, "07 04");
    bench_expect_frame(&bench->frame[0][0], 0x3da, "00 81 00 80 00 80");
    bench_expect_frame(&bench->frame[0][2], 0x3d8, "00 80 00 80 00 80");
}

TEST_ON(saturated_frames_are_longer_and_hold_the_last_good_values, bench_open, bench)
{
    bench_send(bench, 0, 0x20d, "07 04; 08 01");
    bench->ft = (struct ft_sense){.force_n = {750.0, 0.0, 0.0}, .torque_nm = {0.0, 10.0, 0.0}};
    bench_tick(bench);
    bench_expect(bench, 0, 0x3da, "00 C0 00 80 00 80");
    /* fy low, tz high; bits: any, then two a channel: 0 none, 1 low, 2 high */
    bench->ft = (struct ft_sense){.force_n = {375.0, -1600.0, 0.0}, .torque_nm = {0.0, 0.0, 39.5}};
    bench_tick(bench);
    bench_expect(bench, 0, 0x3da, "00 C0 00 80 00 80 11");
    bench_expect(bench, 0, 0x3db, "00 80 00 A0 00 80 81");
    bench_expect(bench, 0, 0x3d8, "00 A0 00 00 00 80 11"); /* uncalibrated ones are the present */
    bench_send(bench, 0, 0x20d, "15 02 00 10 00");         /* a current tare: not of what is held */
    bench_tick(bench);
    bench_expect(bench, 0, 0x3da, "00 C0 00 80 00 80 11");
    bench->ft = (struct ft_sense){.force_n = {375.0, 0.0, 0.0}, .torque_nm = {0.0, 0.0, 0.0}};
    bench_tick(bench);
    bench_expect(bench, 0, 0x3da, "00 B0 00 80 00 80");
    bench_expect(bench, 0, 0x3db, "00 80 00 80 00 80");
}

/* Raw readings of 1000 and 64000 are the last good ones. */
TEST_ON(saturation_begins_below_1000_and_above_64000, bench_open, bench)
{
    static const struct {
        int raw;
        uint8_t length;
    } cases[] = {{1000, 6}, {999, 7}, {64000, 6}, {64001, 7}, {0, 7}, {65535, 7}};

    bench_send(bench, 0, 0x20d, "07 00; 08 01");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bench->ft.force_n[2] = (cases[i].raw - 32768) / 32768.0 * 2000.0;
        bench_tick(bench);
        assert_int_equal(bench_find(bench, 0, 0x3da)->len, cases[i].length);
        assert_int_equal(bench_find(bench, 0, 0x3db)->len, cases[i].length);

        /* The same as a peak within the tick */
        bench->ft.peak_n[2] = bench->ft.force_n[2];
        bench->ft.force_n[2] = 10.0;
        bench_tick(bench);
        assert_int_equal(bench_find(bench, 0, 0x3da)->len, cases[i].length);
        bench->ft.peak_n[2] = 0.0;
    }
}

TEST_ON(commands_of_the_board_are_answered_big_endian, bench_open, bench)
{
    ft_ask(bench, "18 00", "18 00 05 DC");
    ft_ask(bench, "18 02", "18 02 07 D0");
    ft_ask(bench, "18 15", "18 15 00 28");          /* of regulation set 1 */
    ft_ask(bench, "1A", "1A 53 49 4D 30 30 30 44"); /* "SIM000D" */
    ft_ask(bench, "1C 01 00", "1C 06 03 00 05 01 00 01");
    ft_ask(bench, "1C 01 06", "1C 06 03 00 05 01 00 00");
    ft_ask(bench, "1C 00 00", "1C 06 03 00 05 01 00 00"); /* as loaders ask */
    ft_ask(bench, "0A 02 02", "0A 02 02 7F FF");
    ft_ask(bench, "0A 02 03", "0A 02 03 00 00");
    ft_ask(bench, "1B", "1B 01");
    bench_send(bench, 0, 0x20d, "03 12 03 12 34");
    ft_ask(bench, "1B", "1B 00"); /* changed since it was saved */
    ft_ask(bench, "0A 12 03", "0A 12 03 12 34");
    ft_ask(bench, "09", "09 01");
    ft_ask(bench, "1B", "1B 01");
    bench_send(bench, 0, 0x20d, "04 01 02 03");
    ft_ask(bench, "0B 01", "0B 01 02 03");
    bench_send(bench, 0, 0x20d, "11 07");
    ft_ask(bench, "12", "12 07");
    bench_send(bench, 0, 0x20d, "17 04 01 02");
    ft_ask(bench, "18 04", "18 04 01 02");
    bench_send(bench, 0, 0x20d, "19 41 42 43 44 45 46 47");
    ft_ask(bench, "1A", "1A 41 42 43 44 45 46 47");
    bench_send(bench, 0, 0x20d, "01 00; 05 3F; 06 00");
    assert_int_equal(bench_counters(bench).malformed, 0);
    bench_send(bench, 0, 0x20d, "18 06; 0A 06 00; 0A 00 06; 0B 06; 0C 06 00; 14 06; 13 02; 13 03");
    bench_send(bench, 0, 0x20d, "13 02 06 00 00");
    assert_int_equal(bench_counters(bench).malformed, 9);
    bench_send(bench, 0, 0x20d, "1D 00");
    assert_int_equal(bench_counters(bench).unknown, 1);
}

/* The high half of the byte that selects a channel: hosts of newer boards name set 1. */
TEST_ON(a_regulation_set_may_stand_beside_the_channel, bench_open, bench)
{
    bench_send(bench, 0, 0x20d, "04 12 02 03"); /* DAC */
    ft_ask(bench, "0B 12", "0B 12 02 03");
    ft_ask(bench, "0B 02", "0B 02 02 03");
    ft_ask(bench, "1B", "1B 00");
    ft_ask(bench, "09", "09 01");
    bench_send(bench, 0, 0x20d, "13 02 14 FF 38"); /* calibration tare */
    ft_ask(bench, "14 14", "14 14 FF 38");
    ft_ask(bench, "14 04", "14 04 FF 38");
    ft_ask(bench, "1B", "1B 00");
    bench_send(bench, 0, 0x20d, "17 13 01 F4"); /* full scale */
    ft_ask(bench, "18 13", "18 13 01 F4");
    ft_ask(bench, "18 03", "18 03 01 F4");
    assert_int_equal(bench_counters(bench).malformed, 0);

    /* no seventh channel in any set, and the current tare is in none */
    bench_say(bench, 0, 0x20d, "04 16 02 03; 0B 16; 13 02 16 00 00; 14 16; 15 02 14 00 00; 16 14");
    assert_int_equal(bench->count[0], 0);
    assert_int_equal(bench_counters(bench).malformed, 6);
}

TEST_ON(tares_take_the_present_load_away, bench_open, bench)
{
    bench->ft.force_n[0] = 750.0; /* 0x4000 counts */
    bench->ft.torque_nm[2] = -10.0;
    bench_send(bench, 0, 0x20d, "07 00; 08 01");
    bench_ticks(bench, 2);
    bench_expect(bench, 0, 0x3da, "00 C0 00 80 00 80");
    ft_ask(bench, "0C 00 00", "0C 00 00 C0 00");
    bench_send(bench, 0, 0x20d, "15 01"); /* current tare, automatic */
    ft_ask(bench, "16 00", "16 00 C0 00");
    bench_expect(bench, 0, 0x3da, "00 80 00 80 00 80");
    bench_expect(bench, 0, 0x3db, "00 80 00 80 00 80");
    ft_ask(bench, "0C 00 01", "0C 00 01 80 00");
    bench_say(bench, 0, 0x20d, "15 00"); /* reset */
    bench_expect(bench, 0, 0x3da, "00 C0 00 80 00 80");
    bench_send(bench, 0, 0x20d, "13 01"); /* calibration tare, automatic */
    ft_ask(bench, "14 05", "14 05 20 00");
    bench_expect(bench, 0, 0x3da, "00 80 00 80 00 80");
    bench_send(bench, 0, 0x20d, "13 00; 13 02 01 FF FE"); /* channel 1: -2 */
    ft_ask(bench, "14 01", "14 01 FF FE");
    bench_expect(bench, 0, 0x3da, "00 C0 FE 7F 00 80");
}

/* Readings and tares end at 16 bits, they do not wrap: 0xF9FF and 0x03E8 are the last good ones. */
TEST_ON(tares_end_where_16_bits_end, bench_open, bench)
{
    bench_send(bench, 0, 0x20d, "07 04; 08 01");
    for (int i = 0; i < 2; i++) {
        bench->ft.force_n[0] = (i ? -31000.0 : 31000.0) / 32768.0 * 1500.0;
        bench_say(bench, 0, 0x20d, i ? "13 02 00 F8 30" : "13 02 00 07 D0"); /* 2000 further */
        bench_expect(bench, 0, 0x3d8, i ? "00 00 00 80 00 80" : "FF FF 00 80 00 80");
        bench_expect(bench, 0, 0x3da, i ? "00 00 00 80 00 80" : "FF FF 00 80 00 80");
        ft_ask(bench, "0C 00 00", i ? "0C 00 00 00 00" : "0C 00 00 FF FF");
        bench_say(bench, 0, 0x20d, i ? "15 02 00 FF FF" : "15 02 00 00 01"); /* and 1 more */
        bench_expect(bench, 0, 0x3da, i ? "00 00 00 80 00 80" : "FF FF 00 80 00 80");
        bench_send(bench, 0, 0x20d, "15 00");
    }
    for (int i = 0; i < 2; i++) { /* automatic tares are the negative readings */
        bench->ft.force_n[0] = i ? -1600.0 : 1600.0;
        bench_tick(bench);
        bench_send(bench, 0, 0x20d, "13 01");
        ft_ask(bench, "14 00", i ? "14 00 7F FF" : "14 00 80 01");
    }
}

/* The matrix takes readings with their tares as they end, and its rows end at 16 bits, too: fy is
 * -fx, fz half of fx, ty is fx + ty less a tare of 100. */
TEST_ON(the_matrix_takes_what_16_bits_hold, bench_open, bench)
{
    bench_send(bench, 0, 0x20d, "07 00; 08 01; 03 01 00 80 01; 03 02 00 40 00");
    bench_send(bench, 0, 0x20d, "03 04 00 7F FF; 15 02 04 FF 9C");
    bench->ft.torque_nm[1] = 20.0;
    bench->ft.force_n[0] = 31000.0 / 32768.0 * 1500.0;
    bench_say(bench, 0, 0x20d, "13 02 00 07 D0");
    bench_expect(bench, 0, 0x3da, "FF FF 01 00 00 C0");
    bench_expect(bench, 0, 0x3db, "00 80 9B FF 00 80");
    bench->ft.force_n[0] = -31000.0 / 32768.0 * 1500.0;
    bench_say(bench, 0, 0x20d, "13 02 00 F8 30");
    bench_expect(bench, 0, 0x3da, "00 00 FF FF 00 40");
}

TEST_ON(the_matrix_mixes_the_channels, bench_open, bench)
{
    bench->ft.force_n[0] = 750.0;
    bench_send(bench, 0, 0x20d, "07 00; 08 01; 03 00 00 00 00"); /* fx from nothing */
    bench_say(bench, 0, 0x20d, "03 01 00 80 01");                /* fy from -fx */
    bench_expect(bench, 0, 0x3da, "00 80 00 40 00 80");
}

TEST_ON(joint_torques_come_in_pseudo_strain_frames, bench_open, bench)
{
    bench->sense[0].torque_nm = 27.5;     /* half of 55 */
    bench->sense[1].torque_nm = -13.75;   /* a quarter */
    bench->sense[2].torque_nm = 0.001678; /* one step of 1.7 mNm */
    bench_send(bench, 0, 0x20c, "07 00");
    bench_ticks(bench, 4);
    bench_expect(bench, 0, 0x3ca, "00 C0 00 60 01 80");
    bench_expect(bench, 0, 0x3cb, "00 80 00 80 00 80"); /* channels without a joint */
    bench_say(bench, 0, 0x20c, "18 00");
    bench_expect(bench, 0, 0x2c0, "18 00 00 37");
}

TEST_ON(a_sensor_without_a_number_keeps_its_last, bench_open, bench)
{
    bench->ft.force_n[0] = 750.0;
    bench_say(bench, 0, 0x20d, "07 00; 08 01");
    bench->ft.force_n[0] = (double)NAN;
    bench_tick(bench);
    bench_expect(bench, 0, 0x3da, "00 C0 00 80 00 80");
}

TEST_ON(settings_survive_a_restart_and_the_tare_does_not, bench_open, bench)
{
    bench_send(bench, 0, 0x20d, "19 41 42 43 44 45 46 47; 15 02 00 01 00; 07 00");
    bench_send(bench, 0, 0x70d, "00");
    bench_ticks(bench, 100);
    assert_int_equal(bench->count[0], 0);
    bench_ticks(bench, 4901);
    ft_ask(bench, "1A", "1A 41 42 43 44 45 46 47");
    ft_ask(bench, "16 00", "16 00 00 00");
    bench_ticks(bench, 20);
    assert_int_equal(bench->count[0], 0);
}

/* Nothing was good since the restart: saturated frames hold zeros, not the values of before. */
TEST_ON(what_is_held_is_forgotten_by_a_restart, bench_open, bench)
{
    bench->ft.force_n[0] = 750.0;
    bench_say(bench, 0, 0x20d, "07 00; 08 01");
    bench_expect(bench, 0, 0x3da, "00 C0 00 80 00 80");
    bench_send(bench, 0, 0x20d, "08 FF"); /* the next frames would come much later */
    bench_ticks(bench, 3);
    bench_send(bench, 0, 0x70d, "00");
    bench->ft.force_n[1] = 1600.0;
    bench_ticks(bench, 5001);
    bench_say(bench, 0, 0x20d, "07 00; 08 01");
    bench_expect(bench, 0, 0x3da, "00 80 00 80 00 80 21");
}
