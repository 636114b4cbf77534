/* SPDX-License-Identifier: Apache-2.0 */
/* Functions of every iCub board: class 7, and a command's way through the rows of its table. */
#include "boards/icub/board.h"

#include "canbus/frame.h"

#include <string.h>

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

/* Answers discovery. */
static void icub_board_discover(struct icub_board *icub, uint32_t reply_id)
{
    struct board *board = &icub->board;
    const struct board_identity *identity = &board->ops->identity;
    bool loader = board->in_bootloader;
    const uint8_t data[] = {ICUB_DISCOVER, loader ? icub->ops->loader_type : identity->type,
                            identity->major, identity->minor, identity->build};

    /* A bootloader has no build number to tell: that is how hosts know it; and it stays */
    board_queue(board, reply_id, loader ? 4 : 5, data);
    if (loader) {
        board->application_ns = INT64_MAX;
    } else if (icub->ops->discovered) {
        icub->ops->discovered(icub);
    }
}

/* ---- the bootloader ---- */

/* Queues the acknowledgment of a command of the bootloader. */
static void icub_loader_acknowledge(struct icub_board *icub, const struct bus_frame *frame)
{
    board_queue(&icub->board, icub_id(ICUB_MANAGEMENT, icub->board.address, frame->id >> 4), 2,
                (const uint8_t[]){frame->data[0], 1});
}

/* Obeys START: the application resets into the bootloader, which waits as after any reset; in
 * the bootloader it ends that wait. */
static void icub_board_start_update(struct icub_board *icub)
{
    struct board *board = &icub->board;

    if (board->in_bootloader) {
        board->application_ns = INT64_MAX;
    } else {
        board_enter_bootloader(board, BOOTLOADER_NS);
    }
    icub->loader.boot = board->boots;
    icub_loader_start(&icub->loader);
}

bool icub_board_is_downloading(const struct icub_board *icub)
{
    return icub->board.in_bootloader && icub->loader.downloading &&
           icub->loader.boot == icub->board.boots;
}

/* Obeys ADDRESS, DATA and RUN of a download; returns false when they are refused, and not
 * acknowledged. */
static bool icub_board_download(struct icub_board *icub, const struct bus_frame *frame,
                                const int64_t *request)
{
    struct icub_loader *loader = &icub->loader;
    enum icub_line line = ICUB_LINE_GROWS;

    if (!icub->board.in_bootloader) {
        return true; /* the application ignores them */
    }
    if (!icub_board_is_downloading(icub)) {
        return false;
    }
    icub->board.application_ns = INT64_MAX;
    if (frame->data[0] == ICUB_UPDATE_ADDRESS) {
        icub_loader_open_line(loader, (uint8_t)request[0], (uint16_t)request[1],
                              (uint8_t)request[2]);
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

/* Obeys END, which leads to the application; there it is a ping. */
static void icub_board_end_update(struct icub_board *icub)
{
    struct icub_loader *loader = &icub->loader;

    if (icub->board.in_bootloader) {
        if (icub_board_is_downloading(icub) && loader->lines > 0) {
            board_event(&icub->board, BOARD_EVENT_FIRMWARE, 0, loader->bytes, loader->crc);
        }
        loader->downloading = false;
        board_leave_bootloader(&icub->board);
    }
}

/* ---- commands ---- */

/* Obeys a command of class 7; returns false when it is refused. */
static bool icub_board_manage(struct icub_board *icub, const struct bus_frame *frame,
                              const int64_t *request)
{
    struct board *board = &icub->board;
    uint32_t reply_id = icub_id(ICUB_MANAGEMENT, board->address, frame->id >> 4);

    switch ((enum icub_management_command)frame->data[0]) {
    /* What the application and the bootloader both answer */
    case ICUB_DISCOVER:
        icub_board_discover(icub, reply_id);
        return true;
    case ICUB_GET_ADDITIONAL_INFO:
        if (!icub->ops->no_info) {
            icub_board_queue_info(icub, reply_id);
        }
        return true;
    case ICUB_SET_ADDITIONAL_INFO:
        icub_board_set_info(icub, request);
        return true;
    case ICUB_SET_CAN_ADDRESS:
        return board_set_address(board, (uint8_t)request[0]);

    /* A firmware download */
    case ICUB_START_UPDATE:
        icub_board_start_update(icub);
        icub_loader_acknowledge(icub, frame);
        return true;
    case ICUB_UPDATE_ADDRESS:
    case ICUB_UPDATE_DATA:
    case ICUB_UPDATE_RUN:
        return icub_board_download(icub, frame, request);
    case ICUB_UPDATE_END:
        icub_loader_acknowledge(icub, frame);
        icub_board_end_update(icub);
        return true;
    }
    return false;
}

/* Returns the row of a command; NULL when there is none. */
static const struct icub_command *icub_board_find_command(const struct icub_board *board,
                                                          enum icub_class cls, uint8_t first)
{
    const struct icub_board_ops *ops = board->ops;
    uint8_t code = ops->axis_bit ? first & (uint8_t)~ICUB_AXIS_BIT : first;

    if (cls == ICUB_MANAGEMENT) {
        return icub_management_command(first);
    }
    return code < ops->command_count && ops->commands[code].kind ? &ops->commands[code] : NULL;
}

/* Obeys a command of the application and queues its answer; returns false when it is refused. */
static bool icub_board_obey(struct icub_board *icub, const struct bus_frame *frame,
                            const struct icub_command *command, const int64_t *request)
{
    struct board *board = &icub->board;
    int64_t reply[FIELDS_MAX] = {0};
    uint8_t data[8] = {frame->data[0]};
    bool answer = command->reply_length > 0;

    if (!icub->ops->command(icub, frame, request, reply, &answer)) {
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

enum board_verdict icub_board_receive(struct icub_board *icub, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8);
    const struct icub_command *command;
    struct bus_frame cut;
    int64_t request[FIELDS_MAX] = {0};
    bool obeyed;

    /* Which row of the table it is, and whether it fits there */
    if (frame->len == 0) {
        return BOARD_MALFORMED;
    }
    command = icub_board_find_command(icub, cls, frame->data[0]);
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

    /* The bootloader takes the application's commands for known and ignores them */
    if (cls == ICUB_MANAGEMENT) {
        obeyed = icub_board_manage(icub, frame, request);
    } else {
        obeyed = icub->board.in_bootloader || icub_board_obey(icub, frame, command, request);
    }
    return obeyed ? BOARD_OBEYED : BOARD_MALFORMED;
}
