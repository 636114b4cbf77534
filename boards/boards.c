/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All boards of a rig: how they are made, what every board has whatever it speaks (replies, events,
 * its address, its bootloader), and the tick.
 */
#include "boards/board_private.h"

#include "canbus/frame.h"

#include <string.h>

enum { EVENT_SLOTS = 1024 };

/* ---- making ---- */

enum board_personality boards_personality(const struct boards_config *config, int bus)
{
    return config->bus ? config->bus[bus].personality : BOARD_ICUB;
}

/* Sets what the board is and makes the state of its kind; false without memory. */
static bool make_kind(struct board *board, enum board_kind kind, struct arena *arena)
{
    switch (board->bus->config.personality) {
    case BOARD_COMPACT:
        if (kind == BOARD_MOTOR) {
            board->ops = &compact_motor_ops;
            board->compact = compact_motor_create(arena);
            return board->compact;
        }
        board->ops = &compact_ft_ops;
        board->wrench = compact_ft_create(arena);
        return board->wrench;
    case BOARD_FOC:
        if (kind == BOARD_MOTOR) {
            board->ops = &foc_board_ops;
            board->foc = foc_board_create(arena);
            return board->foc;
        }
        break;
    case BOARD_ICUB:
        if (kind == BOARD_MOTOR) {
            board->ops = &motor_board_ops;
            board->motor = motor_board_create(arena);
            return board->motor;
        }
        break;
    }
    board->ops = kind == BOARD_FT ? &ft_board_ops : &torque_board_ops;
    board->strain = strain_board_create(arena);
    return board->strain;
}

/* The axes of a compact board take the next slots of its bus. */
static void take_slots(struct board *board)
{
    struct board_bus *bus = board->bus;

    for (unsigned i = 0; i < BOARD_AXES_MAX && board->config.axis[i].joint >= 0; i++) {
        bus->slot[bus->slots++] = (struct board_slot){board, i};
    }
}

static bool boards_make_board(struct boards *boards, struct board *board,
                              const struct board_config *config, struct arena *arena)
{
    board->boards = boards;
    board->config = *config;
    board->config.name = arena_strdup(arena, config->name ? config->name : "board");
    board->address = config->address;
    board->bus = &boards->bus[config->bus];
    board->node = board->bus->nodes++;
    if (!make_kind(board, config->kind, arena) || !board->config.name) {
        return false;
    }
    if (board->compact) {
        take_slots(board);
    }
    memcpy(board->info, board->config.name, strnlen(board->config.name, sizeof board->info));
    board->bus->by_address[board->address] = board;
    board->bus->capacity += BOARD_REPLIES_MAX;
    board->bus->transmit_max += BOARD_REPLIES_MAX + board->ops->periodic_max;
    board->ops->power_up(board);
    if (config->boot_ns > 0) {
        board->in_bootloader = true;
        board->application_ns = config->boot_ns;
    }
    return true;
}

static bool boards_make(const struct boards_config *config, struct arena *arena,
                        struct boards *boards)
{
    void *slots = arena_alloc(arena, EVENT_SLOTS, sizeof(struct board_event));

    boards->tick_ns = config->tick_ns;
    boards->restarted = config->restarted;
    boards->context = config->context;
    boards->nbus = config->nbus;
    boards->nboard = config->nboard;
    boards->bus = arena_alloc(arena, config->nbus + 1, sizeof *boards->bus);
    boards->board = arena_alloc(arena, config->nboard + 1, sizeof *boards->board);
    if (!slots || !boards->bus || !boards->board) {
        return false;
    }
    ring_init(&boards->events, slots, sizeof(struct board_event), EVENT_SLOTS);
    for (size_t i = 0; config->bus && i < config->nbus; i++) {
        boards->bus[i].config = config->bus[i];
    }
    for (size_t i = 0; i < config->nboard; i++) {
        if (!boards_make_board(boards, &boards->board[i], &config->board[i], arena)) {
            return false;
        }
    }
    if (!board_faults_create(boards, config->faults, arena)) {
        return false;
    }
    for (size_t i = 0; i < config->nbus; i++) {
        struct board_bus *bus = &boards->bus[i];

        bus->replies = arena_alloc(arena, bus->capacity + 1, sizeof *bus->replies);
        if (!bus->replies) {
            return false;
        }
    }
    return true;
}

enum error_code boards_create(const struct boards_config *config, struct arena *arena,
                              struct boards **boards, struct error *error)
{
    enum error_code code = boards_check(config, error);
    struct boards *made;

    if (code) {
        return code;
    }
    made = arena_alloc(arena, 1, sizeof *made);
    if (!made || !boards_make(config, arena, made)) {
        return error_set(error, ERROR_MEMORY, "boards: no memory for %zu boards", config->nboard);
    }
    *boards = made;
    return ERROR_NONE;
}

/* ---- events and replies ---- */

