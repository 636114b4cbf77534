/* SPDX-License-Identifier: Apache-2.0 */
/* A small rig in a configuration tree of its own under /tmp, to be written wrong in every way. */
#ifndef TESTS_UNIT_RIG_RIG_FILES_H
#define TESTS_UNIT_RIG_RIG_FILES_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char tree[32];
static char rig_path[64]; /* TREE/config/rigs/toy.yaml */

/* Two driven joints, one without a drive, on a fixed base */
static const char toy_robot[] =
    "name: toy\n"
    "gravity_m_s2: [0, 0, -9.81]\n"
    "base: {type: fixed, body: trunk}\n"
    "drive: {J_kg_m2: 0.1, Dm_nm_s_rad: 0.2, Ks_nm_rad: 400, Ds_nm_s_rad: 0.2, N: 100, NKt_nm_a: "
    "4,\n"
    "        NKw_v_s_rad: 4, R_ohm: 0.6, L_h: 0.0003}\n"
    "bodies:\n"
    "  - {name: trunk, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}\n"
    "  - {name: upper, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}\n"
    "  - {name: lower, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}\n"
    "  - {name: tail, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}\n"
    "joints:\n"
    "  - {name: hip, type: revolute, parent: trunk, child: upper, axis: [0, 1, 0],\n"
    "     origin: {xyz_m: [0, 0, 0]}, limits: {lower_rad: -1, upper_rad: 2, torque_nm: 50}, drive: "
    "{}}\n"
    "  - {name: knee, type: revolute, parent: upper, child: lower, axis: [0, 1, 0],\n"
    "     origin: {xyz_m: [0, 0, -0.2]}, limits: {lower_rad: 0, upper_rad: 3, torque_nm: 50}, "
    "drive: {}}\n"
    "  - {name: wag, type: revolute, parent: trunk, child: tail, axis: [0, 0, 1],\n"
    "     origin: {xyz_m: [-0.1, 0, 0]}, limits: {lower_rad: -1, upper_rad: 1, torque_nm: 50}}\n"
    "frames:\n"
    "  - {name: sole, body: lower, xyz_m: [0.5, 0, -0.2], rpy_rad: [0, 0, 1.5707963267948966]}\n"
    "  - {name: wrist, body: tail, xyz_m: [0, 0, 0]}\n"
    "ft_sensors:\n"
    "  - {name: foot_ft, frame: sole}\n"
    "  - {name: wrist_ft, frame: wrist}\n"
    "poses:\n"
    "  straight: {}\n"
    "  bent: {joints_rad: {hip: -0.5, knee: 1.0}}\n";

static const char toy_mesh[] =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

static const char toy_rig[] =
    "name: toy\n"
    "robot: {file: ../robots/toy.yaml}\n"
    "clock: free\n"
    "tick_s: 0.002\n"
    "substep_s: 0.0005\n"
    "supply_v: 48\n"
    "initial: {pose: bent}\n"
    "scene:\n"
    "  engine: simbody\n"
    "  transition_velocity_m_s: 0.02\n"
    "  materials:\n"
    "    rubber: {young_pa: 1e5, thickness_m: 0.01, dissipation_s_per_m: 10, static_friction: "
    "1.1,\n"
    "             dynamic_friction: 0.9, viscous_s_per_m: 0.5}\n"
    "  surfaces:\n"
    "    - {name: ground, body: world, shape: half_space, xyz_m: [0, 0, -1], material: rubber}\n"
    "    - {name: ball, frame: sole, shape: sphere, radius_m: 0.02, xyz_m: [0.1, 0, 0], material: "
    "rubber}\n"
    "    - {name: block, body: tail, shape: box, half_extents_m: [0.1, 0.2, 0.3], material: "
    "rubber}\n"
    "    - {name: wedge, body: lower, shape: mesh, mesh: ../meshes/toy.obj, material: rubber}\n"
    "  pairs:\n"
    "    - between: [ground, ball]\n"
    "    - between: [block, ball]\n"
    "motors:\n"
    "  joint_ticks_per_rev: 4096\n"
    "  motor_ticks_per_link_rev: 409600\n"
    "  torque_full_scale_nm: 55\n"
    "  current_limit_a: 12\n"
    "buses:\n"
    "  - name: left\n"
    "    interface: can0\n"
    "    boards:\n"
    "      - {kind: motor, address: 1, axes: [spare, hip], current_limit_a: 5}\n"
    "      - {kind: torque, address: 0x0c, joints: [spare, spare, hip], period_s: 0.004}\n"
    "  - name: right\n"
    "    interface: can1\n"
    "    boards:\n"
    "      - {name: shin, kind: motor, address: 3, axes: [knee]}\n"
    "      - {kind: ft, address: 0x0d, sensor: foot_ft, full_scale_n: [1000, 1000, 2000],\n"
    "         full_scale_nm: [40, 40, 30], transmit_at_start: true}\n"
    "lockstep: {bus: right, step_id: 0x5f0, partner_timeout_s: 2.5}\n"
    "realtime: {priority: 0, cpu: 1, lock_memory: false, overrun: stop}\n"
    "record: {directory: out, format: both}\n"
    "tasks:\n"
    "  servo: {kp_v_per_rad: 10, ki_v_per_rad_s: 20, kw_v_s_per_rad: 4, command_period_s: 0.004}\n"
    "  squat: {thigh_m: 0.2, shank_m: 0.3, depth_m: 0.1, period_s: 2, cycles: 5}\n"
    "page: {listen: \"8080\"}\n";

static int write_file(const char *name, const char *text, size_t size)
{
    char path[128];
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", tree, name);
    file = fopen(path, "w");
    return !file || fwrite(text, 1, size, file) != size || fclose(file) ? -1 : 0;
}

/* Puts to in the place of the first from in text; false when there is no from, or no room. */
static inline bool replace(char *text, size_t capacity, const char *from, const char *to)
{
    char *at = strstr(text, from);
    size_t old = strlen(from), new = strlen(to);

    if (!at || strlen(text) - old + new >= capacity) {
        return false;
    }
    memmove(at + new, at + old, strlen(at + old) + 1);
    memcpy(at, to, new);
    return true;
}

static int make_tree(void)
{
    static const char *const folders[] = {"config", "config/rigs", "config/robots",
                                          "config/meshes"};
    char path[128];

    strcpy(tree, "/tmp/hil-rig-XXXXXX");
    if (!mkdtemp(tree)) {
        return -1;
    }
    for (size_t i = 0; i < 4; i++) {
        snprintf(path, sizeof path, "%s/%s", tree, folders[i]);
        if (mkdir(path, 0700)) {
            return -1;
        }
    }
    snprintf(rig_path, sizeof rig_path, "%s/config/rigs/toy.yaml", tree);
    return write_file("config/robots/toy.yaml", toy_robot, sizeof toy_robot - 1) ||
                   write_file("config/meshes/toy.obj", toy_mesh, sizeof toy_mesh - 1)
               ? -1
               : 0;
}

static void remove_tree(void)
{
    static const char *const names[] = {"config/rigs/toy.yaml",
                                        "config/robots/toy.yaml",
                                        "config/meshes/toy.obj",
                                        "config/rigs",
                                        "config/robots",
                                        "config/meshes",
                                        "config",
                                        "."};
    char path[128];

    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        snprintf(path, sizeof path, "%s/%s", tree, names[i]);
        if (unlink(path)) {
            rmdir(strcmp(names[i], ".") ? path : tree);
        }
    }
}

#endif
