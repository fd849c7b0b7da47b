# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Makes the page and its plots of what error_time measured. Nothing in them is written by hand.

usage: report.py FOLDER GNOMOND [DOCS]

FOLDER holds the tables of error_time; plots.svg and plots.png files and page.md go there. GNOMOND is the
daemon's program: it is asked for its default method. With DOCS (the tree's docs folder) the page goes to
DOCS/error.md and the SVG plots beside it. Needs gnuplot.
"""
import os
import re
import shutil
import statistics
import subprocess
import sys

import tables
from curves import UNKNOWN, Curves, geometric_mean
from page import draw, get_commit, get_machine, number, table

BUDGETS_MS = [16, 24, 32, 48, 64, 128]
LEVELS = [0.05, 0.02, 0.01]
PLOT_MAPS = ["lamps", "sun", "overcast", "rig"]
BASE = "the paper's partition"
LITERAL = "8x24 maxLS=8 2^k mean of samples"


def ratio(value):
    return "-" if value is None else f"{value:.1f}" if value < 10 else f"{value:.0f}"


def quartiles(values):
    first, _, third = statistics.quantiles(values, n=4, method="inclusive")
    return first, third


def spread(pair):
    return f"{number(pair[0])} to {number(pair[1])}"


def front_table(curves):
    rows = []
    for budget in BUDGETS_MS:
        ranked = sorted((curves.mean_error_at_time(m, budget), m) for m in curves.methods
                        if curves.mean_error_at_time(m, budget) is not None)
        base = curves.mean_error_at_time(BASE, budget)
        if not ranked:
            rows.append([f"{budget}", "none", "-", "-", "-"])
            continue
        second = ranked[1] if len(ranked) > 1 else None
        best_error, best = ranked[0]
        rows.append([f"{budget}", f"**{best}**", 
                     f"{number(best_error)} ({spread(quartiles(curves.errors_at_time(best, budget)))})",
                     f"{second[1]}, {number(second[0])}" if second else "-", number(base)])
    return table(["ms", "lowest error", "RMSE (quartiles)", "second", BASE], rows)


def equal_time_table(curves):
    rows = []
    for method in curves.methods:
        cells = []
        for budget in BUDGETS_MS:
            ratios = curves.error_ratios(method, BASE, budget)
            cells.append(f"{ratio(geometric_mean(ratios))} ({ratio(min(ratios))})" if ratios else "-")
        rows.append([method] + cells)
    return table(["method"] + [f"{b} ms" for b in BUDGETS_MS], rows)


def equal_error_table(curves):
    rows = []
    for method in curves.methods:
        cells = []
        for level in [0.1] + LEVELS:
            ratios, base_never, never = curves.time_ratios(method, BASE, level)
            text = f"{ratio(geometric_mean(ratios))} ({ratio(min(ratios))})" if ratios else "-"
            if base_never:
                text += f", +{base_never}"
            if never:
                text += f", -{never}"
            cells.append(text)
        rows.append([method] + cells)
    return table(["method"] + [f"RMSE {level:g}" for level in [0.1] + LEVELS], rows)


def lights_table(curves):
    rows = []
    for method in curves.methods + [BASE]:
        cells = []
        for map_name in curves.maps:
            needed = [curves.lights_for(method, map_name, level) for level in LEVELS]
            cells.append(" / ".join("-" if n is None else "?" if n is UNKNOWN else f"{n:.0f}" for n in needed))
        rows.append([method] + cells)
    return table(["method"] + curves.maps, rows)


def same_lights_table(curves):
    """At 64 and at 256 lights."""
    rows = []
    for method in curves.methods:
        cells = []
        for map_name in curves.maps:
            parts = []
            for n in (64, 256):
                ratios = curves.same_lights_ratios(method, BASE, map_name, n)
                parts.append(ratio(geometric_mean(ratios)) if ratios else "-")
            cells.append(" / ".join(parts))
        rows.append([method] + cells)
    return table(["method"] + curves.maps, rows)


def literal_table(curves):
    """Against the paper's own numbers where it gives them, at no more lights."""
    rows = []
    for method in curves.methods:
        cells = []
        for map_name in curves.maps:
            ratios = curves.literal_ratios(method, LITERAL, map_name)
            cells.append(ratio(geometric_mean(ratios)) if ratios else "-")
        rows.append([method] + cells)
    lights = ["its lights"]
    for map_name in curves.maps:
        lights.append(f"{curves.literal_row(LITERAL, 'ball', map_name)['lights']:.0f}")
    return table(["method"] + curves.maps, [lights] + rows)


