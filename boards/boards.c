/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All boards of a rig, for every protocol: settings, delay of the voltages, real boards on the same
 * bus, lines of the log, the list of protocols, creation, and the phases of a tick.
 */
#include "boards/board_private.h"
#include "boards/protocol_list.h"

#include <inttypes.h>

size_t boards_settings(const struct boards *boards, size_t board, size_t axis)
{
    const struct board *of = boards->board[board];

    return of->ops->settings && !of->config.external && board_joint(of, axis) >= 0
               ? of->ops->settings->count
               : 0;
}

void boards_setting(const struct boards *boards, size_t board, size_t axis, size_t index,
                    struct board_setting *setting)
{
    const struct board *of = boards->board[board];

    of->ops->settings->describe(of, (unsigned)axis, index, setting);
}

double boards_get(const struct boards *boards, size_t board, size_t axis, size_t index)
{
    struct board_setting setting;

    boards_setting(boards, board, axis, index, &setting);
    return setting.value;
}

bool boards_set(struct boards *boards, size_t board, size_t axis, size_t index, double value)
{
    struct board *of = boards->board[board];
    struct board_setting setting;

    boards_setting(boards, board, axis, index, &setting);
    if (!(value >= setting.min && value <= setting.max) ||
        (setting.whole && value != rint(value)) ||
        !of->ops->settings->set(of, (unsigned)axis, index, value)) {
        return false;
    }
    boards->settings_changes++;
    return true;
}

uint64_t boards_settings_changes(const struct boards *boards)
{
    return boards->settings_changes;
}

/* ---- delay of the voltages: a voltage reaches its bridge some ticks after its computation ---- */

/* A voltage, V, or the law of a current controller. */
struct bridge_command {
    double voltage_v;
    struct current_law law;
};

/* Circular list of rows of commands, one per joint. The newest row has the last set points of
 * the boards. The next row is the oldest: it has the voltages of the bridges. */
struct voltage_delay {
    size_t rows, newest, njoint;
    struct bridge_command *row;
};

/* Returns the row that was stored `ticks` ticks before the newest. */
static struct bridge_command *delay_row(const struct voltage_delay *delay, size_t ticks)
{
    return &delay->row[(delay->newest + delay->rows - ticks) % delay->rows * delay->njoint];
}

/* Creates the delay if the configuration has one. Returns false when out of memory. Not RT-safe. */
static bool voltage_delay_create(struct boards *boards, const struct boards_config *config,
                                 struct arena *arena)
{
    struct voltage_delay *delay;

    if (config->voltage_delay_ticks == 0) {
        return true;
    }
    boards->delay = delay = arena_alloc(arena, 1, sizeof *delay);
    if (!delay) {
        return false;
    }
    delay->rows = config->voltage_delay_ticks + 1;
    delay->njoint = config->njoint;
    delay->row = arena_alloc(arena, delay->rows * (config->njoint + 1), sizeof *delay->row);
    return delay->row;
}

/* Copies the voltages of all emulated boards' joints from a row to the command; back: from the
 * command to the row. */
static void delay_copy(const struct boards *boards, struct bridge_command *row, bool back,
                       struct plant_command *command)
{
    for (size_t i = 0; i < boards->nboard; i++) {
        const struct board *board = boards->board[i];

        for (size_t axis = 0; axis < BOARD_AXES_MAX && !board->config.external; axis++) {
            const int joint = board_joint(board, axis);

            if (joint >= 0 && back) {
                row[joint].voltage_v = command->motor[joint].voltage_v;
                row[joint].law = command->motor[joint].law;
            } else if (joint >= 0) {
                const double reading_rad = command->motor[joint].law.reading_rad;

                command->motor[joint].voltage_v = row[joint].voltage_v;
                command->motor[joint].law = row[joint].law;
                command->motor[joint].law.reading_rad = reading_rad;
            }
        }
    }
}

/* ---- real boards on the same bus ---- */

void boards_external_heard(struct boards *boards, int64_t now_ns, size_t index)
{
    struct board *board = boards->board[index];

    boards->event_ns = boards->now_ns = now_ns;
    board->heard_ns = now_ns;
    if (!board->present) {
        board_event(board, BOARD_EVENT_HEARD, 0, 0, 0);
        board->present = true;
        board->silence_told = false;
    }
}

