/* SPDX-License-Identifier: Apache-2.0 */
/* A second opinion on lockstep, made from the frames alone. */
#include "tests/soak/listener.h"

#include "base/hash.h"
#include "canbus/lockstep.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static bool __attribute__((format(printf, 2, 3)))
fail(struct listener *listener, const char *format, ...)
{
    va_list args;

    if (!listener->failure[0]) {
        va_start(args, format);
        vsnprintf(listener->failure, sizeof listener->failure, format, args);
        va_end(args);
    }
    return false;
}

static bool is_control(const struct bus_frame *frame, uint32_t id)
{
    return frame->id == id && !(frame->flags & (FRAME_EXTENDED | FRAME_ERROR));
}

/* One more answer that must come. */
static bool expect(struct listener *listener, uint32_t tick, bool refusal)
{
    if (listener->ndue == LISTENER_DUE) {
        return fail(listener, "more than %d STEP frames wait for an answer", LISTENER_DUE);
    }
    listener->due[listener->ndue++] = (struct listener_due){tick, refusal};
    return true;
}

static bool see_step(struct listener *listener, const struct bus_frame *frame)
{
    uint16_t ticks;

    if (frame->flags & FRAME_REMOTE || frame->len != LOCKSTEP_LENGTH) {
        listener->malformed++; /* is not answered */
        return true;
    }
    if (get_u32_le(frame->data) != listener->tick) {
        listener->refused++;
        return expect(listener, listener->tick, true);
    }
    ticks = get_u16_le(frame->data + 4);
    listener->tick += ticks ? ticks : 1;
    listener->steps++;
    return expect(listener, listener->tick, false);
}

static bool see_done(struct listener *listener, const struct bus_frame *frame)
{
    uint32_t tick = get_u32_le(frame->data);
    uint16_t flags = get_u16_le(frame->data + 4);
    struct listener_due due;

    if (flags & LOCKSTEP_STOPPING) {
        listener->stopping = true;
        return true;
    }
    if (listener->ndue == 0) {
        return fail(listener, "DONE of tick %" PRIu32 " that no STEP has asked for", tick);
    }
    due = listener->due[0];
    memmove(listener->due, listener->due + 1, --listener->ndue * sizeof due);
    if (tick != due.tick || !!(flags & LOCKSTEP_MISMATCH) != due.refusal) {
        return fail(listener, "DONE of tick %" PRIu32 " with flags %u, expected tick %" PRIu32 "%s",
                    tick, flags, due.tick, due.refusal ? ", refused" : "");
    }
    return true;
}

static void hash_frame(struct listener *listener, size_t bus, const struct bus_frame *frame)
{
    uint8_t head[16] = {(uint8_t)bus, frame->flags, frame->len};

    put_u32_le(head + 4, frame->id);
    if (listener->wire) {
        /* When it had arrived, which no sender decides */
        put_u32_le(head + 8, (uint32_t)frame->time_ns);
        put_u32_le(head + 12, (uint32_t)((uint64_t)frame->time_ns >> 32));
    }
    listener->hash = hash_bytes(listener->hash, head, listener->wire ? 16 : 8);
    listener->hash = hash_bytes(listener->hash, frame->data, frame->len);
}

static bool see(struct listener *listener, size_t bus, const struct bus_frame *frame)
{
    const struct loop_lockstep *lockstep = &listener->rig->lockstep;
    bool leads = bus == (size_t)lockstep->bus;

    if (frame->flags & FRAME_ERROR) {
        return true; /* of our own controller */
    }
    hash_frame(listener, bus, frame);
    if (is_control(frame, lockstep->done_id) && frame->len == LOCKSTEP_LENGTH) {
        listener->done[bus]++;
        listener->done_hash[bus] = hash_bytes(listener->done_hash[bus], frame->data, frame->len);
        return !leads || see_done(listener, frame);
    }
    if (is_control(frame, lockstep->step_id)) {
        return !leads || see_step(listener, frame);
    }
    listener->frames[bus]++;
    return true;
}

static bool compare_buses(struct listener *listener)
{
    const size_t leads = (size_t)listener->rig->lockstep.bus;

    for (size_t b = 0; b < listener->rig->nbus; b++) {
        if (listener->done[b] != listener->done[leads] ||
            listener->done_hash[b] != listener->done_hash[leads]) {
            return fail(listener, "bus %s had %" PRIu64 " DONE frames, bus %s %" PRIu64,
                        listener->rig->bus[b].name, listener->done[b],
                        listener->rig->bus[leads].name, listener->done[leads]);
        }
    }
    return listener->ndue == 0 ||
           fail(listener, "%zu STEP frames without an answer", listener->ndue);
}

bool listener_check(struct listener *listener, bool settled)
{
    bool good = true;

    for (size_t b = 0; b < listener->ports.count; b++) {
        size_t count;

        do {
            count = can_receive(listener->ports.port[b], listener->batch, LISTENER_BATCH);
            for (size_t i = 0; i < count; i++) {
                good = see(listener, b, &listener->batch[i]) && good;
            }
        } while (count == LISTENER_BATCH);
        if (listener->ports.port[b]->counters.rx_dropped) {
            good = fail(listener, "the listener on bus %s lost frames", listener->rig->bus[b].name);
        }
    }
    return good && (!settled || compare_buses(listener));
}
