# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What a machine can check of how the code is written. TAP on stdout.

usage: check.py SOURCE_ROOT
"""
import os
import re
import subprocess
import sys

LAYERS = ["proto", "common", "server|client", "tests"]
# Within server: a folder may include itself and those listed.
SERVER = {
    "scene": [],
    "light": ["scene"],
    "render": ["scene", "light"],
    "room": ["scene", "light", "render"],
    "net": ["scene", "light", "render", "room"],
    "http": ["scene", "light", "render", "room"],
}
# The rig judges the renderer, so it may share only rays, meshes and plain pictures with it.
RIG_SERVER = {"server/scene/rt.h", "server/scene/mesh.h"}
RIG_NOT_COMMON = {"common/projection.h", "common/response.h", "common/camera.h",
                  "common/composite.h"}
SUITES = ["unit", "kernel", "golden", "numeric", "fuzz", "e2e", "style", "truth", "vm"]
SOURCE = re.compile(r"\.(c|h|cc|cpp|hpp)$")
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.M)


def files(root):
    out = subprocess.run(["git", "-c", "safe.directory=*", "-C", root, "ls-files"],
                         capture_output=True, text=True, check=True).stdout
    return [p for p in out.split("\n") if p and os.path.isfile(os.path.join(root, p))]


def read(root, path):
    with open(os.path.join(root, path), encoding="utf-8", errors="replace") as f:
        return f.read()


def layer(path):
    top = path.split("/")[0]
    for i, names in enumerate(LAYERS):
        if top in names.split("|"):
            return i
    return None


def include_problem(path, target):
    mine, its = layer(path), layer(target)
    if its is None:
        return f"includes {target}, which is in no layer (includes run from the root)"
    a, b = path.split("/"), target.split("/")
    if its > mine or (its == mine and a[0] != b[0]):
        return f"includes {target}: {a[0]} may not use {b[0]}"
    if a[0] == b[0] == "server" and len(a) > 2 and len(b) > 2 and a[1] != b[1]:
        if a[1] in SERVER and b[1] not in SERVER[a[1]]:
            return f"includes {target}: server/{a[1]} may not use server/{b[1]}"
    if path.startswith("tests/rig/"):
        if b[0] == "server" and target not in RIG_SERVER:
            return f"includes {target}: the rig shares only {', '.join(sorted(RIG_SERVER))}"
        if target in RIG_NOT_COMMON:
            return f"includes {target}: the rig has its own, so that the two can disagree"
    return None


def check_layers(root, paths):
    for path in paths:
        if SOURCE.search(path) and layer(path) is not None:
            for target in INCLUDE.findall(read(root, path)):
                if target.endswith(".pb.h"):
                    continue
                problem = include_problem(path, target)
                if problem:
                    yield f"{path} {problem}"


def check_spdx(root, paths):
    for path in paths:
        if SOURCE.search(path) or path.endswith((".py", "meson.build", ".proto")):
            head = read(root, path)[:400]
            if "SPDX-License-Identifier: ISC" not in head or "SPDX-FileCopyrightText" not in head:
                yield f"{path}: the two SPDX lines are missing at its head"


def check_unfinished(root, paths):
    mark = re.compile(r"\b(TO" + r"DO|FIX" + r"ME|X" + r"XX)\b")
    for path in paths:
        if SOURCE.search(path) or path.endswith((".py", ".md", ".sh", "meson.build")):
            for n, line in enumerate(read(root, path).split("\n"), 1):
                if mark.search(line):
                    yield f"{path}:{n}: a mark of unfinished work: {line.strip()}"


def check_guards(root, paths):
    for path in paths:
        if path.endswith(".h"):
            guard = "GN_" + re.sub(r"[^A-Z0-9]", "_", path.upper())
            if f"#ifndef {guard}\n#define {guard}\n" not in read(root, path):
                yield f"{path}: its include guard should be {guard}"


def check_embree(root, paths):
    for path in paths:
        if SOURCE.search(path) and not path.startswith("server/scene/rt_embree"):
            if re.search(r"\brtc[A-Z]\w+\s*\(|#\s*include\s*<embree", read(root, path)):
                yield f"{path}: only server/scene/rt_embree* may call Embree"


def check_forbidden(root, paths):
    words = {r"-ffast-math": "breaks NaN checks and reproducible sums",
             r"#\s*include\s*<threads\.h>": "use common/thread.h",
             r"\bvolatile\b": "use C11 atomics",
             r"\bskip\(\);": "cmocka prints it as a failure in TAP; see tests/real_data.h"}
    for path in paths:
        if SOURCE.search(path) or path.endswith("meson.build"):
            text = read(root, path)
            for word, why in words.items():
                if re.search(word, text):
                    yield f"{path}: {word}: {why}"


def check_lines(root, paths):
    for path in paths:
        if SOURCE.search(path):
            for n, line in enumerate(read(root, path).split("\n"), 1):
                if len(line) > 100:
                    yield f"{path}:{n}: {len(line)} columns; 100 are the limit"


def check_own_header(root, paths):
    for path in paths:
        own = re.sub(r"\.(c|cc|cpp)$", ".h", path)
        if own != path and own in paths:
            first = re.search(r"^\s*#\s*include\s+(\S+)", read(root, path), re.M)
            if not first or first[1] != f'"{own}"':
                yield f"{path}: the first header it includes should be its own, {own}"


def check_links(root, paths):
    """Links of the documents, and paths between backquotes that begin with a folder of ours."""
    tops = {p.split("/")[0] for p in paths if "/" in p}
    for path in paths:
        if path.endswith((".md", ".conf.example")):
            text = re.sub(r"^```.*?^```", "", read(root, path), flags=re.M | re.S)
            names = [os.path.join(os.path.dirname(path), link)
                     for link in re.findall(r"\]\(([^)#\s]+)", text) if "://" not in link]
            names += [name for name in re.findall(r"`([\w.-]+/[\w./-]*\w)[\s`]", text)
                      if name.split("/")[0] in tops]
            for name in names:
                if not os.path.exists(os.path.join(root, name)):
                    yield f"{path}: names {name}, which is not there"


def check_machine(root, paths):
    place = re.compile(r"(?<![\w.}$])/(home|root|Users|work|mnt|media|opt)/\w[\w./-]*")
    for path in paths:
        if not path.endswith((".png", ".exr")):
            for n, line in enumerate(read(root, path).split("\n"), 1):
                found = place.search(line)
                if found:
                    yield f"{path}:{n}: {found[0]} is a place on one machine"


def check_suites(root, paths):
    """Of each test() in our meson files; tests/run and people choose by suite."""
    for path in paths:
        if path.endswith("meson.build"):
            for call in re.split(r"^\s*test\(", read(root, path), flags=re.M)[1:]:
                call = re.split(r"^\s*(?:benchmark\(|endforeach|foreach|$)", call, flags=re.M)[0]
                if not re.search(rf"suite: [^\n]*'({'|'.join(SUITES)})'", call):
                    yield f"{path}: test({call.split(',')[0]}, ...) is in none of our suites"


def check_traps(root, paths):
    """docs/numerics.md: each row names a test that is there, or what is not built; no trap's test
    is left out."""
    doc = "docs/numerics.md"
    text = read(root, doc)
    named = set()
    for n, line in enumerate(text.split("\n"), 1):
        found = re.findall(r"\b(unit|numeric|truth|e2e)/(\w+)((?:,? `\w+`)+)", line)
        if re.match(r"\| (?!case|#|---)", line) and not found and "not built" not in line:
            yield f"{doc}:{n}: names no test: {line[:60]}"
        for folder, name, tests in found:
            path = next((q for q in (f"tests/{folder}/{name}.c", f"tests/{folder}/{name}.py")
                         if q in paths), None)
            for test in re.findall(r"`(\w+)`", tests):
                named.add(test)
                if not path or not re.search(rf"\b{test}\b", read(root, path)):
                    yield f"{doc}:{n}: {folder}/{name} has no test {test}"
    for path in paths:
        if path.startswith("tests/") and path.endswith(".c"):
            for test in re.findall(r"cmocka_unit_test\w*\((trap_\w+)", read(root, path)):
                if test not in named:
                    yield f"{doc}: says nothing of {test} in {path}"
    for row in range(1, 30):
        if not re.search(rf"^\| {row} \|", text, re.M):
            yield f"{doc}: has no row {row}"


CHECKS = [("includes keep the layers", check_layers),
          ("every source file has its SPDX lines", check_spdx),
          ("nothing is marked unfinished", check_unfinished),
          ("include guards follow the path", check_guards),
          ("Embree is named in its own files", check_embree),
          ("nothing forbidden is used", check_forbidden),
          ("no line of C is over 100 columns", check_lines),
          ("each source file includes its own header first", check_own_header),
          ("what the documents name is there", check_links),
          ("no path of one machine", check_machine),
          ("every test is in a suite", check_suites),
          ("the numerical cases name their tests", check_traps)]


def main():
    root = sys.argv[1]
    paths = files(root)
    print(f"1..{len(CHECKS)}")
    for n, (name, check) in enumerate(CHECKS, 1):
        problems = list(check(root, paths))
        for problem in problems:
            print(f"# {problem}")
        print(f"{'not ok' if problems else 'ok'} {n} - {name}")


main()
