/* SPDX-License-Identifier: Apache-2.0 */
/* The faults of a run: the lines of a rig's section `faults`, and those of the command line. */
#ifndef RIG_FAULTS_H
#define RIG_FAULTS_H

#include "faults/faults.h"
#include "rig/rig.h"

/* Reads all lines, extra (nextra) being those of --fault. wire: by bus, whether it is a wire in
 * virtual time. Errors begin with file:line:column or --fault. Memory from arena. Not RT-safe. */
enum error_code rig_faults_create(const struct rig *rig, const char *const *extra, size_t nextra,
                                  uint64_t seed, const bool *wire, struct arena *arena,
                                  struct faults **faults, struct error *error);

/* Puts out all faults that a rig can have (faults_list); every bus may be a wire. Not RT-safe. */
enum error_code rig_list_faults(const struct rig *rig, fault_list_put put, void *context,
                                struct error *error);

/* Checks one line of a file other than the rig's, as a scenario; every bus may be a wire here.
 * fault: what it says. Errors begin with file:line:column. Not RT-safe. */
enum error_code rig_check_fault(const struct rig *rig, const struct yaml_name *line,
                                struct fault *fault, struct error *error);

#endif