void board_event(const struct board *board, enum board_event_kind kind, unsigned axis, uint32_t a,
                 uint32_t b)
{
    struct boards *boards = board->boards;
    struct board_event event = {
        .time_ns = boards->sensor_time_ns,
        .kind = kind,
        .bus = board->config.bus,
        .address = board->address,
        .axis = (uint8_t)axis,
        .board = (uint16_t)(board - boards->board),
        .a = a,
        .b = b,
    };

    if (!ring_push(&boards->events, &event)) {
        boards->counters.events_lost++;
    }
}

void board_lose(struct board *board)
{
    if (!board->lost_in_overflow) {
        board_event(board, BOARD_EVENT_OVERFLOW, 0, (uint32_t)board->lost + 1, 0);
    }
    board->lost++;
    board->lost_in_status = board->lost_in_overflow = true;
    board->boards->counters.overflows++;
}

void board_queue(struct board *board, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct board_bus *bus = board->bus;
    struct queued_reply *reply = &bus->replies[(bus->head + bus->waiting) % bus->capacity];

    if (board->replies == BOARD_REPLIES_MAX) {
        board_lose(board);
        return;
    }
    board->replies++;
    bus->waiting++;
    *reply = (struct queued_reply){.board = board, .id = (uint16_t)id, .len = len};
    memcpy(reply->data, data, len);
}

void board_queue_info(struct board *board, uint32_t id)
{
    for (uint8_t part = 0; part < ICUB_INFO_LENGTH / ICUB_INFO_PART; part++) {
        uint8_t data[2 + ICUB_INFO_PART] = {ICUB_GET_ADDITIONAL_INFO, part};

        memcpy(data + 2, board->info + part * ICUB_INFO_PART, ICUB_INFO_PART);
        board_queue(board, id, sizeof data, data);
    }
}

void board_set_info(struct board *board, const int64_t *part)
{
    for (int i = 0; i < ICUB_INFO_PART; i++) {
        board->info[part[0] * ICUB_INFO_PART + i] = (char)(uint8_t)part[1 + i];
    }
}

bool board_set_address(struct board *board, uint8_t address)
{
    struct board_bus *bus = board->bus;

    if (address == board->address) {
        return true;
    }
    if (bus->by_address[address]) {
        return false;
    }
    board_event(board, BOARD_EVENT_ADDRESS, 0, board->address, address);
    bus->by_address[board->address] = NULL;
    bus->by_address[address] = board;
    board->address = address;
    return true;
}

void board_enter_bootloader(struct board *board, int64_t duration_ns)
{
    board->application_ns = board->boards->time_ns + duration_ns;
    if (!board->in_bootloader) {
        board->in_bootloader = true;
        board_event(board, BOARD_EVENT_RESTART, 0, 1, 0);
    }
}

void board_leave_bootloader(struct board *board)
{
    const struct boards *boards = board->boards;

    board->in_bootloader = false;
    board_event(board, BOARD_EVENT_RESTART, 0, 0, 0);
    board->ops->power_up(board);
    board->boards->settings_changes++;
    for (size_t i = 0; boards->restarted && i < BOARD_AXES_MAX; i++) {
        if (board_joint(board, i) >= 0) {
            boards->restarted(boards->context, board_joint(board, i));
        }
    }
}

/* ---- reception ---- */

void boards_count_frame(struct boards *boards, struct board *listener, enum board_verdict verdict,
                        const struct bus_frame *frame)
{
    bool unknown = verdict == BOARD_UNKNOWN;

    if (!listener) {
        boards->counters.foreign++;
        return;
    }
    boards->counters.frames++;
    if (verdict != BOARD_OBEYED) {
        boards->counters.unknown += unknown;
        boards->counters.malformed += !unknown;
        board_event(listener, unknown ? BOARD_EVENT_UNKNOWN : BOARD_EVENT_MALFORMED, 0, frame->id,
                    frame->len ? frame->data[0] : 0);
    }
}

void boards_receive(struct boards *boards, size_t bus, const struct bus_frame *frame)
{
    const unsigned foreign = FRAME_EXTENDED | FRAME_REMOTE | FRAME_ERROR;
    bool fd = frame->flags & FRAME_FD;

    if (bus >= boards->nbus || frame->flags & foreign || frame->id > 0x7ff ||
        frame->len > (fd ? 64 : 8) || (fd && !boards->bus[bus].config.fd)) {
        boards->counters.foreign++;
    } else if (boards->bus[bus].config.personality == BOARD_COMPACT) {
        compact_bus_receive(boards, &boards->bus[bus], frame);
    } else {
        icub_bus_receive(boards, &boards->bus[bus], frame);
    }
}

/* ---- the tick ---- */

static void sample(struct board *board, const struct plant_sensors *sensors)
{
    if (!board->sampled) {
        board->ops->sample(board, sensors);
        board->sampled = true;
    }
}

