/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The two CAN controllers of the ZynqMP. What they receive is taken from their FIFO of 64 frames by
 * interrupt and waits in a ring for the program. The program and the interrupt share the ring
 * (one writes, one reads) and the events (see can_events).
 */
#ifndef CAN_H
#define CAN_H

#include "machine.h"

struct can_frame {
    uint32_t id; /* 11 bits */
    uint8_t length;
    uint8_t data[8];
};

enum { CAN_CONTROLLERS = 2, CAN_RING = 256 /* a power of 2 */ };

/* What interrupts tell the program. */
enum can_event {
    CAN_EVENT_SENT = 1 << 0,    /* the frame of can_send_and_tell */
    CAN_EVENT_BUS_OFF = 1 << 1, /* a controller has left its bus */
    CAN_EVENT_USER = 1 << 8,    /* and above: set by can_raise */
};

struct can {
    uintptr_t base;
    unsigned interrupt;
    bool polled;        /* its receive interrupt is off */
    volatile bool tell; /* the end of the next transmission is an event */
    volatile uint32_t head, tail;
    uint32_t received, overflows; /* frames; times that FIFO or ring was full */
    struct can_frame ring[CAN_RING];
};

extern struct can can_controllers[CAN_CONTROLLERS];

/* Resets a controller and joins its bus with 1 Mbit/s: the start, and the way back from bus-off. */
void can_start(unsigned controller);

/* Puts a frame into the transmit FIFO; false when that is full. */
bool can_send(unsigned controller, const struct can_frame *frame);

/* The same; CAN_EVENT_SENT when it has been sent. */
bool can_send_and_tell(unsigned controller, const struct can_frame *frame);

/* Takes the oldest frame from the ring. */
bool can_receive(unsigned controller, struct can_frame *frame);

/* Sleeps until something is in the ring of this controller. */
void can_await(unsigned controller);

/* Adds an event; hands over all events of the time since the last call, and forgets them. */
void can_raise(uint32_t event);
uint32_t can_events(void (*handle)(uint32_t events));

/* Takes at most so many frames from the FIFO of a controller whose interrupt is off. */
void can_poll(unsigned controller, unsigned frames);

static inline uint16_t get_u16(const uint8_t *data)
{
    return (uint16_t)(data[0] | data[1] << 8);
}

static inline uint32_t get_u32(const uint8_t *data)
{
    return get_u16(data) | (uint32_t)get_u16(data + 2) << 16;
}

static inline void put_u16(uint8_t *data, uint16_t value)
{
    data[0] = (uint8_t)value;
    data[1] = (uint8_t)(value >> 8);
}

static inline void put_u32(uint8_t *data, uint32_t value)
{
    put_u16(data, (uint16_t)value);
    put_u16(data + 2, (uint16_t)(value >> 16));
}

#endif
