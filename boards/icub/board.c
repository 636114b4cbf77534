/* SPDX-License-Identifier: Apache-2.0 */
/* Handles a firmware download, line by line; boards/icub/board.h describes it. */
#include "boards/icub/board.h"

#include "base/crc32.h"

/* Appends the bytes of DATA to the line. Adds a complete line to totals, checksum and image. */
static enum icub_line icub_loader_put(struct icub_loader *loader, const uint8_t *data, size_t size)
{
    const uint8_t head[] = {(uint8_t)loader->address, (uint8_t)(loader->address >> 8),
                            loader->memory};
    size_t from = loader->memory ? ICUB_MEMORY_WORDS : 0;

    if (!loader->line_open || size > (size_t)(loader->length - loader->filled)) {
        loader->line_open = false;
        return ICUB_LINE_REFUSED;
    }
    memcpy(loader->line + loader->filled, data, size);
    loader->filled = (uint8_t)(loader->filled + size);
    if (loader->filled < loader->length) {
        return ICUB_LINE_GROWS;
    }
    loader->line_open = false;
    loader->lines++;
    loader->bytes += loader->length;
    loader->crc = crc32_update(loader->crc, head, sizeof head);
    loader->crc = crc32_update(loader->crc, loader->line, loader->length);
    for (size_t i = 0; loader->image && i + 1 < loader->length; i += 2) {
        uint16_t at = (uint16_t)(loader->address + i / 2);

        loader->image[from + at] = (uint16_t)(loader->line[i] | loader->line[i + 1] << 8);
    }
    return ICUB_LINE_COMPLETE;
}

/* Functions of every iCub board: commands of class 7, and handling of a command by its table
 * row. */

static const int64_t BOOTLOADER_NS = (int64_t)ICUB_BOOTLOADER_MS * MS;

/* ---- identity and additional information ---- */

void icub_board_queue_info(struct icub_board *board, uint32_t id)
{
    for (uint8_t part = 0; part < ICUB_INFO_LENGTH / ICUB_INFO_PART; part++) {
        uint8_t data[2 + ICUB_INFO_PART] = {ICUB_GET_ADDITIONAL_INFO, part};

        memcpy(data + 2, board->info + part * ICUB_INFO_PART, ICUB_INFO_PART);
        board_queue(&board->board, id, sizeof data, data);
    }
}

void icub_board_set_info(struct icub_board *board, const int64_t *part)
{
    for (int i = 0; i < ICUB_INFO_PART; i++) {
        board->info[part[0] * ICUB_INFO_PART + i] = (char)(uint8_t)part[1 + i];
    }
}

void icub_board_report_firmware(const struct board *board, unsigned major, unsigned minor,
                                bool acknowledged, int64_t *reply)
{
    const struct board_identity *identity = &board->ops->identity;

    reply[0] = identity->type;
    reply[1] = identity->major;
    reply[2] = identity->minor;
    reply[3] = identity->build;
    reply[4] = major;
    reply[5] = minor;
    reply[6] = acknowledged;
}

/* ---- the bootloader ---- */

/* Queues the acknowledgment of a bootloader command. */
static void icub_loader_acknowledge(struct icub_board *icub, const struct bus_frame *frame)
{
    board_queue(&icub->board, icub_id(ICUB_MANAGEMENT, icub->board.address, frame->id >> 4), 2,
                (const uint8_t[]){frame->data[0], 1});
}

/* Returns whether the bootloader has received START since it was entered. */
static bool icub_board_is_downloading(const struct icub_board *icub)
{
    return icub->board.in_bootloader && icub->loader.downloading &&
           icub->loader.boot == icub->board.boots;
}

/* Obeys ADDRESS, DATA and RUN of a download. Returns false if it refuses the command, and then
 * sends no acknowledgment. */
