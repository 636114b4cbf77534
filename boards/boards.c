/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All boards of a rig: checks of the configuration, dispatch of frames to boards, the part of the
 * protocol that every board shares (class 7, additional information, addresses), replies, events.
 */
#include "boards/board_private.h"

#include "canbus/frame.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { EVENT_SLOTS = 1024, TICK_MAX_MS = 100 };

/* ---- checks ---- */

static enum error_code refuse(struct error *error, const struct board_config *board,
                              const char *text)
{
    return error_set(error, ERROR_INPUT, "board %s: %s", board->name ? board->name : "(no name)",
                     text);
}

static bool positive(double value)
{
    return isfinite(value) && value > 0.0;
}

static enum error_code check_axis(const struct boards_config *config,
                                  const struct board_config *board,
                                  const struct board_axis_config *axis, struct error *error)
{
    if (axis->joint == -1) {
        return ERROR_NONE;
    }
    if (axis->joint < 0 || (size_t)axis->joint >= config->njoint) {
        return refuse(error, board, "there is no joint with the index of its axis");
    }
    if (!positive(axis->joint_ticks_per_rad) || !positive(axis->motor_ticks_per_rad)) {
        return refuse(error, board, "encoders need more than 0 ticks per rad");
    }
    if (!isfinite(axis->lower_rad) || !isfinite(axis->upper_rad) ||
        axis->lower_rad >= axis->upper_rad) {
        return refuse(error, board, "the lower limit of an axis must be below the upper one");
    }
    if (!positive(axis->current_limit_a) || axis->current_limit_a > 1e6) {
        return refuse(error, board, "the current limit of an axis must be above 0 A");
    }
    if (!isfinite(axis->torque_full_scale_nm) || axis->torque_full_scale_nm < 0.0) {
        return refuse(error, board, "the full scale of torque must not be negative");
    }
    return ERROR_NONE;
}

static enum error_code check_channels(const struct boards_config *config,
                                      const struct board_config *board, struct error *error)
{
    if (board->kind == BOARD_FT && (board->ft < 0 || (size_t)board->ft >= config->nft)) {
        return refuse(error, board, "there is no force-torque sensor with its index");
    }
    if (board->period_ns < 0) {
        return refuse(error, board, "the period must not be negative");
    }
    for (int i = 0; i < BOARD_CHANNELS; i++) {
        double scale = board->full_scale[i];

        if (board->kind == BOARD_TORQUE) {
            if (board->torque_joint[i] == -1) {
                continue;
            }
            if (board->torque_joint[i] < 0 || (size_t)board->torque_joint[i] >= config->njoint) {
                return refuse(error, board, "there is no joint with the index of its channel");
            }
        }
        if (!positive(scale) || scale > UINT16_MAX) {
            return refuse(error, board, "a full scale must be above 0 and at most 65535");
        }
        if (board->kind == BOARD_FT && scale != floor(scale)) {
            return refuse(error, board, "a full scale must be a whole number of N or Nm");
        }
    }
    return ERROR_NONE;
}

static enum error_code check_board(const struct boards_config *config,
                                   const struct board_config *board, struct error *error)
{
    if (board->bus < 0 || (size_t)board->bus >= config->nbus) {
        return refuse(error, board, "there is no bus with its index");
    }
    if (board->address < 1 || board->address > ICUB_ADDRESS_MAX) {
        return refuse(error, board, "the address must be 1 to 14");
    }
    if (board->command_timeout_ns < 0) {
        return refuse(error, board, "the command time-out must not be negative");
    }
    switch (board->kind) {
    case BOARD_MOTOR:
        for (int i = 0; i < BOARD_AXES; i++) {
            enum error_code code = check_axis(config, board, &board->axis[i], error);

            if (code) {
                return code;
            }
        }
        return ERROR_NONE;
    case BOARD_FT:
    case BOARD_TORQUE:
        return check_channels(config, board, error);
    }
    return refuse(error, board, "no such kind of board");
}