void boards_external_step(struct boards *boards, int64_t now_ns)
{
    for (size_t i = 0; i < boards->nboard; i++) {
        struct board *board = boards->board[i];
        int64_t since = board->heard_ns < 0 ? 0 : board->heard_ns;

        if (!board->config.external || board->silence_told ||
            now_ns - since <= board->config.external_timeout_ns) {
            continue;
        }
        boards->event_ns = now_ns;
        board_event(board, BOARD_EVENT_SILENT, 0, (uint32_t)((now_ns - since) / MS), 0);
        board->present = false;
        board->silence_told = true;
    }
}

bool boards_external_present(const struct boards *boards, size_t board)
{
    return boards->board[board]->present;
}

/* ---- lines of the log; not called in the loop ---- */

void protocol_list_faults(const struct protocol *protocol, uint32_t bits, char *text, size_t size)
{
    size_t used = 0;

    text[0] = '\0';
    for (size_t i = 0; protocol->fault_names[i] && used < size; i++) {
        if (bits >> i & 1) {
            used += (size_t)snprintf(text + used, size - used, "%s%s", used ? ", " : "",
                                     protocol->fault_names[i]);
        }
    }
}

/* Writes the text of an event, without time and board. */
static void event_describe(const struct boards_bus_config *bus, const struct board_event *event,
                           char *text, size_t size)
{
    const struct protocol *protocol = bus->protocol;
    char faults[128];
    unsigned axis = event->axis;
    uint32_t a = event->a, b = event->b;

    if (protocol->describe_event && protocol->describe_event(bus, event, text, size)) {
        return;
    }
    switch (event->kind) {
    /* Events of an axis */
    case BOARD_EVENT_MODE:
        snprintf(text, size, "axis %u from %s to %s%s", axis, protocol->mode_name(a),
                 protocol->mode_name(b), protocol->modes_are_states ? "" : " mode");
        return;
    case BOARD_EVENT_FAULT:
        protocol_list_faults(protocol, a, faults, sizeof faults);
        snprintf(text, size, "axis %u has a fault: %s", axis, faults);
        return;
    case BOARD_EVENT_TIMEOUT:
        snprintf(text, size, "axis %u: the %s%scommand timed out, %s", axis,
                 protocol->modes_are_states ? "" : protocol->mode_name(a),
                 protocol->modes_are_states ? "" : " ", protocol->timeout_text);
        return;
    case BOARD_EVENT_SOURCE_LOST:
        snprintf(text, size, "axis %u: torque source %" PRIu32 " timed out, motor switched off",
                 axis, a);
        return;
    case BOARD_EVENT_LIMIT:
        snprintf(text, size, "axis %u is beyond its position limit at %" PRId32 " %s", axis,
                 (int32_t)a, protocol->limit_text);
        return;

    /* Events of a frame */
    case BOARD_EVENT_UNKNOWN:
        snprintf(text, size, "unknown command 0x%02" PRIx32 " (id 0x%03" PRIx32 ")", b, a);
        return;
    case BOARD_EVENT_MALFORMED:
        snprintf(text, size,
                 "wrong length or value in command 0x%02" PRIx32 " (id 0x%03" PRIx32 ")", b, a);
        return;

    /* Events of a board */
    case BOARD_EVENT_ADDRESS:
        snprintf(text, size, "address changed from %" PRIu32 " to %" PRIu32, a, b);
        return;
    case BOARD_EVENT_RESTART:
        snprintf(text, size, "%s", a ? "bootloader entered" : "application started");
        return;
    case BOARD_EVENT_FIRMWARE:
        snprintf(text, size, "firmware received, %" PRIu32 " bytes, CRC-32 %08" PRIx32, a, b);
        return;
    case BOARD_EVENT_OVERFLOW:
        snprintf(text, size, "frames lost, %" PRIu32 " so far", a);
        return;
    case BOARD_EVENT_OVER_HEATED:
        snprintf(text, size, "axis %u is too hot: %.1f degree C", axis, (int32_t)a * 0.1);
        return;
    case BOARD_EVENT_OWED:
        snprintf(text, size, "axis %u is not switched on: a strict board first wants %s", axis,
                 a == BOARD_OWED_PROTOCOL ? "GET_FIRMWARE_VERSION with its protocol"
                 : a == BOARD_OWED_PID    ? "SET_POSITION_PID and SET_POSITION_PID_LIMITS"
                                          : "a calibration");
        return;
    case BOARD_EVENT_SILENT:
        snprintf(text, size, "external board silent for %" PRIu32 " ms", a);
        return;
    case BOARD_EVENT_HEARD:
        snprintf(text, size, "external board heard");
        return;
    }
    snprintf(text, size, "event %d", (int)event->kind);
}

