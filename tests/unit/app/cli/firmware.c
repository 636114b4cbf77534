/* SPDX-License-Identifier: Apache-2.0 */
/* A download into the bootloader of a board of a running simulator ends up in a file. */
#include "app/cli/cli.h"
#include "tests/test.h"

#include <sys/stat.h>
#include <unistd.h>

enum { LEFT_LEG = 1, IMAGE = 2 * 65536 * 2 };

/* START twice, as canLoader does, six bytes at 0x0084 of the program, two at 0x2000 of the data,
 * RUN, END; a tick each. */
static const struct bus_frame download[] = {
    {.id = 0x702, .len = 1, .data = {0x00}},
    {.id = 0x702, .len = 1, .data = {0x00}},
    {.id = 0x702, .len = 5, .data = {0x01, 6, 0x84, 0x00, 0}},
    {.id = 0x702, .len = 7, .data = {0x03, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66}},
    {.id = 0x702, .len = 5, .data = {0x01, 2, 0x00, 0x20, 1}},
    {.id = 0x702, .len = 3, .data = {0x03, 0xab, 0xcd}},
    {.id = 0x702, .len = 5, .data = {0x02, 0x84}},
    {.id = 0x702, .len = 1, .data = {0x04}},
};

struct loader_host {
    struct bus_ports ports;
    size_t sent;
};

static void loader_host_step(void *context, int64_t now_ns)
{
    struct loader_host *host = context;

    (void)now_ns;
    if (host->sent < sizeof download / sizeof *download) {
        can_send(host->ports.port[LEFT_LEG], &download[host->sent++], 1);
    }
}

/* The bench, whose boards keep what is downloaded. */
static const struct rig *load_bench(struct arena *arena)
{
    static struct rig rig;
    static struct board_config board[64];
    const struct rig *loaded;
    struct error error;

    assert_no_error(
        rig_load(HIL_SOURCE_DIR "/config/rigs/coman-bench.yaml", arena, &loaded, &error),
        error.text);
    rig = *loaded;
    assert_true(rig.boards.nboard <= 64);
    memcpy(board, rig.boards.board, rig.boards.nboard * sizeof *board);
    for (size_t i = 0; i < rig.boards.nboard; i++) {
        board[i].keep_firmware = true;
    }
    rig.boards.board = board;
    return &rig;
}

/* Downloads to board 2 of the leg, and writes what has come. */
static enum error_code download_into(const char *folder, struct error *error)
{
    struct loader_host host = {.sent = 0};
    const struct simulator_observer observer = {&host, loader_host_step};
    struct simulator_config config = {.clock = LOOP_CLOCK_FREE,
                                      .transport = TRANSPORT_LOCAL,
                                      .ticks = 20,
                                      .observer = &observer,
                                      .guests = 1,
                                      .row_period_ns = 1000000};
    struct simulator *simulator;
    struct realtime_report report;
    char notice[256];
    struct arena arena;
    enum error_code code;

    assert_ok(arena_init(&arena, (size_t)1 << 30, error));
    config.rig = load_bench(&arena);
    if (simulator_create(&config, &arena, &simulator, notice, error) ||
        simulator_join(simulator, &host.ports, error) ||
        simulator_start(simulator, &report, error)) {
        fail_msg("%s", error->text);
    }
    assert_int_equal(simulator_run(simulator), LOOP_END_LENGTH);
    code = firmware_write(simulator, folder, error);
    bus_ports_close(&host.ports);
    simulator_destroy(simulator);
    arena_fini(&arena);
    return code;
}

TEST(what_was_downloaded_is_in_a_file)
{
    static unsigned char expected[IMAGE], found[IMAGE + 1];
    char folder[] = "/tmp/hil-firmware-XXXXXX", path[256], command[300];
    struct error error;
    struct stat there;
    FILE *file;

    memset(expected, 0xff, sizeof expected);
    memcpy(expected + 2 * 0x84, (const unsigned char[]){0x11, 0x22, 0x33, 0x44, 0x55, 0x66}, 6);
    memcpy(expected + 2 * (0x10000 + 0x2000), (const unsigned char[]){0xab, 0xcd}, 2);
    assert_non_null(mkdtemp(folder));
    assert_ok(download_into(folder, &error));
    snprintf(path, sizeof path, "%s/firmware-left_leg-0x02.bin", folder);
    file = fopen(path, "r");
    assert_non_null(file);
    assert_int_equal(fread(found, 1, sizeof found, file), IMAGE);
    fclose(file);
    assert_memory_equal(found, expected, IMAGE);

    /* Of no other board; and a link that stands in its place is replaced, not followed */
    snprintf(command, sizeof command, "%s/firmware-left_leg-0x01.bin", folder);
    assert_int_equal(access(command, F_OK), -1);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(symlink("elsewhere", path), 0);
    assert_ok(download_into(folder, &error));
    assert_int_equal(lstat(path, &there), 0);
    assert_true(S_ISREG(there.st_mode));
    assert_int_equal(there.st_size, IMAGE);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(rmdir(folder), 0);
}
