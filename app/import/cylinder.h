/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Joints of an import that take a hydraulic drive of the catalogue. The file of the robot knows of
 * no cylinder, and the drive of no joint: what lies between is assumed, from these rules.
 *
 * Triangle of the joint and the two pins: the cylinder's pin is four strokes away from the joint,
 * and the lever as long as the stroke allows, at most two strokes, when the joint's range takes 90
 * % of the stroke, with as much left at either end. The lever of the force is the same at both
 * ends of the range; where it would be less than a quarter of its longest there, from some 150
 * degrees on, the range is too wide for a triangle, and refused. The piston pushes towards the end
 * of the range that is nearer to 0, to the straight leg.
 *
 * Supply: the pressure is the highest that the drives are made for. The accumulator, precharged to
 * 60 % of it, gives the oil that draws all pistons out once; the pump what draws them out and in
 * once in two seconds, beside their leakage; the relief valve takes all of that 0.5 % above the
 * pressure.
 *
 * Gains: a valve is a source of speed, kw volts for a rad/s (hydraulic_speed_constant). The loop's
 * velocity gain K_v = kp / kw is a fifth of the frequency, rad/s, at which the joint swings on its
 * oil with all that is behind it, or where the robot floats with half of its mass at the end of
 * the leg, as on HyQ (11/s of 58 rad/s); at most 16/s, because of the buses' delay. A linear loop
 * is stable for K_v below twice the damping ratio times that frequency (Merritt, 1967, chapter 8):
 * more than oil and friction give to what stands on one leg, so that a fifth is no more than what
 * several legs bear. An integral, ki = kp K_v / 5, finds what the lap of the valve covers.
 *
 * Not RT-safe.
 */
#ifndef APP_IMPORT_CYLINDER_H
#define APP_IMPORT_CYLINDER_H

#include "app/import/drive.h"

/* Checks whether the joint's drive of the catalogue is hydraulic. */
bool import_takes_cylinder(const struct import_robot *from, size_t j);

/* Fills the hydraulic drives of those joints, their strengths and the supply of the robot. bears:
 * by joint, what it bears in a pose, N m. ERROR_INPUT with file:line where a range is too wide. */
enum error_code import_take_cylinders(struct import_robot *from, const double *bears,
                                      struct import_notes *notes, struct error *error);

/* Computes the gains of a joint with a cylinder at the angle q, rad. inertia: what swings on
 * its oil, kg m2. */
struct import_gains import_cylinder_gains(const struct robot *robot, size_t j, double q,
                                          double inertia);

#endif