static bool icub_board_download(struct icub_board *icub, const struct bus_frame *frame,
                                const int64_t *request)
{
    struct icub_loader *loader = &icub->loader;
    enum icub_line line = ICUB_LINE_GROWS;

    if (!icub->board.in_bootloader) {
        return true; /* the application ignores these commands */
    }
    if (!icub_board_is_downloading(icub)) {
        return false;
    }
    icub->board.application_ns = INT64_MAX;
    if (frame->data[0] == ICUB_UPDATE_ADDRESS) {
        loader->line_open = true;
        loader->length = (uint8_t)request[0];
        loader->filled = 0;
        loader->address = (uint16_t)request[1];
        loader->memory = (uint8_t)request[2];
        return true;
    }
    if (frame->data[0] == ICUB_UPDATE_DATA) {
        line = icub_loader_put(loader, frame->data + 1, frame->len - 1u);
    }
    if (frame->data[0] == ICUB_UPDATE_RUN || line == ICUB_LINE_COMPLETE) {
        icub_loader_acknowledge(icub, frame);
    }
    return line != ICUB_LINE_REFUSED;
}

/* ---- commands ---- */

/* Obeys a command of class 7. Returns false if it refuses the command. */
static bool icub_board_manage(struct icub_board *icub, const struct bus_frame *frame,
                              const int64_t *request)
{
    const struct icub_board_ops *ops = icub_ops_of(icub);
    struct board *board = &icub->board;
    struct icub_loader *loader = &icub->loader;
    const uint8_t identity[] = {
        ICUB_DISCOVER, board->in_bootloader ? ops->loader_type : ops->base.identity.type,
        ops->base.identity.major, ops->base.identity.minor, ops->base.identity.build};
    uint32_t reply_id = icub_id(ICUB_MANAGEMENT, board->address, frame->id >> 4);

    switch ((enum icub_management_command)frame->data[0]) {
    /* Both application and bootloader obey these commands. In the bootloader, DISCOVER reports no
     * build number and stops the timer that starts the application */
    case ICUB_DISCOVER:
        board_queue(board, reply_id, board->in_bootloader ? 4 : 5, identity);
        if (board->in_bootloader) {
            board->application_ns = INT64_MAX;
        } else if (ops->discovered) {
            ops->discovered(icub);
        }
        return true;
    case ICUB_GET_ADDITIONAL_INFO:
        if (!ops->no_info) {
            icub_board_queue_info(icub, reply_id);
        }
        return true;
    case ICUB_SET_ADDITIONAL_INFO:
        icub_board_set_info(icub, request);
        return true;
    case ICUB_SET_CAN_ADDRESS:
        return board_set_address(board, (uint8_t)request[0]);

    /* START of a download. The application restarts into the bootloader, which waits BOOTLOADER_NS
     * as after any reset. In the bootloader, START stops this timer. An erased image is all ones,
     * as in flash */
    case ICUB_START_UPDATE:
        if (board->in_bootloader) {
            board->application_ns = INT64_MAX;
        } else {
            board_enter_bootloader(board, BOOTLOADER_NS);
        }
        loader->boot = board->boots;
        loader->downloading = true;
        loader->line_open = false;
        loader->lines = loader->bytes = loader->crc = 0;
        if (loader->image) {
            memset(loader->image, 0xff, sizeof *loader->image * ICUB_MEMORIES * ICUB_MEMORY_WORDS);
        }
        icub_loader_acknowledge(icub, frame);
        return true;
    case ICUB_UPDATE_ADDRESS:
    case ICUB_UPDATE_DATA:
    case ICUB_UPDATE_RUN:
        return icub_board_download(icub, frame, request);
    /* leaves the bootloader; the application only acknowledges END */
    case ICUB_UPDATE_END:
        icub_loader_acknowledge(icub, frame);
        if (board->in_bootloader) {
            if (icub_board_is_downloading(icub) && loader->lines > 0) {
                board_event(board, BOARD_EVENT_FIRMWARE, 0, loader->bytes, loader->crc);
            }
            loader->downloading = false;
            board_leave_bootloader(board);
        }
        return true;
    }
    return false;
}

/* Obeys a command of the application and queues its answer. Returns false if the board refuses the
 * command. */
