# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Error curves of methods: what the best setting within a time or a number of lights gives.

A pair is a scene with a map. Every curve is the lower envelope of its settings, so a method is never
blamed for a setting worse than a cheaper one; between settings it is interpolated in log-log, beyond
the last one it stays as it is (the plateau), before the first one there is none.
"""
import math
import statistics

import tables

# An answer that only settings too near to the truth to be judged could give.
UNKNOWN = math.nan

MEANS = ["lights", "rmse", "flip", "relmse", "relmse_trimmed", "ms_light", "ms_frame", "rays"]


def geometric_mean(values):
    values = list(values)
    return math.exp(sum(map(math.log, values)) / len(values)) if values else None


def envelope(points):
    """[(x, error)] by rising x, only those better than all before."""
    best, out = math.inf, []
    for x, error in sorted(points):
        if error < best:
            best = error
            if out and out[-1][0] == x:
                out.pop()
            out.append((x, error))
    return out


def look_up(points, x):
    """Error at x of an envelope."""
    if not points or x < points[0][0]:
        return None
    for (x0, e0), (x1, e1) in zip(points, points[1:]):
        if x < x1:
            t = math.log(x / x0) / math.log(x1 / x0)
            return math.exp((1 - t) * math.log(e0) + t * math.log(e1))
    return points[-1][1]


def find(points, error):
    """Smallest x at which an envelope comes down to the error; None: never."""
    if not points or points[-1][1] > error:
        return None
    if points[0][1] <= error:
        return points[0][0]
    for (x0, e0), (x1, e1) in zip(points, points[1:]):
        if e1 <= error:
            t = math.log(error / e0) / math.log(e1 / e0)
            return math.exp((1 - t) * math.log(x0) + t * math.log(x1))
    return None


class Curves:
    def __init__(self, rows, reference, base):
        self.all = rows
        self.nearest = {(r["scene"], r["map"]): 10 * r["self_error"] for r in reference}
        self.rows = [r for r in rows if r["lights"] > 0 and r["rmse"] > 0
                     and r["rmse"] >= self.nearest[r["scene"], r["map"]]]
        self.base = base
        self.maps = list(dict.fromkeys(r["map"] for r in rows))
        self.pairs = list(dict.fromkeys((r["scene"], r["map"]) for r in rows))
        self.methods = [m for m in dict.fromkeys(r["method"] for r in rows)
                        if m not in tables.BASELINE]

    def count_all(self, scene, map_name):
        return sum(r["scene"] == scene and r["map"] == map_name for r in self.all)

    def count_too_near(self, scene, map_name):
        return sum(r["scene"] == scene and r["map"] == map_name
                   and r["rmse"] < self.nearest[scene, map_name] for r in self.all)

    def select(self, method, scene, map_name):
        names = tables.BASELINE if method == self.base else (method,)
        return [r for r in self.rows if r["method"] in names and r["scene"] == scene
                and r["map"] == map_name]

    def by_time(self, method, pair):
        return envelope([(r["ms_light"] + r["ms_frame"], r["rmse"]) for r in self.select(method, *pair)])

    def by_lights(self, method, pair):
        return envelope([(r["lights"], r["rmse"]) for r in self.select(method, *pair)])

    def points(self, method, scene, map_name):
        """(lights, ms, error) to be drawn: all of a method, the envelope of the baseline."""
        rows = self.select(method, scene, map_name)
        if method == self.base:
            kept = {x for x, _ in envelope([(r["lights"], r["rmse"]) for r in rows])}
            best = {}
            for r in rows:
                if r["lights"] in kept and r["rmse"] < best.get(r["lights"], {"rmse": 9})["rmse"]:
                    best[r["lights"]] = r
            rows = list(best.values())
        points = sorted((r["lights"], r["ms_light"] + r["ms_frame"], r["rmse"]) for r in rows)
        if method == self.base:  # more lights and more time do not help it: the plateau
            most = self.select(method, scene, map_name)
            points.append((max(r["lights"] for r in most),
                           max(r["ms_light"] + r["ms_frame"] for r in most), points[-1][2]))
        return points

    def errors_at_time(self, method, ms):
        """Of all pairs; None unless it has a setting for each."""
        errors = [look_up(self.by_time(method, p), ms) for p in self.pairs]
        return None if None in errors else errors

    def mean_error_at_time(self, method, ms):
        errors = self.errors_at_time(method, ms)
        return errors and geometric_mean(errors)

    def error_ratios(self, method, base, ms):
        pairs = [(look_up(self.by_time(base, p), ms), look_up(self.by_time(method, p), ms))
                 for p in self.pairs]
        return [b / m for b, m in pairs if b is not None and m is not None]

    def time_ratios(self, method, base, error):
        """Ratios where both come down to the error; how often only the method does; only the base."""
        times = [(find(self.by_time(base, p), error), find(self.by_time(method, p), error))
                 for p in self.pairs]
        return ([b / m for b, m in times if b and m], sum(1 for b, m in times if m and not b),
                sum(1 for b, m in times if b and not m))

    def lights_for(self, method, map_name, error):
        """Geometric mean over the scenes; None where one of them never gets there; UNKNOWN where one
        may have, by a setting that is not judged."""
        pairs = [p for p in self.pairs if p[1] == map_name]
        needed = [find(self.by_lights(method, p), error) for p in pairs]
        missing = [p for p, n in zip(pairs, needed) if n is None]
        if missing:
            return UNKNOWN if all(self.may_reach(method, p, error) for p in missing) else None
        return geometric_mean(needed)

    def may_reach(self, method, pair, error):
        """Whether a setting that is not judged may have no more than that error."""
        names = tables.BASELINE if method == self.base else (method,)
        bound = min(self.nearest[pair], error + self.nearest[pair] / 10)
        return any(r["method"] in names and (r["scene"], r["map"]) == pair and r["rmse"] < bound
                   for r in self.all)

    def same_lights_ratios(self, method, base, map_name, n):
        """The base's error at n lights over the method's."""
        pairs = [p for p in self.pairs if p[1] == map_name]
        found = [(look_up(self.by_lights(base, p), n), look_up(self.by_lights(method, p), n))
                 for p in pairs]
        return [b / m for b, m in found if b and m]

    def literal_row(self, params, scene, map_name):
        return next(r for r in self.select("seed", scene, map_name) if r["params"] == params)

    def literal_ratios(self, method, params, map_name):
        """Error of that setting of the literal partition over the method's at as many lights."""
        ratios = []
        for scene, its_map in self.pairs:
            if its_map == map_name:
                row = self.literal_row(params, scene, map_name)
                mine = look_up(self.by_lights(method, (scene, map_name)), row["lights"])
                if mine:
                    ratios.append(row["rmse"] / mine)
        return ratios

    def near(self, method, pair, n):
        """The setting that asks for n lights; of the baseline the best one of at most n."""
        rows = self.select(method, *pair)
        if method == self.base:
            rows = sorted((r for r in rows if r["lights"] <= n), key=lambda r: r["rmse"])
        else:
            rows = [r for r in rows if r["asked"] == n]
        return rows[0] if rows else None

    def mean_row(self, method, n, pairs=None):
        """Over all pairs: geometric means; arithmetic of the bias."""
        rows = [self.near(method, p, n) for p in pairs or self.pairs]
        if not rows or None in rows:
            return None
        mean = {key: geometric_mean(max(r[key], 1e-12) for r in rows) for key in MEANS}
        mean["bias"] = statistics.mean(r["bias"] for r in rows)
        return mean

    def mean_row_on(self, method, map_name, n):
        return self.mean_row(method, n, [p for p in self.pairs if p[1] == map_name])

    def irradiance_at(self, method, map_name, n):
        row = self.near(method, next(p for p in self.pairs if p[1] == map_name), n)
        return row["irradiance"] if row else None
