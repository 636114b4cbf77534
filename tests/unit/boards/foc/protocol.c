/* SPDX-License-Identifier: Apache-2.0 */
/* The module of the 2FOC protocol: whom its fields are about, in which units, and its load. */
#include "tests/unit/boards/foc/foc_bench.h"

struct search {
    const struct boards_config *config;
    const char *message;
    int bus, board, index, found;
    struct field_subject subject;
};

static bool visit(void *context, const struct message *message)
{
    struct search *search = context;
    const struct field *field = message->fields;
    struct message_field of = {.message = message, .code = message->code};

    if (strcmp(message->name, search->message) != 0 ||
        (message->from_host ? message->receiver : message->sender) != search->board) {
        return true;
    }
    for (; field->type != FIELD_END && of.index < search->index; field++) {
        of.index += !(field->type & FIELD_PADDING);
    }
    of.field = field;
    boards_describe_field(search->config, search->bus, &of, &search->subject);
    search->found++;
    return true;
}

/* The subject of a field of the message with a name that goes from or to a board (-1: to all). */
static struct field_subject subject_of(const struct boards_config *config, int bus,
                                       const char *message, int board, int index)
{
    struct search search = {config, message, bus, board, index, 0, {0}};

    boards_messages(config, bus, visit, &search);
    assert_true(search.found > 0);
    return search.subject;
}

/* bus 0: boards 1 (joint 0) and 3 (joint 1); another bus has a board 2. */
TEST(a_target_is_of_the_motor_at_its_address)
{
    struct board_bench bench;

    configure(&bench);
    bench.board[4].address = 2;
    for (int i = 0; i < 4; i++) {
        const struct field_subject target =
            subject_of(&bench.config, 0, "DESIRED_TARGETS", MESSAGE_NO_BOARD, i);

        assert_ptr_equal(target.axis, i == 0   ? &bench.board[0].axis[0]
                                      : i == 2 ? &bench.board[1].axis[0]
                                               : NULL);
    }
}

/* 65536 icubdeg are a turn of the rotor, which turns 100 times a turn of the joint. */
TEST(angles_of_the_rotor_are_told_as_those_of_the_joint)
{
    const double icubdeg_rad = 2.0 * M_PI / 65536.0 / 100.0;
    struct field_subject current, velocity, position;
    struct board_bench bench;

    configure(&bench);
    current = subject_of(&bench.config, 0, "FOC", 1, 0);
    velocity = subject_of(&bench.config, 0, "FOC", 1, 1);
    position = subject_of(&bench.config, 0, "FOC", 1, 2);
    assert_ptr_equal(current.axis, &bench.board[1].axis[0]);
    assert_ptr_equal(velocity.axis, &bench.board[1].axis[0]);
    assert_ptr_equal(position.axis, &bench.board[1].axis[0]);
    assert_string_equal(current.unit, "mA");
    assert_string_equal(velocity.unit, "rad/s");
    assert_string_equal(position.unit, "rad");
    assert_near(current.scale, 1.0, 0.0);
    assert_near(velocity.scale, 1000.0 * icubdeg_rad, 1e-12 * 1000.0 * icubdeg_rad);
    assert_near(position.scale, icubdeg_rad, 1e-12 * icubdeg_rad);

    /* Without a gear nobody knows */
    bench.board[1].axis[0].gear = 0.0;
    position = subject_of(&bench.config, 0, "FOC", 1, 2);
    assert_string_equal(position.unit, "icubdeg");
    assert_near(position.scale, 1.0, 0.0);
}

static bool visit_owner(void *context, const struct message *message)
{
    const struct boards_config *config = context;
    const int board = message->from_host ? message->receiver : message->sender;
    struct message_field of = {.message = message, .field = message->fields};
    struct field_subject subject;

    if (board == MESSAGE_NO_BOARD || !of.field || of.field->type == FIELD_END) {
        return true;
    }
    boards_describe_field(config, 0, &of, &subject);
    assert_ptr_equal(subject.axis, config->board[board].kind != BOARD_MOTOR || message->id >> 8 == 7
                                       ? NULL
                                       : &config->board[board].axis[0]);
    return true;
}

/* Class 7 is management. */
TEST(what_is_no_management_is_about_the_motor)
{
    struct board_bench bench;

    configure(&bench);
    boards_messages(&bench.config, 0, visit_owner, &bench.config);
}

