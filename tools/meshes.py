#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the meshes of config/meshes as OBJ text.

    meshes.py foot-mesh coman|walkman right|left >FILE
    meshes.py terrain-mesh bump|ramp|steps|waves [OPTIONS] >FILE

Lengths are in meters. The same arguments give the same file on every machine, to the micrometer.

foot-mesh: the collision mesh of a foot in the ankle frame (origin on its axes, x forward, y left,
z up). The sole is the robot's published outline, flat. The top is assumed: flat, the outline at
4/5 of its size. The sole is a set of rings: the outline, cut into 42 pieces of nearly equal
length, then copies scaled toward its centroid with fewer and fewer points, stitched into
triangles. Springs sit at triangle centroids, so many small triangles of like size integrate the
pressure well. The triangles tile the outline. The wall has two rows, so that the centroids of the
lower one lie a centimeter above the sole: the wall stays out of a contact that is less deep. 504
triangles, as in the paper (Table 2).

terrain-mesh: ground that is not flat: a shape in the middle of a level plate (z = 0) that leads
to it and away from it; x forward, 0 where the shape begins, y left, 0 in its middle, z up. The
surface is the top of a closed solid. The plate is thick, so that contact, which takes the depth
under the nearest side, finds the top. The top is a grid of lines along x and y; each rectangle is
two triangles. Where the top is level the lines are far apart, because a tick costs by the
triangles under a foot.

Shapes, of height H and length L, s from -1 to 1 along x and t along y:

    bump   H (1 - s^2)^2 (1 - t^2)^2; steepest sideways at t = 1/sqrt(3), which with --side-slope
           gives its width (without: as wide as the plate, and 1 for the factor)
    ramp   up at --slope, level, down at the same slope
    steps  --count up and down again, all treads of one length; risers lean by 5 mm
    waves  --count of H (1 - cos)/2