static bool icub_board_obey(struct icub_board *icub, const struct bus_frame *frame,
                            const struct icub_command *command, const int64_t *request)
{
    struct board *board = &icub->board;
    int64_t reply[FIELDS_MAX] = {0};
    uint8_t data[8] = {frame->data[0]};
    bool answer = command->reply_length > 0;

    if (!icub_ops_of(icub)->command(icub, frame, request, reply, &answer)) {
        return false;
    }
    if (answer) {
        fields_encode(command->reply, reply, data + 1);
        board_queue(board,
                    icub_id((enum icub_class)(frame->id >> 8), board->address, frame->id >> 4),
                    command->reply_length, data);
    }
    return true;
}

/* Receives a command of class 0, 2 or 7 that is addressed to the board. */
static enum board_verdict icub_board_receive(struct icub_board *icub, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8);
    const struct icub_board_ops *ops = icub_ops_of(icub);
    const struct icub_command *command = NULL;
    struct bus_frame cut;
    int64_t request[FIELDS_MAX] = {0};
    uint8_t code = frame->data[0] & (uint8_t)(ops->axis_bit ? ~ICUB_AXIS_BIT : ~0);
    bool obeyed;

    /* Find the table row, then check the length and the values */
    if (frame->len == 0) {
        return BOARD_MALFORMED;
    }
    if (cls == ICUB_MANAGEMENT) {
        command = icub_management_command(frame->data[0]);
    } else if (code < ops->command_count && ops->commands[code].kind) {
        command = &ops->commands[code];
    }
    if (!command) {
        return BOARD_UNKNOWN;
    }
    if (icub->board.bus->config.padded && frame->len == 8 && command->request_max < 8) {
        cut = *frame;
        cut.len = command->request_max;
        frame = &cut;
    }
    if (frame->len < command->request_min || frame->len > command->request_max ||
        !fields_decode(command->request, frame->data + 1, frame->len - 1u, request)) {
        return BOARD_MALFORMED;
    }

    /* The bootloader ignores all valid commands of the application */
    if (cls == ICUB_MANAGEMENT) {
        obeyed = icub_board_manage(icub, frame, request);
    } else {
        obeyed = icub->board.in_bootloader || icub_board_obey(icub, frame, command, request);
    }
    return obeyed ? BOARD_OBEYED : BOARD_MALFORMED;
}

/* Buses with iCub boards: passes each command to the addressed boards, and torques from STRAIN
 * boards to motor boards. */

/* Returns whether a command selects this board by its class and address. Only two kinds of
 * broadcasts of class 7 select boards: discovery, and the frames of a download. A loader program
 * sends START to each board, and then the frames of the download once to all boards. They select
 * the boards whose bootloader has received START. */
static bool icub_board_is_addressed(const struct icub_board *board, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8);

    if (cls != ICUB_MANAGEMENT) {
        return cls == icub_ops_of(board)->command_class;
    }
    if ((frame->id & 0xf) != ICUB_EVERYONE || frame->len == 0) {
        return (frame->id & 0xf) != ICUB_EVERYONE;
    }
    switch (frame->data[0]) {
    case ICUB_DISCOVER:
        return true;
    case ICUB_UPDATE_ADDRESS:
    case ICUB_UPDATE_RUN:
    case ICUB_UPDATE_DATA:
        return icub_board_is_downloading(board);
    case ICUB_UPDATE_END:
        return board->board.in_bootloader;
    default:
        return false;
    }
}

/* Passes a command to the addressed board, or to all boards. */
static void icub_bus_receive_command(struct boards *boards, struct board_bus *bus,
                                     const struct bus_frame *frame)
{
    unsigned to = frame->id & 0xf;
    unsigned first = to == ICUB_EVERYONE ? 1 : to;
    unsigned last = to == ICUB_EVERYONE ? ICUB_ADDRESS_MAX : to;
    struct board *listener = NULL;
    enum board_verdict worst = BOARD_OBEYED;

    /* Count a broadcast once, with the worst verdict of all boards */
    for (unsigned address = first; address <= last; address++) {
        struct board *board = bus->by_address[address];
        enum board_verdict verdict;

        if (!board || board->away || !icub_board_is_addressed(icub_board_of(board), frame)) {
            continue;
        }
        board_hear(board);
        verdict = icub_board_receive(icub_board_of(board), frame);
        if (!listener || verdict > worst) {
            listener = board;
            worst = verdict;
        }
    }
    boards_count_frame(boards, listener, worst, frame);
}

