# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Measures how fast the renderer is and makes the page and its plots of it.

usage: report.py DOCS PERFORMANCE [OPTION...] FOLDER
       report.py DOCS --from FOLDER

Runs PERFORMANCE with the options and FOLDER, which gets its tables, or takes those that are there. Writes
DOCS/performance.md and its SVG plots; PNG ones go to FOLDER. Nothing in them is written by hand. Needs gnuplot.
"""
import math
import os
import shutil
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, ".."))
from page import draw, get_commit, get_machine, number, read, table  # noqa: E402

BUDGET_MS = 16
GOAL_RMSE = 0.01
FRAMES = {"paper": "the paper's (quality seed)", "one-ray": "interactive, one ray a pixel",
          "interactive": "interactive as served"}
LOOPS = {"none": "virtual objects only", "first": "real objects first",
         "where-cut": "real objects where a light is cut"}
AXES = {"pixels": "pixels", "lights": "lights", "triangles": "triangles of the object", "threads": "threads"}


def count(n):
    return f"{n / 1e6:.2f} M" if n >= 1e5 else f"{n:.0f}"


def timing(row):
    return f"{number(row['ms'], 3)} ± {number(row['iqr'] / 2, 2)}"


def group(rows, key):
    found = {}
    for row in rows:
        found.setdefault(row[key], []).append(row)
    return found


def fastest(rows):
    return min(rows, key=lambda r: r["ms"])


def hardest_table(frames):
    rows = []
    for name, found in frames.items():
        ours, peers = found[0], found[2:]
        for row in found[:2]:
            rows.append([f"**{FRAMES[name]}**, camera {row['real']}", f"{row['lights']:.0f}", timing(row),
                         count(row["rays"]), f"{1e3 / row['ms']:.1f}", "", ""])
        for peer in peers:
            far = "-" if peer["off"] == "" else f"{peer['off']:.0f} ({peer['largest_code']:.0e})"
            rows.append([f"loop, {peer['loop']} outside, {LOOPS[peer['real']]}", f"{peer['lights']:.0f}",
                         timing(peer), count(peer["rays"]), f"{1e3 / peer['ms']:.1f}",
                         f"{peer['ms'] / ours['ms']:.1f}", far])
    return table(["frame", "directions", "ms", "shadow rays", "frames/s", "times slower",
                  "pixels off (most)"], rows)


def say_hardest(frames):
    lines = []
    for name, found in frames.items():
        ours, moving, peer = found[0], found[1], fastest(found[2:])
        text = (f"- {FRAMES[name][0].upper() + FRAMES[name][1:]}: **{peer['ms'] / ours['ms']:.1f} times** faster than "
                f"the fastest loop ({peer['ms'] / moving['ms']:.1f} where the camera moves), "
                f"{1e3 / ours['ms']:.1f} frames/s ({1e3 / moving['ms']:.1f}), "
                f"{100 * ours['rays'] / peer['rays']:.2g} % of its rays")
        off = [p["off"] for p in found[2:] if p["off"] != ""]
        if off:
            text += "; every pixel within 1/255" if not any(off) else f"; {max(off):.0f} PIXELS OFF"
        lines.append(text + ".")
    return lines


def rate_table(rows):
    lines = []
    names = {"embree16": "Embree's own loop, full packets made beforehand", "call": "the same rays, our packets and call",
             "pass": "the frame's shadow pass, all of it", "embree1": "Embree's own loop, single rays made beforehand"}
    for name, found in group(rows, "frame").items():
        peer = found[0]
        for row in found:
            what = names[row["what"]] if name != "naive" or row is peer else "gn_rt_is_occluded, as the naive loop calls it"
            speed, own = row["rays"] / row["ms"], peer["rays"] / peer["ms"]
            lines.append([name, what, count(row["rays"]), timing(row), f"{1e-3 * speed:.0f}",
                          f"{100 * speed / own:.0f} %"])
    return table(["frame", "what", "rays", "ms", "Mray/s", "of Embree's"], lines)


def error_table(rows):
    """For each map and scene, RMSE and ms by the number of lights."""
    pairs = {}
    for row in rows:
        pairs.setdefault((row["map"], row["scene"]), []).append(row)
    lines = []
    for (map_name, scene), found in pairs.items():
        lines.append([f"{map_name}, {scene}"] + [f"{number(r['rmse'])} in {number(r['ms'])}" for r in found])
    return table(["map, scene"] + [f"{r['asked']:.0f}" for r in next(iter(pairs.values()))], lines), pairs


def say_error(pairs):
    met, best = 0, []
    for (map_name, scene), found in pairs.items():
        within = [r for r in found if r["ms"] <= BUDGET_MS]
        row = min(within, key=lambda r: r["rmse"]) if within else None
        met += row is not None and row["rmse"] <= GOAL_RMSE
        enough = [r for r in found if r["rmse"] <= GOAL_RMSE]
        need = f"{number(min(enough, key=lambda r: r['ms'])['ms'])} ms" if enough else "more lights than tried"
        best.append([f"{map_name}, {scene}", number(row["rmse"]) if row else "-",
                     f"{row['asked']:.0f}" if row else "-", need])
    return ([f"RMSE {GOAL_RMSE} within {BUDGET_MS} ms: **{met} of {len(pairs)}** pairs.", ""]
            + table(["map, scene", f"RMSE within {BUDGET_MS} ms", "lights", f"RMSE {GOAL_RMSE} takes"], best))


def fit(points):
    """Exponent of the least-squares line through (log x, log y)."""
    xs, ys = [math.log(x) for x, _ in points], [math.log(y) for _, y in points]
    mx, my = sum(xs) / len(xs), sum(ys) / len(ys)
    return sum((x - mx) * (y - my) for x, y in zip(xs, ys)) / sum((x - mx) ** 2 for x in xs)


def scaling_tables(axes):
    lines = []
    for axis, found in axes.items():
        points = [(r["x"], r["ms"]) for r in found]
        all_of = f"{fit(points):+.2f}" if len(points) > 1 else "-"
        last = f"{fit(points[-3:]):+.2f}" if len(points) > 3 else "-"
        lines.append([AXES[axis], f"{found[0]['x']:.0f} to {found[-1]['x']:.0f}",
                      " ".join(number(r["ms"], 3) for r in found), all_of, last])
    return table(["axis", "from, to", "ms", "exponent", "of the last three"], lines)


def say_threads(found):
    if len(found) < 2:
        return "One processor: no speed-up to measure."
    first, last = found[0], found[-1]
    return f"{last['x']:.0f} threads are {first['ms'] / last['ms']:.2f} times as fast as one."


def write_points(folder, name, points):
    path = os.path.join(folder, f"{name}.dat")
    with open(path, "w", encoding="utf-8") as f:
        for numbers in points:
            f.write(" ".join(f"{v:.6g}" for v in numbers) + "\n")
    return path


def draw_scaling(folder, axes):
    body = "set multiplot layout 2,2 margins 0.09,0.97,0.09,0.94 spacing 0.10,0.16\n"
    for axis, found in axes.items():
        path = write_points(folder, f"scaling-{axis}", [(r["x"], r["ms"], max(r["ms"] - r["iqr"] / 2, 1e-3),
                                                         r["ms"] + r["iqr"] / 2) for r in found])
        points = [(r["x"], r["ms"]) for r in found]
        x, y = points[0]
        slope = 1 if axis != "threads" else -1
        title = f"{AXES[axis]}: exponent {fit(points):+.2f}" if len(points) > 1 else AXES[axis]
        low, high = x / 1.5, points[-1][0] * 1.5
        body += (f"set title '{title}'\nset xlabel '{AXES[axis]}'\nset ylabel 'ms' offset 1.5\n"
                 f"set xrange [{low}:{high}]\nset key {'right' if axis == 'threads' else 'left'} top\n"
                 f"plot {y}*(x/{x})**{slope} ls 100 title 'slope {slope}', "
                 f"'{path}' using 1:2:3:4 with yerrorlines pt 7 ps 0.6 lw 1.5 lc rgb '#1f77b4' notitle\n")
    draw(folder, "performance-scaling", body, (900, 700))


def draw_error(folder, pairs):
    colors = {"lamps": "#d62728", "overcast": "#1f77b4", "sun": "#ff7f0e"}
    parts = []
    for (map_name, scene), found in pairs.items():
        path = write_points(folder, f"error-{map_name}-{scene}", [(r["ms"], r["rmse"]) for r in found])
        parts.append(f"'{path}' with linespoints lw 1.5 ps 0.7 pt {7 if scene == 'ball' else 4} "
                     f"lc rgb '{colors[map_name]}' title '{map_name}, {scene}'")
    body = ("set xlabel 'ms, whole frame, 640 x 480'\nset ylabel 'RMSE of the shadow'\nset key right top\n"
            f"set arrow from {BUDGET_MS},graph 0 to {BUDGET_MS},graph 1 nohead dt 2 lc rgb '#666666'\n"
            f"set arrow from graph 0,first {GOAL_RMSE} to graph 1,first {GOAL_RMSE} nohead dt 2 lc rgb '#666666'\n"
            f"set xrange [*:*]\nset yrange [*:*]\nset offsets graph 0.05, graph 0.35, graph 0, graph 0\nplot {', '.join(parts)}\n")
    draw(folder, "performance-error", body, (800, 520))


def make_page(folder):
    run = read(folder, "run.csv")[0]
    frames = group(read(folder, "hardest.csv"), "frame")
    axes = group(read(folder, "scaling.csv"), "axis")
    errors, pairs = error_table(read(folder, "error.csv"))
    draw_scaling(folder, axes)
    draw_error(folder, pairs)
    with open(os.path.join(HERE, "page.md.in"), encoding="utf-8") as f:
        page = f.read()
    fields = {
        "machine": get_machine(), "commit": get_commit(), "compiler": run["compiler"],
        "threads": f"{run['threads']:.0f}", "repeats": f"{run['repeats']:.0f}",
        "hardest": hardest_table(frames), "say_hardest": say_hardest(frames),
        "rate": rate_table(read(folder, "rate.csv")), "error": errors, "say_error": say_error(pairs),
        "scaling": scaling_tables(axes), "say_threads": say_threads(axes["threads"]),
    }
    for key, value in fields.items():
        page = page.replace(f"@{key}@", "\n".join(value) if isinstance(value, list) else value)
    return page


def main():
    if len(sys.argv) < 4 or (sys.argv[2] == "--from" and len(sys.argv) != 4):
        sys.exit(__doc__)
    docs, program, folder = sys.argv[1], sys.argv[2], sys.argv[-1]
    if program != "--from":
        done = subprocess.run(sys.argv[2:])
        if done.returncode:
            sys.exit(f"{program}: exit {done.returncode}")
    page = make_page(folder)
    with open(os.path.join(docs, "performance.md"), "w", encoding="utf-8") as f:
        f.write(page)
    for name in ("performance-scaling", "performance-error"):
        shutil.copyfile(os.path.join(folder, f"{name}.svg"), os.path.join(docs, f"{name}.svg"))


main()
