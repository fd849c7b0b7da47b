# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Judges what deploy/quickstart made: report.json, the contact sheet, a short table.

usage: quickstart_report.py GNOMON_RIG GNOMON_RENDER RIG_FOLDER OUT_FOLDER
"""
import json
import os
import shutil
import subprocess
import sys

SEQUENCES = ("lamps", "interior", "sunrise", "city")
FIRST = 1, 201, 401, 601  # number of the first environment frame of each: deploy/quickstart
ROWS = 4  # of each sequence on the contact sheet


def run(*args):
    done = subprocess.run([str(a) for a in args], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"quickstart: {done.stderr.strip() or args[0]}")


def load(*path):
    with open(os.path.join(*path), encoding="utf-8") as f:
        return json.load(f)


def save(value, *path):
    with open(os.path.join(*path), "w", encoding="utf-8") as f:
        json.dump(value, f, indent=1)


def is_same_file(a, b):
    with open(a, "rb") as f, open(b, "rb") as g:
        return f.read() == g.read()


def judge(rig, folder, composites):
    """Errors by frame name, as gnomon-rig judge finds them."""
    path = os.path.join(composites, "judged.json")
    run(rig, "judge", "--report", path, folder, composites)
    frames = load(path)["frames"]
    os.unlink(path)
    return {os.path.splitext(f["name"])[0]: f for f in frames}


def get_shown(n):
    """The frames that the sheet shows: spread evenly, as gnomon-rig sheet does."""
    rows = min(ROWS, n)
    return sorted({row * (n - 1) // (rows - 1) if rows > 1 else 0 for row in range(rows)})


def render_offline(render, folder, sequence, frame, out, composite):
    """The same frame by gnomon-render: light map and shadow factor for the sheet. Returns whether its
    composite is the daemon's to the bit."""
    name = os.path.basename(frame["picture"])
    work = os.path.join(out, "offline")
    os.makedirs(work, exist_ok=True)
    save(dict(sequence["camera"], world_from_camera=frame["world_from_camera"]), work, "camera.json")
    save(sequence["environment"], work, "setup.json")
    kind = os.path.basename(folder)
    for part in ("light", "shadow"):
        os.makedirs(os.path.join(work, part, kind), exist_ok=True)
    run(render, "--scene", os.path.join(folder, sequence["scene"]),
        "--env", os.path.join(folder, frame["environment"]),
        "--env-params", os.path.join(work, "setup.json"),
        "--camera", os.path.join(work, "camera.json"),
        "--background", os.path.join(folder, frame["picture"]),
        "--light-map", os.path.join(work, "light", kind, name),
        "--shadow-png", os.path.join(work, "shadow", kind, name),
        "--composite-png", os.path.join(work, name), "--out", os.path.join(work, "layers.exr"))
    return is_same_file(os.path.join(work, name), composite)


def collect(rig, render, rig_folder, out, name):
    """The report of one sequence: a list of frames."""
    folder = os.path.join(rig_folder, name)
    sequence = load(folder, "sequence.json")
    composites = os.path.join(out, "composites", name)
    view = {f["name"]: f for f in load(composites, "view.json")["frames"]}
    for frame in view.values():
        if frame["outcome"] != "result":
            sys.exit(f"quickstart: {name} {frame['name']} was dropped: {frame['sentence']}")
    errors = judge(rig, folder, composites)
    bounced = judge(rig, os.path.join(folder, "bounces"), os.path.join(composites, "bounces"))
    shown = get_shown(len(sequence["frames"]))
    frames = []
    for i, frame in enumerate(sequence["frames"]):
        stem = os.path.splitext(os.path.basename(frame["picture"]))[0]
        item = {"sequence": name, "frame": stem, "label": frame.get("label", ""), **view[stem],
                "environment_frame": FIRST[SEQUENCES.index(name)] + i,
                "error": {k: errors[stem][k] for k in ("object", "shadow")},
                "error_with_bounces": {k: bounced[stem][k] for k in ("object", "shadow")}}
        item["is_in_step"] = item["receipt"]["lighting_sequence"] == item["environment_frame"]
        if i in shown:
            is_same = render_offline(render, folder, sequence, frame, out,
                                     os.path.join(composites, stem + ".png"))
            if i == 0:  # the lights of later frames go on from those before
                item["same_as_gnomon_render"] = is_same
        frames.append(item)
    return frames


def mean(values):
    values = list(values)
    return sum(values) / len(values) if values else float("nan")


def print_table(frames):
    print(f"{'':10} {'frames':>6} {'ms':>7} {'lights':>6} {'light age':>9}  "
          f"{'object':>13} {'shadow':>13}   {'with bounces: object, shadow':>28}")
    for name in SEQUENCES:
        rows = [f for f in frames if f["sequence"] == name]
        receipts = [f["receipt"] for f in rows]

        def cell(kind, part):
            return (f"{mean(f[kind][part]['composite'] for f in rows):5.2f} "
                    f"({mean(f[kind][part]['untouched'] for f in rows):5.1f})")

        ms = mean(sum(r["stages_ms"].values()) - r["stages_ms"]["queue"] for r in receipts)
        print(f"{name:10} {len(rows):6d} {ms:7.1f} {mean(r['lights'] for r in receipts):6.0f} "
              f"{mean(r['lighting_age_ms'] for r in receipts):6.0f} ms  "
              f"{cell('error', 'object'):>13} {cell('error', 'shadow'):>13}   "
              f"{cell('error_with_bounces', 'object'):>13} {cell('error_with_bounces', 'shadow'):>13}")
    print("ms: decoding to encoding, in the daemon. Errors: mean absolute difference from the truth in\n"
          "8-bit codes over the pixels the object changes; in brackets that of the untouched frame.")


def main():
    rig, render, rig_folder, out = sys.argv[1:5]
    frames = []
    for name in SEQUENCES:
        frames += collect(rig, render, rig_folder, out, name)
    save({"format": "gnomon-quickstart 1", "frames": frames}, out, "report.json")
    sheet = os.path.join(out, "contact-sheet.png")
    run(rig, "sheet", "--out", sheet, "--title", "Gnomon", "--rows", ROWS,
        "--composites", os.path.join(out, "composites"),
        "--light", os.path.join(out, "offline", "light"),
        "--shadow", os.path.join(out, "offline", "shadow"),
        *(os.path.join(rig_folder, name) for name in SEQUENCES))
    shutil.rmtree(os.path.join(out, "offline"))
    print_table(frames)
    for f in frames:
        if not f["is_in_step"]:
            print(f"note: {f['sequence']} {f['frame']} was lit by environment frame "
                  f"{f['receipt']['lighting_sequence']}, not its own {f['environment_frame']}")
    for f in frames:
        if f["is_in_step"] and f.get("same_as_gnomon_render") is False:
            print(f"note: {f['sequence']} {f['frame']}: gnomon-render's composite is not the daemon's")
    print(f"composites    {out}/composites\ncontact sheet {sheet}\nreport        {out}/report.json")


main()
