#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: package.sh CPACK
# The Debian package python3-coman-hil, unpacked beside that of the program: what is imported from
# there drives the program from there. Prints TAP.
set -u
cpack=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$HIL_SOURCE_DIR/tests/service/tap.sh"
tap_show="$work/out"

for program in dpkg-deb dpkg-shlibdeps; do
    if ! command -v "$program" >/dev/null; then
        echo "1..0 # SKIP $program is not installed (Debian package dpkg-dev)"
        exit 0
    fi
done
if ! /usr/bin/python3 -c 'import can, canmatrix' 2>/dev/null; then
    echo "1..0 # SKIP python-can or canmatrix is not installed (python3-can, python3-canmatrix)"
    exit 0
fi
echo 1..6
"$cpack" --config "$HIL_BINARY_DIR/CPackConfig.cmake" -G DEB -B "$work" >"$work/out" 2>&1
deb=$(echo "$work"/python3-coman-hil_*_all.deb)
[ -s "$deb" ]
result $? "the package is built"

dpkg-deb -I "$deb" >"$work/out"
field() { dpkg-deb -f "$deb" "$1"; }
depends=$(field Depends)
[ "$(field Package)" = python3-coman-hil ] && [ "$(field Architecture)" = all ] &&
    [ "$(field Suggests)" = python3-pytest ] && [ -z "$(field Recommends)" ] &&
    [ "$(field Version)" = "$(dpkg-deb -f "$work"/coman-hil_*.deb Version)" ] &&
    [ "$depends" = "coman-hil (= $(field Version)), python3 (>= 3.9), python3-can (>= 4), \
python3-canmatrix" ]
result $? "it names what it needs" "$depends"

dpkg-deb -e "$deb" "$work/control"
for script in postinst prerm; do
    { [ -x "$work/control/$script" ] && grep -q '^set -e$' "$work/control/$script" &&
        sh -n "$work/control/$script"; } || echo "$script"
done >"$work/out" 2>&1
[ ! -s "$work/out" ] && [ ! -e "$work/control/postrm" ]
result $? "it has its own maintainer scripts, and not those of the service"

for package in "$work"/*.deb; do
    dpkg-deb -x "$package" "$work/root"
done
dpkg-deb -c "$deb" | awk '
    $1 !~ /^d/ && $6 !~ /^\.\/usr\/lib\/python3\/dist-packages\/coman_hil\/[a-z_]+\.py$/ &&
    $6 != "./usr/share/doc/python3-coman-hil" || $2 != "root/root" ||
    $1 !~ /^(drwxr-xr-x|-rw-r--r--|lrwxrwxrwx)$/' >"$work/out"
[ ! -s "$work/out" ] && [ -s "$work/root/usr/share/doc/python3-coman-hil/NOTICE" ]
result $? "it has modules and a link to the notices of the program, nothing else"

cat >"$work/elbow.py" <<'EOF'
import coman_hil
assert coman_hil.__file__.startswith(__import__("sys").argv[1]), coman_hil.__file__
with coman_hil.Simulator("coman-fd", hold="always") as sim:
    sim.enable("LElbj")
    sim.joints["LElbj"].voltage_v = 2
    sim.step(50)
    assert sim.joints["LElbj"].current_a > 0.1
EOF
(cd "$work" && unset COMAN_HIL && PATH="$work/root/usr/bin:/usr/bin:/bin" \
    PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=$work/root/usr/lib/python3/dist-packages \
    timeout -k 5 60 /usr/bin/python3 elbow.py "$work/root") >"$work/out" 2>&1 </dev/null
result $? "what is installed starts the installed program, by the name of an installed rig"

# The prefix of whoever installs from the source
DESTDIR=$work/local "${cpack%cpack}cmake" --install "$HIL_BINARY_DIR" --prefix /usr/local \
    --component python >"$work/out" 2>&1
folder=$(cd "$work/local" && find usr/local -name coman_hil)
/usr/bin/python3 -c 'import site, sys; sys.exit(sys.argv[1] not in site.getsitepackages())' \
    "/${folder%/coman_hil}" >>"$work/out" 2>&1
result $? "below /usr/local it is where python3 looks"
exit $failed
