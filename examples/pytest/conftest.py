# SPDX-License-Identifier: Apache-2.0
"""Tests of a controller against the simulator: the fixture `simulator` of coman_hil starts one in
lockstep for each test. The program is the one of the environment variable COMAN_HIL, else
coman-hil on the PATH; the rig is that of COMAN_HIL_RIG, else the installed coman."""
pytest_plugins = ["coman_hil.pytest"]
