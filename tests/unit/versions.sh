#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# All files that name the program's version name the same one, and ./dev tag makes the next one of a
# clone. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$HIL_SOURCE_DIR/tests/service/tap.sh"
tap_show="$work/out"
export GIT_AUTHOR_NAME=t GIT_AUTHOR_EMAIL=t@t GIT_COMMITTER_NAME=t GIT_COMMITTER_EMAIL=t@t

echo 1..5
python3 "$HIL_SOURCE_DIR/tools/tag.py" >"$work/out" 2>&1
result $? "all files name one version"

mkdir "$work/tree" && cd "$work/tree" || exit 1
(cd "$HIL_SOURCE_DIR" && tar -cf - tools/tag.py CMakeLists.txt python/pyproject.toml CHANGELOG.md \
    examples/ros2_control/package.xml systemd/debian/changelog) | tar -xf -
git init -q . && git add . && git commit -qm begin
python3 tools/tag.py 0.0.1 >"$work/out" 2>&1
[ $? = 1 ] && grep -q "expected three numbers and more than" "$work/out"
result $? "an older version is refused"
sed -i 's/^## \[Unreleased\]$/&\n\n### Fixed\n\n- A fault./' CHANGELOG.md
python3 tools/tag.py --unsigned 99.1.0 >"$work/out" 2>&1
[ $? = 1 ] && grep -q "not committed" "$work/out"
result $? "a tree with changes is refused"
git commit -qam change && python3 tools/tag.py --unsigned 99.1.0 >"$work/out" 2>&1 &&
    [ "$(python3 tools/tag.py)" = 99.1.0 ] && [ -z "$(git status --porcelain)" ] &&
    git tag -l --format='%(contents)' v99.1.0 | grep -q '^- A fault\.$'
result $? "a version is written to all files, committed and tagged with its changes"
python3 tools/tag.py --unsigned 99.2.0 >"$work/out" 2>&1
[ $? = 1 ] && grep -q "has no changes below" "$work/out"
result $? "a version without changes is refused"
exit $failed
