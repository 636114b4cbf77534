/* SPDX-License-Identifier: Apache-2.0 */
/* A second opinion on lockstep, made from the frames alone. */
#include "tests/soak/watch.h"

#include "base/hash.h"
#include "boards/icub/protocol.h"
#include "canbus/lockstep.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static bool __attribute__((format(printf, 2, 3))) fail(struct watch *watch, const char *format, ...)
{
    va_list args;

    if (!watch->failure[0]) {
        va_start(args, format);
        vsnprintf(watch->failure, sizeof watch->failure, format, args);
        va_end(args);
    }
    return false;
}

static bool is_control(const struct bus_frame *frame, uint32_t id)
{
    return frame->id == id && !(frame->flags & (FRAME_EXTENDED | FRAME_ERROR));
}

/* One more answer that must come. */
static bool expect(struct watch *watch, uint32_t tick, bool refusal)
{
    if (watch->ndue == WATCH_DUE) {
        return fail(watch, "more than %d STEP frames wait for an answer", WATCH_DUE);
    }
    watch->due[watch->ndue++] = (struct watch_due){tick, refusal};
    return true;
}

static bool see_step(struct watch *watch, const struct bus_frame *frame)
{
    uint16_t ticks;

    if (frame->flags & FRAME_REMOTE || frame->len != LOCKSTEP_LENGTH) {
        watch->malformed++; /* is not answered */
        return true;
    }
    if (get_u32_le(frame->data) != watch->tick) {
        watch->refused++;
        return expect(watch, watch->tick, true);
    }
    ticks = get_u16_le(frame->data + 4);
    watch->tick += ticks ? ticks : 1;
    watch->steps++;
    return expect(watch, watch->tick, false);
}

static bool see_done(struct watch *watch, const struct bus_frame *frame)
{
    uint32_t tick = get_u32_le(frame->data);
    uint16_t flags = get_u16_le(frame->data + 4);
    struct watch_due due;

    if (flags & LOCKSTEP_STOPPING) {
        watch->stopping = true;
        return true;
    }
    if (watch->ndue == 0) {
        return fail(watch, "DONE of tick %" PRIu32 " that no STEP has asked for", tick);
    }
    due = watch->due[0];
    memmove(watch->due, watch->due + 1, --watch->ndue * sizeof due);
    if (tick != due.tick || !!(flags & LOCKSTEP_MISMATCH) != due.refusal) {
        return fail(watch, "DONE of tick %" PRIu32 " with flags %u, expected tick %" PRIu32 "%s",
                    tick, flags, due.tick, due.refusal ? ", refused" : "");
    }
    return true;
}

static void hash_frame(struct watch *watch, size_t bus, const struct bus_frame *frame)
{
    uint8_t head[16] = {(uint8_t)bus, frame->flags, frame->len};

    put_u32_le(head + 4, frame->id);
    if (watch->wire) {
        /* when it had arrived, which no sender decides */
        put_u32_le(head + 8, (uint32_t)frame->time_ns);
        put_u32_le(head + 12, (uint32_t)((uint64_t)frame->time_ns >> 32));
    }
    watch->hash = hash_bytes(watch->hash, head, watch->wire ? 16 : 8);
    watch->hash = hash_bytes(watch->hash, frame->data, frame->len);
}

static bool see(struct watch *watch, size_t bus, const struct bus_frame *frame)
{
    const struct loop_lockstep *lockstep = &watch->rig->lockstep;
    bool leads = bus == (size_t)lockstep->bus;

    if (frame->flags & FRAME_ERROR) {
        return true; /* of our own controller */
    }
    hash_frame(watch, bus, frame);
    if (is_control(frame, lockstep->done_id) && frame->len == LOCKSTEP_LENGTH) {
        watch->done[bus]++;
        watch->done_hash[bus] = hash_bytes(watch->done_hash[bus], frame->data, frame->len);
        return !leads || see_done(watch, frame);
    }
    if (is_control(frame, lockstep->step_id)) {
        return !leads || see_step(watch, frame);
    }
    watch->frames[bus]++;
    return true;
}

static bool compare_buses(struct watch *watch)
{
    const size_t leads = (size_t)watch->rig->lockstep.bus;

    for (size_t b = 0; b < watch->rig->nbus; b++) {
        if (watch->done[b] != watch->done[leads] ||
            watch->done_hash[b] != watch->done_hash[leads]) {
            return fail(watch, "bus %s had %" PRIu64 " DONE frames, bus %s %" PRIu64,
                        watch->rig->bus[b].name, watch->done[b], watch->rig->bus[leads].name,
                        watch->done[leads]);
        }
    }
    return watch->ndue == 0 || fail(watch, "%zu STEP frames without an answer", watch->ndue);
}

bool watch_look(struct watch *watch, bool settled)
{
    bool good = true;

    for (size_t b = 0; b < watch->ports.count; b++) {
        size_t count;

        do {
            count = can_receive(watch->ports.port[b], watch->batch, WATCH_BATCH);
            for (size_t i = 0; i < count; i++) {
                good = see(watch, b, &watch->batch[i]) && good;
            }
        } while (count == WATCH_BATCH);
        if (watch->ports.port[b]->counters.rx_dropped) {
            good = fail(watch, "the listener on bus %s lost frames", watch->rig->bus[b].name);
        }
    }
    return good && (!settled || compare_buses(watch));
}
