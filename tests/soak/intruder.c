/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/soak/stranger.h"

#include "boards/icub/protocol.h"
#include "canbus/lockstep.h"

static const double BURST = 0.01; /* in a tick */
enum { BURST_MOST = 8 };

static uint32_t below(struct stranger *stranger, uint32_t count)
{
    return (uint32_t)(random_bits(&stranger->random) % count);
}

/* Of no board: an extended or remote frame, or one of the skin, which none of ours has. */
static void make_harmless(struct stranger *stranger, struct bus_frame *frame)
{
    switch (below(stranger, 3)) {
    case 0:
        frame->flags |= FRAME_EXTENDED;
        frame->id = below(stranger, 1u << 29);
        break;
    case 1:
        frame->flags = FRAME_REMOTE;
        break;
    default:
        frame->id = 0x400u | (frame->id & 0xffu);
        break;
    }
}

static void make_step(struct stranger *stranger, uint32_t tick, struct bus_frame *frame)
{
    uint32_t wrong = tick + 1 + below(stranger, UINT32_MAX - 1);

    frame->id = stranger->rig->lockstep.step_id;
    frame->flags = 0;
    frame->len = below(stranger, 2) ? LOCKSTEP_LENGTH : (uint8_t)below(stranger, 9);
    put_u32_le(frame->data, wrong);
}

static struct bus_frame make_frame(struct stranger *stranger, bool rude, uint32_t tick)
{
    struct bus_frame frame = {.id = below(stranger, 1u << 11), .len = (uint8_t)below(stranger, 9)};

    for (int i = 0; i < 8; i++) {
        frame.data[i] = (uint8_t)below(stranger, 256);
    }
    if (below(stranger, 8) == 0) {
        make_step(stranger, tick, &frame);
    } else if (!rude) {
        make_harmless(stranger, &frame);
    }
    if (frame.id == stranger->rig->lockstep.done_id && !(frame.flags & FRAME_EXTENDED)) {
        frame.id--;
    }
    return frame;
}

void stranger_step(struct stranger *stranger, bool rude, uint32_t tick)
{
    uint32_t count;

    if (random_uniform(&stranger->random) >= BURST) {
        return;
    }
    count = 1 + below(stranger, BURST_MOST);
    for (uint32_t i = 0; i < count; i++) {
        size_t bus = below(stranger, (uint32_t)stranger->rig->nbus);
        struct bus_frame frame = make_frame(stranger, rude, tick);

        stranger->frames += can_send(stranger->ports.port[bus], &frame, 1);
    }
}