void board_event_format(const struct boards *boards, const struct board_event *event, char *text,
                        size_t size)
{
    const struct board *board = boards->board[event->board];
    char what[192];

    event_describe(&board->bus->config, event, what, sizeof what);
    snprintf(text, size, "%.6f s: %s (bus %d, address %d): %s", (double)event->time_ns * 1e-9,
             board->config.name, event->bus, event->address, what);
}

/* ---- list of protocols; boards/CMakeLists.txt generates it from the folders of boards/ ---- */

#define PROTOCOL_ADDRESS(NAME) &protocol_##NAME,
static const struct protocol *const protocols[] = {PROTOCOLS(PROTOCOL_ADDRESS)};

/* One char per protocol: the offset of a member is the index of the protocol. */
#define PROTOCOL_MEMBER(NAME) char NAME;
struct protocol_index {
    PROTOCOLS(PROTOCOL_MEMBER)
};

#define PROTOCOL_WORD(NAME) {#NAME, (int)offsetof(struct protocol_index, NAME)},
const struct word protocol_words[] = {PROTOCOLS(PROTOCOL_WORD){NULL, 0}};

const struct protocol *protocol_at(size_t index)
{
    return index < ARRAY_COUNT(protocols) ? protocols[index] : NULL;
}

const struct protocol *protocol_find(const char *name)
{
    for (size_t i = 0; i < ARRAY_COUNT(protocols); i++) {
        if (!strcmp(protocols[i]->name, name)) {
            return protocols[i];
        }
    }
    return NULL;
}

const char *protocols_list(size_t capability, char *text, size_t size)
{
    const struct protocol *has[ARRAY_COUNT(protocols)];
    size_t count = 0, used = 0;

    for (size_t i = 0; i < ARRAY_COUNT(protocols); i++) {
        if (*(const bool *)((const char *)protocols[i] + capability)) {
            has[count++] = protocols[i];
        }
    }
    text[0] = '\0';
    for (size_t i = 0; i < count && used < size; i++) {
        used += (size_t)snprintf(text + used, size - used, "%s%s",
                                 i == 0           ? ""
                                 : i == count - 1 ? " or "
                                                  : ", ",
                                 has[i]->name);
    }
    return text;
}

enum { EVENT_SLOTS = 1024 };

/* ---- creation ---- */

const struct boards_bus_config *boards_bus(const struct boards_config *config, int bus)
{
    static const struct boards_bus_config unsaid;

    return config->bus ? &config->bus[bus] : &unsaid;
}

const struct protocol *boards_protocol(const struct boards_config *config, int bus)
{
    const struct protocol *protocol = boards_bus(config, bus)->protocol;

    return protocol ? protocol : protocol_at(0);
}

/* Powers up a board and its axes. */
static void board_power_up(struct board *board)
{
    board->ops->power_up(board);
    for (unsigned i = 0; i < board->axes; i++) {
        axis_power_up(board, i);
    }
}

