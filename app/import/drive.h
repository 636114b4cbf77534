/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Assumes drives for a robot whose file gives at most the strength and the speed of its joints, and
 * chooses gains for position loops. Not RT-safe.
 *
 * Numbers that are not in the file follow these rules:
 *
 * Strength: the effort in the file. It is a placeholder if it is 0, or more than 20 times the
 * gravity torque of the robot's strongest joint (at least the robot's weight at 0.1 m). The
 * strength is then three times the worst gravity torque of the joint. In any case it is at least
 * 1.5 times the joint's load in each of the robot's poses.
 *
 * Speed: the velocity in the file, or 2 pi rad/s if that is 0 or above 100 rad/s.
 *
 * Drive, all on the link side: at the supply voltage V the no-load speed is 1.5 times the speed,
 * and the full strength is available at the speed. So N Kw = N Kt = V / (1.5 speed), and R = N Kt V
 * / (3 strength). With full strength the rotor reaches the speed in 20 ms. Friction is 2 % of the
 * strength. The gear deflects by 10 mrad under full strength (Ks); Ds = 0.5 ms Ks; L = 0.5 ms R.
 *
 * Joints that follow others have no drive. The drives of their leaders bear their loads. The rules
 * for couplings are below.
 */
#ifndef APP_IMPORT_DRIVE_H
#define APP_IMPORT_DRIVE_H

#include "app/import/tree_simplify.h"

/* Fills the drives and strengths of all joints of the robot, which must be finished (robot_finish).
 * A joint with a catalogue drive (below) gets that drive; hydraulic drives follow the rules below.
 * *supply_v is the highest nominal voltage of the catalogue drives. Without any, it is the voltage
 * at which each drive needs at most 25 A for full strength, and at least 24 V. */
enum error_code import_assume_drives(struct import_robot *from, struct arena *arena,
                                     struct import_notes *notes, double *supply_v,
                                     struct error *error);

/* Gains of a joint's loop V = kp (ref - qm) + ki integral - kd qm' + kw ref' + load times the
 * initial torque. Unused for joints without a drive. */
struct import_gains {
    double kp_v_per_rad, ki_v_per_rad_s, kd_v_s_per_rad, kw_v_s_per_rad, load_v_per_nm;
    /* stiffness of the loop, as a share of 1.5 times the joint's tipping stiffness; 0 = stiff
     * enough */
    double short_of;
};

/* Computes gains from the drives, and from the inertia I of each joint in the given pose, rotor
 * included, with the other joints free.
 *
 * The stiffness K = kp N Kt / R is 20 times the worst gravity stiffness. For a floating robot it is
 * five times, because the load is then half of the weight at the end of the limb. If the robot
 * stands in the pose, K is at least 1.5 times the tipping stiffness (weight times height of the
 * center of mass above the joint, divided by the number of feet). The file's dry friction deflects
 * the loop by at most 5 mrad. K is limited to between (30 rad/s)^2 I and (60 rad/s)^2 I. Above
 * that, the delay of the buses, about 4 ms, would use up the phase margin. The damping makes the
 * loop aperiodic: D = 2 sqrt(K I), minus the motor's own damping Dm + N Kt N Kw / R.
 * kw compensates the motor's own damping at the speed of the reference.
 *
 * Above the resonance of the spring, the loop moves only the rotor. Therefore the part of D from
 * feedback is at most J / 10 ms, and K is at most (100 rad/s)^2 J and D^2 / I (half of the
 * aperiodic damping). The gains of cylinders are below. */
enum error_code import_find_gains(const struct robot *robot, const double *joint, bool stands,
                                  struct arena *arena, struct import_gains *gains,
                                  struct error *error);

/* ---- drives of the catalogue ---- */

/*
 * Drives from the catalogue (config/drives/) that the user selects for an import. `--drive NAME`
 * applies to all revolute joints. `--drive PATTERN=NAME` applies to joints whose names match the
 * pattern (*, ? and [...] as in a shell). If several match, the last one counts. NAME may be the
 * path of a drive file, which is then copied to the folder drives of the import.
 */

/* Fills drive, drive_file and drive_copy of the robot. Errors name the option and what was not
 * found: a drive, with the nearest name in the catalogue, or a joint for a pattern. Memory is from
 * arena. */
