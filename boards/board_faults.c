/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Applies the faults of boards (faults/faults.h). They act on a board's power, firmware, contact to
 * the bus, and on all frames that it sends, replies included.
 *
 *   off           neither receives nor sends; its bridges are open; cold boot afterwards
 *   hung          the firmware stops: the board neither receives nor sends. After `watchdog`
 *                 seconds it is reset and boots from cold, even if the fault lasts longer. A board
 *                 hangs once each time the fault begins, while its application runs
 *   intermittent  runs, but neither receives nor sends during the gaps
 *   stuck         every identifier repeats the data of its last frame before the fault
 *   garbage       random data; identifier and length stay
 *   slow          sends one of `factor` frames of every identifier
 *   delayed       sends frames later; at most DELAYED_MAX frames wait
 *
 * Other boards on the bus receive the disturbed frames of a STRAIN board.
 *
 * The PWM timers of a hung board continue with their last compare values. Its bridges therefore
 * keep their duty cycles until the reset opens them. The firmware of a 2FOC board turns the field
 * of its motor. When it hangs, the field stops and holds the rotor. The plant's motor model
 * represents this as 0 V, so the motor brakes. An emergency stop (boards_shut_down) cuts the
 * motors' supply, so it also opens the bridges of hung boards.
 */
#include "boards/board_private.h"

enum { IDS_MAX = 32, DELAYED_MAX = 2048 };

/* The last frame that was sent with an identifier. */
struct sent_id {
    struct bus_frame frame;
    uint64_t count;
};

struct board_fault {
    const struct fault *fault;
    struct random_stream random;
    bool gap;                   /* INTERMITTENT: a gap is active */
    bool spent;                 /* HUNG: the board has hung since the fault began */
    struct sent_id id[IDS_MAX]; /* STUCK, SLOW: last frame and count of each identifier */
    size_t nid;
    struct bus_frame *waiting; /* DELAYED: circular queue; time_ns of a frame: when it is due */
    size_t first, count;
};

struct board_faults {
    struct board_fault *fault;
    size_t count;
    bool without_power, hung;
    int64_t watchdog_ns;         /* time at which the watchdog ends the hang */
    double duty[BOARD_AXES_MAX]; /* duty cycles of the bridges during a hang */
};

bool board_faults_create(struct boards *boards, const struct faults *faults, struct arena *arena)
{
    size_t n = faults ? faults_count(faults) : 0;

    for (size_t i = 0; i < n; i++) {
        const struct fault *fault = faults_at(faults, i);
        struct board *board;
        struct board_fault *to;
        char stream[FAULT_NAME_SIZE + 64];

        if (fault->target != FAULT_BOARD || fault->index >= boards->nboard) {
            continue;
        }

        /* A board may have every fault of the list, so allocate that many at its first fault */
        board = boards->board[fault->index];
        if (!board->faults) {
            board->faults = arena_alloc(arena, 1, sizeof *board->faults);
            if (!board->faults ||
                !(board->faults->fault = arena_alloc(arena, n, sizeof *board->faults->fault))) {
                return false;
            }
        }

        /* Give each fault its own random stream, independent of other faults */
        to = &board->faults->fault[board->faults->count++];
        to->fault = fault;
        snprintf(stream, sizeof stream, "fault %s", fault->name);
        to->random = random_named(faults_seed(faults), stream);
        if (fault->kind == FAULT_DELAYED &&
            !(to->waiting = arena_alloc(arena, DELAYED_MAX, sizeof *to->waiting))) {
            return false;
        }
    }
    return true;
}

/* ---- power and contact ---- */

/* Discards the waiting answers of a board, because its memory is lost. */
static void board_discard_replies(const struct board *board)
{
    struct board_bus *bus = board->bus;

    for (size_t i = 0; i < bus->waiting; i++) {
        struct queued_reply *reply = &bus->replies[(bus->head + i) % bus->capacity];

        if (reply->board == board) {
            reply->lost = true;
        }
    }
}

/* ---- hang of the firmware ---- */

/* Returns the fault that makes the application hang in this tick; NULL = none. */
static struct board_fault *board_find_hang(const struct board *board)
{
    for (size_t i = 0; i < board->faults->count; i++) {
        struct board_fault *f = &board->faults->fault[i];

        if (f->fault->kind == FAULT_HUNG) {
            f->spent = f->spent && f->fault->active;
            if (f->fault->active && !f->spent && !board->in_bootloader && !board->faults->hung) {
                return f;
            }
        }
    }
    return NULL;
}

/* Runs one tick of a board with power. Returns true while it hangs. */
static bool board_step_hang(struct board *board, double supply_v, struct plant_command *command)
{
    struct board_faults *faults = board->faults;
    struct board_fault *f = board_find_hang(board);

    if (f) {
        f->spent = true;

        /* Start a hang: the timers keep the present duty cycle of each bridge */
        for (size_t i = 0; i < BOARD_AXES_MAX; i++) {
            int joint = board_joint(board, i);

            faults->duty[i] = joint >= 0 && !board->ops->turns_field && supply_v > 0.0
                                  ? command->motor[joint].voltage_v / supply_v
                                  : 0.0;
            /* Clamp: the supply may have dropped since the board set the bridge */
            faults->duty[i] = fmax(fmin(faults->duty[i], 1.0), -1.0);
        }
        faults->hung = true;
        faults->watchdog_ns = board->boards->now_ns + (int64_t)(f->fault->value[0] * 1e9);
    } else if (faults->hung && board->boards->now_ns >= faults->watchdog_ns) {
        faults->hung = false;
        board_discard_replies(board);
        board_enter_bootloader(board, board->config.boot_ns);
    }
    if (faults->hung) {
        /* Set the bridges of a hung board to their last duty cycles */
        for (size_t i = 0; i < BOARD_AXES_MAX; i++) {
            int joint = board_joint(board, i);

            if (joint >= 0) {
                struct motor_command *motor = &command->motor[joint];

                motor->voltage_v = motor->bridge_on ? board->faults->duty[i] * supply_v : 0.0;
                motor->law.on = false;
            }
        }
    }
    return faults->hung;
}