--rough lifts the points of the grid by R u^2, u uniform in [0, 1): few high points among many low
ones make a few steep facets among many flat ones. Then all heights are scaled for the highest to
be H.
"""
import argparse
import math
import sys

RIM = 42  # points of a foot's outline after cutting
TOP_SCALE = 0.8
LINES_MAX = 100  # of the grid along an axis: at most 22,000 triangles
RISER_RUN = 0.005
STEEPEST = 1.5396007  # of (1 - s^2)^2: 8/(3 sqrt(3))

# Title, outline of the right sole (xy, counterclockwise from above), z of the sole and of the top
FEET = {
    "coman": ("COMAN", [
        (-0.06, -0.023), (-0.055, -0.0328), (-0.05, -0.0387), (-0.0409, -0.0434), (-0.028, -0.045),
        (0.068, -0.045), (0.082, -0.0418), (0.0952, -0.0362), (0.1081, -0.0285), (0.1186, -0.0193),
        (0.1269, -0.0045), (0.1299, 0.0071), (0.1299, 0.0206), (0.1272, 0.0308), (0.1245, 0.0349),
        (0.1183, 0.0408), (0.1055, 0.045), (-0.035, 0.045), (-0.0462, 0.0408), (-0.0559, 0.0308),
        (-0.06, 0.0192)], -0.0932, -0.03),
    "walkman": ("WALK-MAN", [  # the rectangle of 2015
        (-0.111, -0.09), (0.195, -0.09), (0.195, 0.07), (-0.111, 0.07)], -0.1435, -0.08),
}


def micrometer(x):
    """Rounds half away from zero, never to -0."""
    return math.copysign(math.floor(abs(x * 1e6) + 0.5), x) / 1e6 + 0.0


class Mesh:
    def __init__(self):
        self.vertex, self.face = [], []

    def add(self, x, y, z):
        self.vertex.append((micrometer(x), micrometer(y), z))
        return len(self.vertex) - 1

    def write(self, comments, name):
        print("# SPDX-License-Identifier: Apache-2.0", *comments, f"o {name}", sep="\n")
        for point in self.vertex:
            # The shortest decimal that reads back as the same number
            print("v", *(next(text for text in (f"{x:.{digits}g}" for digits in range(1, 18))
                              if float(text) == x) for x in point))
        for a, b, c in self.face:
            print("f", a + 1, b + 1, c + 1)


# ---- feet ----


class Foot(Mesh):
    def __init__(self, outline, sole_z, top_z):
        super().__init__()
        self.cut(outline)
        sole = self.ring(RIM, 1, sole_z)
        waist = self.ring(RIM, (1 + TOP_SCALE) / 2, (sole_z + top_z) / 2)
        top = self.ring(RIM, TOP_SCALE, top_z)

        # 42 + 2 (36 + 28 + 20 + 12 + 6) + 4 * 42 + 42 + 2 * 24 = 504 triangles
        self.fill(sole, 1, [36, 28, 20, 12, 6], sole_z, False)
        self.stitch(sole, waist, True)
        self.stitch(waist, top, True)
        self.fill(top, TOP_SCALE, [24], top_z, True)

    def cut(self, outline):
        """Cuts the outline into RIM pieces: each new point goes to the edge with the longest."""
        edges = list(zip(outline, outline[1:] + outline[:1]))
        length = [math.sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]))
                  for a, b in edges]
        pieces = [1] * len(edges)
        for _ in range(RIM - len(edges)):
            pieces[max(range(len(edges)), key=lambda e: length[e] / pieces[e])] += 1

        # Each point, and its fraction of the perimeter
        perimeter, run = 0, 0
        for part in length:
            perimeter += part
        self.rim, self.along = [], []
        for (a, b), part, count in zip(edges, length, pieces):
            for s in (p / count for p in range(count)):
                self.rim.append([a[c] + s * (b[c] - a[c]) for c in (0, 1)])
                self.along.append((run + s * part) / perimeter)
            run += part

        twice, moment = 0, [0, 0]
        for a, b in edges:
            part = a[0] * b[1] - b[0] * a[1]
            twice += part
            moment = [moment[c] + part * (a[c] + b[c]) for c in (0, 1)]
        self.centroid = [moment[c] / (3 * twice) for c in (0, 1)]

    def point(self, along):
        """The point of the cut outline at a fraction of its length."""
        i = max(i for i in range(RIM) if self.along[i] <= along)
        a, b = self.rim[i], self.rim[(i + 1) % RIM]
        s = (along - self.along[i]) / ((self.along + [1])[i + 1] - self.along[i])
        return [a[c] + s * (b[c] - a[c]) for c in (0, 1)]

    def ring(self, count, scale, z):
        """Adds the outline scaled about its centroid: its RIM points, or count evenly spaced ones.
        Returns the vertices, and where each lies along the outline."""
        along = self.along if count == RIM else [i / count for i in range(count)]
        return [self.add(*(c + scale * (p - c) for c, p in zip(self.centroid, self.point(at))), z)
                for at in along], along

    def triangle(self, a, b, c, upward):
        self.face.append((a, b, c) if upward else (a, c, b))

    def stitch(self, outer, inner, upward):
        """Fills the band between two rings: walks both, always stepping on the one behind."""
        o = i = 0

        def middle(ring, at):
            return (ring[1][at] + (ring[1] + [1])[at + 1]) / 2

        while o < len(outer[0]) or i < len(inner[0]):
            here, there = outer[0][o % len(outer[0])], inner[0][i % len(inner[0])]
            if i == len(inner[0]) or (o < len(outer[0]) and middle(outer, o) <= middle(inner, i)):
                o += 1
                self.triangle(here, outer[0][o % len(outer[0])], there, upward)
            else:
                i += 1
                self.triangle(here, inner[0][i % len(inner[0])], there, upward)

    def fill(self, outer, scale, counts, z, upward):
        """Fills a ring with smaller rings, the last of them with a fan about the centroid."""
        for r, count in enumerate(counts):
            inner = self.ring(count, scale * (len(counts) - r) / (len(counts) + 1), z)
            self.stitch(outer, inner, upward)
            outer = inner
        hub = self.add(*self.centroid, z)
        for a, b in zip(outer[0], outer[0][1:] + outer[0][:1]):
            self.triangle(a, b, hub, upward)

    def mirror(self):
        """Turns y round, and with it the sense of every triangle."""
        self.vertex = [(x, -y, z) for x, y, z in self.vertex]
        self.face = [(a, c, b) for a, b, c in self.face]


def foot_mesh(words):
    title, *shape = FEET[words.robot]
    foot = Foot(*shape)
    if words.side == "left":
        foot.mirror()
    foot.write([f"# {title}, {words.side} foot, in the ankle frame (m); made by foot-mesh, "
                "not to be edited."], f"foot_{words.side}")


# ---- ground ----


def uniform(seed, name):
    """Yields numbers in [0, 1): splitmix64 from an FNV-1a hash, as in base/random.h."""
    mask = (1 << 64) - 1

    def bits():
        nonlocal state
        state = (state + 0x9e3779b97f4a7c15) & mask
        z = (state ^ state >> 30) * 0xbf58476d1ce4e5b9 & mask
        z = (z ^ z >> 27) * 0x94d049bb133111eb & mask
        return z ^ z >> 31

    state = 0xcbf29ce484222325
    for byte in name.encode():
        state = (state ^ byte) * 0x100000001b3 & mask
    state = bits() ^ seed
    state = bits()
    while True:
        yield (bits() >> 11) * 2.0 ** -53


class Terrain(Mesh):
    def __init__(self, t, refuse):
        super().__init__()
        self.t, self.span = t, t.width
        if t.shape == "bump" and t.side_slope > 0:
            self.span = 2 * STEEPEST * t.height / math.tan(math.radians(t.side_slope))
            if self.span > t.width:
                refuse(f"--side-slope: makes the bump {self.span:g} m wide, more than --width "
                       f"{t.width:g}")
        if t.shape == "ramp" and 2 * t.height / math.tan(math.radians(t.slope)) >= t.length:
            refuse(f"--length: found {t.length:g}, expected more than the length of both slopes")
        if t.shape == "steps" and t.length < 4 * RISER_RUN * (2 * t.count - 1):
            refuse(f"--length: found {t.length:g}, too short for {t.count} steps up and down")
        self.breaks = self.find_breaks()
        self.x, self.y = self.find_lines()
        if max(len(self.x), len(self.y)) > LINES_MAX:
            refuse(f"--cell: found {t.cell:g}, too fine: the grid has room for {LINES_MAX} lines")
        self.add_top()
        self.add_walls()

    def find_breaks(self):
        """Where along the way a slope or a tread begins or ends, and the height there for H = 1."""
        t, at = self.t, [(0, 0)]
        if t.shape == "ramp":
            run = t.height / math.tan(math.radians(t.slope))
            at += [(run, 1), (t.length - run, 1)]
        if t.shape != "steps":
            return at + [(t.length, 0)]

        # The first riser begins at 0, the last ends at the length
        tread = t.length / (2 * t.count - 1)
        for step in range(2 * t.count):
            rising = step < t.count
            level = step if rising else 2 * t.count - step
            if step > 0:
                at.append((step * tread - (0 if rising else RISER_RUN), level / t.count))
            at.append((step * tread + (RISER_RUN if rising else 0),
                       (step + 1 if rising else level - 1) / t.count))
        return at

    def find_lines(self):
        t = self.t
        curved = t.rough > 0 or t.shape in ("bump", "waves")
        narrow = self.span < t.width

        def extend(line, to, fine):
            # An even number of parts no wider than a cell: a bump has its top on a line
            start = line[-1]
            parts = 2 * math.ceil((to - start) / t.cell / 2 - 1e-9) if fine else 1
            line += [start + (to - start) * i / parts for i in range(1, parts)] + [to]

        x, y = [-t.lead, 0], [-t.width / 2] + [-self.span / 2] * narrow
        for at, _ in self.breaks[1:]:
            extend(x, at, curved)
        extend(x, t.length + t.lead, False)
        extend(y, self.span / 2, t.rough > 0 or (t.shape == "bump" and t.side_slope > 0))
        if narrow:
            extend(y, t.width / 2, False)
        return x, y

    def height(self, x, y):
        """The height of the shape, for H = 1."""
        t = self.t

        def bump(s):
            return (1 - s * s) * (1 - s * s)

        if t.shape == "bump":
            across = bump(2 * y / self.span) if t.side_slope > 0 else 1
            return bump(2 * x / t.length - 1) * across
        if t.shape == "waves":
            return (1 - math.cos(2 * math.pi * t.count * x / t.length)) / 2
        i = 1
        while i + 1 < len(self.breaks) and self.breaks[i][0] <= x:
            i += 1
        (x0, z0), (x1, z1) = self.breaks[i - 1], self.breaks[i]
        return z0 + (z1 - z0) * (x - x0) / (x1 - x0)

    def add_top(self):
        t, random, points = self.t, uniform(self.t.seed, "terrain"), []
        for i, x in enumerate(self.x):
            for y in self.y:
                u = next(random)
                inside = 1 < i < len(self.x) - 2 and x < t.length and (
                    self.span == t.width or abs(y) < self.span / 2 - 1e-9)
                z = t.height * self.height(x, y) + t.rough * u * u if inside else 0
                points.append((x, y, z))
        highest = max(z for _, _, z in points)
        for x, y, z in points:
            self.add(x, y, micrometer(z * (t.height / highest)))

        # Which way a rectangle is cut alternates, so that no direction is preferred
        for i in range(len(self.x) - 1):
            for j in range(len(self.y) - 1):
                a = i * len(self.y) + j
                b, c, d = a + len(self.y), a + len(self.y) + 1, a + 1
                self.face += [(a, b, c), (a, c, d)] if (i + j) % 2 == 0 else [(a, b, d), (b, c, d)]
        self.ntop = len(self.face)

    def add_walls(self):
        """Adds walls down from the rim of the top, counterclockwise from above, and the bottom."""
        nx, ny = len(self.x), len(self.y)
        top = [i * ny for i in range(nx - 1)] + [(nx - 1) * ny + j for j in range(ny - 1)]
        top += [i * ny + ny - 1 for i in range(nx - 1, 0, -1)] + list(range(ny - 1, 0, -1))
        bottom = micrometer(-self.t.depth)
        low = [self.add(*self.vertex[v][:2], bottom) for v in top]
        middle = self.add(self.t.length / 2, 0, bottom)
        for i in range(len(top)):
            k = (i + 1) % len(top)
            self.face += [(low[i], low[k], top[k]), (low[i], top[k], top[i]),
                          (low[k], low[i], middle)]

    def slopes(self):
        """The slopes that half and 90 % of the shape's area do not exceed, and the largest; deg."""
        facets = []
        for face in self.face[:self.ntop]:
            a, b, c = (self.vertex[v] for v in face)
            u, v = ([q - p for p, q in zip(a, end)] for end in (b, c))
            n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
            if 0 < sum(p[0] for p in (a, b, c)) / 3 < self.t.length and (
                    abs(sum(p[1] for p in (a, b, c)) / 3) < self.span / 2):
                facets.append((math.degrees(math.atan2(math.hypot(n[0], n[1]), n[2])), n[2]))
        facets.sort()
        area, run, found = sum(part for _, part in facets), 0, [facets[0][0]] * 2
        for slope, part in facets:
            run += part
            found = [slope if run <= share * area else old
                     for share, old in zip((0.5, 0.9), found)]
        return *found, facets[-1][0]


