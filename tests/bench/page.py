# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What the generated pages share: tables, numbers, plots, where and of what they were measured."""
import csv
import math
import os
import subprocess
import sys


def read(folder, name):
    with open(os.path.join(folder, name), newline="", encoding="utf-8") as f:
        rows = list(csv.DictReader(f))
    for row in rows:
        for key, value in row.items():
            try:
                row[key] = float(value)
            except ValueError:
                pass
    return rows


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |",
             "| --- |" + " ---: |" * (len(head) - 1)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def number(value, digits=2):
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:#.{digits}g}".rstrip(".") if value < 10 ** digits else f"{value:.0f}"


def get_machine():
    model = "unknown processor"
    with open("/proc/cpuinfo", encoding="utf-8") as f:
        for line in f:
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    return f"{model}, {os.cpu_count()} processors"


def get_commit():
    if os.environ.get("GN_COMMIT"):  # what was measured, where the tree has moved on since
        return os.environ["GN_COMMIT"]
    here = os.path.dirname(os.path.abspath(__file__))
    done = subprocess.run(["git", "-C", here, "log", "-1", "--format=%h of %cs"],
                          capture_output=True, text=True)
    return done.stdout.strip() or "unknown"


PLOT_HEAD = """
set logscale xy
set grid
set key off
set format y "%g"
set style line 100 lc rgb "#999999" dt 2 lw 1
"""


def draw(folder, name, body, size):
    for terminal, suffix in (("svg", "svg"), ("pngcairo", "png")):
        scale = f"{size[0]},{size[1]}"
        script = (f"set terminal {terminal} size {scale} font 'sans,11' background rgb 'white'\n"
                  f"set output '{os.path.join(folder, name)}.{suffix}'\n{PLOT_HEAD}{body}\nunset multiplot\n")
        done = subprocess.run(["gnuplot"], input=script, text=True, capture_output=True)
        if done.returncode:
            sys.exit(f"gnuplot, {name}.{suffix}: {done.stderr.strip()}")
