/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Driver of the ZynqMP's CAN controllers (UG1085, "CAN Controller").
 *
 * QEMU 7.2 differs from the silicon in two places: it keeps the identifier as it is, not in bits
 * 31-21 of its register, and the first byte of the data in bits 7-0, not 31-24. CAN_AS_SILICON
 * makes a program for the chip. Its controllers never make an error, so bus-off never happens to
 * them: what the program does then is met by the bus-off of the boards alone.
 */
#include "can.h"

enum { SRR = 0x00, MSR = 0x04, BRPR = 0x08, BTR = 0x0c, ISR = 0x1c, IER = 0x20, ICR = 0x24 };
enum { TXFIFO_ID = 0x30, TXFIFO_DLC = 0x34, TXFIFO_DATA1 = 0x38, TXFIFO_DATA2 = 0x3c };
enum { RXFIFO_ID = 0x50, RXFIFO_DLC = 0x54, RXFIFO_DATA1 = 0x58, RXFIFO_DATA2 = 0x5c };

enum { SRR_SRST = 1 << 0, SRR_CEN = 1 << 1 };
enum {
    ISR_TXOK = 1 << 1,
    ISR_TXFLL = 1 << 2,
    ISR_RXOFLW = 1 << 6,
    ISR_RXNEMP = 1 << 7,
    ISR_BSOFF = 1 << 9,
};
enum { DLC_SHIFT = 28 };

struct can can_controllers[CAN_CONTROLLERS] = {
    {.base = 0xff060000, .interrupt = 55},
    {.base = 0xff070000, .interrupt = 56},
};

static volatile uint32_t events;

/* ---- layout of the registers ---- */

#ifdef CAN_AS_SILICON
static uint32_t layout_id(uint32_t id)
{
    return id << 21;
}

static uint32_t layout_id_back(uint32_t value)
{
    return value >> 21;
}

static uint32_t layout_data(uint32_t data)
{
    return __builtin_bswap32(data);
}
#else
static uint32_t layout_id(uint32_t id)
{
    return id;
}

static uint32_t layout_id_back(uint32_t value)
{
    return value;
}

static uint32_t layout_data(uint32_t data)
{
    return data;
}
#endif

/* ---- interrupt ---- */

static void ring_put(struct can *can, const struct can_frame *frame)
{
    if (can->head - can->tail == CAN_RING) {
        can->overflows++;
        return;
    }
    can->ring[can->head % CAN_RING] = *frame;
    can->head++; /* only now does the program see it */
    can->received++;
}

/* Takes at most so many frames from the FIFO. The bit says again that there are more. */
static void fifo_drain(struct can *can, unsigned most)
{
    for (; most > 0 && register_read(can->base + ISR) & ISR_RXNEMP; most--) {
        struct can_frame frame;

        frame.id = layout_id_back(register_read(can->base + RXFIFO_ID));
        frame.length = (uint8_t)(register_read(can->base + RXFIFO_DLC) >> DLC_SHIFT);
        put_u32(frame.data, layout_data(register_read(can->base + RXFIFO_DATA1)));
        put_u32(frame.data + 4, layout_data(register_read(can->base + RXFIFO_DATA2)));
        register_write(can->base + ICR, ISR_RXNEMP);
        ring_put(can, &frame);
    }
}

static void can_serve(void *context)
{
    struct can *can = context;
    uint32_t status = register_read(can->base + ISR);

    register_write(can->base + ICR, status & (ISR_TXOK | ISR_RXOFLW | ISR_BSOFF));
    if (status & ISR_RXOFLW) {
        can->overflows++;
    }
    if (status & ISR_BSOFF) {
        events |= CAN_EVENT_BUS_OFF;
    }
    if (status & ISR_TXOK && can->tell) {
        can->tell = false;
        events |= CAN_EVENT_SENT;
    }
    if (!can->polled) {
        fifo_drain(can, UINT32_MAX);
    }
}

/* ---- program ---- */

void can_start(unsigned controller)
{
    struct can *can = &can_controllers[controller];

    interrupts_disable();
    can->tell = false;
    can->tail = can->head;
#ifdef BUG_FIFO
    can->polled = controller == 1;
#endif
    register_write(can->base + SRR, SRR_SRST);
    register_write(can->base + SRR, 0);
    register_write(can->base + BRPR, 4); /* 100 MHz / 5, 20 time quanta a bit */
    register_write(can->base + BTR, 1 << 7 | 2 << 4 | 15);
    register_write(can->base + MSR, 0); /* normal, no loop */
    register_write(can->base + IER,
                   ISR_TXOK | ISR_RXOFLW | ISR_BSOFF | (can->polled ? 0 : ISR_RXNEMP));
    register_write(can->base + SRR, SRR_CEN);
    interrupts_connect(can->interrupt, can_serve, can);
    interrupts_enable();
}

bool can_send(unsigned controller, const struct can_frame *frame)
{
    const uintptr_t base = can_controllers[controller].base;

    if (register_read(base + ISR) & ISR_TXFLL) {
        return false;
    }
    register_write(base + TXFIFO_ID, layout_id(frame->id));
    register_write(base + TXFIFO_DLC, (uint32_t)frame->length << DLC_SHIFT);
    register_write(base + TXFIFO_DATA1, layout_data(get_u32(frame->data)));
    register_write(base + TXFIFO_DATA2, layout_data(get_u32(frame->data + 4)));
    return true;
}

bool can_send_and_tell(unsigned controller, const struct can_frame *frame)
{
    can_controllers[controller].tell = true;
    return can_send(controller, frame);
}

bool can_receive(unsigned controller, struct can_frame *frame)
{
    struct can *can = &can_controllers[controller];

    if (can->tail == can->head) {
        return false;
    }
    *frame = can->ring[can->tail % CAN_RING];
    can->tail++;
    return true;
}

/* Interrupts are off between the look and the sleep: one that comes there ends the sleep at once,
 * where it would else be served first and the sleep miss it. */
void can_await(unsigned controller)
{
    struct can *can = &can_controllers[controller];

    interrupts_disable();
    if (can->tail == can->head) {
        interrupts_await();
    }
    interrupts_enable();
}

void can_poll(unsigned controller, unsigned frames)
{
    if (can_controllers[controller].polled) {
        fifo_drain(&can_controllers[controller], frames);
    }
}

void can_raise(uint32_t event)
{
    interrupts_disable();
    events |= event;
    interrupts_enable();
}

uint32_t can_events(void (*handle)(uint32_t seen))
{
    uint32_t seen;

#ifdef BUG_RACE
    seen = events;
    handle(seen);
    events = 0; /* and with it what interrupts have added meanwhile */
#else
    interrupts_disable();
    seen = events;
    events = 0;
    interrupts_enable();
    handle(seen);
#endif
    return seen;
}
