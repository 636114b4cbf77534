#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: uninstall.sh INSTALL_MANIFEST
# Removes what cmake --install has put there, below $DESTDIR as it did, and the folders of ours that
# are empty then.
set -eu
while read -r file || [ -n "$file" ]; do
    rm -f -- "${DESTDIR:-}$file"
done <"$1"
sed -n 's|^\(.*/\(lib\)\{0,1\}coman-hil[^/]*\)/.*|\1|p' "$1" | sort -u | while read -r folder; do
    if [ -d "${DESTDIR:-}$folder" ]; then
        find "${DESTDIR:-}$folder" -depth -type d -empty -delete
    fi
done
