# SPDX-License-Identifier: Apache-2.0
# The implicit integrator with all that it stands on, and the adaptive one.
hil_test(dynamics_implicit SOURCES unit/dynamics_implicit.c LIBS random_robot LABELS unit)
if(TARGET symbolic_builtin)
    target_link_libraries(test_dynamics_implicit PRIVATE symbolic symbolic_builtin)
    target_compile_definitions(test_dynamics_implicit PRIVATE HIL_SYMBOLIC)
endif()
hil_test(integrator_dopri5 SOURCES unit/integrator_dopri5.c LIBS model LABELS unit)
hil_test(actuator_step SOURCES unit/actuator_step.c physics/toy.c LIBS model LABELS unit)
hil_test(implicit SOURCES physics/implicit.c physics/toy.c LIBS model LABELS physics)
hil_test(implicit_standing SOURCES physics/implicit_standing.c LIBS model TIMEOUT 120 LABELS physics)
hil_test(contact_tangent SOURCES unit/contact_tangent.c LIBS contact LABELS unit)
hil_test(implicit_grasp SOURCES physics/implicit_grasp.c LIBS rt TIMEOUT 120 LABELS physics)
