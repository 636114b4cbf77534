#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: package.sh CMAKE CPACK
# The Debian package as a distribution would look at it, and install and uninstall by CMake below a
# folder. tests/service/systemd.sh installs the package for real. Prints TAP.
set -u
cmake=$1 cpack=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out"

# nothing TEXT: what a search has found is said, and is a failure
nothing() {
    printf '%s\n' "$1" >"$work/out"
    [ -z "$1" ]
}

for program in dpkg-deb dpkg-shlibdeps file; do
    if ! command -v "$program" >/dev/null; then
        printf '1..1\nok 1 - package # SKIP %s is not installed (%s)\n' "$program" \
            "Debian packages dpkg-dev, file"
        exit 0
    fi
done
echo 1..19

# ---- the package ----

"$cpack" --config "$HIL_BINARY_DIR/CPackConfig.cmake" -G DEB -B "$work" >"$work/out" 2>&1
deb=$(echo "$work"/coman-hil_*.deb)
[ -s "$deb" ]
result $? "the package is built"

field() { dpkg-deb -f "$deb" "$1"; }
dpkg-deb -I "$deb" >"$work/out"
case $(field Depends) in *libc6*libyaml*) true ;; *) false ;; esac &&
    [ "$(field Package)" = coman-hil ] &&
    [ "$(field Architecture)" = "$(dpkg --print-architecture)" ] && [ -n "$(field Description)" ] &&
    [ -n "$(field Maintainer)" ] && [ "$(field Installed-Size)" -gt 0 ]
result $? "it names the libraries that it needs, and itself"

dpkg-deb -e "$deb" "$work/control"
dpkg-deb -x "$deb" "$work/data"
dpkg-deb -c "$deb" >"$work/list"
nothing "$(awk '
    $2 != "root/root" ||
    ($1 !~ /^drwxr-xr-x$/ && $1 !~ /^-rwxr-xr-x$/ && $1 !~ /^-rw-r--r--$/) ||
    ($1 ~ /^-rwx/ && $6 !~ /\/bin\//)' "$work/list")"
result $? "all is root's, writable by root alone, and only programs are executable"
nothing "$(awk '
    $1 !~ /^d/ &&
    $6 !~ /^\.\/usr\/bin\/coman-hil(-bench)?$/ &&
    $6 !~ /^\.\/usr\/lib\/systemd\/system\/coman-hil/ &&
    $6 !~ /^\.\/usr\/share\/bash-completion\/completions\/coman-hil(-bench)?$/ &&
    $6 !~ /^\.\/usr\/share\/zsh\/vendor-completions\/_coman-hil(-bench)?$/ &&
    $6 !~ /^\.\/usr\/share\/fish\/vendor_completions\.d\/coman-hil(-bench)?\.fish$/ &&
    $6 !~ /^\.\/usr\/share\/(coman-hil|doc\/coman-hil|man)\//' "$work/list")"
result $? "no file is outside of its places"
(cd "$work/data/usr/share/coman-hil" && find . -type f | sort) >"$work/installed"
if git -C "$HIL_SOURCE_DIR" ls-files config >"$work/tracked" 2>/dev/null && [ -s "$work/tracked" ]
then
    sed 's|^config|.|' "$work/tracked" | sort >"$work/source"
    diff "$work/source" "$work/installed" >"$work/out"
    result $? "every file of config that belongs to the source is installed, and no other"
else
    skip "every file of config is installed" "this is no git repository"
fi
zcat "$work/data/usr/share/doc/coman-hil/changelog.gz" | head -n 1 >"$work/out"
grep -qF "coman-hil ($(field Version)) " "$work/out"
result $? "the changelog begins with this version"
if command -v lintian >/dev/null; then
    lintian --allow-root --fail-on error,warning "$deb" >"$work/out" 2>&1
    result $? "lintian finds no error and nothing to warn of"
else
    skip "lintian finds no error and nothing to warn of" "lintian is not installed"
fi
file "$work/data/usr/bin/coman-hil" >"$work/out"
grep -q ', stripped' "$work/out"
result $? "the program is stripped"
(cd "$work/data" && md5sum --quiet -c ../control/md5sums) >"$work/out" 2>&1
result $? "its checksums are right"
nothing "$(for script in postinst prerm postrm; do
    [ -x "$work/control/$script" ] || echo "$script is not executable"
    sh -n "$work/control/$script" 2>&1
    grep -q '^set -e$' "$work/control/$script" || echo "$script goes on after errors"
    ! command -v shellcheck >/dev/null || shellcheck "$work/control/$script"
done)"
result $? "maintainer scripts can be run, and stop at errors"
# a program with debugging information would name them all, one without has no reason to
nothing "$(cd "$work/data" && grep -rlF -e "$HIL_BINARY_DIR" -e "$HIL_SOURCE_DIR" . 2>&1)"
result $? "no installed file knows where it was built"

