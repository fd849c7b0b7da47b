# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""The renderer against the capture rig's truth. TAP on stdout.

usage: truth.py GNOMON_RIG GNOMON_RENDER WORK_FOLDER

Each frame of the rig's sequences is rendered from what the rig's devices delivered (the camera frame,
the log codes of the probe, the pose), and the composite is compared with the path-traced picture that
has the teapot physically in it, over the pixels that the teapot changes by more than 1/255: object
and shadow apart. Reference quality at 0 bounces must be within 2/255 mean absolute on both and at most
a fifth of the error of the untouched camera frame there. Interactive quality: figures. (Bounces:
agreement.c.) The truth has noise of its own: in a mean of absolute differences it only adds, so what
passes would pass without it; by chance it may move that mean by a tenth of the limit at most.
"""
import json
import math
import os
import subprocess
import sys

import sequences

LIMIT = 2.0  # 8-bit codes, mean absolute
SHARE = 0.2  # of the untouched frame's error


def run(*args):
    done = subprocess.run([str(a) for a in args], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, args))}: exit {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def load(path):
    with open(path, encoding="utf-8") as f:
        return json.load(f)


def save(path, value):
    with open(path, "w", encoding="utf-8") as f:
        json.dump(value, f)


def render(tool, folder, quality):
    """Renders every frame at that quality; returns the folder of composites."""
    sequence = load(os.path.join(folder, "sequence.json"))
    out = os.path.join(folder, quality)
    os.makedirs(out, exist_ok=True)
    setup = os.path.join(folder, "setup.json")
    save(setup, sequence["environment"])
    for frame in sequence["frames"]:
        name = os.path.basename(frame["picture"])
        camera = os.path.join(out, "camera.json")
        save(camera, dict(sequence["camera"], world_from_camera=frame["world_from_camera"]))
        run(tool, "--scene", os.path.join(folder, sequence["scene"]),
            "--env", os.path.join(folder, frame["environment"]), "--env-params", setup,
            "--camera", camera, "--background", os.path.join(folder, frame["picture"]),
            "--quality", quality, "--out", os.path.join(out, name[:-4] + ".exr"),
            "--composite-png", os.path.join(out, name))
    return out


def judge(rig, folder, composites):
    report = os.path.join(composites, "judged.json")
    print("\n".join("# " + line for line in
                    run(rig, "judge", "--report", report, folder, composites).split("\n") if line))
    return load(report)


def problems(report):
    for frame in report["frames"]:
        for part in ("object", "shadow"):
            error = frame[part]
            if error["pixels"] == 0:
                yield f"{frame['name']}: no {part} pixels"
            by_chance = error["noise"] / math.sqrt(max(error["pixels"], 1))
            if by_chance > LIMIT / 10:
                yield f"{frame['name']}: {part} truth is only known to {by_chance:.2f}/255"
            if error["composite"] > LIMIT:
                yield f"{frame['name']}: {part} {error['composite']:.2f}/255, limit {LIMIT}"
            if error["composite"] > SHARE * error["untouched"]:
                yield (f"{frame['name']}: {part} {error['composite']:.2f}/255 is more than a fifth of "
                       f"the untouched {error['untouched']:.2f}")


def main():
    rig, tool, work = sys.argv[1:4]
    cases = ("lamps",) + sequences.MAPS
    print(f"1..{len(cases)}")
    for n, name in enumerate(cases, 1):
        if name != "lamps" and not sequences.get_map(name):
            print(f"ok {n} - {name} # SKIP no {name}.exr: deploy/fetch-maps FOLDER, and "
                  "GN_TEST_MAPS=FOLDER")
            continue
        folder = sequences.make(rig, work, name)
        print(f"# {name}, interactive")
        judge(rig, folder, render(tool, folder, "interactive"))
        print(f"# {name}, reference")
        found = list(problems(judge(rig, folder, render(tool, folder, "reference"))))
        for problem in found:
            print(f"# {problem}")
        print(f"{'not ok' if found else 'ok'} {n} - {name}: reference within {LIMIT:g}/255 of the truth")


main()
