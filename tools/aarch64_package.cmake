# SPDX-License-Identifier: Apache-2.0
# Read by CPack: dpkg-shlibdeps takes the packages of the preset aarch64's root for those of arm64.
cmake_path(SET root NORMALIZE ${CMAKE_CURRENT_LIST_DIR}/../build/debian-arm64)
set(ENV{DPKG_ADMINDIR} ${root}/var/lib/dpkg)
set(ENV{DEB_HOST_ARCH} arm64)
