# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""No method's error may grow unseen. TAP on stdout.

usage: guard.py ERROR_TIME EXPECTED.csv WORK_FOLDER [--update]

Runs the quick sweep of error_time, whose figures are the same bits each time, and compares them with
the table in the tree: nothing may be more than 3 % worse, nothing missing, nothing new. Times are
not looked at, nor is the references' own error: a quick reference has whole texels, which is enough to
see a figure change and not enough to say how far from the truth it is.
--update writes the table anew; say why in the commit.
"""
import bisect
import csv
import os
import statistics
import subprocess
import sys

import tables

LEAST_RANK, LEAST_NEAR = 0.9, 0.9  # of the estimated errors: rank correlation, share within 2 times
GROWTH = 1.03
SLACK = 1e-5  # differences up to this are nothing
# What is looked at: table, its key columns, its figures, for all of which less is better.
WATCHED = [("error.csv", ["scene", "map", "method", "params"],
            ["rmse", "irradiance", "flip", "relmse_trimmed"]),
           ("irradiance.csv", ["map", "harmonics"], ["irradiance"]),
           ("stream.csv", ["method", "params", "smoothing"],
            ["flicker", "noise_codes", "response_frames"])]


def collect(folder):
    """{(table, key, figure): value}"""
    found = {}
    for name, keys, figures in WATCHED:
        for row in tables.read(folder, name):
            key = " ".join(f"{row[k]:g}" if isinstance(row[k], float) else row[k] for k in keys)
            for figure in figures:
                found[name.removesuffix(".csv"), key, figure] = row[figure]
    return found


def get_ranks(values):
    """Mean ranks, ties shared."""
    order = sorted(values)
    return [(bisect.bisect_left(order, v) + bisect.bisect_right(order, v)) / 2 for v in values]


def judge_estimates(folder):
    """(Spearman's rank correlation, share within a factor of 2, pictures, unknown) of the renderer's
    estimated error beside the measured one."""
    rows = [r for r in tables.read(folder, "error.csv") if r["masked"]]
    known = [(r["rmse"], r["estimated"]) for r in rows if r["estimated"] >= 0]
    rank = statistics.correlation(*(get_ranks(v) for v in zip(*known)))
    near = sum(e / 2 <= t <= 2 * e for t, e in known) / len(known)
    return rank, near, len(rows), len(rows) - len(known)


def load(path):
    with open(path, newline="", encoding="utf-8") as f:
        return {(r["table"], r["key"], r["figure"]): float(r["value"]) for r in csv.DictReader(f)}


def save(path, found):
    with open(path, "w", newline="", encoding="utf-8") as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerow(["table", "key", "figure", "value"])
        for key, value in found.items():
            writer.writerow([*key, f"{value:.5g}"])


def main():
    if len(sys.argv) not in (4, 5) or sys.argv[4:] not in ([], ["--update"]):
        sys.exit(__doc__)
    tool, expected_path, work = sys.argv[1:4]
    out = os.path.join(work, "quick")
    os.makedirs(out, exist_ok=True)
    done = subprocess.run([tool, "--quick", "--cache", os.path.join(work, "references"), out],
                          capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{tool}: exit {done.returncode}: {done.stderr.strip()}")
    found = collect(out)
    if sys.argv[4:]:
        save(expected_path, found)
        return
    expected = load(expected_path)
    groups = list(dict.fromkeys((k[0], k[2]) for k in list(expected) + list(found)))
    print(f"1..{len(groups) + 2}")
    print("# quick references, their own error not estimated: changes are found, no errors vouched for")
    for n, (table, figure) in enumerate(groups, 1):
        bad, better = [], 0
        for key, was in expected.items():
            if (key[0], key[2]) != (table, figure):
                continue
            now = found.get(key)
            if now is None:
                bad.append(f"{key[1]}: not measured any more")
            elif not now <= was * GROWTH + SLACK:  # a NaN is bad too
                bad.append(f"{key[1]}: {now:.4g}, was {was:.4g}")
            elif now < was / GROWTH - SLACK:
                better += 1
        for line in bad[:20]:
            print(f"# {line}")
        if better:
            print(f"# {better} figures are better than in the table: guard.py --update keeps that")
        print(f"{'not ok' if bad else 'ok'} {n} - {table}: no {figure} has grown")
    new = sorted({k[1] for k in found if k not in expected})
    for key in new[:20]:
        print(f"# not in the table: {key}")
    print(f"{'not ok' if new else 'ok'} {len(groups) + 1} - all that is measured is in the table")
    rank, near, n_all, n_unknown = judge_estimates(out)
    print(f"# estimated error over {n_all} pictures: rank correlation {rank:.3f}, within a factor of 2 "
          f"in {100 * near:.0f} %, unknown in {n_unknown}")
    good = rank > LEAST_RANK and near >= LEAST_NEAR and 10 * n_unknown <= n_all
    print(f"{'ok' if good else 'not ok'} {len(groups) + 2} - the estimated error is true")


main()