/* Two boards with one address or two axes with one joint. */
static enum error_code check_pair(const struct board_config *a, const struct board_config *b,
                                  struct error *error)
{
    if (a->bus == b->bus && a->address == b->address) {
        return error_set(error, ERROR_INPUT, "board %s: its address %d is that of board %s",
                         b->name ? b->name : "(no name)", b->address,
                         a->name ? a->name : "(no name)");
    }
    if (a->kind != BOARD_MOTOR || b->kind != BOARD_MOTOR) {
        return ERROR_NONE;
    }
    for (int i = 0; i < BOARD_AXES; i++) {
        for (int j = 0; j < BOARD_AXES; j++) {
            if (a->axis[i].joint >= 0 && a->axis[i].joint == b->axis[j].joint) {
                return refuse(error, b, "one of its joints already has an axis of another board");
            }
        }
    }
    return ERROR_NONE;
}

static enum error_code check(const struct boards_config *config, struct error *error)
{
    if (config->tick_ns <= 0 || config->tick_ns > (int64_t)TICK_MAX_MS * MS) {
        return error_set(error, ERROR_INPUT, "boards: the tick must be above 0 and at most %d ms",
                         TICK_MAX_MS);
    }
    if (config->nboard > UINT16_MAX) {
        return error_set(error, ERROR_INPUT, "boards: %zu are too many", config->nboard);
    }
    for (size_t i = 0; i < config->nboard; i++) {
        const struct board_config *board = &config->board[i];
        enum error_code code = check_board(config, board, error);

        if (!code && board->kind == BOARD_MOTOR && board->axis[0].joint >= 0 &&
            board->axis[0].joint == board->axis[1].joint) {
            code = refuse(error, board, "both axes have the same joint");
        }
        for (size_t j = 0; !code && j < i; j++) {
            code = check_pair(&config->board[j], board, error);
        }
        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* ---- making ---- */

static const struct board_ops *ops_of(enum board_kind kind)
{
    return kind == BOARD_MOTOR ? &motor_board_ops
           : kind == BOARD_FT  ? &ft_board_ops
                               : &torque_board_ops;
}

static bool make_board(struct boards *boards, struct board *board,
                       const struct board_config *config, struct arena *arena)
{
    board->boards = boards;
    board->config = *config;
    board->config.name = arena_strdup(arena, config->name ? config->name : "board");
    board->ops = ops_of(config->kind);
    board->address = config->address;
    board->bus = &boards->bus[config->bus];
    if (config->kind == BOARD_MOTOR) {
        board->motor = motor_board_create(arena);
    } else {
        board->strain = strain_board_create(arena);
    }
    if (!board->config.name || (!board->motor && !board->strain)) {
        return false;
    }
    memcpy(board->info, board->config.name, strnlen(board->config.name, sizeof board->info));
    board->bus->by_address[board->address] = board;
    board->bus->capacity += BOARD_REPLIES_MAX;
    board->bus->transmit_max += BOARD_REPLIES_MAX + board->ops->periodic_max;
    board->ops->power_up(board);
    return true;
}

static bool make(const struct boards_config *config, struct arena *arena, struct boards *boards)
{
    void *slots = arena_alloc(arena, EVENT_SLOTS, sizeof(struct board_event));

    boards->tick_ns = config->tick_ns;
    boards->nbus = config->nbus;
    boards->nboard = config->nboard;
    boards->bus = arena_alloc(arena, config->nbus + 1, sizeof *boards->bus);
    boards->board = arena_alloc(arena, config->nboard + 1, sizeof *boards->board);
    if (!slots || !boards->bus || !boards->board) {
        return false;
    }
    ring_init(&boards->events, slots, sizeof(struct board_event), EVENT_SLOTS);
    for (size_t i = 0; i < config->nboard; i++) {
        if (!make_board(boards, &boards->board[i], &config->board[i], arena)) {
            return false;
        }
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
    enum error_code code = check(config, error);
    struct boards *made;

    if (code) {
        return code;
    }
    made = arena_alloc(arena, 1, sizeof *made);
    if (!made || !make(config, arena, made)) {
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

static void board_lose(struct board *board)
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

/* ---- commands ---- */

enum verdict { OBEYED, UNKNOWN, MALFORMED };

static void enter_bootloader(struct board *board)
{
    board->application_ns = board->boards->time_ns + (int64_t)ICUB_BOOTLOADER_MS * MS;
    if (!board->in_bootloader) {
        board->in_bootloader = true;
        board_event(board, BOARD_EVENT_RESTART, 0, 1, 0);
    }
}

static void leave_bootloader(struct board *board)
{
    board->in_bootloader = false;
    board_event(board, BOARD_EVENT_RESTART, 0, 0, 0);
    board->ops->power_up(board);
}

static void discover(struct board *board, uint32_t reply_id)
{
    const uint8_t data[] = {ICUB_DISCOVER, board->ops->type, board->ops->major, board->ops->minor,
                            board->ops->build};

    /* a bootloader has no build number to tell: that is how hosts know it */
    board_queue(board, reply_id, board->in_bootloader ? 4 : 5, data);
    if (!board->in_bootloader && board->ops->discovered) {
        board->ops->discovered(board);
    }
}

static bool management(struct board *board, const struct bus_frame *frame, const int64_t *request)
{
    uint32_t reply_id = icub_id(ICUB_MANAGEMENT, board->address, frame->id >> 4);

    switch ((enum icub_management_command)frame->data[0]) {
    case ICUB_DISCOVER:
        discover(board, reply_id);
        return true;
    case ICUB_GET_ADDITIONAL_INFO:
        board_queue_info(board, reply_id);
        return true;
    case ICUB_SET_ADDITIONAL_INFO:
        board_set_info(board, request);
        return true;
    case ICUB_SET_CAN_ADDRESS:
        return board_set_address(board, (uint8_t)request[0]);
    case ICUB_START_UPDATE:
        enter_bootloader(board);
        return true;
    case ICUB_UPDATE_ADDRESS:
    case ICUB_UPDATE_DATA:
        if (board->in_bootloader) {
            enter_bootloader(board);
        }
        return true;
    case ICUB_UPDATE_RUN:
        if (board->in_bootloader) {
            leave_bootloader(board);
        }
        return true;
    case ICUB_UPDATE_END:
        board_queue(board, reply_id, 2, (const uint8_t[]){ICUB_UPDATE_END, 1});
        return true;
    }
    return false;
}

static const struct icub_command *find_command(const struct board *board, enum icub_class cls,
                                               uint8_t first)
{
    const struct board_ops *ops = board->ops;
    uint8_t code = cls == ICUB_POLLING_MOTOR ? first & (uint8_t)~ICUB_AXIS_BIT : first;

    if (cls == ICUB_MANAGEMENT) {
        return icub_management_command(first);
    }
    return code < ops->command_count && ops->commands[code].kind ? &ops->commands[code] : NULL;
}

static bool obey(struct board *board, const struct bus_frame *frame,
                 const struct icub_command *command, const int64_t *request)
{
    int64_t reply[ICUB_FIELDS_MAX] = {0};
    uint8_t data[8] = {frame->data[0]};
    bool answer = command->reply_length > 0;

    if (!board->ops->command(board, frame, request, reply, &answer)) {
        return false;
    }
    if (answer) {
        icub_encode(command->reply, reply, data + 1);
        board_queue(board,
                    icub_id((enum icub_class)(frame->id >> 8), board->address, frame->id >> 4),
                    command->reply_length, data);
    }
    return true;
}

static enum verdict handle(struct board *board, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8);
    const struct icub_command *command;
    int64_t request[ICUB_FIELDS_MAX] = {0};
    bool obeyed;

    if (frame->len == 0) {
        return MALFORMED;
    }
    command = find_command(board, cls, frame->data[0]);
    if (!command) {
        return UNKNOWN;
    }
    if (frame->len < command->request_min || frame->len > command->request_max ||
        !icub_decode(command->request, frame->data + 1, frame->len - 1u, request)) {
        return MALFORMED;
    }
    if (cls == ICUB_MANAGEMENT) {
        obeyed = management(board, frame, request);
    } else {
        obeyed = board->in_bootloader || obey(board, frame, command, request);
    }
    return obeyed ? OBEYED : MALFORMED;
}

static bool is_for(const struct board *board, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8);
    bool everyone = (frame->id & 0xf) == ICUB_EVERYONE;

    if (cls == ICUB_MANAGEMENT) {
        /* of the management commands only discovery may go to everyone */
        return !everyone || (frame->len > 0 && frame->data[0] == ICUB_DISCOVER);
    }
    return cls == board->ops->command_class;
}

static void receive_command(struct boards *boards, struct board_bus *bus,
                            const struct bus_frame *frame)
{
    unsigned to = frame->id & 0xf;
    unsigned first = to == ICUB_EVERYONE ? 1 : to;
    unsigned last = to == ICUB_EVERYONE ? ICUB_ADDRESS_MAX : to;
    struct board *listener = NULL;
    enum verdict worst = OBEYED;

    for (unsigned address = first; address <= last; address++) {
        struct board *board = bus->by_address[address];
        enum verdict verdict;

        if (!board || !is_for(board, frame)) {
            continue;
        }
        verdict = handle(board, frame);
        if (!listener || verdict > worst) {
            listener = board;
            worst = verdict;
        }
    }
    if (!listener) {
        boards->counters.foreign++;
        return;
    }
    boards->counters.frames++;
    if (worst != OBEYED) {
        bool unknown = worst == UNKNOWN;

        boards->counters.unknown += unknown;
        boards->counters.malformed += !unknown;
        board_event(listener, unknown ? BOARD_EVENT_UNKNOWN : BOARD_EVENT_MALFORMED, 0, frame->id,
                    frame->len ? frame->data[0] : 0);
    }
}

void bus_hear_strain(struct board_bus *bus, uint8_t address, unsigned type, const uint8_t *data,
                     int64_t time_ns)
{
    struct torque_source *source = &bus->source[address];
    unsigned first = type == ICUB_FORCE ? 0 : BOARD_CHANNELS / 2;

    for (unsigned i = 0; i < BOARD_CHANNELS / 2; i++) {
        source->value[first + i] = (int16_t)(get_u16_le(data + 2 * i) - ICUB_STRAIN_ZERO);
    }
    source->time_ns = time_ns;
    source->heard = true;
}

/* A STRAIN board that is not ours: hardware on the bus, whose torques a motor board may use. */
static void receive_strain(struct boards *boards, struct board_bus *bus,
                           const struct bus_frame *frame)
{
    unsigned type = frame->id & 0xf;
    uint8_t source = frame->id >> 4 & 0xf;

    boards->counters.foreign++;
    if ((type == ICUB_FORCE || type == ICUB_TORQUE) && source >= 1 && source <= ICUB_ADDRESS_MAX &&
        !bus->by_address[source] &&
        (frame->len == ICUB_STRAIN_LENGTH || frame->len == ICUB_STRAIN_SATURATED_LENGTH)) {
        bus_hear_strain(bus, source, type, frame->data, boards->time_ns);
    }
}

void boards_receive(struct boards *boards, size_t bus, const struct bus_frame *frame)
{
    if (bus >= boards->nbus || frame->flags || frame->id > 0x7ff || frame->len > 8) {
        boards->counters.foreign++;
        return;
    }
    switch (frame->id >> 8) {
    case ICUB_POLLING_MOTOR:
    case ICUB_POLLING_ANALOG:
    case ICUB_MANAGEMENT:
        receive_command(boards, &boards->bus[bus], frame);
        break;
    case ICUB_PERIODIC_ANALOG:
        receive_strain(boards, &boards->bus[bus], frame);
        break;
    default:
        boards->counters.foreign++;
        break;
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

static void shut_down(struct board *board, struct plant_command *command)
{
    if (board->ops->shut_down) {
        board->ops->shut_down(board, command);
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

        sample(board, sensors);
        board->sampled = false;
        if (board->in_bootloader) {
            shut_down(board, command);
            if (boards->time_ns >= board->application_ns) {
                leave_bootloader(board);
            }
        } else if (board->ops->control) {
            board->ops->control(board, span, command);
        }
    }
}

static void put_frame(struct frame_sink *sink, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct bus_frame *frame = &sink->frames[sink->count++];

    memset(frame, 0, sizeof *frame);
    frame->id = id;
    frame->len = len;
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
    put_frame(sink, id, len, data);
}

static void send_replies(struct board_bus *bus, struct frame_sink *sink)
{
    while (bus->waiting && sink->count < sink->max) {
        struct queued_reply *reply = &bus->replies[bus->head];

        put_frame(sink, reply->id, reply->len, reply->data);
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
    boards->sensor_time_ns = sensors->time_ns;
    span = (struct ms_span){.from = bus->sent_ms, .to = boards->time_ns / MS};
    bus->sent_ms = span.to;
    send_replies(bus, &sink);
    for (unsigned address = 1; address <= ICUB_ADDRESS_MAX; address++) {
        struct board *board = bus->by_address[address];

        if (!board) {
            continue;
        }
        sample(board, sensors);
        if (!board->in_bootloader) {
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
        shut_down(&boards->board[i], command);
    }
}

bool boards_fault(const struct boards *boards)
{
    for (size_t i = 0; i < boards->nboard; i++) {
        if (boards->board[i].motor && motor_board_fault(boards->board[i].motor)) {
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

static const char *mode_name(uint32_t mode)
{
    switch (mode) {
    case ICUB_MODE_IDLE:
        return "idle";
    case ICUB_MODE_POSITION:
        return "position";
    case ICUB_MODE_VELOCITY:
        return "velocity";
    case ICUB_MODE_TORQUE:
        return "torque";
    case ICUB_MODE_IMPEDANCE_POSITION:
        return "impedance position";
    case ICUB_MODE_IMPEDANCE_VELOCITY:
        return "impedance velocity";
    case ICUB_MODE_CURRENT:
        return "current";
    case ICUB_MODE_MIXED:
        return "mixed";
    case ICUB_MODE_DIRECT:
        return "direct position";
    case ICUB_MODE_OPEN_LOOP:
        return "voltage";
    case ICUB_MODE_CALIBRATION:
        return "calibration";
    case ICUB_MODE_HARDWARE_FAULT:
        return "hardware fault";
    default:
        return "unknown";
    }
}

static void fault_names(uint32_t bits, char *text, size_t size)
{
    static const char *const names[] = {"under-voltage",  "over-voltage", "external",
                                        "over-current",   "Hall sensor",  "absolute encoder",
                                        "optical encoder"};
    size_t used = 0;

    text[0] = '\0';
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        if (bits >> i & 1 && used < size) {
            used += (size_t)snprintf(text + used, size - used, "%s%s", used ? ", " : "", names[i]);
        }
    }
}

static void describe(const struct board_event *event, char *text, size_t size)
{
    char faults[128];
    unsigned axis = event->axis;
    uint32_t a = event->a, b = event->b;

    switch (event->kind) {
    case BOARD_EVENT_MODE:
        snprintf(text, size, "axis %u from %s to %s mode", axis, mode_name(a), mode_name(b));
        return;
    case BOARD_EVENT_FAULT:
        fault_names(a, faults, sizeof faults);
        snprintf(text, size, "axis %u has a fault: %s", axis, faults);
        return;
    case BOARD_EVENT_TIMEOUT:
        snprintf(text, size, "axis %u: the %s command went stale, now 0", axis, mode_name(a));
        return;
    case BOARD_EVENT_SOURCE_LOST:
        snprintf(text, size, "axis %u: torque source %" PRIu32 " is silent, motor off", axis, a);
        return;
    case BOARD_EVENT_LIMIT:
        snprintf(text, size, "axis %u is beyond its limit at %" PRId32 " ticks, voltage 0", axis,
                 (int32_t)a);
        return;
    case BOARD_EVENT_UNKNOWN:
        snprintf(text, size, "no such command 0x%02" PRIx32 " (id 0x%03" PRIx32 ")", b, a);
        return;
    case BOARD_EVENT_MALFORMED:
        snprintf(text, size,
                 "wrong length or value in command 0x%02" PRIx32 " (id 0x%03" PRIx32 ")", b, a);
        return;
    case BOARD_EVENT_ADDRESS:
        snprintf(text, size, "moves from address %" PRIu32 " to %" PRIu32, a, b);
        return;
    case BOARD_EVENT_RESTART:
        snprintf(text, size, "%s", a ? "in its bootloader" : "application started");
        return;
    case BOARD_EVENT_OVERFLOW:
        snprintf(text, size, "loses frames, %" PRIu32 " until now", a);
        return;
    }
    snprintf(text, size, "event %d", (int)event->kind);
}

void board_event_format(const struct boards *boards, const struct board_event *event, char *text,
                        size_t size)
{
    char what[192];

    describe(event, what, sizeof what);
    snprintf(text, size, "%.6f s: %s (bus %d, address %d): %s", (double)event->time_ns * 1e-9,
             boards->board[event->board].config.name, event->bus, event->address, what);
}

void boards_counters(const struct boards *boards, struct boards_counters *counters)
{
    *counters = boards->counters;
}
