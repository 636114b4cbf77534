#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# HEAD on a machine that has nothing: a minimal Debian with git, in which a clone is run for three
# seconds and tested (./dev fresh). What a test needs and ./dev does not install fails there,
# whatever somebody has installed here by hand.
#
#   fresh.sh WORK [--suite SUITE] [TEST...]
#   fresh.sh WORK [--suite SUITE] --package FILE.deb   installs the package there instead, runs the
#                                                      robot, and removes it
#   fresh.sh WORK [--suite SUITE] --container          makes the images of Containerfile and of
#                                                      examples/ci/Containerfile, and uses them
#
# SUITE is a release of Debian, for example trixie; without it, this machine's release.
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

# sources_of SUITE: lines of sources.list for another release, from where this machine gets its own
sources_of() {
    apt-get indextargets --format '$(REPO_URI) $(ORIGIN) $(CODENAME) $(COMPONENT) $(CREATED_BY)' |
        awk -v suite="$1" '$2 == "Debian" && $4 == "main" && $5 == "Packages" {
            sub(/^[a-z]+/, suite, $3)
            print "deb", $1, $3, "main"
        }' | sort -u
}

# make_root ROOT ARCHIVES SUITE: the minimal Debian, with this machine's way to its packages
make_root() {
    local root=$1 archives=$2 suite=$3 release sources=() file
    release=$(. /etc/os-release && echo "$VERSION_CODENAME")
    if [ "${suite:-$release}" != "$release" ]; then
        sources_of "$suite" >"$root.list"
        sources=("$root.list")
    else
        for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.{list,sources}; do
            [ -s "$file" ] && sources+=("$file")
        done
    fi
    # proxies, dates, retries: what apt was told about fetching, but not what it would do afterwards
    apt-config dump --no-empty | grep '^Acquire::' | grep -v '^Acquire::IndexTargets' >"$root.apt"
    mkdir -p "$archives/partial"
    mmdebstrap --quiet --mode=root --variant=minbase --include=$packages --aptopt="$root.apt" \
        --dpkgopt=force-unsafe-io \
        --skip=essential/unlink,cleanup/apt \
        --setup-hook='mkdir -p "$1/var/cache/apt/archives"' \
        --setup-hook="sync-in '$archives' /var/cache/apt/archives" \
        --customize-hook="sync-out /var/cache/apt/archives '$archives'" \
        "${suite:-$release}" "$root" "${sources[@]}"
    rm -f "$root.apt" "$root.list"
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

# enter ROOT ARCHIVES COMMANDS [ARGUMENT...]: becomes a shell in the machine that runs the commands
enter() {
    local root=$1 archives=$2 inside=$3
    shift 3
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

# in_machine ROOT ARCHIVES COMMANDS [ARGUMENT...]: the same in a process of its own, and returns
in_machine() {
    unshare --mount --pid --mount-proc --fork --kill-child bash "$script" --enter "$@"
}

# clone TO: HEAD, as a person who clones it has it
clone() {
    git clone --quiet --no-hardlinks "$source" "$1"
    git -C "$1" checkout --quiet --detach "$(git -C "$source" rev-parse HEAD)"
}

# make_images FOLDER FILE WORK ARCHIVES: what a container builder does with FILE, whose COPY lines
# read FOLDER. The stages are in WORK/stage-NAME, the last one is WORK/image. Only instructions that
# it knows may stand there. No registry of images is used: FROM is the minimal Debian of WORK/root.
make_images() {
    local folder=$1 file=$2 work=$3 archives=$4 line words stage=image
    while read -r line; do
        read -ra words <<<"$line"
        case $line in
        FROM\ *)
            case ${words[1]} in
            'debian:${SUITE}'*) ;;
            *) echo "$file: found \"$line\", expected FROM debian:\${SUITE}" >&2 && return 1 ;;
            esac
            stage=image
            [ "${words[2]:-}" != AS ] || stage=stage-${words[3]}
            rm -rf --one-file-system "${work:?}/$stage"
            cp -a "$work/root" "$work/$stage"
            ;;
        COPY\ --from=*)
            mkdir -p "$work/$stage${words[3]}"
            cp -a "$work/stage-${words[1]#--from=}${words[2]}/." "$work/$stage${words[3]}"
            ;;
        COPY\ *)
            mkdir -p "$work/$stage${words[2]}"
            cp -a "$folder/${words[1]}/." "$work/$stage${words[2]}"
            ;;
        RUN\ *)
            echo "$line"
            in_machine "$work/$stage" "$archives" "exec sh -c \"\$1\"" "${line#RUN }"
            ;;
        ARG\ SUITE=* | WORKDIR\ * | USER\ hil | EXPOSE\ * | ENTRYPOINT\ * | CMD\ *) ;;
        *) echo "$file: found \"$line\", which nobody has tried" >&2 && return 1 ;;
        esac
    done < <(sed -e ':a' -e '/\\$/N; s/\\\n//; ta' "$file" | grep -v -e '^#' -e '^$')
}

