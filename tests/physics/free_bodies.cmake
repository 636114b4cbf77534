# SPDX-License-Identifier: Apache-2.0
# Free bodies: in the plant, and in rigs.
hil_test(free_body SOURCES physics/free_body.c physics/toy.c LIBS model LABELS physics)
hil_test(sliding SOURCES physics/sliding.c physics/toy.c LIBS model LABELS physics)
