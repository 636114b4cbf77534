/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the rig files of an import. */
#include "app/import/write.h"

#include "boards/described/protocol.h"
#include "base/whole_file.h"

#include <math.h>
#include <string.h>

enum { INERTIAL_ADDRESS = 8 };

/* ---- boards ---- */

/* Returns the current limit of a joint's board, A: 1.5 times the current of its drive at full
 * strength. */
static double drive_current_limit(const struct robot_joint *joint)
{
    return 1.5 * joint->torque_limit / joint->sea.Kt;
}

/* Writes a key with a list of the joints first to last - 1 of a bus. */
static void write_joints(FILE *out, const struct import_rig *rig, const struct import_bus *bus,
                         const char *key, size_t first, size_t last)
{
    fprintf(out, "%s: [", key);
    for (size_t k = first; k < last; k++) {
        fprintf(out, "%s\"%s\"", k > first ? ", " : "", rig->robot->joint[bus->joint[k]].name);
    }
    fputs("]", out);
}

/* Returns the name of the protocol's model for the drive of a joint, the end of the drive's name:
 * dm4310 for damiao-dm4310. Returns NULL without such a model. */
static const char *joint_find_model(const struct import_rig *rig, size_t joint)
{
    const struct described_protocol *protocol = rig->plan->boards.described;
    const char *drive = rig->drive_file[joint];

    for (size_t i = 0; drive && protocol && i < protocol->nmodel; i++) {
        const char *name = protocol->model[i].name;
        const size_t length = name ? strlen(name) : 0, whole = strlen(drive);

        if (length > 0 && whole > length && drive[whole - length - 1] == '-' &&
            strcmp(drive + whole - length, name) == 0) {
            return name;
        }
    }
    return NULL;
}

/* Writes the boards for the joints of a bus: one board of servo valves, or motor boards with as
 * many axes as the protocol allows. If the protocol has a board that sends joint torques, also
 * writes this board. */
static void write_axes(FILE *out, const struct import_rig *rig, const struct import_bus *bus)
{
    const struct protocol_bench *bench = rig->plan->bench;
    const size_t step = bus->protocol ? bus->njoint : bench->board_axes;

    for (size_t first = 0; first < bus->njoint; first += step) {
        const size_t last = first + step < bus->njoint ? first + step : bus->njoint;
        double current = 0.0;

        fprintf(out, "      - {kind: motor, address: %u",
                step == 1 ? bus->address[first] : (unsigned)(first / step) + 1);
        write_joints(out, rig, bus, ", axes", first, last);
        for (size_t k = first; k < last && !bus->protocol; k++) {
            current = fmax(current, drive_current_limit(&rig->robot->joint[bus->joint[k]]));
        }
        if (!bus->protocol) {
            const char *model = joint_find_model(rig, bus->joint[first]);

            fprintf(out, ", current_limit_a: %.4g%s%s%s", current, model ? ", model: " : "",
                    model ? model : "",
                    rig->plan->boards.optional ? ", transmit_at_start: true" : "");
        }
        fputs("}\n", out);
    }
    if (bus->njoint > 0 && !bus->protocol && rig->plan->boards.protocol->torque_boards) {
        fprintf(out, "      - {kind: torque, address: 0x%02x", bench->torque_address);
        write_joints(out, rig, bus, ", joints", 0, bus->njoint);
        fprintf(out, ", period_s: %s}\n", bench->torque_period_s);
    }
}

/* Checks whether all buses are for servo valves. */
static bool plan_has_only_valves(const struct import_plan *plan)
{
    size_t count = 0;

    for (size_t i = 0; i < plan->nbus; i++) {
        count += plan->bus[i].protocol && plan->bus[i].njoint > 0;
    }
    return count == plan->nbus;
}