/* Creates a board of its protocol and puts it on its bus. Returns false when out of memory. */
static bool boards_make_board(struct boards *boards, size_t index,
                              const struct board_config *config, struct arena *arena)
{
    struct board_bus *bus = boards->bus[config->bus];
    const struct board_ops *ops = bus->config.protocol->board[config->kind];
    struct board *board = arena_alloc(arena, 1, ops->size);
    unsigned axes = board_config_axes(config);

    if (!board) {
        return false;
    }
    boards->board[index] = board;
    board->ops = ops;
    board->boards = boards;
    board->bus = bus;
    board->index = (uint16_t)index;
    board->heard_ns = -1;
    board->config = *config;
    board->config.name = arena_strdup(arena, config->name ? config->name : "board");
    if (!board->config.name) {
        return false;
    }
    board->random = random_named(boards->seed, board->config.name);

    /* Put the board on its bus, and reserve room for its frames of a tick */
    board->axes = board->ops->axis_size ? bus->config.protocol->axes_max : 0;
    if (axes > 0 && axes < board->axes && !bus->config.protocol->spare_axes) {
        board->axes = (uint8_t)axes;
    }
    board->address = config->address;
    board->node = bus->nodes++;
    board_bus_place(bus, board->address, board);
    bus->capacity += BOARD_REPLIES_MAX;
    bus->transmit_max += BOARD_REPLIES_MAX + board->ops->periodic_max;
    if (bus->ops->add_board && !bus->ops->add_board(bus, board, arena)) {
        return false;
    }

    board_power_up(board);
    board->away = config->external;
    if (config->boot_ns > 0 && !config->external) {
        board->in_bootloader = true;
        board->application_ns = config->boot_ns;
    }
    return true;
}

bool boards_firmware(const struct boards *boards, size_t board, struct board_firmware *firmware)
{
    const struct board *of = boards->board[board];
    const struct protocol *protocol = of->bus->config.protocol;

    return protocol->firmware && protocol->firmware(of, firmware);
}

/* Creates the buses. Returns false when out of memory. */
static bool boards_make_buses(struct boards *boards, const struct boards_config *config,
                              struct arena *arena)
{
    boards->nbus = config->nbus;
    boards->bus = arena_alloc(arena, config->nbus + 1, sizeof(struct board_bus *));
    for (size_t i = 0; boards->bus && i < config->nbus; i++) {
        const struct protocol *protocol = boards_protocol(config, (int)i);

        boards->bus[i] = arena_alloc(arena, 1, protocol->bus->size);
        if (!boards->bus[i]) {
            return false;
        }
        boards->bus[i]->ops = protocol->bus;
        boards->bus[i]->config = *boards_bus(config, (int)i);
        boards->bus[i]->config.protocol = protocol;
        boards->bus[i]->reply = protocol->reply;
    }
    return boards->bus;
}

/* Creates buses, boards, queues and faults. Returns false when out of memory. */
static bool boards_make(struct boards *boards, const struct boards_config *config,
                        struct arena *arena)
{
    void *slots = arena_alloc(arena, EVENT_SLOTS, sizeof(struct board_event));

    boards->tick_ns = config->tick_ns;
    boards->restarted = config->restarted;
    boards->context = config->context;
    boards->nboard = config->nboard;
    boards->seed = config->faults ? faults_seed(config->faults) : 0;
    boards->board = arena_alloc(arena, config->nboard + 1, sizeof(struct board *));
    if (!slots || !boards->board || !boards_make_buses(boards, config, arena)) {
        return false;
    }
    ring_init(&boards->events, slots, sizeof(struct board_event), EVENT_SLOTS);
    for (size_t i = 0; i < config->nboard; i++) {
        if (!boards_make_board(boards, i, &config->board[i], arena)) {
            return false;
        }
    }

    /* Allocate the queues of the buses; the boards have determined their lengths */
    for (size_t i = 0; i < config->nbus; i++) {
        struct board_bus *bus = boards->bus[i];

        bus->replies = arena_alloc(arena, bus->capacity + 1, sizeof *bus->replies);
        if (!bus->replies) {
            return false;
        }
    }
    return voltage_delay_create(boards, config, arena) &&
           board_faults_create(boards, config->faults, arena);
}

/* Checks what a rig's schema cannot: refuses a servo valve on boards that cannot move one, and too
 * many axes on a bus that numbers its axes. */
