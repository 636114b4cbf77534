#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Compares the wake-ups of soak_realtime with those of cyclictest. Reads NAME-N.ours and
NAME-N.cyclictest of a directory, whose runs were made together and in turns, prints both side by
side, and writes histogram.csv. For realtime.sh.

    realtime.py DIRECTORY

Both latencies are from the absolute deadline to the first look at the clock after the sleep.
cyclictest cuts them off to microseconds; ours are rounded up by at most 1/64 (rt/histogram.h), then
cut off to half a microsecond.
"""

import collections
import os
import re
import sys

COUNTS = ("ticks", "overruns", "overruns_wait", "lost_ticks", "page_faults")


class Latencies:
    """Counts by half microseconds, merged from several runs."""

    def __init__(self):
        self.bins = collections.Counter()
        self.max_us = 0.0

    def add(self, microseconds, count):
        self.bins[int(2 * microseconds)] += count

    def percentile(self, fraction):
        """Nearest rank: the bin in which it lies."""
        rank, seen = fraction * self.bins.total(), 0
        for half, count in sorted(self.bins.items()):
            seen += count
            if seen >= rank:
                return half / 2
        return self.max_us

    def row(self, name):
        shares = [self.percentile(fraction) for fraction in (0.5, 0.99, 0.999)]
        columns = "".join(f" {value:9.1f}" for value in shares + [self.max_us])
        return f"  {name:22} {self.bins.total():9}{columns}"


class Tally:
    """All runs of a name."""

    def __init__(self, directory, name):
        self.ours, self.theirs = Latencies(), Latencies()
        self.counts = collections.Counter()
        self.runs = 0
        while os.path.exists(path := os.path.join(directory, f"{name}-{self.runs}.ours")):
            self.read_ours(path)
            self.read_theirs(os.path.join(directory, f"{name}-{self.runs}.cyclictest"))
            self.runs += 1
        if not self.runs:
            raise ValueError(f"there are no runs {name}")

    def read_ours(self, path):
        """Reads lines "# name value", then "upper edge in ns, count"."""
        for line in open(path, encoding="ascii"):
            if match := re.match(r"# (\w+) (\d+)", line):
                name, value = match[1], int(match[2])
                self.counts[name] += value
                if name == "max_ns":
                    self.ours.max_us = max(self.ours.max_us, value / 1e3)
            else:
                edge, count = line.split()
                self.ours.add(int(edge) / 1e3, int(count))

    def read_theirs(self, path):
        """Reads lines "us count" and comments of cyclictest -h, whose counts must agree."""
        total, found = 0, 0
        for line in open(path, encoding="ascii"):
            if match := re.match(r"(\d+) (\d+)", line):
                self.theirs.add(int(match[1]), int(match[2]))
                found += int(match[2])
            elif match := re.match(r"# (Total|Max Latencies|Histogram Overflows): (\d+)", line):
                value = int(match[2])
                if match[1] == "Total":
                    total = value
                elif match[1] == "Max Latencies":
                    self.theirs.max_us = max(self.theirs.max_us, value)
                else:
                    self.theirs.add(10 * self.theirs.max_us + 1e6, value)
        if found != total or found == 0:
            raise ValueError(f"the counts of {path} disagree")

    def ratio(self):
        theirs = self.theirs.percentile(0.99)
        return self.ours.percentile(0.99) / theirs if theirs else 0.0

    def show(self, name):
        heads = "".join(f" {head:>9}" for head in ("count", "p50", "p99", "p99.9", "max"))
        print(f"{name}, {self.runs} runs\n  {'wake-up latency, us':22}{heads}")
        print(self.ours.row("coman-hil"))
        print(self.theirs.row("cyclictest"))
        ticks, overruns, by_wait, lost, faults = (self.counts[count] for count in COUNTS)
        print(
            f"  ratio of p99 {self.ratio():.2f}; {ticks} ticks, {overruns} overruns, {by_wait} of"
            f" them by a late wake-up, {lost} deadlines dropped, {faults} page faults"
        )


def main():
    directory = sys.argv[1]
    tallies = {name: Tally(directory, name) for name in ("together", "alternating")}
    with open(os.path.join(directory, "histogram.csv"), "w", encoding="ascii") as csv:
        csv.write("runs,latency_us,coman_hil,cyclictest\n")
        for name, tally in tallies.items():
            tally.show(name)
            for half in sorted(tally.ours.bins | tally.theirs.bins):
                counts = tally.ours.bins[half], tally.theirs.bins[half]
                csv.write(f"{name},{half / 2:.1f},{counts[0]},{counts[1]}\n")
    together, alternating = tallies.values()
    print(
        f"soak: wake-up p99 {together.ours.percentile(0.99):.1f} us, cyclictest's in the same run"
        f" {together.theirs.percentile(0.99):.1f} us: ratio {together.ratio():.2f}"
        f" ({alternating.ratio():.2f} when alternating), wanted at most 1.30;"
        f" {sum(tally.counts['overruns'] for tally in tallies.values())} overruns in"
        f" {sum(tally.counts['ticks'] for tally in tallies.values())} ticks"
    )


if __name__ == "__main__":
    main()