/* Writes all buses with their boards. A bus names its protocol if it differs from the rig's. */
static void write_buses(FILE *out, const struct import_rig *rig)
{
    const struct import_plan *plan = rig->plan;
    const bool only_valves = plan_has_only_valves(plan);

    fputs("\nbuses:\n", out);
    for (size_t i = 0; i < plan->nbus; i++) {
        const struct import_bus *bus = &plan->bus[i];

        fprintf(out, "  - name: bus%zu\n    interface: can%zu\n", i, i);
        if (bus->protocol && !only_valves) {
            fprintf(out, "    protocol: %s\n", bus->protocol);
        } else if (!bus->protocol && plan->boards.fd) {
            fprintf(out, "    fd: true\n    data_bitrate: %d\n", plan->counted ? 5000000 : 8000000);
        }
        fputs("    boards:\n", out);
        write_axes(out, rig, bus);

        /* Write the sensor boards. Full scales are assumed: five times the robot's weight, N, and
         * the moment of this force at a lever of 0.2 m, N m. They are limited to the range of 16
         * bits. */
        double force = ceil(fmax(5.0 * 9.81 * rig->robot->total_mass, 10.0) / 10.0) * 10.0;
        double moment = ceil(0.2 * force);
        const struct protocol_bench *bench = rig->plan->bench;

        force = fmin(force, 65535.0);
        moment = fmin(moment, 65535.0);
        for (size_t k = 0; k < bus->nft; k++) {
            fprintf(
                out,
                "      - {kind: ft, address: 0x%02x, sensor: \"%s\", full_scale_n: [%g, %g, %g],\n"
                "         full_scale_nm: [%g, %g, %g], period_s: %s}\n",
                (unsigned)(bench->ft_address + k), rig->robot->ft[bus->ft[k]].name, force, force,
                force, moment, moment, moment, bench->ft_period_s);
        }
        if (bus->imu) {
            fprintf(out, "      - {kind: inertial, address: %u, period_s: 0.005}\n",
                    (unsigned)INERTIAL_ADDRESS);
        }
    }
}

/* ---- gains ---- */

/* Writes the servo task with the gains of each driven joint. Other gains keep their default of
 * 0. */
static void write_gains(FILE *out, const struct import_rig *rig)
{
    const struct robot *robot = rig->robot;
    const bool only_valves = plan_has_only_valves(rig->plan);

    /* Write the defaults first; a joint without gains does not move */
    fprintf(out,
            "\ntasks:\n"
            "  # From the drives and the inertias of the pose; how stands in the manual of import\n"
            "  servo:\n"
            "    kp_v_per_rad: 0.0\n"
            "    ki_v_per_rad_s: 0.0\n"
            "    kw_v_s_per_rad: 0.0\n"
            "    trim_per_s: 1.0\n"
            "    command_period_s: %s\n"
            "    others:\n",
            only_valves ? "0.001" : rig->plan->bench->command_period_s);
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        const struct import_gains *gains = &rig->gains[j];

        /* Electric drives get damping and a load term, cylinders get an integral term */
        if (joint->sea.present) {
            fprintf(out,
                    "      - {joints: [\"%s\"], kp_v_per_rad: %.5g, kd_v_s_per_rad: %.5g, "
                    "kw_v_s_per_rad: %.5g,\n         load_v_per_nm: %.5g}\n",
                    joint->name, gains->kp_v_per_rad, gains->kd_v_s_per_rad, gains->kw_v_s_per_rad,
                    gains->load_v_per_nm);
        } else if (joint->hydraulic.present) {
            fprintf(out,
                    "      - {joints: [\"%s\"], kp_v_per_rad: %.5g, ki_v_per_rad_s: %.5g, "
                    "kw_v_s_per_rad: %.5g,\n         trim_per_s: 0.0, sway_damping_per_s: 0.0}\n",
                    joint->name, gains->kp_v_per_rad, gains->ki_v_per_rad_s, gains->kw_v_s_per_rad);
        }
    }
}

/* ---- rigs ---- */

/* Returns the full scale of torques, N m: 1.2 times the torque of the strongest joint. *current_a
 * receives the current limit of the strongest motor, A; 1 A without motors. */
static double robot_find_strongest(const struct robot *robot, double *current)
{
    double torque = 1.0, most = 0.0;

    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot_joint_is_driven(&robot->joint[j])) {
            torque = fmax(torque, 1.2 * robot->joint[j].torque_limit);
        }
        if (robot->joint[j].sea.present) {
            most = fmax(most, fmax(drive_current_limit(&robot->joint[j]), 1e-3));
        }
    }
    *current = most > 0.0 ? most : 1.0;
    return fmin(ceil(torque), 65535.0);
}

/* Returns a distance that no stop yields under the torque of its joint's drive, rad. */
static double robot_find_margin(const struct robot *robot)
{
    double margin = 1e-3;

    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];

        if (robot_joint_is_driven(joint) && joint->stop.stiffness > 0.0) {
            margin = fmax(margin, 2.0 * joint->torque_limit / joint->stop.stiffness);
        }
    }
    return margin;
}

