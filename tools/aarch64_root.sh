#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: aarch64_root.sh ROOT PACKAGE...
# A folder of Debian's packages for arm64 and of all that they depend on, to compile and link with
# and to run programs from under QEMU (./dev setup --aarch64). They are unpacked, not installed:
# nothing of them is run, this machine's own packages stay as they are, and no two can conflict.
set -euo pipefail
root=$1
shift
[ "$(id -u)" -eq 0 ] && mode=root || mode=unshare

# this machine's release and its way to the packages
release=$(. /etc/os-release && echo "$VERSION_CODENAME")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
apt-config dump --no-empty | grep '^Acquire::' | grep -v '^Acquire::IndexTargets' >"$work/apt"

rm -rf "$root"
mkdir -p "$(dirname "$root")"
packages=$(IFS=, && echo "$*")
mmdebstrap --quiet --mode="$mode" --arch=arm64 --variant=extract --include="$packages" \
    --aptopt="$work/apt" --skip=cleanup/apt "$release" "$root"

# links that the packages' scripts would have made
for library in blas lapack; do
    for file in "$root"/usr/lib/aarch64-linux-gnu/$library/lib$library.so*; do
        ln -sf "$library/$(basename "$file")" "$root/usr/lib/aarch64-linux-gnu/"
    done
done

# The database of what is there, for the dependencies of packages that are made (dpkg-shlibdeps). It
# names the files by where they are on this machine.
database=$root/var/lib/dpkg
echo 1 >"$database/info/format" # names are PACKAGE:arm64 where those of two machines could meet
for archive in "$root"/var/cache/apt/archives/*.deb; do
    package=$(dpkg-deb -f "$archive" Package)
    info=$database/info/$package
    [ "$(dpkg-deb -f "$archive" Multi-Arch)" != same ] || info=$info:arm64
    dpkg-deb --fsys-tarfile "$archive" | tar -t | sed "s|^\.|$root|; s|/\$||" >"$info.list"
    dpkg-deb -e "$archive" "$work/control"
    for file in symbols shlibs; do
        [ ! -f "$work/control/$file" ] || cp "$work/control/$file" "$info.$file"
    done
    {
        echo "Package: $package"
        echo "Status: install ok installed"
        sed '/^Package:/d' "$work/control/control"
        echo
    } >>"$database/status"
    rm -rf "$work/control" "$archive"
done