/* Passes DESIRED_TARGETS (boards/foc) to all boards. It is the only class 1 frame that a host
 * sends. */
static void icub_bus_receive_targets(struct boards *boards, struct board_bus *bus,
                                     const struct bus_frame *frame)
{
    struct board *listener = NULL;
    enum board_verdict worst = BOARD_OBEYED;

    if (frame->id != icub_id(ICUB_PERIODIC_MOTOR, ICUB_HOST, ICUB_EVERYONE)) {
        boards->counters.foreign++;
        return;
    }
    for (unsigned address = 1; address <= ICUB_ADDRESS_MAX; address++) {
        struct board *board = bus->by_address[address];

        if (board && !board_is_deaf(board) && icub_ops_of(icub_board_of(board))->targets) {
            listener = board;
            board_hear(board);
            worst = icub_ops_of(icub_board_of(board))->targets(icub_board_of(board), frame)
                        ? worst
                        : BOARD_MALFORMED;
        }
    }
    boards_count_frame(boards, listener, worst, frame);
}

void icub_bus_hear_strain(struct board_bus *bus, uint8_t address, enum icub_analog_type type,
                          const uint8_t *data, int64_t time_ns)
{
    struct torque_source *source = &icub_bus_of(bus)->source[address];
    unsigned first = type == ICUB_FORCE ? 0 : BOARD_CHANNELS / 2;

    for (unsigned i = 0; i < BOARD_CHANNELS / 2; i++) {
        source->value[first + i] = (int16_t)(get_u16_le(data + 2 * i) - ICUB_STRAIN_ZERO);
    }
    source->time_ns = time_ns;
}

/* Passes a frame to its receivers, by its class (struct board_bus_ops). */
static void icub_bus_receive(struct boards *boards, struct board_bus *bus,
                             const struct bus_frame *frame)
{
    switch (frame->id >> 8) {
    case ICUB_POLLING_MOTOR:
    case ICUB_POLLING_ANALOG:
    case ICUB_MANAGEMENT:
        icub_bus_receive_command(boards, bus, frame);
        break;
    case ICUB_PERIODIC_MOTOR:
        icub_bus_receive_targets(boards, bus, frame);
        break;
    case ICUB_PERIODIC_ANALOG: {
        /* Store a frame from a real STRAIN board, so that motor boards can use its torques */
        unsigned type = frame->id & 0xf;
        uint8_t source = frame->id >> 4 & 0xf;

        boards->counters.foreign++;
        if ((type == ICUB_FORCE || type == ICUB_TORQUE) && source >= 1 &&
            source <= ICUB_ADDRESS_MAX && !bus->by_address[source] &&
            (frame->len == ICUB_STRAIN_LENGTH || frame->len == ICUB_STRAIN_SATURATED_LENGTH)) {
            icub_bus_hear_strain(bus, source, (enum icub_analog_type)type, frame->data,
                                 boards->now_ns);
        }
        break;
    }
    default:
        boards->counters.foreign++;
        break;
    }
}

/* Stores the name of a new board as its additional information. Allocates the memory for its
 * firmware, if it keeps one. */
static bool icub_bus_add_board(struct board_bus *bus, struct board *board, struct arena *arena)
{
    struct icub_board *icub = icub_board_of(board);
    uint16_t **image = &icub->loader.image;

    (void)bus;
    memcpy(icub->info, board->config.name, strnlen(board->config.name, sizeof icub->info));
    if (board->config.kind != BOARD_MOTOR || !board->config.keep_firmware) {
        return true;
    }
    *image = arena_alloc(arena, (size_t)ICUB_MEMORIES * ICUB_MEMORY_WORDS, sizeof **image);
    return *image;
}

const struct board_bus_ops icub_bus_ops = {
    .size = sizeof(struct icub_bus),
    .add_board = icub_bus_add_board,
    .receive = icub_bus_receive,
};
