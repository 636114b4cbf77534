#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# HEAD on a machine that has nothing: a minimal Debian 12 with git, of this release's packages
# only, in which a clone is run for three seconds and tested (./dev fresh). What a test needs and
# ./dev does not install fails there, whatever somebody has installed here by hand.
#
#   fresh.sh WORK [TEST...]
#   fresh.sh WORK --package FILE.deb   installs the package there instead, runs the robot, and
#                                      removes it
#
# WORK/root is the machine, made anew each time and left for a look; WORK/archives keeps the
# downloaded packages. The machine uses this one's kernel, its sources of packages (/etc/apt) and
# its name server. All mounts and processes of it are in name spaces of their own and end with the
# script. Closes with the suite's line "N passed, N failed, N skipped"; exits 1 when something
# failed.
set -euo pipefail
source=$(cd "$(dirname "$0")/.." && pwd)

# what a person has on a fresh machine before the clone: git, and certificates for a remote
packages=ca-certificates,git

# make_root ROOT ARCHIVES: the minimal Debian, with this machine's way to its packages
make_root() {
    local root=$1 archives=$2 release sources=() file
    release=$(. /etc/os-release && echo "$VERSION_CODENAME")
    for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.{list,sources}; do
        [ -s "$file" ] && sources+=("$file")
    done
    # proxies, dates, retries: what apt was told about fetching, but not what it would do afterwards
    apt-config dump --no-empty | grep '^Acquire::' | grep -v '^Acquire::IndexTargets' >"$root.apt"
    mkdir -p "$archives/partial"
    mmdebstrap --quiet --mode=root --variant=minbase --include=$packages --aptopt="$root.apt" \
        --dpkgopt=force-unsafe-io \
        --skip=essential/unlink,cleanup/apt \
        --setup-hook='mkdir -p "$1/var/cache/apt/archives"' \
        --setup-hook="sync-in '$archives' /var/cache/apt/archives" \
        --customize-hook="sync-out /var/cache/apt/archives '$archives'" \
        "$release" "$root" "${sources[@]}"
    rm -f "$root.apt"
    # keys that sources name by their file
    for file in /etc/apt/keyrings /etc/apt/trusted.gpg.d /usr/share/keyrings; do
        [ ! -d $file ] || { mkdir -p "$root$file" && cp -rn $file/. "$root$file"; }
    done
    cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
}

# try_package: what is done in the machine with /root/package.deb
try_package() {
    local left
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq
    apt-get install -y -qq --no-install-recommends /root/package.deb >/dev/null
    cd /tmp
    coman-hil version
    coman-hil run coman --task squat --clock free --transport local --duration 2 --record record
    [ -s record/signals.csv ]
    coman-hil test command_timeout
    apt-get purge -y -qq coman-hil >/dev/null
    left=$(find /usr /etc /var /run -path /var/cache -prune -o -path /var/log -prune -o \
        -name '*coman*' -print)
    [ -z "$left" ] || { printf 'left behind: %s\n' "$left" && return 1; }
    echo "1 passed, 0 failed, 0 skipped"
}

# enter ROOT ARCHIVES [--package FILE | TEST...]: becomes a run and the suite in the machine
enter() {
    local root=$1 archives=$2
    local inside='cd /root/coman-hil && ./dev run --duration 3 && ./dev test "$@"'
    shift 2
    if [ "${1:-}" = --package ]; then
        inside="$(declare -f try_package); try_package"
    fi
    mount --bind "$root" "$root"
    mount -t proc proc "$root/proc"
    mount --rbind /sys "$root/sys"
    mount --rbind /dev "$root/dev"
    mount -t tmpfs -o mode=1777 tmpfs "$root/dev/shm"
    mount -t tmpfs -o mode=755 tmpfs "$root/run"
    mount --bind "$archives" "$root/var/cache/apt/archives"
    # no chroot, in which nobody may make a user name space
    cd "$root"
    pivot_root . mnt
    umount -l mnt
    exec chroot . /usr/bin/env -i HOME=/root TERM=dumb LC_ALL=C.UTF-8 \
        PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        ${http_proxy:+"http_proxy=$http_proxy"} ${https_proxy:+"https_proxy=$https_proxy"} \
        bash -euo pipefail -c "$inside" fresh "$@"
}

# fresh WORK [TEST...]: the first process of the name spaces
fresh() {
    local root=$1/root archives=$1/archives
    shift
    rm -rf --one-file-system "$root"
    echo "making a minimal Debian in $root"
    make_root "$root" "$archives"
    if [ "${1:-}" = --package ]; then
        cp "$2" "$root/root/package.deb"
    else
        git clone --quiet --no-hardlinks "$source" "$root/root/coman-hil"
        git -C "$root/root/coman-hil" checkout --quiet --detach \
            "$(git -C "$source" rev-parse HEAD)"
    fi
    enter "$root" "$archives" "$@"
}

if [ "${1:-}" = --inside ]; then
    shift
    fresh "$@"
fi
work=${1:?the folder to work in}
shift
if [ "${1:-}" = --package ]; then
    set -- --package "$(realpath -e "${2:?the package}")"
fi
mkdir -p "$work"
work=$(cd "$work" && pwd)
exec 9>"$work/lock"
flock --nonblock 9 || { echo "fresh: another one works in $work" >&2; exit 1; }

# the first process heeds no signal but KILL, which ends all others and the mounts with it
setpriv --pdeathsig KILL unshare --mount --pid --mount-proc --fork --kill-child \
    bash "$0" --inside "$work" "$@" </dev/null 9>&- &
machine=$!
trap 'kill -KILL $machine 2>/dev/null || true' EXIT # a status of its own would become ours
trap 'exit 130' INT TERM HUP
wait $machine
