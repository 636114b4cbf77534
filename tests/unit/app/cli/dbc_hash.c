/* SPDX-License-Identifier: Apache-2.0 */
/* The hashes of a rig's DBC files in the file of --ready. */
#include "app/cli/cli.h"

#include <inttypes.h>

#include "rig/dbc.h"
#include "tests/test.h"

static struct error error;

static struct arena arena;

FIXTURE(begin)
{
    return arena_init(&arena, (size_t)1 << 30, &error) ? -1 : 0;
}

FIXTURE(end)
{
    arena_fini(&arena);
    return 0;
}

static const struct rig *load(const char *path)
{
    const struct rig *rig;

    assert_no_error(rig_load(path, &arena, &rig, &error), error.text);
    return rig;
}

/* Appends BUS=HASH of the text that a bus's DBC file has, by FNV-1a written out. */
static void append_expected(const struct rig *rig, size_t bus, char *text, size_t size)
{
    struct memory_file file = {.text = NULL};
    uint64_t hash = UINT64_C(14695981039346656037);
    const size_t used = strlen(text);
    struct dbc *dbc;

    assert_ok(rig_dbc(rig, bus, &arena, &dbc, &error));
    assert_ok(dbc_hash_write_text(dbc, &file, &error));
    assert_memory_equal(file.text, "VERSION", 7);
    for (size_t i = 0; i < file.size; i++) {
        hash = (hash ^ (uint8_t)file.text[i]) * UINT64_C(1099511628211);
    }
    free(file.text);
    snprintf(text + used, size - used, "%s%s=%016" PRIx64, used ? " " : "", rig->bus[bus].name,
             hash);
}

TEST_WITH(each_bus_has_the_hash_of_its_file, begin, end)
{
    const struct rig *rig = load(HIL_SOURCE_DIR "/config/rigs/coman.yaml");
    char expected[2048] = "";
    const char *hashes, *again;

    for (size_t i = 0; i < rig->nbus; i++) {
        append_expected(rig, i, expected, sizeof expected);
    }
    assert_ok(dbc_hash_rig(rig, &arena, &hashes, &error));
    assert_string_equal(hashes, expected);

    /* The supply is in every file */
    struct rig changed = *rig;

    changed.supply_v += 1.0;
    assert_ok(dbc_hash_rig(&changed, &arena, &again, &error));
    assert_int_equal(strlen(again), strlen(hashes));
    assert_null(strstr(again, strstr(hashes, "=") + 1));
    assert_string_not_equal(again, hashes);
}

TEST_WITH(a_bus_that_no_file_can_hold_is_left_out, begin, end)
{
    struct rig changed = *load(HIL_SOURCE_DIR "/config/rigs/coman.yaml");
    struct rig_bus bus[RIG_BUSES_MAX];
    const char *hashes;

    memcpy(bus, changed.bus, changed.nbus * sizeof *bus);
    bus[1].interface = "can\"1"; /* no text of a DBC has a quote */
    changed.bus = bus;
    assert_ok(dbc_hash_rig(&changed, &arena, &hashes, &error));
    assert_null(strstr(hashes, bus[1].name));
    assert_non_null(strstr(hashes, bus[0].name));
    assert_non_null(strstr(hashes, bus[2].name));
}

TEST_WITH(no_memory_is_an_error, begin, end)
{
    const struct rig *rig = load(HIL_SOURCE_DIR "/config/rigs/coman.yaml");
    const char *hashes;
    struct arena small;

    assert_ok(arena_init(&small, 16, &error));
    assert_int_equal(dbc_hash_rig(rig, &small, &hashes, &error), ERROR_MEMORY);
    arena_fini(&small);
}