# as_user: the user of the image with no privilege of any kind, as the sample commands have it
as_user='setpriv --reuid hil --regid hil --clear-groups --no-new-privs --bounding-set -all
    env HOME=/home/hil'
as_user=${as_user//$'\n'/}

# try_containers WORK ARCHIVES: both images, and what their user does with them
try_containers() {
    local work=$1 archives=$2
    clone "$work/clone"
    make_images "$work/clone" "$source/Containerfile" "$work" "$archives"
    in_machine "$work/image" "$archives" "cd /work && $as_user coman-hil version &&
        $as_user coman-hil run coman-bench --transport local --gateway 29536 --duration 20 --quiet &
        cd /work && for i in \$(seq 100); do
            ! $as_user python3 -c '
import can
bus = can.Bus(interface=\"socketcand\", host=\"127.0.0.1\", port=29536, channel=\"can1\")
bus.send(can.Message(arbitration_id=0x70F, data=[0xFF], is_extended_id=False))
assert bus.recv(5), \"no board answers\"' 2>error || { echo 'a board answers on TCP' && exit 0; }
            sleep 0.1
        done
        cat error && exit 1"
    # the image for CI takes the packages that the other one has made
    rm -rf "$work/user" && cp -a "$source/examples/ci" "$work/user"
    cp -a "$work/stage-build/packages" "$work/user/packages"
    make_images "$work/user" "$source/examples/ci/Containerfile" "$work" "$archives"
    du -sh "$work/image" | sed 's/\s.*/ in the image for CI/'
    cp -a "$source/examples/ci" "$work/image/work/robot"
    in_machine "$work/image" "$archives" \
        "chown -R hil /work/robot && cd /work/robot && exec $as_user sh job.sh"
    echo "2 passed, 0 failed, 0 skipped"
}

# fresh WORK SUITE [--package FILE | --container | TEST...]: the first process of the name spaces
fresh() {
    local root=$1/root archives=$1/archives${2:+-$2} work=$1 suite=$2
    shift 2
    rm -rf --one-file-system "$root"
    echo "making a minimal Debian in $root"
    make_root "$root" "$archives" "$suite"
    case ${1:-} in
    --package)
        cp "$2" "$root/root/package.deb"
        enter "$root" "$archives" "$(declare -f try_package); try_package"
        ;;
    --container)
        rm -rf --one-file-system "$work/clone"
        try_containers "$work" "$archives"
        ;;
    *)
        clone "$root/root/coman-hil"
        enter "$root" "$archives" \
            'cd /root/coman-hil && ./dev run --duration 3 && ./dev test "$@"' "$@"
        ;;
    esac
}

script=$(realpath "$0")
case ${1:-} in
--enter)
    shift
    enter "$@"
    ;;
--inside)
    shift
    fresh "$@"
    exit
    ;;
esac
work=${1:?the folder to work in}
suite=
shift
if [ "${1:-}" = --suite ]; then
    suite=${2:?a release of Debian}
    shift 2
fi
if [ "${1:-}" = --package ]; then
    set -- --package "$(realpath -e "${2:?the package}")"
fi
mkdir -p "$work"
work=$(cd "$work" && pwd)
exec 9>"$work/lock"
flock --nonblock 9 || { echo "fresh: another one works in $work" >&2; exit 1; }

# the first process heeds no signal but KILL, which ends all others and the mounts with it
setpriv --pdeathsig KILL unshare --mount --pid --mount-proc --fork --kill-child \
    bash "$script" --inside "$work" "$suite" "$@" </dev/null 9>&- &
machine=$!
trap 'kill -KILL $machine 2>/dev/null || true' EXIT # a status of its own would become ours
trap 'exit 130' INT TERM HUP
wait $machine
