/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Assumed drives for a robot whose file gives at most the strength and speed of its joints, and
 * gains for position loops. Numbers that are not in the file follow these rules:
 *
 * Strength: the file's effort. If it is 0 or more than 20 times the gravity torque of the robot's
 * strongest joint (at least the robot's weight at 0.1 m), it is a placeholder; then three times the
 * worst gravity torque of the joint. In any case at least 1.5 times the joint's load in each of the
 * robot's poses. Speed: the file's velocity; if it is 0 or above 100 rad/s, 2 pi rad/s.
 *
 * Drive, all on the link side: at the supply voltage V the no-load speed is 1.5 times the speed,
 * and the full strength is available at the speed: N Kw = N Kt = V / (1.5 speed), R = N Kt V / (3
 * strength). The rotor reaches that speed in 20 ms with full strength. Friction takes 2 % of the
 * strength. The gear deflects by 10 mrad under full strength (Ks); Ds = 0.5 ms Ks; L = 0.5 ms R.
 *
 * Joints that follow others have no drive. The drives of their leaders bear their loads; the rules
 * for their couplings are below.
 *
 * Not RT-safe.
 */
#ifndef APP_IMPORT_DRIVE_H
#define APP_IMPORT_DRIVE_H

#include "app/import/tree_simplify.h"

/* Fills drives and strengths of all joints of the robot, which must be finished (robot_finish). A
 * joint with a drive of the catalogue (below) gets that drive, a hydraulic one by the rules below.
 * *supply_v is the highest nominal voltage of the catalogue drives. Without any, it is the voltage
 * that supplies all drives with at most 25 A each at full strength, at least 24 V. */
enum error_code import_assume_drives(struct import_robot *from, struct arena *arena,
                                     struct import_notes *notes, double *supply_v,
                                     struct error *error);

/* Gains by joint of the loop V = kp (ref - qm) + ki integral - kd qm' + kw ref' + load times the
 * initial torque; unused for joints without a drive. */
struct import_gains {
    double kp_v_per_rad, ki_v_per_rad_s, kd_v_s_per_rad, kw_v_s_per_rad, load_v_per_nm;
    /* stiffness of the loop as a share of 1.5 times that at which the joint tips; 0 = enough */
    double short_of;
};

/* Computes gains from the drives and from the inertia I of each joint in the given pose with the
 * other joints free, rotor included.
 *
 * The stiffness K = kp N Kt / R is five times the worst gravity stiffness. If the robot stands in
 * that pose, it is at least 1.5 times the tipping stiffness (weight times the height of the center
 * of mass above the joint, divided by the number of feet). K is limited to between (30 rad/s)^2 I
 * and (60 rad/s)^2 I; above that, the delay of the buses, about 4 ms, would use up the phase
 * margin. The damping makes the loop aperiodic, D = 2 sqrt(K I), minus the motor's own damping Dm
 * + N Kt N Kw / R.
 *
 * Above the resonance with the spring the loop moves only the rotor. So the fed back part of D is
 * at most J / 10 ms, and K at most (100 rad/s)^2 J and D^2 / I (half of the aperiodic damping).
 * Gains of cylinders are below. */
enum error_code import_find_gains(const struct robot *robot, const double *joint, bool stands,
                                  struct arena *arena, struct import_gains *gains,
                                  struct error *error);

/* ---- drives of the catalogue ---- */

/*
 * Drives from the catalogue (config/drives/) that the user selects for an import. `--drive NAME` is
 * for all revolute joints, `--drive PATTERN=NAME` for joints whose names match the pattern (*, ?
 * and [...] as in a shell). If several match, the last one is used. NAME may be the path of a drive
 * file, which is copied into the folder drives of the import.
 */

/* Fills drive, drive_file and drive_copy of the robot. Errors give the option, the missing name
 * and the nearest one: a name in the catalogue, or a pattern without a matching joint. Memory from
 * arena. */
enum error_code import_pick_drives(const struct import_options *options, struct arena *arena,
                                   struct import_robot *to, struct error *error);

/* Returns the short-time torque of a drive, N m: the file's peak or rated torque, else the stall
 * torque at its supply voltage. */
double import_drive_torque(const struct robot_drive *drive);

/* ---- hydraulic drives ---- */

/*
 * Joints of an import with a hydraulic drive of the catalogue. The robot's file has no cylinders,
 * and the drive has no joint. So the connection is assumed, by these rules.
 *
 * Triangle of the joint and the two pins: the cylinder's pin is four strokes away from the joint.
 * The lever is as long as possible, at most two strokes, so that the joint's range takes 90 % of
 * the stroke, with equal margins at both ends. The lever of the force is equal at both ends of the
 * range. If it would be less than a quarter of its maximum there, for ranges from about 150
 * degrees, the range is too wide for a triangle and refused. The piston pushes toward the end of
 * the range that is nearer to 0, the straight leg.
 *
 * Supply: the pressure is the highest nominal pressure of the drives. The accumulator, precharged
 * to 60 % of it, holds the oil to extend all pistons once. The pump delivers the oil to extend and
 * retract them once in two seconds, plus their leakage. The relief valve passes this flow at 0.5 %
 * above the pressure.
 *
 * Gains: a valve is a source of speed, kw volts per rad/s (hydraulic_speed_constant). The loop's
 * velocity gain K_v = kp / kw is a fifth of the frequency, rad/s, at which the joint oscillates on
 * its oil with all bodies behind it, for a floating robot also with half of its mass at the end of
 * the leg, as on HyQ (11/s for 58 rad/s). It is at most 16/s, because of the buses' delay. A linear
 * loop is stable for K_v below twice the damping ratio times that frequency (Merritt, 1967, chapter
 * 8). Oil and friction give less damping than a robot on one leg would need, and a fifth is what
 * several legs bear. An integral gain ki = kp K_v / 5 compensates the overlap of the valve.
 */

/* Checks whether a joint's drive from the catalogue is hydraulic. */
bool import_takes_cylinder(const struct import_robot *from, size_t j);

/* Fills the hydraulic drives of these joints, their strengths and the robot's supply. bears: by
 * joint, its load in a pose, N m. Returns ERROR_INPUT with file:line if a range is too wide. */
enum error_code import_take_cylinders(struct import_robot *from, const double *bears,
                                      struct import_notes *notes, struct error *error);

/* Computes the gains of a joint with a cylinder at the angle q, rad. inertia: inertia that
 * oscillates on its oil, kg m2. */
struct import_gains import_cylinder_gains(const struct robot *robot, size_t j, double q,
                                          double inertia);

/* ---- couplings ---- */

/*
 * Stiffness and damping of the couplings of an import, which no file gives. With the effective
 * inertia I of the follower, other joints held, the follower oscillates on its coupling at 1000
 * rad/s, a radian per tick, so that gravity bends it by tenths of a milliradian. If the leader has
 * a drive, the coupling also deflects by at most 1 mrad of the leader's angle under the drive's
 * full torque. K is the larger of both values, and at most 1e8; D = 2 sqrt(K I) damps the follower
 * critically. Units are the follower's.
 *
 * Loads of followers count at their leaders: torques times the multiplier, stiffnesses times its
 * square.
 */

/* Fills stiffness and damping of the robot's couplings and adds a note for each. Torque limits and
 * drives must be known. */
enum error_code import_stiffen_couplings(struct import_robot *from, struct arena *arena,
                                         struct import_notes *notes, struct error *error);

/* What followers pass on to their leaders. */
enum import_lead { IMPORT_LEAD_TORQUES, IMPORT_LEAD_LOADS, IMPORT_LEAD_STIFFNESSES };

/* Adds the loads of followers to their leaders, by joint: torques with their signs, times the
 * multiplier; magnitudes, times its magnitude; stiffnesses, times its square. */
void import_lead(const struct robot *robot, enum import_lead what, double *value);

#endif
