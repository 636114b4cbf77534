/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Steady operation of an electric drive: the load that it holds or turns at a constant speed. Uses
 * eqs (2) to (4) of model/drives/actuator.h with all rates zero, and the gear friction of
 * model/drives/effects.h. The winding is at 25 degree C. Ignores cogging, hysteresis and play,
 * whose mean over a turn is zero, and bridge losses, which do not belong to the gear.
 *
 * sense is 1 if the motor turns or starts to turn the load forward, -1 if the load drives the motor
 * back. Torques are N m on the link. The motor's torque is positive forward, the load is positive
 * against the motor. Speeds are rad/s, positive in the given sense. RT-safe.
 */
#ifndef MODEL_DRIVES_STEADY_H
#define MODEL_DRIVES_STEADY_H

#include "model/robot.h"

/* Returns the load at a motor torque >= 0 and a speed >= 0. sense 1: load that the motor turns.
 * sense -1: load that turns the motor back, or NAN if there is none because the gear is
 * self-locking. */
double steady_load(const struct robot_sea *sea, double motor, double speed, int sense);

/* Returns the motor torque at a load >= 0 and a speed >= 0. sense 1: torque that turns the load.
 * sense -1: torque at which the load turns back. NAN if there is none. */
double steady_motor(const struct robot_sea *sea, double load, double speed, int sense);

/* Returns the current at a voltage and a speed, which may be negative. */
double steady_current(const struct robot_sea *sea, double voltage, double speed);

/* Returns the speed at which a voltage > 0 turns a load forward; NAN if it stalls. */
double steady_speed(const struct robot_sea *sea, double voltage, double load);

#endif
