/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Steady operation of an electric drive: the load that it holds or turns at a constant speed, from
 * eqs (2) to (4) of model/drives/actuator.h and the gear friction of model/drives/effects.h with
 * all rates zero, winding at 25 degree C. Cogging, hysteresis, play and bridge losses are left out:
 * their mean over a turn is zero, or they do not belong to the gear.
 *
 * sense is 1 if the motor turns or starts to turn the load forward, -1 if the load drives it back.
 * Torques are N m on the link: of the motor, positive forward; of the load, positive against the
 * motor. Speeds are rad/s, positive in the given sense. RT-safe.
 */
#ifndef MODEL_DRIVES_STEADY_H
#define MODEL_DRIVES_STEADY_H

#include "model/robot.h"

/* Returns the load that a motor torque >= 0 turns, or that turns the motor back, at a speed >= 0.
 * Returns NAN if there is none: the gear is self-locking. */
double steady_load(const struct robot_sea *sea, double motor, double speed, int sense);

/* Returns the motor torque that turns a load >= 0, or lets it turn back; NAN if there is none. */
double steady_motor(const struct robot_sea *sea, double load, double speed, int sense);

/* Returns the speed at which a voltage > 0 turns a load forward; NAN if it stalls. */
double steady_speed(const struct robot_sea *sea, double voltage, double load);

#endif
