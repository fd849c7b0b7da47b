# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Runs the commands that README.md gives. TAP on stdout.

usage: readme.py SOURCE_ROOT BUILD_ROOT GNOMON_RIG WORK_FOLDER
Each ```sh block is run by a shell as it stands: deploy/quickstart in the source tree, on sequences
as small as truth.py's, the others in a folder with the files that the README names. `tests/run` is not
run by one of its own tests.
"""
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile

import sequences
import shell


def prepare(rig, folder):
    """What the README tells its reader to put into a folder."""
    sequence = os.path.join(folder, "sequence")
    subprocess.run([rig, "make", "--width", "160", "--height", "120", "--frames-per-light", "1",
                    "--paths", "8", sequence], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    for name in os.listdir(sequence):
        if name.endswith((".obj", ".mtl")) or name in ("scene.json", "camera.json"):
            shutil.copy(os.path.join(sequence, name), folder)
    # A lat-long map; the rig's angular one is taken for such, as only the commands are tested.
    shutil.copy(os.path.join(sequence, "env", "angular-3.exr"), os.path.join(folder, "light.exr"))
    os.mkdir(os.path.join(folder, "shots"))
    for i in range(2):
        shutil.copy(os.path.join(sequence, "camera", "0000.png"),
                    os.path.join(folder, "shots", f"{i}.png"))
    with open(os.path.join(folder, "gnomond.conf"), "w", encoding="utf-8") as f:
        f.write("[room studio]\nscene = scene.json\n")


def check_quickstart(root, text):
    out = os.path.join(root, "quickstart-out")
    with open(os.path.join(out, "report.json"), encoding="utf-8") as f:
        frames = json.load(f)["frames"]
    assert len(frames) == 7, f"{len(frames)} frames"  # four of the lamps, one of each map
    # On a machine too busy for a frame a second a frame may meet another's light: that is said, and
    # such a frame cannot be judged.
    in_step = [f for f in frames if f["is_in_step"]]
    assert len(in_step) >= 4, f"{len(in_step)} of {len(frames)} frames in step"
    for frame in frames:
        where = f"{frame['sequence']} {frame['frame']}"
        assert frame["outcome"] == "result", f"{where}: {frame['outcome']}"
    for frame in in_step:
        where = f"{frame['sequence']} {frame['frame']}"
        assert frame.get("same_as_gnomon_render", True), f"{where}: daemon and gnomon-render differ"
        for part, error in frame["error"].items():
            # Interactive quality is judged by its figures; this only sees a picture gone wrong.
            assert error["composite"] < 0.5 * error["untouched"], f"{where}: {part} {error}"
    assert os.path.getsize(os.path.join(out, "contact-sheet.png")) > 100000
    assert "contact sheet" in text and "--stay" in text


def check_own(folder):
    for name in ("0.png", "1.png", "view.json"):
        assert os.path.exists(os.path.join(folder, "composites", name)), f"no composites/{name}"


def is_free(port):
    with socket.socket() as s:
        s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            s.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def end(number, frame):
    """A test that is stopped ends what it started: the `finally` of run()."""
    raise SystemExit(128 + number)


def main():
    signal.signal(signal.SIGTERM, end)
    root, build, rig, work = (os.path.abspath(a) for a in sys.argv[1:5])
    path = ":".join(os.path.join(build, d) for d in ("server", "client"))
    env = dict(os.environ, PATH=path + ":" + os.environ["PATH"], GN_RIG_FOLDER=work,
               GN_RIG_OPTIONS=" ".join(sequences.OPTIONS))
    with open(os.path.join(root, "README.md"), encoding="utf-8") as f:
        blocks = [b for b in shell.get_blocks(f.read()) if b != "tests/run"]
    assert "deploy/quickstart" in blocks and len(blocks) >= 3, blocks
    print(f"1..{len(blocks)}")
    with tempfile.TemporaryDirectory(prefix="gnomon-readme-") as folder:
        prepare(rig, folder)
        for name in ("lamps",) + tuple(filter(sequences.get_map, sequences.MAPS)):
            sequences.make(rig, work, name)
        for n, block in enumerate(blocks, 1):
            name = block.split("\n")[0]
            if "gnomond " in block and not (is_free(7340) and is_free(7341)):
                print(f"ok {n} - {name} # SKIP the default ports 7340 and 7341 are taken")
                continue
            try:
                text = shell.run(block, root if block.startswith("deploy/") else folder, env)
                if block.startswith("deploy/"):
                    check_quickstart(root, text)
                elif "gnomon view" in block:
                    check_own(folder)
                elif "gnomon-render" in block:
                    assert os.path.getsize(os.path.join(folder, "layers.exr")) > 0
            except (AssertionError, OSError, RuntimeError, ValueError) as problem:
                print(f"# {problem}\nnot ok {n} - {name}")
                continue
            print(f"ok {n} - {name}", flush=True)


main()
