#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# The arrow of dependencies between the folders, checked on the #include lines: who may include what,
# and that C++ stands only in contact/simbody.cpp and in tests. Prints TAP. A planted violation of
# each kind shows that the check would see one.
set -u
source=${HIL_SOURCE_DIR:-$(cd "$(dirname "$0")/../.." && pwd)}

# FOLDER: what its files may include of the tree, as extended regular expressions of whole paths.
# dynamics/ is written by the build. The planned folders that do not exist yet are checked as soon as they do.
rules='
base     base/[^/]*
contact  (base|contact)/[^/]*
canbus   (base|canbus)/[^/]*
model    (base|model|model/symbolic)/[^/]*|contact/(contact|mesh)\.h|dynamics/builtin\.inc
boards   (base|boards)/[^/]*|canbus/frame\.h|model/plant_io\.h
tasks    (base|canbus|tasks)/[^/]*|boards/[a-z]*_protocol\.h
rt       (base|contact|canbus|model|model/symbolic|boards|tasks|rt)/[^/]*
'
folders='base|contact|canbus|model|boards|tasks|rt|viewer|tests|config|systemd'

# violations ROOT: one line for each include that is not allowed
violations() {
    echo "$rules" | while read -r folder allowed; do
        [ -n "$folder" ] && [ -d "$1/$folder" ] || continue
        find "$1/$folder" -type f \( -name '*.[ch]' -o -name '*.cpp' -o -name '*.hpp' -o -name '*.cc' \) |
            while read -r file; do
                # "repository/relative.h" and <the/same.h>; a bare or ../ name is not relative to the root
                sed -n 's/^[[:space:]]*#[[:space:]]*include[[:space:]]*\(["<][^">]*\)[">].*/\1/p' "$file" |
                    while read -r include; do
                        path=${include#?}
                        case $include in
                        '<'*) echo "$path" | grep -Eq "^($folders)/" || continue ;;
                        esac
                        echo "$path" | grep -Eqx "$allowed" ||
                            echo "${file#"$1"/}: includes $path"
                    done
            done
    done
}

# foreign ROOT: C++ outside its places
foreign() {
    (cd "$1" && find . \( -name .git -o -path ./build -o -path ./tests \) -prune -o -type f \
        \( -name '*.cpp' -o -name '*.hpp' -o -name '*.cc' -o -name '*.cxx' -o -name '*.hh' \) -print) |
        sed 's|^\./||' | grep -vx 'contact/simbody\.cpp'
    true
}

number=0
failures=0
# result NAME FINDINGS: ok when there are none
result() {
    number=$((number + 1))
    if [ -z "$2" ]; then
        echo "ok $number - $1"
    else
        echo "not ok $number - $1"
        echo "$2" | sed 's/^/# /'
        failures=$((failures + 1))
    fi
}

# planted NAME FILE TEXT: a tree with just this file must be found wrong
planted() {
    tree=$(mktemp -d)
    mkdir -p "$tree/$(dirname "$2")"
    printf '%s\n' "$3" >"$tree/$2"
    if [ -n "$(violations "$tree")$(foreign "$tree")" ]; then
        result "$1" ""
    else
        result "$1" "$2 with \"$3\" was not seen"
    fi
    rm -rf "$tree"
}

echo 1..13
result folders_include_only_what_they_may "$(violations "$source")"
result cpp_stands_only_in_contact_simbody_and_tests "$(foreign "$source")"
planted base_knows_nobody base/x.c '#include "canbus/frame.h"'
planted contact_knows_no_model contact/x.h '#include "model/robot.h"'
planted canbus_knows_no_boards canbus/x.c '#include "boards/board.h"'
planted model_calls_contact_through_its_headers_only model/x.c '#include "contact/contact_private.h"'
planted boards_see_no_plant_beyond_plant_io boards/x.c '  #  include  "model/plant.h"'
planted boards_see_no_can_port boards/x.c '#include "canbus/port.h"'
planted tasks_cannot_peek_at_the_plant tasks/x.c '#include <model/plant_io.h>'
planted tasks_see_no_boards_beyond_the_protocol tasks/x.c '#include "boards/board.h"'
planted nobody_includes_tests rt/x.c '#include "tests/physics/near.h"'
planted includes_are_repository_relative model/symbolic/x.c '#include "../robot.h"'
planted cpp_elsewhere_is_seen model/x.cpp 'int x;'
exit $((failures > 0))
