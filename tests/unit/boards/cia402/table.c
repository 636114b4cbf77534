/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The one table of objects: its order, what frames and EDS files make of it, and that a node
 * answers by SDO what its EDS file says, object by object, and nothing else.
 */
#include "tests/unit/boards/cia402/cia402_bench.h"

#include "boards/cia402/table.h"

TEST(rows_are_in_order_and_have_initial_values_in_range)
{
    for (size_t i = 0; i < cia402_object_count; i++) {
        const struct cia402_object *object = &cia402_objects[i];

        assert_true(object->count >= 1);
        assert_ptr_equal(cia402_object_at(object->index, object->sub), object);
        assert_ptr_equal(cia402_object_at(object->index, object->sub + object->count - 1u), object);
        if (i > 0) {
            const struct cia402_object *before = object - 1;

            assert_true(
                before->index < object->index ||
                (before->index == object->index && before->sub + before->count <= object->sub));
        }
        if (object->type == CIA402_TEXT || object->type == CIA402_DOMAIN) {
            assert_int_equal(cia402_type_bits(object->type), 0);
            continue;
        }
        assert_true(cia402_lowest(object) <= object->initial);
        assert_true(object->initial <= cia402_highest(object));
        assert_true(!object->unit || object->scale > 0.0);
    }
    assert_null(cia402_object_at(0x0fff, 0));
    assert_null(cia402_object_at(0xffff, 0));
    assert_null(cia402_object_at(0x1018, 0));
}

/* The fields that the DBC has are the mapped objects, in size, unit and scale. */
TEST(frames_have_the_objects_that_are_mapped)
{
    for (int kind = CIA402_KIND_DRIVE; kind <= CIA402_KIND_INERTIAL; kind++) {
        struct cia402_plan plan;

        for (unsigned row = 0; cia402_plan_row((enum cia402_kind)kind, kind ? 0 : 4, row, &plan);
             row++) {
            const struct field *field = cia402_plan_fields(&plan), *first = field;
            unsigned bits = 0;

            assert_non_null(field);
            for (int i = 0; i < plan.count; i++) {
                unsigned index = plan.object[i] >> 16, sub = plan.object[i] >> 8 & 0xff;
                const struct cia402_object *object;

                if (index >= 0x4000 && !kind) { /* of axis 0 */
                    index = (index < 0x6000 ? 0x4000 : 0x6000) +
                            (index - (index < 0x6000 ? 0x4000 : 0x6000)) % CIA402_AXIS_STEP;
                }
                object = cia402_object_at(index, sub);
                assert_non_null(object);
                assert_true(object->access & (plan.receive ? CIA402_MAP_RPDO : CIA402_MAP_TPDO));
                assert_int_equal(field->type & FIELD_BITS_MASK, cia402_type_bits(object->type));
                assert_int_equal(plan.object[i] & 0xff, cia402_type_bits(object->type));
                assert_int_equal((field->type & FIELD_SIGNED) != 0, cia402_lowest(object) < 0);
                if (object->unit) {
                    assert_string_equal(field->unit, object->unit);
                    assert_true(field->scale == object->scale);
                }
                bits += cia402_type_bits(object->type);
                field += field[1].type != FIELD_END;
            }
            assert_int_equal(bits, 8 * plan.length);
            assert_int_equal(plan.length % fields_bytes(first), 0);
        }
    }
}

/* ---- EDS files against SDO ---- */

enum { TEXT_MAX = 1 << 20 };

static char *write_eds(const struct board_bench *bench, int board)
{
    char *text = calloc(1, TEXT_MAX);
    FILE *out = fmemopen(text, TEXT_MAX, "w");
    struct arena arena;
    struct error error;

    assert_ok(arena_init(&arena, 1 << 20, &error));
    assert_ok(cia402_eds_write(&bench->board[board], "x.eds", &arena, out, &error));
    assert_int_equal(fclose(out), 0);
    arena_fini(&arena);
    assert_true(strlen(text) > 1000 && strlen(text) < TEXT_MAX - 1);
    return text;
}

/* A key of a section; "" when it has none. */
static const char *eds_value(const char *text, const char *section, const char *key)
{
    static char value[256];
    char head[64];
    const char *at, *end;

    snprintf(head, sizeof head, "\n[%s]\n", section);
    at = strstr(text, head);
    value[0] = '\0';
    if (!at) {
        return NULL;
    }
    at += strlen(head);
    end = strstr(at, "\n[");
    snprintf(head, sizeof head, "%s=", key);
    for (; at && (!end || at < end); at = strchr(at, '\n') ? strchr(at, '\n') + 1 : NULL) {
        if (strncmp(at, head, strlen(head)) == 0) {
            snprintf(value, sizeof value, "%.*s", (int)strcspn(at + strlen(head), "\n"),
                     at + strlen(head));
            break;
        }
    }
    return value;
}

static int64_t eds_number(const char *value, unsigned node)
{
    bool relative = strncmp(value, "$NODEID+", 8) == 0;

    return strtoll(value + (relative ? 8 : 0), NULL, 0) + (relative ? node : 0);
}

/* Statuswords, the supply, and the faults of a sensor that has no orientation are not 0. */
static bool is_measured(unsigned index)
{
    return index == 0x6041 || index == 0x6841 || index == 0x6079 || index == 0x6879 ||
           index == 0x2101;
}

