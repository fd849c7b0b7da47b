# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Does count.py see every way in which a test can end? Has meson run a test of each. TAP on stdout.

usage: count_check.py COUNT_PY MESON
"""
import json
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

# What the test's shell does -> what count.py must make of it: passed, failed, skipped, its words.
CASES = [
    ("all pass", "echo 1..2; echo ok 1 - a; echo ok 2 - b", (2, 0, 0), []),
    ("one fails", "echo 1..2; echo ok 1; echo not ok 2 - b; exit 1", (1, 1, 0), ["t1: 2 - b"]),
    ("two fail and it crashes", "echo 1..3; echo not ok 1; echo not ok 2; kill -SEGV $$",
     (0, 2, 0), []),
    ("one skips", "echo 1..2; echo 'ok 1 - a # SKIP no map'; echo ok 2", (1, 0, 1), ["a: no map"]),
    ("a skip without a reason", "echo 1..1; echo 'ok 1 - a # SKIP'", (0, 1, 0), ["neither"]),
    ("all skips", "echo '1..0 # SKIP no python'", (0, 0, 1), ["t5: no python"]),
    ("nothing said", "true", (0, 1, 0), ["neither"]),
    ("nothing done", "echo 1..0", (0, 1, 0), ["neither"]),
    ("crash before a result", "echo 1..2; kill -SEGV $$", (0, 1, 0), ["ERROR after 0"]),
    ("crash after a result", "echo 1..2; echo ok 1; kill -SEGV $$", (1, 1, 0), ["ERROR after 1"]),
    ("crash after all results", "echo 1..1; echo ok 1; kill -SEGV $$", (1, 1, 0), ["ERROR"]),
    ("bad exit after all results", "echo 1..1; echo ok 1; exit 3", (1, 1, 0), ["ERROR after 1"]),
    ("fewer than planned", "echo 1..3; echo ok 1; echo ok 2", (2, 1, 0), ["ERROR after 2"]),
    ("more than planned", "echo 1..1; echo ok 1; echo ok 2", (2, 1, 0), ["ERROR after 2"]),
    ("bail out", "echo 1..2; echo ok 1; echo 'Bail out! no daemon'", (1, 1, 0), ["ERROR"]),
    ("time-out", "echo 1..2; echo ok 1; sleep 60", (1, 1, 0), ["TIMEOUT after 1"]),
]


def quoted(text):
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def write(path, text):
    with open(path, "w", encoding="utf-8") as f:
        f.write(text)


def count(*arguments):
    done = subprocess.run([sys.executable, sys.argv[1], *arguments], capture_output=True, text=True)
    return done.stdout, done.returncode


def problem(output, status, want, words):
    """None where count.py said just that, else what it said."""
    passed, failed, skipped = want
    last = f"{passed} passed, {failed} failed" + (f", {skipped} skipped" if skipped else "")
    if output.endswith(last + "\n") and status == (failed > 0) and all(w in output for w in words):
        return None
    return f"wanted {last!r} and {words}, got exit {status} with {output!r}"


def run_cases(top):
    """The folder where meson has run one test per case, t0, t1..."""
    lines = ["project('p')"]
    for i, (_, script, _, _) in enumerate(CASES):
        lines.append(f"test('t{i}', find_program('sh'), args: ['-c', {quoted(script)}],\n"
                     f"  protocol: 'tap', suite: 's{i}',"
                     f" timeout: {1 if 'sleep' in script else 600})")
    write(os.path.join(top, "meson.build"), "\n".join(lines) + "\n")
    build = os.path.join(top, "build")
    subprocess.run([sys.argv[2], "setup", build, top], check=True, stdout=subprocess.DEVNULL)
    subprocess.run([sys.argv[2], "test", "-C", build], stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    return build


def part(build, name, cases):
    """A folder with the records of these cases only, out of the whole build's."""
    logs = os.path.join(build, "meson-logs")
    mine = os.path.join(build, name, "meson-logs")
    os.makedirs(mine)
    with open(os.path.join(logs, "testlog.json"), encoding="utf-8") as f:
        lines = [line for line in f if json.loads(line)["name"].split("t")[-1] in cases]
    write(os.path.join(mine, "testlog.json"), "".join(lines))
    tree = ET.parse(os.path.join(logs, "testlog.junit.xml"))
    for suite in list(tree.getroot()):
        for case in suite.findall("testcase"):
            test = case.get("classname") if suite.get("name") != "p" else case.get("name")
            if test.split("t")[-1] not in cases:
                suite.remove(case)
    tree.write(os.path.join(mine, "testlog.junit.xml"))
    return os.path.dirname(mine)


def checks(top):
    """Yields the name of each check and what is wrong."""
    build = run_cases(top)
    for i, (name, _, want, words) in enumerate(CASES):
        yield name, problem(*count("0", part(build, f"c{i}", [str(i)])), want, words)
    first, second = (os.path.join(build, c) for c in ("c0", "c3"))
    everything = [sum(want[k] for _, _, want, _ in CASES) for k in range(3)]
    yield "all of them", problem(*count("0", build), everything, [])
    yield "two builds", problem(*count("0", first, second), (3, 0, 1), [])
    yield "a build failed", problem(*count("1", first), (2, 1, 0), [])
    yield "no test ran", problem(*count("0", part(build, "none", [])), (0, 1, 0), ["no test ran"])
    os.unlink(os.path.join(first, "meson-logs", "testlog.junit.xml"))
    yield "no record", problem(*count("0", first, second), (1, 1, 1), ["no record"])


def main():
    with tempfile.TemporaryDirectory() as top:
        n = 0
        for name, wrong in checks(top):
            n += 1
            if wrong:
                print("# " + wrong)
            print(f"{'not ok' if wrong else 'ok'} {n} - {name}")
        print(f"1..{n}")


main()