def number(low, high, of=float):
    def read(text):
        value = of(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"found {text}, expected {low:g} to {high:g}")
        return value
    return read


def main():
    main_parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = main_parser.add_subparsers(dest="kind", required=True)
    foot = kinds.add_parser("foot-mesh", help="the collision mesh of a foot")
    foot.add_argument("robot", choices=FEET)
    foot.add_argument("side", choices=("right", "left"))
    shapes = kinds.add_parser("terrain-mesh", help="ground that is not flat").add_subparsers(
        dest="shape", required=True)
    for name in ("bump", "ramp", "steps", "waves"):
        shape = shapes.add_parser(name, allow_abbrev=False,
                                  formatter_class=argparse.ArgumentDefaultsHelpFormatter)
        for option, default, low, high, text in (
                ("--height", 0.03, 0.001, 1, "of the highest point, m"),
                ("--length", 1.6, 0.1, 20, "of the shape, along x, m"),
                ("--width", 6, 0.1, 20, "of the plate, along y, m"),
                ("--lead", 3, 0.1, 20, "level plate before and behind the shape, m"),
                ("--depth", 0.4, 0.05, 5, "of the plate's bottom, m"),
                ("--rough", 0, 0, 0.2, "lift points at random by up to so much, m"),
                ("--cell", 0.1, 0.005, 1, "largest cell of what is curved or rough, m")):
            shape.add_argument(option, type=number(low, high), default=default, help=text)
        shape.add_argument("--seed", type=number(0, 1e9, int), default=0, help="of --rough")
    shapes.choices["bump"].add_argument(
        "--side-slope", type=number(0, 45), default=0,
        help="steepest slope sideways of the smooth shape, deg; 0: as wide as the plate")
    shapes.choices["ramp"].add_argument("--slope", type=number(0.5, 45), default=5,
                                        help="up and down, deg")
    for name in ("steps", "waves"):
        shapes.choices[name].add_argument("--count", type=number(1, 20, int), default=3,
                                          help=f"{name} up" if name == "steps" else name)
    words = main_parser.parse_args()
    if words.kind == "foot-mesh":
        foot_mesh(words)
        return
    terrain = Terrain(words, shapes.choices[words.shape].error)
    half, most, all_ = terrain.slopes()
    terrain.write([f"# Ground (m), not to be edited; made by: {' '.join(sys.argv[1:])}",
                   f"# {len(terrain.face)} triangles; slopes of half of the shape up to {half:.1f} "
                   f"deg, of 90 % up to {most:.1f}, of all up to {all_:.1f}."], "terrain")


if __name__ == "__main__":
    main()