def irradiance_tables(curves, harmonics):
    rows = []
    for method in curves.methods:
        rows.append([method] + [number(curves.irradiance_at(method, m, 64)) for m in curves.maps])
    kinds = list(dict.fromkeys(r["harmonics"] for r in harmonics))
    for kind in kinds:
        found = {r["map"]: r["irradiance"] for r in harmonics if r["harmonics"] == kind}
        rows.append([f"harmonics, {kind}"] + [number(found.get(m)) for m in curves.maps])
    return table(["method"] + curves.maps, rows)


def still_table(curves, n):
    rows = []
    for method in curves.methods + [BASE]:
        row = curves.mean_row(method, n)
        if row:
            rows.append([method, f"{row['lights']:.0f}", number(row["rmse"]),
                         f"{row['bias']:+.1e}", number(row["relmse_trimmed"]),
                         number(row["relmse"]), number(row["flip"]), number(row["ms_light"]),
                         number(row["ms_frame"]), f"{row['rays'] / 1e3:.0f}"])
    return table(["method", "lights", "RMSE", "bias", "relMSE, trimmed", "untrimmed", "FLIP",
                  "ms to lights", "ms frame", "1000 rays"], rows)


def stream_table(stream):
    rows = []
    for s in stream:
        name = s["method"] if s["method"] not in tables.BASELINE else f"{s['method']}, {s['params']}"
        rows.append([name, f"{s['lights']:.0f}", f"{s['smoothing']:g}", number(s["flicker"]),
                     number(s["noise_codes"]), f"{s['response_frames']:.0f}"])
    return table(["method", "lights", "filter s", "flicker F", "noise, codes", "frames to 90 %"], rows)


def reference_table(curves, reference):
    rows = []
    for r in reference:
        rows.append([r["map"], r["scene"], f"{r['self_error']:.1e}",
                     f"{curves.count_too_near(r['scene'], r['map'])} of "
                     f"{curves.count_all(r['scene'], r['map'])}"])
    return table(["map", "scene", "reference within", "settings too near to judge"], rows)


def read_default(gnomond):
    """(method, lights) that the daemon takes where its configuration names none."""
    text = subprocess.run([gnomond, "--print-config"], capture_output=True, text=True,
                          check=True).stdout
    return (re.search(r"^#?light-method = (\S+)$", text, re.M)[1],
            int(re.search(r"^#?lights = (\d+)$", text, re.M)[1]))


def rank(curves, stream, default, ms):
    """Methods by mean error within that time, with what their light does in a stream."""
    filtered = {r["method"]: r for r in stream if r["smoothing"] > 0}
    ranked = []
    for method in curves.methods:
        errors = curves.errors_at_time(method, ms)
        if errors is None:
            continue
        ratios = curves.error_ratios(default, method, ms)  # of the method's over the default's
        ranked.append({"method": method, "error": geometric_mean(errors), "quartiles": quartiles(errors),
                       "ratio": geometric_mean(ratios), "ratios": quartiles(ratios),
                       "wins": sum(r < 1 for r in ratios), "flicker": filtered[method]["flicker"],
                       "frames": filtered[method]["response_frames"]})
    return sorted(ranked, key=lambda r: r["error"])


def is_on_front(row, ranked):
    """No other has less error and less flicker and answers as soon."""
    return not any(o["error"] < row["error"] and o["flicker"] < row["flicker"]
                   and o["frames"] <= row["frames"] for o in ranked)


def find_knee(ranked):
    """Of the quickest to answer, the least product: error / a costs flicker * a or more."""
    quickest = min(r["frames"] for r in ranked)
    return min((r for r in ranked if r["frames"] == quickest),
               key=lambda r: r["error"] * r["flicker"])