/* What SDO says of a sub-index, compared to its section. */
static void compare_object(struct board_bench *bench, int board, const char *text, unsigned index,
                           unsigned sub, bool alone)
{
    const struct board_config *config = &bench->board[board];
    unsigned answer, type;
    uint32_t got =
        sdo_exchange(bench, (size_t)config->bus, config->address, 0x40, index, sub, 0, &answer);
    char section[32];
    const char *value;

    snprintf(section, sizeof section, alone ? "%X" : "%Xsub%X", index, sub);
    value = eds_value(text, section, "DataType");
    if (answer == 0x80 && got == 0x08000024) { /* the history is empty */
        return;
    }
    if (answer == 0x80) {
        assert_int_equal(got, 0x06090011);
        assert_null(value);
        return;
    }
    if (!value) {
        fail_msg("0x%04X sub %u is not in the EDS file", index, sub);
        return;
    }
    type = (unsigned)strtoul(value, NULL, 0);
    if (answer == 0x41) {
        assert_true(type == 9 || type == 15);
        assert_int_equal(got, strlen(eds_value(text, section, "DefaultValue")));
        return;
    }
    assert_int_equal(4 - (answer >> 2 & 3), type == 2 || type == 5   ? 1
                                            : type == 3 || type == 6 ? 2
                                                                     : 4);
    if (!is_measured(index)) {
        uint32_t mask = (uint32_t)(UINT64_C(0xffffffff) >> 8 * (answer >> 2 & 3));
        int64_t wanted = eds_number(eds_value(text, section, "DefaultValue"), config->address);

        if (((uint32_t)wanted & mask) != got) {
            fail_msg("0x%04X sub %u is 0x%x, in the EDS file 0x%x", index, sub, got,
                     (unsigned)wanted);
        }
    }

    /* What is read only cannot be written, what is not can */
    value = eds_value(text, section, "AccessType");
    if (strncmp(value, "rw", 2) != 0) {
        unsigned bytes = 4 - (answer >> 2 & 3);

        assert_int_equal(
            sdo_write(bench, (size_t)config->bus, config->address, index, sub, bytes, got),
            0x06010002);
    }
}

TEST_ON(a_node_answers_what_its_eds_file_says, board_bench, bench)
{
    for (int board = 0; board < BENCH_BOARDS; board++) {
        unsigned objects = 0, listed = 0;
        char *text;

        configure(bench);
        for (int i = 0; i < BENCH_BOARDS; i++) {
            bench->board[i].axis[0].lower_rad = -1.5 - i;
        }
        bench_start(bench);
        text = write_eds(bench, board);
        for (unsigned index = 0x1000; index <= 0xa000; index++) {
            const struct board_config *config = &bench->board[board];
            unsigned answer;
            char section[16];

            snprintf(section, sizeof section, "%X", index);
            sdo_exchange(bench, (size_t)config->bus, config->address, 0x40, index, 0, 0, &answer);
            if (answer == 0x80) {
                assert_null(eds_value(text, section, "ParameterName"));
                continue;
            }
            objects++;
            if (*eds_value(text, section, "SubNumber")) {
                for (unsigned sub = 0; sub < 16; sub++) {
                    compare_object(bench, board, text, index, sub, false);
                }
            } else {
                compare_object(bench, board, text, index, 0, true);
            }
        }
        listed = (unsigned)atoi(eds_value(text, "MandatoryObjects", "SupportedObjects")) +
                 (unsigned)atoi(eds_value(text, "OptionalObjects", "SupportedObjects")) +
                 (unsigned)atoi(eds_value(text, "ManufacturerObjects", "SupportedObjects"));
        assert_int_equal(objects, listed);
        assert_true(objects > 20);
        free(text);
    }
}

/* Pressures in 10 mbar, the opening in thousandths; torque modes are no modes of a valve, and its
 * torque is the cylinder's. */
TEST(a_valve_tells_its_pressures_and_has_no_torque_modes)
{
    struct board_bench base, *bench = &base;
    const uint32_t torque_modes = 1u << 3 | 1u << 9;

    configure(bench);
    bench->board[0].axis[0] = bench_axis(0);
    bench->board[0].axis[0].valve = true;
    bench->board[0].axis[0].bemf_v_s_rad = 0.36;
    bench->sense[0] = (struct motor_sense){
        .torque_nm = 11.0, .pressure_pa = {60.6e5, 7e7}, .valve_opening = -0.25};
    bench_start(bench);
    bench_tick(bench);
    assert_int_equal(READ(0x4008, 1), 6060);
    assert_int_equal(READ(0x4008, 2), 65535); /* no more fits */
    assert_int_equal((int16_t)READ(0x4009, 0), -250);
    assert_int_equal((int16_t)READ(0x6077, 0), 200); /* of 55 N m */
    assert_int_equal(READ(0x6076, 0), 55000);
    assert_int_equal(READ(0x4014, 3), 360);
    assert_int_equal(READ(0x6502, 0) & torque_modes, 0);
    assert_int_equal(sdo_write(bench, 0, 4, 0x6060, 0, 1, 4), 0x06090030);
    assert_int_equal(sdo_write(bench, 0, 4, 0x6060, 0, 1, 10), 0x06090031); /* 9 is the highest */
    WRITE(0x6060, 0, 1, 8);

    /* The axis beside it has a motor */
    assert_int_equal(READ(0x4808, 1), 0);
    assert_int_equal(READ(0x6d02, 0) & torque_modes, torque_modes);
    assert_int_equal(sdo_write(bench, 0, 4, 0x6860, 0, 1, 4), 0);
    bench_stop(bench);
}
