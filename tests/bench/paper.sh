#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: paper.sh COMAN-HIL-BENCH
# The report of bench paper, made in its short form: every table and figure is there, HTML and SVG
# are well formed, numbers are those of an independent calculation, none is missing. Times are
# looked at for their order of magnitude at most. Prints TAP.
set -u
program=$1
source=${HIL_SOURCE_DIR:?}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$source" || exit 1

module=()
[ -e "${HIL_BINARY_DIR:?}/tests/libhil-peers.so" ] &&
    module=(--peers "$HIL_BINARY_DIR/tests/libhil-peers.so")
"$program" paper --quick --out "$work/report" "${module[@]}" >"$work/out" 2>"$work/err" </dev/null
echo $? >"$work/status"
"$program" paper --quick -o /dev/null/report >"$work/refused" 2>&1 </dev/null
echo $? >>"$work/refused"

PYTHONPATH=$HIL_SOURCE_DIR/tests/service:$HIL_SOURCE_DIR/tools PYTHONDONTWRITEBYTECODE=1 \
    python3 - "$work" "$source" <<'END'
import csv, html.parser, math, os, re, sys, xml.etree.ElementTree as xml

from figures import hold
from tap import check

work, source = sys.argv[1:]
report = work + "/report/"


def read(name):
    with open(report + name) as file:
        return file.read()


def table(name):
    with open(report + name, newline="") as file:
        return list(csv.DictReader(file))


class Page(html.parser.HTMLParser):
    """Remembers ids, links and elements that were closed in the wrong order."""

    VOID = {"meta", "link", "br", "hr"}

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.faults, self.outside = [], [], [], [], []

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if "id" in given:
            self.ids.append(given["id"])
        if given.get("href", "").startswith("#"):
            self.links.append(given["href"][1:])
        self.outside += [v for k, v in given.items() if k in ("src", "href")
                         and not v.startswith("#")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        self.open.pop()

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.faults.append((tag, self.getpos()))


print("1..16")
status = open(work + "/status").read().strip()
said = open(work + "/err").read().strip()[-300:].replace("\n", " ")
check(status == "0" and open(work + "/out").read().endswith("/index.html\n"), "the report is made",
      f"{status} {said}")
if status != "0":
    sys.exit(1)

text = read("index.html")
page = Page()
page.feed(text)
page.close()
check(not page.faults and not page.open, "the page closes what it opens",
      f"{page.faults[:3]} {page.open[:3]}")
check(len(set(page.ids)) == len(page.ids) and set(page.links) <= set(page.ids) and not page.outside,
      "its names are unique, its links lead somewhere, and it needs no other file",
      f"{len(page.ids)} names, {len(page.links)} links, {page.outside[:3]}")

figures = {3: 2, 4: 1, 9: 4, 10: 4, 11: 2, 12: 4}
tables = ("table-1", "table-2", "real-time-factors", "accelerations", "table-1-speed",
          "choices-made", "not-reproduced")
missing = [f"figure-{n}" for n in figures if f"figure-{n}" not in page.ids
           or not table(f"figure-{n}.csv")]
missing += [name for name in tables if name not in page.ids or not table(name + ".csv")]
check(not missing, "every table and figure is on the page and in a file", missing)

plots = re.findall(r"<svg.*?</svg>", text, re.S)
bad = []
for n, count in figures.items():
    for panel in range(1, count + 1):
        try:
            root = xml.fromstring(read(f"figure-{n}-{panel}.svg"))
        except (OSError, xml.ParseError) as fault:
            bad.append(f"{n}-{panel}: {fault}")
            continue
        labels = [e.text for e in root.iter("{http://www.w3.org/2000/svg}text")]
        lines = [e for e in root.iter("{http://www.w3.org/2000/svg}path")
                 if e.get("class") == "line"]
        if len(labels) < 6 or not lines:
            bad.append(f"{n}-{panel}: {len(labels)} labels, {len(lines)} lines")
for plot in plots:
    xml.fromstring(plot)
check(not bad and len(plots) == sum(figures.values()), "plots are XML with labels and lines",
      f"{len(plots)} plots; {bad}")

words = re.sub(r"<style>.*?</style>", "", text, flags=re.S)
nan = re.findall(r"[^>]{0,40}\b(?:nan|inf)\b[^<]{0,40}", words, re.I)
check(not nan, "no number is missing", nan[:3])

# figure N as {(panel, series): [(x, y)]}
def curves(n):
    found = {}
    for row in table(f"figure-{n}.csv"):
        found.setdefault((row["panel"], row["series"]),
                         []).append((float(row["x"]), float(row["y"])))
    return found


findings = {row["quantity"]: row for row in table("compared.csv")}


def here(beginning):
    row = next(r for q, r in findings.items() if q.startswith(beginning))
    return [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", row["here"])]


# Table 1: the paper's own errors bound ours; ODE's are those of its method, within a factor of
# three
rows = table("table-1.csv")
ours = [r for r in rows if r["program"].startswith("coman-hil")]
limit = {"0.01": 3e-8, "0.0001": 1e-13}
check(len(ours) == 4 and all(0 < float(r["energy error"]) <= limit[r["dt"]] for r in ours),
      "energy errors of the pendulums are within the paper's", [r["energy error"] for r in ours])
lines = read("table-1.csv").splitlines()
theirs = [l.split(",") for l in lines if "paper: ODE" in l]
check(all(1 / 3 < float(l[5]) / float(l[6]) < 3 for l in theirs) and len(theirs) in (0, 4),
      "those of ODE are the paper's within a factor of three", [(l[5], l[6]) for l in theirs])



# where the paper's errors come from: the same motion by plain Runge-Kutta on the equation of motion
# in closed form, inertia a'' = -moment sin a, without our plant and its compensated sums
def swing(bodies, weights, inner, dt, units, visit):
    inertia, moment = ((6.5, 1.0), (49.0, 10.0))[bodies - 1]
    angle, rate = 0.0, 2.1
    for k in range(round(units / dt)):
        rates, pulls = [], []
        for row in inner:
            at = angle + dt * sum(a * r for a, r in zip(row, rates))
            rates.append(rate + dt * sum(a * p for a, p in zip(row, pulls)))
            pulls.append(-moment / inertia * math.sin(at))
        before = angle
        angle += dt * sum(w * r for w, r in zip(weights, rates))
        rate += dt * sum(w * p for w, p in zip(weights, pulls))
        visit(k, before, angle, 0.5 * inertia * rate * rate - moment * math.cos(angle))
    return 0.5 * inertia * 2.1 * 2.1 - moment


KUTTA_3 = (1 / 6, 2 / 3, 1 / 6), ((), (0.5,), (-1.0, 2.0))
RK4 = (1 / 6, 1 / 3, 1 / 3, 1 / 6), ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0))