def choice_table(ranked, n_pairs):
    knee = find_knee(ranked)
    rows = []
    for r in ranked:
        name = r["method"] + (" (front)" if is_on_front(r, ranked) else "")
        rows.append([f"**{name}**" if r is knee else name,
                     f"{number(r['error'])} ({spread(r['quartiles'])})",
                     f"{r['ratio']:.2f} ({r['ratios'][0]:.2f} to {r['ratios'][1]:.2f})",
                     f"{r['wins']} of {n_pairs}", number(r["flicker"], 3), f"{r['frames']:.0f}",
                     number(r["error"] * r["flicker"], 3)])
    return table(["method", "RMSE (quartiles)", "over the default's", "less than it in", "flicker F",
                  "frames to 90 %", "RMSE · F"], rows)


def compare(row, own):
    """What a method's error is beside the default's, in words."""
    if row is own:
        return "is the default itself"
    low, high = row["ratios"]
    text = f"has {row['ratio']:.2f} times the default's error (quartiles {low:.2f} to {high:.2f}"
    return text + (": a tie within the spread)" if low <= 1 <= high else ")")


def say_choice(curves, ranked, default, n):
    own = next(r for r in ranked if r["method"] == default)
    first, knee = ranked[0], find_knee(ranked)
    lines = [f"- By error alone **{first['method']}** leads: it {compare(first, own)} and F = "
             f"{number(first['flicker'], 3)}. For single pictures (`gnomon-render`), where nothing can "
             "flicker, that or the table above is the one to go by.",
             f"- By the rule **{knee['method']}** leads: it {compare(knee, own)} and F = "
             f"{number(knee['flicker'], 3)}."]
    steady = ", ".join(r["method"] for r in ranked if r["flicker"] < 1) or "none"
    row, base = curves.mean_row(default, n), curves.mean_row(BASE, n)
    lines.append(f"- The daemon's default is **{default}** with {n} lights, F = {number(own['flicker'], 3)}. A "
                 f"picture that stands still has 1; below that: {steady}. The default has its lights in "
                 f"{number(row['ms_light'])} ms, the paper's partition in {number(base['ms_light'])}.")
    if knee is not own:
        rival = curves.mean_row(knee["method"], n)
        lines.append(f"- So the default is not what the rule names. {knee['method']} flickers "
                     f"{own['flicker'] / knee['flicker']:.2f} times less than it, on one stream, for which there is "
                     f"no spread, and has its lights in {number(rival['ms_light'])} ms. The default is the paper's kind "
                     "of method, regions; whoever wants the steadier one sets "
                     f"`light-method = {knee['method']}`.")
    times = [(r["iqr_light"] + r["iqr_frame"]) / (r["ms_light"] + r["ms_frame"]) for r in curves.rows]
    lines.append(f"- The repeats of a time lie {100 * statistics.median(times):.0f} % of it apart (interquartile, median of all "
                 "settings); errors are the same bits each time.")
    return lines


def say_requirement(curves, reference):
    missed = [(r["map"], r["scene"], curves.count_too_near(r["scene"], r["map"])) for r in reference]
    total = len(missed)
    missed = [f"{m}/{s} ({n} settings)" for m, s, n in missed if n]
    text = ("Required is that this be under a tenth of the smallest error measured. That is met on "
            f"{total - len(missed)} of {total} pairs")
    return text + (f" and **missed** on {', '.join(missed)}." if missed else ".")


def plot_panel(out, curves, map_name, axis, title, is_last, floor):
    """axis 1: time, 0: lights."""
    names = curves.methods + [BASE]
    parts = []
    for i, method in enumerate(names):
        points = curves.points(method, "ball", map_name)
        path = os.path.join(out, f"{axis}_{map_name}_{i}.dat")
        with open(path, "w", encoding="utf-8") as f:
            for lights, ms, error in points:
                f.write(f"{ms if axis else lights} {error}\n")
        width, kind = (3, 7) if method == BASE else (1.3, i % 13 + 1)
        color = "black" if method == BASE else COLORS[i % len(COLORS)]
        parts.append(f"'{path}' using 1:2 with linespoints lw {width} pt {kind} ps 0.5 "
                     f"lc rgb '{color}' title \"{method}\"")
    x0 = 30 if axis else 16
    parts.append(f"{floor}*({x0}/x)**0.5 ls 100 title 'slope -1/2'")
    parts.append(f"{floor}*({x0}/x) ls 100 dt 3 title 'slope -1'")
    key = "set key at screen 0.995, screen 0.7 right font ',9' samplen 2" if is_last else "set key off"
    return f"set title '{title}'\n{key}\nplot {', '.join(parts)}\n"


