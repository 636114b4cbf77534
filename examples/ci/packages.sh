#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: packages.sh SOURCE FOLDER
# Builds the Debian packages of coman-hil from its source tree and copies them into FOLDER.
set -eu
mkdir -p "$2"
(cd "$1" && ./dev package)
cp "$1"/build/packages/*.deb "$2"