static void board_shut_down(struct board *board, struct plant_command *command)
{
    if (board->ops->shut_down) {
        board->ops->shut_down(board, command);
    }
}

static void board_step(struct board *board, struct ms_span span, struct plant_command *command)
{
    if (board->in_bootloader) {
        board_shut_down(board, command);
        if (board->boards->time_ns >= board->application_ns) {
            board_leave_bootloader(board);
        }
    } else if (board->ops->control) {
        board->ops->control(board, span, command);
    }
}

void boards_control(struct boards *boards, const struct plant_sensors *sensors,
                    struct plant_command *command)
{
    struct ms_span span;

    boards->sensor_time_ns = sensors->time_ns;
    span.from = boards->time_ns / MS;
    boards->time_ns += boards->tick_ns;
    span.to = boards->time_ns / MS;
    for (size_t i = 0; i < boards->nboard; i++) {
        struct board *board = &boards->board[i];
        enum board_health health = BOARD_WORKS;

        sample(board, sensors);
        board->sampled = false;
        if (board->faults) {
            health = board_faults_control(board, sensors, command);
        }
        if (health == BOARD_WORKS) {
            board_step(board, span, command);
        } else if (health == BOARD_WITHOUT_POWER) {
            board_shut_down(board, command);
        }
    }
}

void boards_set_can_state(struct boards *boards, size_t board, const struct board_can_state *state)
{
    if (board < boards->nboard) {
        boards->board[board].can = *state;
    }
}

static void board_put_frame(const struct board *board, struct frame_sink *sink, uint32_t id,
                            uint8_t len, const uint8_t *data)
{
    struct bus_frame *frame = &sink->frames[sink->count++];

    memset(frame, 0, sizeof *frame);
    frame->id = id;
    frame->flags = sink->flags;
    frame->len = len;
    frame->node = board->node;
    frame->time_ns = sink->time_ns;
    if (len) {
        memcpy(frame->data, data, len);
    }
}

void board_send(struct board *board, struct frame_sink *sink, uint32_t id, uint8_t len,
                const uint8_t *data)
{
    if (sink->count == sink->max) {
        board_lose(board);
        return;
    }
    board_put_frame(board, sink, id, len, data);
}

static void bus_send_replies(struct board_bus *bus, struct frame_sink *sink)
{
    while (bus->waiting && sink->count < sink->max) {
        struct queued_reply *reply = &bus->replies[bus->head];

        if (!reply->lost) {
            size_t from = sink->count;

            board_put_frame(reply->board, sink, reply->id, reply->len, reply->data);
            if (reply->board->faults) {
                board_faults_filter(reply->board, sink, from);
            }
        }
        reply->board->replies--;
        bus->head = (bus->head + 1) % bus->capacity;
        bus->waiting--;
    }
}

size_t boards_transmit(struct boards *boards, size_t bus_index, const struct plant_sensors *sensors,
                       struct bus_frame *frames, size_t max)
{
    struct frame_sink sink = {.frames = frames, .max = max, .time_ns = sensors->time_ns};
    struct board_bus *bus;
    struct ms_span span;

    if (bus_index >= boards->nbus) {
        return 0;
    }
    bus = &boards->bus[bus_index];
    sink.flags = bus->config.fd ? FRAME_FD | FRAME_BRS : 0;
    boards->sensor_time_ns = sensors->time_ns;
    span = (struct ms_span){.from = bus->sent_ms, .to = boards->time_ns / MS};
    bus->sent_ms = span.to;
    bus_send_replies(bus, &sink);
    for (unsigned address = 1; address < BOARD_ADDRESSES; address++) {
        struct board *board = bus->by_address[address];

        if (!board) {
            continue;
        }
        sample(board, sensors);
        if (board->faults && !board_is_deaf(board)) {
            board_faults_transmit(board, span, &sink);
        } else if (!board_is_deaf(board)) {
            board->ops->transmit(board, span, &sink);
        }
    }
    return sink.count;
}

size_t boards_transmit_max(const struct boards *boards, size_t bus)
{
    return bus < boards->nbus ? boards->bus[bus].transmit_max : 0;
}

void boards_shut_down(struct boards *boards, struct plant_command *command)
{
    for (size_t i = 0; i < boards->nboard; i++) {
        board_shut_down(&boards->board[i], command);
    }
}

bool boards_fault(const struct boards *boards)
{
    for (size_t i = 0; i < boards->nboard; i++) {
        const struct board *board = &boards->board[i];

        if (board->ops->fault && board->ops->fault(board)) {
            return true;
        }
    }
    return false;
}

/* ---- the log's side ---- */

bool boards_next_event(struct boards *boards, struct board_event *event)
{
    return ring_pop(&boards->events, event);
}

const struct ring *boards_event_ring(const struct boards *boards)
{
    return &boards->events;
}

void boards_counters(const struct boards *boards, struct boards_counters *counters)
{
    *counters = boards->counters;
}
