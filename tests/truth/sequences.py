# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""The rig's sequences that the tests of this folder share: path-traced by the one that comes first.

The camera looks at the teapot from near by: 60 x 45 pixels as fine as those of 120 x 90 with the
whole table, and the same ones are judged, as only what the teapot changes is.
"""
import fcntl
import os
import subprocess

OPTIONS = ("--width", "60", "--height", "45", "--zoom", "2", "--frames-per-light", "1",
           "--direct-paths", "512", "--paths", "8")
MAPS = "interior", "sunrise", "city"


def get_map(name):
    """The file of a light map; None where it is not there."""
    path = os.path.join(os.environ.get("GN_TEST_MAPS", ""), name + ".exr")
    return path if os.path.exists(path) else None


def make(rig, work, name):
    """Makes the sequence of the lamp room or of a map in WORK/NAME; returns that folder."""
    folder = os.path.join(work, name)
    light = ["--light", "lamps"] if name == "lamps" else ["--light", get_map(name),
                                                          "--probe", "angular"]
    os.makedirs(work, exist_ok=True)
    with open(os.path.join(work, "lock"), "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = subprocess.run([rig, "make", *light, *OPTIONS, folder], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"gnomon-rig make {folder}: {done.stderr.strip()}")
    return folder