COLORS = ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2",
          "#bcbd22", "#7f7f7f", "#393b79"]


def draw_all(folder, curves, stream):
    data = os.path.join(folder, "data")
    os.makedirs(data, exist_ok=True)
    maps = [m for m in PLOT_MAPS if m in curves.maps]
    for name, axis, label in (("error-time", 1, "ms, frame to lights and picture"),
                              ("error-lights", 0, "lights")):
        body = ("set multiplot layout 2,2 margins 0.08,0.80,0.08,0.95 spacing 0.09,0.13\n"
                f"set xlabel '{label}'\nset ylabel 'RMSE of the shadow' offset 1.5\n"
                "set xrange [*:*]\nset yrange [0.001:0.3]\n")
        for i, map_name in enumerate(maps):
            body += plot_panel(data, curves, map_name, axis, f"{map_name}, ball",
                               i == len(maps) - 1, 0.06)
        draw(folder, name, body, (1000, 720))
    rows = [s for s in stream if s["smoothing"] == 0]
    path = os.path.join(data, "stream.dat")
    with open(path, "w", encoding="utf-8") as f:
        for s in rows:
            base = s["method"] in tables.BASELINE
            row = curves.mean_row_on(BASE if base else s["method"], "lamps", 64)
            if row:
                f.write(f"{row['rmse']} {s['flicker']} \"{s['method']}\"\n")
    body = (f"set xlabel 'RMSE of the shadow, lamps, about 64 lights'\nset ylabel 'flicker F'\n"
            f"set offsets graph 0.1, graph 0.2, graph 0.1, graph 0.1\n"
            f"plot '{path}' using 1:2:3 with labels point pt 7 offset char 1,0.6 left notitle\n")
    draw(folder, "error-flicker", body, (640, 420))


def make_page(folder, gnomond, curves):
    harmonics = tables.read(folder, "irradiance.csv")
    stream = tables.read(folder, "stream.csv")
    run = tables.read(folder, "run.csv")[0]
    reference = tables.read(folder, "reference.csv")
    default, n = read_default(gnomond)
    row = curves.mean_row(default, n)
    ms = row["ms_light"] + row["ms_frame"]
    ranked = rank(curves, stream, default, ms)
    draw_all(folder, curves, stream)
    template = os.path.join(os.path.dirname(os.path.abspath(__file__)), "page.md.in")
    with open(template, encoding="utf-8") as f:
        page = f.read()
    fields = {
        "machine": get_machine(), "commit": get_commit(), "compiler": run["compiler"],
        "load": f"{run['load']:.0f}",
        "size": f"{run['width']:.0f} x {run['height']:.0f}", "repeats": f"{run['repeats']:.0f}",
        "maps": ", ".join(curves.maps), "n_pairs": f"{len(curves.pairs)}",
        "default": f"{default} with {n} lights", "default_ms": f"{ms:.0f}",
        "choice": choice_table(ranked, len(curves.pairs)), "verdict": say_choice(curves, ranked, default, n),
        "front": front_table(curves), "equal_time": equal_time_table(curves),
        "equal_error": equal_error_table(curves), "lights": lights_table(curves),
        "same_lights": same_lights_table(curves), "literal": literal_table(curves), "still": still_table(curves, 64),
        "irradiance": irradiance_tables(curves, harmonics), "stream": stream_table(stream),
        "reference": reference_table(curves, reference),
        "requirement": say_requirement(curves, reference),
    }
    for key, value in fields.items():
        page = page.replace(f"@{key}@", "\n".join(value) if isinstance(value, list) else value)
    return page


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    folder = sys.argv[1]
    curves = Curves(tables.read(folder, "error.csv"), tables.read(folder, "reference.csv"), BASE)
    page = make_page(folder, sys.argv[2], curves)
    with open(os.path.join(folder, "page.md"), "w", encoding="utf-8") as f:
        f.write(page)
    if sys.argv[3:]:
        shutil.copyfile(os.path.join(folder, "page.md"), os.path.join(sys.argv[3], "error.md"))
        for name in ("error-time", "error-lights", "error-flicker"):
            shutil.copyfile(os.path.join(folder, f"{name}.svg"),
                            os.path.join(sys.argv[3], f"{name}.svg"))


main()