def energy_error(bodies, method, dt):
    energies = []
    start = swing(bodies, *method, dt, 10.0, lambda k, before, angle, e: energies.append(e))
    return max(abs((e - start) / e) for e in energies)


ends = [0.0]


def note_end(k, before, angle, energy):
    goal = 2 * math.pi * len(ends)
    if angle >= goal:
        ends.append(0.01 * (k + (goal - before) / (angle - before)))


swing(2, *RK4, 0.01, 300.0, note_end)
mean, other = 1.0, math.sqrt(1 - 4 * (5 / 24.5) / 2.1**2)  # of the elliptic integral, by agm
for _ in range(8):
    mean, other = (mean + other) / 2, math.sqrt(mean * other)
period = 4 * math.pi / (2 * mean) / 2.1
linear = max(abs(b - a - period) for a, b in zip(ends, ends[1:]))
third = [energy_error(n, KUTTA_3, 0.01) for n in (1, 2)]
plain = [energy_error(n, RK4, 1e-4) for n in (1, 2)]
check(["%.1e" % e for e in third] == ["2.0e-08", "3.5e-08"] and "%.1e" % linear == "6.0e-09"
      and all(1e-14 < e < 2e-13 for e in plain),
      "plain methods give the paper's 3e-8, 1e-13 and 5e-9", f"{third} {plain} {linear}")

# Fig. 10: Newton's laws on a box of 1.5 kg; the touch where the paper has it
box = curves(10)[("1", "implicit, 1 ms")]
touch = here("wrists touch")[0]
before = [y for x, y in box if -0.1 < x < touch]  # the box has come to rest on the table
check(abs(touch - 1.06) < 0.06 and all(abs(y - 1.5 * 9.81) < 0.01 for y in before),
      "the table carries 14.715 N until the wrists touch the box at 1.06 s",
      f"{touch} s, {min(before):.4f} to {max(before):.4f} N")
held = [y for x, y in box if x > box[-1][0] - 0.3]
check(abs(sum(held) / len(held) - 14.715) < 0.2 and here("the box rises")[0] > 30,
      "the box hangs between the wrists, lifted",
      f"{sum(held) / len(held):.3f} N, {here('the box rises')} mm")

# forces of the feet: the robots' masses, added up from their files
def mass(file, names=None):
    body = re.search(r"^bodies:\n(.*?)(?=^\w)", open(f"{source}/config/robots/{file}.yaml").read(),
                     re.M | re.S).group(1)
    return sum(float(m) for m in re.findall(r"mass_kg: ([0-9.eE+-]+)", body))


weight = mass("walkman") * 9.81
feet, off = here("both feet, standing")[0], here("both feet less m")[0]
check("of regularized friction, 2 mm/s" in text, "the paper's friction is kept")
check(abs(feet / weight - 1) < 0.005 and off < 0.002 * weight,
      "WALK-MAN's feet carry its weight, and m (g + a) when it moves",
      f"{feet} N of {weight:.1f}, {off} N RMS")
depth, knee, hip = here("depth"), here("knee torque"), here("hip, error")[0]
check(abs(depth[0] - 300) < 10 and 40 < knee[0] < 60 and 110 < knee[1] < 140 and hip < 10,
      "it squats 30 cm deep, hips tracked, knees loaded as statics ask for",
      f"{depth} mm, {knee} N m, {hip} mrad")

refused = open(work + "/refused").read()
stiff, soft = here("grasping force at the end")[0], here("the same, elbows")[0]
measured = {
    "period": here("period from")[0], "period_error": here("largest error of the period")[0],
    "grasp_before_n": here("vertical force on the box before")[0], "touch_s": touch,
    "stiff_elbow_n": stiff, "soft_elbow_n": soft, "walkman_knee_nm": knee[1],
    "walkman_feet_n": feet, "walkman_feet_off_n": off}
for number, dt in (("1", "0.01"), ("1", "0.0001"), ("2", "0.01"), ("2", "0.0001")):
    measured[f"pendulum_{number}_{dt[2:]}"] = next(
        float(r["energy error"]) for r in ours if r["bodies"] == number and r["dt"] == dt)
stale = [name for name, value in measured.items() if not hold(name, value)]
check(not stale, "docs/figures.csv has the figures of the report", stale)
check(stiff > 5 * soft > 0 and "/dev/null/report" in refused and refused.split()[-1] == "3",
      "soft elbows press less; a folder that cannot be made is an error",
      f"{stiff} N, {soft} N; {refused.strip()}")
END