links=$HIL_SOURCE_DIR/tests/service/links.py
nothing "$(python3 "$links" "$work/data/usr/share/doc/coman-hil" 2>&1)"
result $? "links of the installed guides lead to what is installed"
nothing "$(python3 "$links" "$HIL_SOURCE_DIR" build node_modules .git 2>&1)"
result $? "links of the source's guides lead to what is there"

# ---- the package of the client ----

client=$(echo "$work"/libcoman-hil-client-dev_*.deb)
[ "$(dpkg-deb -f "$client" Package)" = libcoman-hil-client-dev ] &&
    [ "$(dpkg-deb -f "$client" Section)" = libdevel ] &&
    [ "$(dpkg-deb -f "$client" Depends)" = libc6-dev ] &&
    [ "$(dpkg-deb -f "$client" Version)" = "$(field Version)" ] &&
    dpkg-deb -e "$client" "$work/client-control" && [ ! -e "$work/client-control/postinst" ]
result $? "the client's package needs the C library alone, and runs no scripts"
dpkg-deb -c "$client" >"$work/list"
dpkg-deb -x "$client" "$work/client"
nothing "$(awk '
    $2 != "root/root" || ($1 !~ /^drwxr-xr-x$/ && $1 !~ /^-rw-r--r--$/) ||
    ($1 !~ /^d/ &&
    $6 !~ /^\.\/usr\/include\/coman_hil_client\.h$/ &&
    $6 !~ /^\.\/usr\/lib\/([a-z0-9_-]+\/)?libcoman-hil-client\.a$/ &&
    $6 !~ /^\.\/usr\/lib\/([a-z0-9_-]+\/)?pkgconfig\/coman-hil-client\.pc$/ &&
    $6 !~ /^\.\/usr\/lib\/([a-z0-9_-]+\/)?cmake\/coman-hil-client\/[a-z-]+\.cmake$/ &&
    $6 !~ /^\.\/usr\/share\/doc\/libcoman-hil-client-dev\/(copyright|changelog\.gz)$/)' \
    "$work/list"
    cd "$work/client" && grep -rlF -e "$HIL_BINARY_DIR" -e "$HIL_SOURCE_DIR" . 2>&1)"
result $? "it has a library, its header and what finds them, and does not know where it was built"
if command -v lintian >/dev/null; then
    lintian --allow-root --fail-on error,warning "$client" >"$work/out" 2>&1
    result $? "lintian finds no error and nothing to warn of in it"
else
    skip "lintian finds no error and nothing to warn of in it" "lintian is not installed"
fi

# ---- install and uninstall by CMake ----

everything() { (cd "$work/root" && find . "$@" | sort); }

DESTDIR=$work/root "$cmake" --install "$HIL_BINARY_DIR" --prefix /opt/hil >"$work/out" 2>&1 &&
    "$work/root/opt/hil/bin/coman-hil" check coman >"$work/out" 2>&1
result $? "an installed program finds the installed rigs wherever it is"
everything -type f >"$work/before"
touch "$work/root/opt/hil/share/coman-hil/rigs/mine.yaml"
DESTDIR=$work/root "$cmake" --build "$HIL_BINARY_DIR" --target uninstall >"$work/out" 2>&1 &&
    [ -s "$work/before" ] && [ "$(everything -type f)" = ./opt/hil/share/coman-hil/rigs/mine.yaml ]
result $? "uninstall removes every file that was installed, and no other"
rm "$work/root/opt/hil/share/coman-hil/rigs/mine.yaml"
DESTDIR=$work/root sh "$HIL_SOURCE_DIR/systemd/uninstall.sh" \
    "$HIL_BINARY_DIR/install_manifest.txt" >"$work/out" 2>&1 &&
    nothing "$(everything -type d -name '*coman-hil*')"
result $? "and the folders, when they are empty"
exit $failed