enum error_code import_pick_drives(const struct import_options *options, struct arena *arena,
                                   struct import_robot *to, struct error *error);

/* Returns the short-time torque of a drive, N m: the file's peak or rated torque, else the stall
 * torque at its supply voltage. */
double import_drive_torque(const struct robot_drive *drive);

/* ---- hydraulic drives ---- */

/*
 * Joints of an import with a hydraulic catalogue drive. The robot's file has no cylinders, and the
 * drive file has no joint geometry, so the geometry is assumed by these rules.
 *
 * Triangle of the joint and the two pins: the cylinder's pin is four strokes away from the joint.
 * The lever is as long as possible, at most two strokes, such that the joint's range uses 90 % of
 * the stroke, with equal margins at both ends. The force has equal levers at both ends of the
 * range. If these levers are less than a quarter of the largest lever, which happens for ranges
 * above about 150 degrees, the import refuses the range. The piston extends toward the end of the
 * range that is nearer to 0, the straight leg.
 *
 * Supply: the pressure is the highest nominal pressure of the drives. The accumulator has a
 * precharge of 60 % of the pressure, and holds the oil to extend all pistons once. The pump
 * delivers the oil to extend and retract them once in two seconds, plus their leakage. The relief
 * valve passes this flow at 0.5 % above the pressure.
 *
 * Gains: a valve is a source of speed, with kw volts per rad/s (hydraulic_speed_constant). The
 * loop's velocity gain K_v = kp / kw is a fifth of the frequency, rad/s, at which the joint
 * oscillates on its oil with all bodies behind it. For a floating robot, half of its mass at the
 * end of the leg is included, as on HyQ (11/s for 58 rad/s). K_v is at most 16/s, because of the
 * delay of the buses. A linear loop is stable for K_v below twice the damping ratio times that
 * frequency (Merritt, 1967, chapter 8). Oil and friction give less damping than a robot on one leg
 * would need; a fifth is enough for several legs. An integral gain ki = kp K_v / 5 compensates the
 * overlap of the valve.
 */

/* Checks whether a joint has a hydraulic drive from the catalogue. */
bool import_takes_cylinder(const struct import_robot *from, size_t j);

/* Fills the hydraulic drives of these joints, their strengths, and the robot's supply. bears: load
 * of each joint in a pose, N m. Returns ERROR_INPUT with file:line if a range is too wide. */
enum error_code import_take_cylinders(struct import_robot *from, const double *bears,
                                      struct import_notes *notes, struct error *error);

/* Computes the gains of a joint with a cylinder at the angle q, rad. inertia: the inertia that
 * oscillates on the cylinder's oil, kg m2. */
struct import_gains import_cylinder_gains(const struct robot *robot, size_t j, double q,
                                          double inertia);

/* ---- couplings ---- */

/*
 * Stiffness and damping of the couplings of an import, which no file gives. The follower oscillates
 * on its coupling at 1000 rad/s, a radian per tick, with its effective inertia I and other joints
 * held. Gravity then bends it by tenths of a milliradian. If the leader has a drive, the coupling
 * also deflects by at most 1 mrad of the leader's angle under the drive's full torque. K is the
 * larger of both values, and at most 1e8. D = 2 sqrt(K I) damps the follower critically. Units are
 * the follower's.
 *
 * Loads of followers act on their leaders: torques times the multiplier, stiffnesses times its
 * square.
 */

/* Fills stiffness and damping of the robot's couplings, and adds a note for each. Set torque limits
 * and drives first. */
enum error_code import_stiffen_couplings(struct import_robot *from, struct arena *arena,
                                         struct import_notes *notes, struct error *error);

/* Quantities that followers transmit to their leaders. */
enum import_lead { IMPORT_LEAD_TORQUES, IMPORT_LEAD_LOADS, IMPORT_LEAD_STIFFNESSES };

/* Adds the values of followers to their leaders, by joint. Signed torques are multiplied by the
 * multiplier, load magnitudes by its magnitude, stiffnesses by its square. */
void import_lead(const struct robot *robot, enum import_lead what, double *value);

#endif
