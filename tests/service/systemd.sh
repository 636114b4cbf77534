#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The service as a laboratory has it: the Debian package, with systemd as the first process of a
# kernel that has CAN. Without arguments, on the host: builds the package and boots the guest. With
# "guest" it is the guest's first process: it puts a root that can be written to over the host's
# files and becomes systemd, of which systemd_inside.sh is the one service that tests the others.
# usage: systemd.sh CPACK
set -u
here=$(cd "$(dirname "$0")" && pwd)

skip() {
    printf '1..1\nok 1 - systemd # SKIP %s\n' "$1"
    exit 0
}

host() {
    [ -x /lib/systemd/systemd ] || skip "systemd is not installed"
    command -v dpkg-shlibdeps >/dev/null || skip "dpkg-dev is not installed"
    ls /usr/lib/uml/modules/*/kernel/fs/overlayfs/overlay.ko >/dev/null 2>&1 ||
        skip "the modules of user-mode Linux have no overlay file system"
    packages=$HIL_BINARY_DIR/systemd-packages
    rm -rf "$packages"
    "$1" --config "$HIL_BINARY_DIR/CPackConfig.cmake" -G DEB -B "$packages" >/dev/null || exit 70
    # the same with a newer version
    dpkg-deb -R "$packages"/coman-hil_*.deb "$packages/next" &&
        sed -i 's/^Version: .*/&+next/' "$packages/next/DEBIAN/control" &&
        dpkg-deb --root-owner-group -Znone -b "$packages/next" "$packages/next.deb" >/dev/null ||
        exit 70
    exec bash "$here/../bus/uml/run.sh" -t 340 -x bash "$here/systemd.sh" guest
}

# small_database FOLDER: of the packages that ours depends on, in the place of the machine's, which
# takes many seconds to read here
small_database() {
    local needed
    needed=$(dpkg-deb -f "$(echo "$HIL_BINARY_DIR"/systemd-packages/coman-hil_*.deb)" Depends |
        tr ',|' '\n\n' | awk '{ print $1 }')
    mount -t tmpfs none "$1"
    mkdir -p "$1/info" "$1/updates" "$1/triggers"
    awk -v RS= -v ORS='\n\n' -v needed="$needed" '
        BEGIN { for (n = split(needed, list); n; n--) want[list[n]] = 1 }
        $1 == "Package:" && $2 in want' /var/lib/dpkg/status >"$1/status"
    for package in $needed; do
        cp /var/lib/dpkg/info/"$package".list /var/lib/dpkg/info/"$package":*.list \
            "$1/info" 2>/dev/null
    done
}

guest() {
    local root=/run/root folder
    insmod "/usr/lib/uml/modules/$(uname -r)/kernel/fs/overlayfs/overlay.ko"
    mkdir /run/root /run/layer
    mount -t tmpfs none /run/layer
    mkdir /run/layer/upper /run/layer/work
    mount -t overlay overlay -o lowerdir=/,upperdir=/run/layer/upper,workdir=/run/layer/work \
        $root || exit 71
    for folder in proc sys dev tmp; do
        mount --rbind /$folder $root/$folder
    done
    mount -t tmpfs none $root/run
    # what the guest changes, for those who look for what is left of it
    mkdir $root/run/upper
    mount --bind /run/layer/upper $root/run/upper
    small_database $root/var/lib/dpkg
    # the machine of the test may be a container, whose policy forbids packages to stop services
    if [ -e $root/usr/sbin/policy-rc.d ]; then
        : >/run/layer/no_policy
        mount --bind /run/layer/no_policy $root/usr/sbin/policy-rc.d
    fi
    for folder in "$HIL_WORK" "$HIL_SOURCE_DIR" "$HIL_BINARY_DIR"; do
        mkdir -p "$root$folder" && mount --bind "$folder" "$root$folder"
    done
    cd $root && pivot_root . mnt && umount -l mnt || exit 71

    mkdir -p /run/units /run/systemd/journald.conf.d /run/systemd/system.conf.d
    printf '[Journal]\nStorage=volatile\n' >/run/systemd/journald.conf.d/test.conf
    cat >/run/units/hil-test.target <<END
[Unit]
Requires=basic.target
Wants=hil-test.service
After=basic.target
AllowIsolate=yes
END
    # the guest's /dev is made by hand, and no private one can be put in its place
    mkdir /run/units/coman-hil-vcan@.service.d
    printf '[Service]\nPrivateDevices=no\n' >/run/units/coman-hil-vcan@.service.d/guest.conf
    # A service of the machine with Delegate=, running or not, gives every slice a processor
    # controller, and this kernel no group with one any time for real-time threads
    mkdir /run/units/service.d
    printf '[Service]\nDelegate=no\n' >/run/units/service.d/guest.conf
    # basic.target of the distribution starts what this guest has no use for
    printf '[Unit]\nRequires=systemd-journald.service\nAfter=systemd-journald.service\n' \
        >/run/units/basic.target
    cat >/run/units/hil-test.service <<END
[Unit]
DefaultDependencies=no
After=systemd-journald.service
[Service]
Type=oneshot
Environment=HIL_WORK=$HIL_WORK HIL_SOURCE_DIR=$HIL_SOURCE_DIR HIL_BINARY_DIR=$HIL_BINARY_DIR
ExecStart=/bin/bash $here/systemd_inside.sh
StandardOutput=append:$HIL_WORK/output
StandardError=append:$HIL_WORK/console
TimeoutStartSec=1000
END
    # nor for the units that generators make of the machine's files each time that units are read
    export SYSTEMD_GENERATOR_PATH=/run/none SYSTEMD_ENVIRONMENT_GENERATOR_PATH=/run/none
    export SYSTEMD_UNIT_PATH=/run/units:/etc/systemd/system:/usr/lib/systemd/system
    exec /lib/systemd/systemd --system --unit=hil-test.target --log-target=journal \
        --show-status=no systemd.unified_cgroup_hierarchy=1
}

case ${1:-} in
guest) guest ;;
*) host "${1:?the path of cpack}" ;;
esac
