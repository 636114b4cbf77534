# SPDX-License-Identifier: Apache-2.0
# The implicit integrator with all that it stands on, and the adaptive one.
hil_test(implicit SOURCES physics/implicit.c physics/toy.c LIBS model LABELS physics)
hil_test(implicit_truth SOURCES physics/implicit_truth.c physics/toy.c
         LIBS sim TIMEOUT 120 LABELS physics)
hil_test(implicit_stability SOURCES physics/implicit_stability.c physics/toy.c LIBS model
         LABELS physics)
