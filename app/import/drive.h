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
 * couplings are as stiff as stiffness.h says.
 *
 * Not RT-safe.
 */
#ifndef APP_IMPORT_DRIVE_H
#define APP_IMPORT_DRIVE_H

#include "app/import/tree_simplify.h"

/* Fills drives and strengths of all joints of the robot, which is finished (robot_finish). Joints
 * with a drive of the catalogue (catalogue.h) get that, a hydraulic one by cylinder.h. *supply_v
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
 * and D^2 / I, which is half of the aperiodic damping. Those of cylinders: cylinder.h. */
enum error_code import_find_gains(const struct robot *robot, const double *joint, bool stands,
                                  struct arena *arena, struct import_gains *gains,
                                  struct error *error);

#endif