/* Boards 0 and 1 are 2FOC boards, board 3 a force-torque sensor of 1500 N and 40 Nm. */
TEST(a_sensor_counts_from_the_middle_of_its_scale)
{
    struct board_bench bench;

    configure(&bench);
    for (int i = 0; i < 2; i++) {
        const struct field_subject subject =
            subject_of(&bench.config, 0, i ? "TORQUE" : "FORCE", 3, 0);

        assert_null(subject.axis);
        assert_int_equal(subject.channel, i ? 3 : 0);
        assert_string_equal(subject.unit, i ? "Nm" : "N");
        assert_near(subject.offset, i ? -40.0 : -1500.0, 0.0);
        assert_near(subject.scale, (i ? 40.0 : 1500.0) / 32768.0, 0.0);
    }
}

/* ---- messages ---- */

struct cycles {
    uint32_t motor[2], status[2], additional[2];
    int discoveries;
};

static bool visit_cycle(void *context, const struct message *message)
{
    struct cycles *cycles = context;

    /* A frame of 8 bytes is full of targets of 16 bits, one for each of four addresses */
    if (!strcmp(message->name, "DESIRED_TARGETS")) {
        assert_int_equal(message->length, 8);
        assert_int_equal(message->repeats * fields_bytes(message->fields), 8);
    }
    if (message->id == 0x70f && message->from_host) {
        cycles->discoveries += message->code == 0xff;
    } else if (message->sender == 0 || message->sender == 1) {
        uint32_t *cycle = !strcmp(message->name, "FOC")                 ? cycles->motor
                          : !strcmp(message->name, "STATUS")            ? cycles->status
                          : !strcmp(message->name, "ADDITIONAL_STATUS") ? cycles->additional
                                                                        : NULL;

        if (cycle) {
            cycle[message->sender] = message->cycle_ns;
        }
    }
    return true;
}

TEST(messages_have_the_cycles_of_their_boards)
{
    struct cycles cycles = {{0}, {0}, {0}, 0};
    struct board_bench bench;

    configure(&bench);
    bench.board[0].status_period_ns = 10000000;
    boards_messages(&bench.config, 0, visit_cycle, &cycles);
    assert_int_equal(cycles.discoveries, 1);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(cycles.motor[i], 1000000);
        assert_int_equal(cycles.status[i], i ? 1000000 : 10000000);
        assert_int_equal(cycles.additional[i],
                         foc_additional_status_ms(bench.board[i].address) * 1000000);
    }
}

/* ---- load ---- */

enum { LOADS = 64 };

struct loads {
    struct load_frame frame[LOADS];
    size_t count;
};

static void keep(void *context, const struct load_frame *frame)
{
    struct loads *loads = context;

    assert_true(loads->count < LOADS);
    loads->frame[loads->count++] = *frame;
}

/* How many frames of a length come with a period. */
static int count_of(const struct loads *loads, bool from_host, unsigned length, double period_s)
{
    int count = 0;

    for (size_t i = 0; i < loads->count; i++) {
        const struct load_frame *frame = &loads->frame[i];

        count += frame->from_host == from_host && frame->length == length &&
                 fabs(frame->period_s - period_s) < 1e-9;
    }
    return count;
}

/* Of each motor FOC a millisecond, STATUS as the rig says, ADDITIONAL_STATUS in a cycle by its
 * address; targets a millisecond. */
TEST(each_motor_loads_the_bus_with_its_frames)
{
    struct loads loads = {.count = 0};
    struct board_bench bench;

    configure(&bench);
    bench.board[0].status_period_ns = 20000000;
    bench.config.nboard = 2;
    for (int i = 0; i < 2; i++) {
        for (int k = 1; k < BOARD_AXES_MAX; k++) {
            bench.board[i].axis[k].joint = -1;
        }
    }
    boards_load(&bench.config, 0, 1e-3, keep, &loads);
    assert_int_equal(loads.count, 7);
    assert_int_equal(count_of(&loads, true, 8, 1e-3), 1);
    assert_int_equal(count_of(&loads, false, 8, 1e-3), 3); /* STATUS of the second, too */
    assert_int_equal(count_of(&loads, false, 8, 20e-3), 1);
    assert_int_equal(count_of(&loads, false, 4, foc_additional_status_ms(1) * 1e-3), 1);
    assert_int_equal(count_of(&loads, false, 4, foc_additional_status_ms(3) * 1e-3), 1);

    /* One axis is enough for targets; none wants none */
    loads.count = 0;
    bench.config.nboard = 1;
    boards_load(&bench.config, 0, 1e-3, keep, &loads);
    assert_int_equal(loads.count, 4);
    assert_int_equal(count_of(&loads, true, 8, 1e-3), 1);
    loads.count = 0;
    bench.board[0].axis[0].joint = -1;
    boards_load(&bench.config, 0, 1e-3, keep, &loads);
    assert_int_equal(count_of(&loads, true, 8, 1e-3), 0);
}
