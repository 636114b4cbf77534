/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Position control of one joint at 1 kHz: a smooth trajectory, and a voltage that follows it. The
 * angle is that of the rotor through its gear, rad of the joint. The one file that computes in
 * floating point: interrupts do not.
 */
#ifndef CONTROL_H
#define CONTROL_H

#include "machine.h"

struct control {
    float from, to, reference, integral; /* rad, rad, rad, V */
    float speed;                         /* of the reference, rad/s */
    uint32_t tick, ticks;                /* of the trajectory */
};

/* Holds the place where the rotor is. */
void control_hold(struct control *control, int32_t position_icubdeg);

/* Moves from the reference to an angle in so many ticks. */
void control_move(struct control *control, int16_t to_mrad, uint32_t ticks);

/* Moves the reference on by so many microrad in this tick. */
void control_creep(struct control *control, int32_t urad);

/* One tick: the voltage as a target, 32000 = the supply. */
int16_t control_step(struct control *control, int32_t position_icubdeg);

/* For reports. */
int16_t control_mrad(int32_t position_icubdeg);

#endif