static enum error_code boards_check(const struct boards_config *config, struct error *error)
{
    for (size_t bus = 0; bus < config->nbus; bus++) {
        const struct protocol *protocol = boards_protocol(config, (int)bus);
        size_t slots = 0;

        for (size_t i = 0; i < config->nboard; i++) {
            const struct board_config *board = &config->board[i];
            unsigned axes = board->bus == (int)bus ? board_config_axes(board) : 0;

            slots += axes;
            for (unsigned k = 0; protocol->no_valves && k < axes; k++) {
                if (board->axis[k].valve) {
                    return error_set(error, ERROR_INPUT,
                                     "board %s: found a servo valve on a bus that speaks %s, "
                                     "expected a motor",
                                     board->name, protocol->name);
                }
            }
        }
        if (protocol->slots_max > 0 && slots > protocol->slots_max) {
            return error_set(error, ERROR_INPUT,
                             "found %zu axes on a bus that speaks %s, expected at most %d", slots,
                             protocol->name, protocol->slots_max);
        }
    }
    return ERROR_NONE;
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
    if (!made || !boards_make(made, config, arena)) {
        return error_set(error, ERROR_MEMORY, "boards: no memory for %zu boards", config->nboard);
    }
    *boards = made;
    return ERROR_NONE;
}

/* ---- events and replies ---- */

