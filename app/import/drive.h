/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives for a robot whose file says at most how strong and how fast its joints are, and gains of
 * position loops for them. Every number that is not the file's is assumed, from these rules:
 *
 * Strength: the effort of the file, unless it is 0 or more than 20 times what gravity asks of the
 * robot's strongest joint, which is no strength but a placeholder; then three times what gravity
 * asks of the joint at the worst; and never less than 1.5 times what the joint bears in one of the
 * robot's poses. Speed: the velocity of the file, unless it is 0 or over 100
 * rad/s; then 2 pi rad/s.
 *
 * Drive, all on the link side: at the supply V it runs 1.5 times as fast without load, and has its
 * full strength at its speed, so N Kw = N Kt = V / (1.5 speed), R = N Kt V / (3 strength). The
 * rotor comes to that speed in 20 ms with full strength; friction takes 2 % of it; the gear gives
 * way by 10 mrad under it (Ks), with Ds = 0.5 ms Ks; L = 0.5 ms R.
 *
 * Joints that follow others have no drive: what they bear their leaders' drives bear, and their
 * couplings are as stiff as said below.
 *
 * Not RT-safe.
 */
#ifndef APP_IMPORT_DRIVE_H
#define APP_IMPORT_DRIVE_H

#include "app/import/tree_simplify.h"

/* Fills drives and strengths of all joints of the robot, which is finished (robot_finish). Joints
 * with a drive of the catalogue (below) get that, a hydraulic one by the rules below. *supply_v
 * is the highest that those are made for; without any, what feeds all with at most 25 A each at
 * full strength, 24 V or more. */
enum error_code import_assume_drives(struct import_robot *from, struct arena *arena,
                                     struct import_notes *notes, double *supply_v,
                                     struct error *error);

/* Gains by joint of the loop V = kp (ref - qm) + ki integral - kd qm' + kw ref' + load times
 * the torque at the start; unused for joints without a drive. */
struct import_gains {
    double kp_v_per_rad, ki_v_per_rad_s, kd_v_s_per_rad, kw_v_s_per_rad, load_v_per_nm;
};

/* Gains from the drives and from the inertia I that every joint shows in that pose when the others
 * are free to give way, its rotor included. The stiffness K = kp N Kt / R is five times what
 * gravity takes at the worst, and 1.5 times what tips the robot over the joint where it stands in
 * that pose (its weight by the height of its center above the joint, by the feet), within
 * (30 rad/s)^2 I and (60 rad/s)^2 I; above that the delay of the buses, some 4 ms, would eat the
 * phase. The damping makes the loop aperiodic, D = 2 sqrt(K I),
 * less what the motor has itself, Dm + N Kt N Kw / R. Above the resonance with the spring the loop
 * moves the rotor alone: what is fed back of D is J / 10 ms at most, and K at most (100 rad/s)^2 J
 * and D^2 / I, which is half of the aperiodic damping. Those of cylinders are below. */
enum error_code import_find_gains(const struct robot *robot, const double *joint, bool stands,
                                  struct arena *arena, struct import_gains *gains,
                                  struct error *error);

/* ---- drives of the catalogue ---- */

/*
 * Drives that the user picks from the catalogue (config/drives/) for the joints of an import:
 * `--drive NAME` for all that turn, `--drive PATTERN=NAME` for those whose names the pattern
 * matches (*, ? and [...] as in a shell); of several that match the last one counts. NAME may be
 * the path of a drive file, which is copied into the folder drives of the import.
 */

/* Fills drive, drive_file and drive_copy of the robot. Errors name the option, what is not there
 * and what is nearest: a name of the catalogue, a pattern that no joint matches. Memory from
 * arena. */
enum error_code import_pick_drives(const struct import_options *options, struct arena *arena,
                                   struct import_robot *to, struct error *error);

/* Returns the short-time torque of a drive, N m: its peak or rated torque by the file, else the
 * stall torque at its supply voltage. */
double import_drive_torque(const struct robot_drive *drive);

/* ---- hydraulic drives ---- */

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
 *
 */

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

/* ---- couplings ---- */

/*
 * Stiffness and damping of the couplings of an import, which no file gives. The follower alone,
 * with the inertia I that it shows while all else is held, would swing on its coupling at 1000
 * rad/s, a radian a tick, so that gravity bends it by tenths of a milliradian; where the leader has
 * a drive, the coupling gives way by no more than 1 mrad of the leader's under all that this drive
 * gives. K is the larger of the two, and 1e8 at most; D = 2 sqrt(K I) damps the follower
 * critically. Units are the follower's.
 *
 * Loads of followers are their leaders': what a follower bears counts there by the multiplier, and
 * as a stiffness by its square.
 */

/* Fills stiffness and damping of the robot's couplings and notes each; torque limits and drives
 * must be known. */
enum error_code import_stiffen_couplings(struct import_robot *from, struct arena *arena,
                                         struct import_notes *notes, struct error *error);

/* Add to each leader what its followers bear, by joint: torques with their signs, by the
 * multiplier; magnitudes of loads, by its magnitude; stiffnesses, by its square. */
void import_lead_torques(const struct robot *robot, double *torque);
void import_lead_loads(const struct robot *robot, double *load);
void import_lead_stiffnesses(const struct robot *robot, double *stiffness);

#endif
