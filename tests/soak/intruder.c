/* SPDX-License-Identifier: Apache-2.0 */
/* Random frames of a node that belongs to nobody. */
#include "tests/soak/intruder.h"

#include "canbus/lockstep.h"

static const double BURST = 0.01; /* in a tick */
enum { BURST_MOST = 8 };

static uint32_t below(struct intruder *intruder, uint32_t count)
{
    return (uint32_t)(random_bits(&intruder->random) % count);
}

/* Received by no board: an extended or remote frame, or one of the skin, which none has. */
static void make_harmless(struct intruder *intruder, struct bus_frame *frame)
{
    switch (below(intruder, 3)) {
    case 0:
        frame->flags |= FRAME_EXTENDED;
        frame->id = below(intruder, 1u << 29);
        break;
    case 1:
        frame->flags = FRAME_REMOTE;
        break;
    default:
        frame->id = 0x400u | (frame->id & 0xffu);
        break;
    }
}

static void make_step(struct intruder *intruder, uint32_t tick, struct bus_frame *frame)
{
    uint32_t wrong = tick + 1 + below(intruder, UINT32_MAX - 1);

    frame->id = intruder->rig->lockstep.step_id;
    frame->flags = 0;
    frame->len = below(intruder, 2) ? LOCKSTEP_LENGTH : (uint8_t)below(intruder, 9);
    put_u32_le(frame->data, wrong);
}

static struct bus_frame make_frame(struct intruder *intruder, bool rude, uint32_t tick)
{
    struct bus_frame frame = {.id = below(intruder, 1u << 11), .len = (uint8_t)below(intruder, 9)};

    for (int i = 0; i < 8; i++) {
        frame.data[i] = (uint8_t)below(intruder, 256);
    }
    if (below(intruder, 8) == 0) {
        make_step(intruder, tick, &frame);
    } else if (!rude) {
        make_harmless(intruder, &frame);
    }
    if (frame.id == intruder->rig->lockstep.done_id && !(frame.flags & FRAME_EXTENDED)) {
        frame.id--;
    }
    return frame;
}

void intruder_step(struct intruder *intruder, bool rude, uint32_t tick)
{
    uint32_t count;

    if (random_uniform(&intruder->random) >= BURST) {
        return;
    }
    count = 1 + below(intruder, BURST_MOST);
    for (uint32_t i = 0; i < count; i++) {
        size_t bus = below(intruder, (uint32_t)intruder->rig->nbus);
        struct bus_frame frame = make_frame(intruder, rude, tick);

        intruder->frames += can_send(intruder->ports.port[bus], &frame, 1);
    }
}