void board_event(const struct board *board, enum board_event_kind kind, unsigned axis, uint32_t a,
                 uint32_t b)
{
    static const struct board_reason none;
    struct boards *boards = board->boards;
    const struct board_reason *reason = kind == BOARD_EVENT_MALFORMED ? &boards->reason : &none;
    struct board_event event = {
        .time_ns = boards->event_ns,
        .kind = kind,
        .bus = board->config.bus,
        .address = board->address,
        .axis = (uint8_t)axis,
        .board = board->index,
        .row = reason->row,
        .why = reason->why,
        .a = a,
        .b = reason->why ? reason->found : b,
        .c = reason->expected,
    };

    if (kind == BOARD_EVENT_MALFORMED) {
        boards->malformed = event;
    }
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

/* Returns the flags of a frame in the format of its bus. */
static uint8_t bus_flags(const struct board_bus *bus)
{
    return bus->config.fd ? FRAME_FD | FRAME_BRS : 0;
}

void board_queue(struct board *board, uint32_t id, uint8_t len, const uint8_t *data)
{
    board_queue_as(board, id, bus_flags(board->bus), len, data);
}

/* Returns an entry of the queue of a bus; 0 = the next one. */
static struct queued_reply *bus_reply_at(const struct board_bus *bus, size_t index)
{
    return &bus->replies[(bus->head + index) % bus->capacity];
}

/* Returns when a message of a board is due: at once, or after the reply time of a command. */
static int64_t board_find_due(struct board *board)
{
    const struct boards *boards = board->boards;
    struct board_reply_time time = board->config.reply;
    int64_t due_ns;

    if (!boards->reply) {
        return boards->now_ns;
    }
    time.delay_ns = time.delay_ns < 0 ? boards->reply->delay_ns : time.delay_ns;
    time.spread_ns = time.spread_ns < 0 ? boards->reply->spread_ns : time.spread_ns;
    due_ns = boards->arrival_ns + time.delay_ns;
    if (time.spread_ns > 0) {
        due_ns += (int64_t)(random_uniform(&board->random) * (double)time.spread_ns);
    }
    board->reply_ns = due_ns > board->reply_ns ? due_ns : board->reply_ns;
    return board->reply_ns;
}

/* Adds an entry to the queue of the bus, behind the messages that are due no later. Returns NULL if
 * a real board answers, or if the board has too many answers. */
static struct queued_reply *board_add_reply(struct board *board)
{
    struct board_bus *bus = board->bus;
    int64_t due_ns;
    size_t at;

    if (board->config.external) {
        return NULL;
    }
    if (board->replies == BOARD_REPLIES_MAX) {
        board_lose(board);
        return NULL;
    }
    due_ns = board_find_due(board);
    at = bus->waiting++;
    while (at > 0 && bus_reply_at(bus, at - 1)->due_ns > due_ns) {
        *bus_reply_at(bus, at) = *bus_reply_at(bus, at - 1);
        at--;
    }
    board->replies++;
    *bus_reply_at(bus, at) = (struct queued_reply){.board = board, .due_ns = due_ns};
    return bus_reply_at(bus, at);
}

void board_queue_as(struct board *board, uint32_t id, uint8_t flags, uint8_t len,
                    const uint8_t *data)
{
    struct queued_reply *reply = board_add_reply(board);

    if (reply) {
        reply->flags = flags;
        reply->len = len;
        reply->id = id;
        memcpy(reply->data, data, len);
    }
}

void board_queue_transmit(struct board *board)
{
    struct queued_reply *reply = board_add_reply(board);

    if (reply) {
        reply->transmit = true;
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
    board_bus_place(bus, address, board);
    board->address = address;
    return true;
}

void board_enter_bootloader(struct board *board, int64_t duration_ns)
{
    int64_t restart_ns = board->config.restart_ns;

    board->application_ns =
        board->boards->now_ns + (duration_ns > restart_ns ? duration_ns : restart_ns);
    board->boots++;
    if (!board->in_bootloader) {
        board->in_bootloader = true;
        board_event(board, BOARD_EVENT_RESTART, 0, 1, 0);
    }
}

void board_leave_bootloader(struct board *board)
{
    struct boards *boards = board->boards;

    board->in_bootloader = false;
    board_event(board, BOARD_EVENT_RESTART, 0, 0, 0);
    board_power_up(board);
    boards->settings_changes++;
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

    if (!listener || listener->config.external) {
        boards->counters.foreign++;
        return;
    }
    boards->counters.frames++;
    board_hear(listener);
    if (verdict != BOARD_OBEYED) {
        boards->counters.unknown += unknown;
        boards->counters.malformed += !unknown;
        board_event(listener, unknown ? BOARD_EVENT_UNKNOWN : BOARD_EVENT_MALFORMED, 0, frame->id,
                    frame->len ? frame->data[0] : 0);
        boards->reason = (struct board_reason){0};
    }
}

void boards_receive_early(struct boards *boards, int64_t now_ns, int64_t arrival_ns, size_t bus,
                          const struct bus_frame *frame)
{
    bool fd = frame->flags & FRAME_FD, extended = frame->flags & FRAME_EXTENDED;

    if (bus >= boards->nbus || frame->flags & FRAME_ERROR ||
        frame->id > (extended ? 0x1fffffff : 0x7ff) || frame->len > (fd ? 64 : 8) ||
        (extended && !boards->bus[bus]->ops->extended) || (fd && !boards->bus[bus]->config.fd) ||
        (frame->flags & FRAME_REMOTE && !boards->bus[bus]->ops->remote)) {
        boards->counters.foreign++;
        return;
    }
    boards->event_ns = boards->now_ns = now_ns;
    boards->arrival_ns = arrival_ns;
    boards->reply = &boards->bus[bus]->reply;
    boards->bus[bus]->ops->receive(boards, boards->bus[bus], frame);
    boards->reply = NULL;
}

void boards_receive(struct boards *boards, int64_t now_ns, size_t bus,
                    const struct bus_frame *frame)
{
    boards_receive_early(boards, now_ns, now_ns, bus, frame);
}

/* ---- control ---- */

/* Opens the bridges of an emulated board. */
static void board_shut_down(struct board *board, struct plant_command *command)
{
    if (board->ops->shut_down && !board->config.external) {
        board->ops->shut_down(board);
        axes_drive_bridges(board, command);
    }
}

void boards_control(struct boards *boards, int64_t now_ns, struct plant_command *command)
{
    struct ms_span span = {.from = now_ns / MS, .to = (now_ns + boards->tick_ns) / MS};

    boards->event_ns = now_ns;
    boards->now_ns = now_ns + boards->tick_ns;
    if (boards->delay) {
        delay_copy(boards, delay_row(boards->delay, 0), false, command);
    }
    for (size_t i = 0; i < boards->nboard; i++) {
        struct board *board = boards->board[i];
        enum board_health health = board->config.external ? BOARD_HUNG
                                   : board->faults        ? board_faults_control(board, command)
                                                          : BOARD_WORKS;

        if (health == BOARD_WORKS) {
            /* Run one tick of a board with power: its bootloader or its application */
            if (board->in_bootloader) {
                board_shut_down(board, command);
                if (board->boards->now_ns >= board->application_ns) {
                    board_leave_bootloader(board);
                }
            } else if (board->ops->control) {
                board->ops->control(board, span);
                axes_drive_bridges(board, command);
            }
        } else if (health == BOARD_WITHOUT_POWER) {
            board_shut_down(board, command);
        }
    }

    /* Store the voltages that the boards have set, and write the oldest stored voltages to the
     * bridges */
    struct voltage_delay *delay = boards->delay;

    if (delay) {
        delay->newest = (delay->newest + 1) % delay->rows;
        delay_copy(boards, delay_row(delay, 0), true, command);
        delay_copy(boards, delay_row(delay, delay->rows - 1), false, command);
    }
}

void boards_shut_down(struct boards *boards, int64_t now_ns, struct plant_command *command)
{
    boards->event_ns = boards->now_ns = now_ns;
    for (size_t i = 0; i < boards->nboard; i++) {
        board_shut_down(boards->board[i], command);
    }
}

/* Returns whether an axis of an emulated board is in hardware fault. */
static bool board_is_faulty(const struct board *board)
{
    bool faulty = false;

    for (unsigned i = 0; i < board->axes; i++) {
        faulty = faulty || board_axis(board, i)->faulty;
    }
    return faulty && !board->config.external;
}

bool boards_fault(const struct boards *boards)
{
    for (size_t i = 0; i < boards->nboard; i++) {
        if (board_is_faulty(boards->board[i])) {
            return true;
        }
    }
    return false;
}

void boards_state(const struct boards *boards, size_t index, struct board_state *state)
{
    const struct board *board = boards->board[index];

    *state = (struct board_state){
        .address = board->address,
        .in_bootloader = board->in_bootloader,
        .away = board->away && !board->config.external,
        .external = board->config.external,
        .silent = board->config.external && !board->present,
        .faulty = board_is_faulty(board),
        .heard_ns = board->heard_ns,
    };
    for (unsigned i = 0; i < BOARD_AXES_MAX && board_joint(board, i) >= 0; i++) {
        state->mode[i] = board_axis(board, i)->mode;
        state->naxis++;
    }
}

/* ---- sensors ---- */

void boards_sample(struct boards *boards, int64_t now_ns, const struct plant_sensors *sensors)
{
    boards->event_ns = boards->now_ns = now_ns;
    boards->supply_v = isfinite(sensors->supply_v) ? fmax(sensors->supply_v, 0.0) : 0.0;
    boards->oil_pa = isfinite(sensors->oil_pa) ? fmax(sensors->oil_pa, 0.0) : 0.0;
    for (size_t i = 0; i < boards->nboard; i++) {
        struct board *board = boards->board[i];

        if (board->ops->axis_size) {
            axes_read_sensors(board, sensors);
        }
        board->ops->sample(board, sensors);
    }
}

/* ---- transmission ---- */

/* Returns whether a CAN controller has errors to report. */
static bool can_state_has_errors(const struct board_can_state *state)
{
    return state->tec != 0 || state->rec != 0 || state->bus_off;
}

void boards_set_can_state(struct boards *boards, size_t board, const struct board_can_state *state)
{
    if (board < boards->nboard) {
        struct board *of = boards->board[board];

        of->bus->can_errors += can_state_has_errors(state);
        of->bus->can_errors -= can_state_has_errors(&of->can);
        of->can = *state;
    }
}

bool boards_have_can_errors(const struct boards *boards, size_t bus)
{
    return boards->bus[bus]->can_errors > 0;
}

struct bus_frame *board_add_frame(struct board *board, struct frame_sink *sink)
{
    struct bus_frame *frame = &sink->frames[sink->count];

    if (sink->count == sink->max) {
        board_lose(board);
        return NULL;
    }
    *frame = (struct bus_frame){.node = board->node, .time_ns = sink->time_ns};
    sink->count++;
    return frame;
}

/* Sends a frame with the given flags. */
static void board_send_as(struct board *board, struct frame_sink *sink, uint32_t id, uint8_t flags,
                          uint8_t len, const uint8_t *data)
{
    struct bus_frame *frame = board_add_frame(board, sink);

    if (frame) {
        frame->id = id;
        frame->flags = flags;
        frame->len = len;
        memcpy(frame->data, data, len);
    }
}

void board_send(struct board *board, struct frame_sink *sink, uint32_t id, uint8_t len,
                const uint8_t *data)
{
    board_send_as(board, sink, id, bus_flags(board->bus), len, data);
}

/* Sends the periodic frames of a board. Other boards on the bus hear the frames that its faults
 * leave. */
static void board_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    size_t from = sink->count;

    board->ops->transmit(board, span, sink);
    if (board->faults) {
        board_faults_filter(board, sink, from);
    }
    for (size_t i = from; board->ops->sent && i < sink->count; i++) {
        board->ops->sent(board, &sink->frames[i]);
    }
}

/* Sends the waiting answers that are due by due_ns, in order, until the sink is full. */
static void bus_send_replies(struct board_bus *bus, int64_t due_ns, struct frame_sink *sink)
{
    while (bus->waiting && bus->replies[bus->head].due_ns <= due_ns && sink->count < sink->max) {
        struct queued_reply *reply = &bus->replies[bus->head];

        if (reply->transmit && !reply->lost && !board_is_deaf(reply->board)) {
            const struct ms_span span = {.from = bus->sent_ms, .to = sink->time_ns / MS};

            if (sink->count > 0 && sink->max - sink->count < reply->board->ops->periodic_max) {
                return; /* in the next call */
            }
            board_transmit(reply->board, span, sink);
        } else if (!reply->lost && !reply->transmit) {
            size_t from = sink->count;

            board_send_as(reply->board, sink, reply->id, reply->flags, reply->len, reply->data);
            if (reply->board->faults) {
                board_faults_filter(reply->board, sink, from);
            }
        }
        reply->board->replies--;
        bus->head = (bus->head + 1) % bus->capacity;
        bus->waiting--;
    }
}

size_t boards_answer(struct boards *boards, int64_t now_ns, int64_t due_ns, size_t bus,
                     struct bus_frame *frames, size_t max)
{
    struct frame_sink sink = {.frames = frames, .max = max, .time_ns = now_ns};

    boards->event_ns = boards->now_ns = now_ns;
    bus_send_replies(boards->bus[bus], due_ns, &sink);
    return sink.count;
}

int64_t boards_next_answer(const struct boards *boards, size_t bus)
{
    const struct board_bus *of = boards->bus[bus];

    return of->waiting ? of->replies[of->head].due_ns : INT64_MAX;
}

size_t boards_transmit_periodic(struct boards *boards, int64_t now_ns, size_t bus_index,
                                struct bus_frame *frames, size_t max)
{
    struct frame_sink sink = {.frames = frames, .max = max, .time_ns = now_ns};
    struct board_bus *bus = boards->bus[bus_index];
    const struct ms_span span = {.from = bus->sent_ms, .to = now_ns / MS};

    boards->event_ns = boards->now_ns = now_ns;
    bus->sent_ms = span.to;
    for (struct board **board = &bus->by_address[1]; board < &bus->by_address[bus->address_end];
         board++) {
        if (*board && !board_is_deaf(*board)) {
            board_transmit(*board, span, &sink);
        }
    }
    return sink.count;
}

size_t boards_transmit(struct boards *boards, int64_t now_ns, size_t bus, struct bus_frame *frames,
                       size_t max)
{
    size_t count;

    if (bus >= boards->nbus) {
        return 0;
    }
    count = boards_answer(boards, now_ns, now_ns, bus, frames, max);
    return count + boards_transmit_periodic(boards, now_ns, bus, frames + count, max - count);
}

size_t boards_transmit_max(const struct boards *boards, size_t bus)
{
    return bus < boards->nbus ? boards->bus[bus]->transmit_max : 0;
}

/* ---- called by the thread of the log ---- */

bool boards_next_event(struct boards *boards, struct board_event *event)
{
    return ring_pop(&boards->events, event);
}

const struct ring *boards_event_ring(const struct boards *boards)
{
    return &boards->events;
}

bool boards_last_malformed(const struct boards *boards, struct board_event *event)
{
    *event = boards->malformed;
    return boards->counters.malformed > 0;
}

void boards_counters(const struct boards *boards, struct boards_counters *counters)
{
    *counters = boards->counters;
}
