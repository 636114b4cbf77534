/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What an electric drive holds and turns at a constant speed: eqs (2) to (4) of
 * model/drives/actuator.h and the gear's friction of model/drives/effects.h with all rates zero,
 * the winding at 25 degree C. Cogging, hysteresis, play and the bridge's own losses are left out:
 * they vanish in the mean of a turn, or are none of the gear's.
 *
 * A sense is 1 where the motor turns or is about to turn the load forward, -1 where the load drives
 * it back. Torques are N m on the link: of the motor, positive forward, and of the load, positive
 * where it holds against that. Speeds are rad/s in that sense. RT-safe.
 */
#ifndef MODEL_DRIVES_STEADY_H
#define MODEL_DRIVES_STEADY_H

#include "model/robot.h"

/* Returns the load that a motor's torque (0 or more) turns, or that turns the motor back, at a
 * speed of 0 or more; NAN where no load does: the gear locks itself. */
double steady_load(const struct robot_sea *sea, double motor, double speed, int sense);

/* Returns the motor's torque that turns a load (0 or more), or lets it turn back; NAN where none
 * does. */
double steady_motor(const struct robot_sea *sea, double load, double speed, int sense);

/* Returns the speed at which a voltage of more than 0 turns a load forward; NAN where it stalls. */
double steady_speed(const struct robot_sea *sea, double voltage, double load);

#endif