enum error_code import_write_rig(const struct import_rig *rig, const char *path,
                                 struct error *error)
{
    const struct robot *robot = rig->robot;
    double current, torque = robot_find_strongest(robot, &current);
    const bool only_valves = plan_has_only_valves(rig->plan);
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }

    /* Write head, clock and integrator, then the data for the boards and the task */
    fprintf(file.out,
            "# Made by `coman-hil import`: a first rig for this robot, %s.\n"
            "# Supply, currents, encoders, full scales and gains are assumed.\n"
            "name: \"%s\"\n"
            "description: imported, %s; %zu buses\n\n"
            "robot:\n  file: \"../robots/%s.yaml\"\n%s\n"
            "clock: real\n"
            "tick_s: 0.001\n"
            "substep_s: 0.001\n"
            "integrator: implicit\n"
            "dynamics: fastest\n"
            "protocol: %s\n"
            "supply_v: %g\n\n"
            "initial:\n  pose: \"%s\"\n",
            robot->floating ? "held by its base" : "its base fixed in the world", robot->name,
            robot->floating ? "hangs by its base" : "base fixed in the world", rig->plan->nbus,
            robot->name, robot->floating ? "  fixed_base: true\n" : "",
            only_valves ? "servo-valve" : rig->plan->boards.name, rig->supply_v, rig->pose);
    if (robot->floating) {
        fprintf(file.out, "  base_xyz_m: [0.0, 0.0, %.4g]\n", rig->height_m);
    }
    fprintf(file.out,
            "  hold: until_enabled    # the links are clamped until all motors are on\n\n"
            "motors:\n"
            "  joint_ticks_per_rev: 65536\n"
            "  motor_ticks_per_link_rev: 409600\n"
            "  torque_full_scale_nm: %g\n"
            "  current_limit_a: %.4g\n"
            "  limit_margin_rad: %.3g    # a joint that its stop bears is not beyond its limits\n"
            "%s",
            torque, current, robot_find_margin(robot),
            rig->plan->bench->motors ? rig->plan->bench->motors : "");
    write_buses(file.out, rig);
    write_gains(file.out, rig);
    return whole_file_close(&file, ERROR_NONE, error);
}

enum error_code import_write_standing(const struct import_rig *rig, const char *path,
                                      struct error *error)
{
    const struct robot *robot = rig->robot;
    struct whole_file file;
    bool settles = true;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }
    /* A castor turns behind its swivel first, so a robot with castors starts without settling */
    for (size_t j = 0; j < robot->njoint && rig->rolls; j++) {
        settles =
            settles && (robot->joint[j].type != JOINT_REVOLUTE ||
                        robot_joint_is_driven(&robot->joint[j]) || robot_find_coupling(robot, j));
    }
    fprintf(file.out,
            "# Made by `coman-hil import`: the robot on the ground in the pose of that name.\n"
            "extends: \"%s.yaml\"\n"
            "name: \"%.50s-standing\"\n"
            "description: imported, on the ground\n\n"
            "robot: {fixed_base: false}\n\n"
            "initial:\n  pose: \"%s\"\n  base_xyz_m: [0.0, 0.0, %.6g]\n  settle: %s\n\n"
            "scene:\n  engine: native\n  friction: sticking\n",
            robot->name, robot->name, rig->standing, rig->standing_height_m,
            settles ? "true" : "false");

    /* Write the materials of ground and robot. Their stiffness is proportional to the weight, so
     * that the layers deflect by some tenths of a millimeter under the whole weight. Wheels touch
     * along a line, so a robot on wheels has stiffer layers. Parts of its base on the ground are
     * castors, with little friction. */
    static const struct {
        const char *name, *thickness_m;
        double friction;
    } material[] = {
        {"ground", "1.0e-3", 1.0}, {"shell", "2.0e-4", 1.0}, {"castor", "2.0e-4", 0.02}};
    double young = (rig->rolls ? 2e6 : 1e5) * fmax(robot->total_mass / 30.0, 0.05);

    fputs("  materials:\n", file.out);
    for (int i = 0; i < (rig->rolls ? 3 : 2); i++) {
        fprintf(file.out,
                "    %s:\n      young_pa: %.3g\n      thickness_m: %s\n"
                "      dissipation_s_per_m: 10.0\n      static_friction: %g\n"
                "      dynamic_friction: %g\n      viscous_s_per_m: 0.0\n",
                material[i].name, young, material[i].thickness_m, material[i].friction,
                0.8 * material[i].friction);
    }

    fprintf(file.out,
            "  surfaces:\n"
            "    - {name: ground, body: world, shape: half_space, material: ground}\n"
            "  robot_surfaces: {material: shell, %sself_collision: false}\n\n"
            "tasks:\n"
            "  servo: {trim_per_s: 0.3, sway_damping_per_s: 3.0}\n",
            rig->rolls ? "base_material: castor, " : "");
    return whole_file_close(&file, ERROR_NONE, error);
}