enum board_health board_faults_control(struct board *board, struct plant_command *command)
{
    double supply_v = board->boards->supply_v;
    bool off = false, gap = false, hung;

    /* Find whether the board has power and contact in this tick */
    for (size_t i = 0; i < board->faults->count; i++) {
        struct board_fault *f = &board->faults->fault[i];

        if (!f->fault->active) {
            f->gap = false;
        } else if (f->fault->kind == FAULT_OFF) {
            off = true;
        } else if (f->fault->kind == FAULT_INTERMITTENT) {
            f->gap = random_gap(&f->random, f->gap, f->fault->value[0], f->fault->value[1],
                                1e-9 * (double)board->boards->tick_ns);
            gap = gap || f->gap;
        }
    }

    /* Switch the power. A board with power may start to hang */
    if (off && !board->faults->without_power) {
        board_discard_replies(board);
        board->faults->without_power = true;
        board->faults->hung = false;
    } else if (!off && board->faults->without_power) {
        board->faults->without_power = false;
        board_enter_bootloader(board, board->config.boot_ns);
    }
    hung = !off && board_step_hang(board, supply_v, command);
    board->away = off || gap || hung;
    return off ? BOARD_WITHOUT_POWER : hung ? BOARD_HUNG : BOARD_WORKS;
}

/* ---- frames ---- */

/* Returns the entry of an identifier, a new one if necessary; NULL = the table is full. */
static struct sent_id *board_fault_find_id(struct board_fault *f, uint32_t id)
{
    for (size_t i = 0; i < f->nid; i++) {
        if (f->id[i].frame.id == id) {
            return &f->id[i];
        }
    }
    if (f->nid == IDS_MAX) {
        return NULL;
    }
    f->id[f->nid].frame.id = id;
    return &f->id[f->nid++];
}

/* Replaces the data of a frame by the data of its identifier's last frame before the fault. */
static void board_fault_freeze_frame(struct board_fault *f, struct bus_frame *frame)
{
    struct sent_id *last = board_fault_find_id(f, frame->id);

    if (last && f->fault->active && last->count > 0) {
        frame->len = last->frame.len;
        memcpy(frame->data, last->frame.data, sizeof frame->data);
    } else if (last) {
        last->frame = *frame;
        last->count++;
    }
}

/* Applies a fault to a frame. Returns false when the frame is delayed or dropped. */
static bool board_fault_disturb_frame(struct board_fault *f, struct bus_frame *frame)
{
    struct sent_id *last;

    if (f->fault->kind == FAULT_STUCK) {
        board_fault_freeze_frame(f, frame); /* stores the data while the fault is inactive */
        return true;
    }
    if (!f->fault->active) {
        return true;
    }

    switch (f->fault->kind) {
    case FAULT_GARBAGE: /* identifier and length stay */
        for (size_t i = 0; i < frame->len; i++) {
            frame->data[i] = (uint8_t)(random_bits(&f->random) >> 32);
        }
        return true;
    case FAULT_SLOW: /* send one in `factor` frames of each identifier */
        last = board_fault_find_id(f, frame->id);
        return !last || last->count++ % (uint64_t)f->fault->value[0] == 0;
    case FAULT_DELAYED: /* queue the frame until it is due; drop it when the queue is full */
        if (f->count < DELAYED_MAX) {
            struct bus_frame *slot = &f->waiting[(f->first + f->count++) % DELAYED_MAX];

            *slot = *frame;
            slot->time_ns += (int64_t)(f->fault->value[0] * 1e9);
        }
        return false;
    default:
        return true;
    }
}

void board_faults_filter(struct board *board, struct frame_sink *sink, size_t from)
{
    struct board_faults *faults = board->faults;

    for (size_t i = 0; i < faults->count; i++) {
        struct board_fault *f = &faults->fault[i];
        size_t kept = from;

        for (size_t k = from; k < sink->count; k++) {
            if (!board->away && board_fault_disturb_frame(f, &sink->frames[k])) {
                sink->frames[kept++] = sink->frames[k];
            }
        }
        sink->count = kept;
        if (f->fault->kind == FAULT_DELAYED && !board->away) {
            /* Send the delayed frames that are due, in order */
            while (f->count > 0 && sink->count < sink->max &&
                   f->waiting[f->first].time_ns <= sink->time_ns) {
                struct bus_frame *frame = &sink->frames[sink->count++];

                *frame = f->waiting[f->first];
                frame->time_ns = sink->time_ns;
                f->first = (f->first + 1) % DELAYED_MAX;
                f->count--;
            }
        }
    }
}
