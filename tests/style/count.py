# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Adds up the records that `meson test` left in the build folders.

usage: count.py FAILED_BUILDS BUILD_DIR...
Prints each failure and each skip with its reason, and as the last line "N passed, M failed[, K
skipped]". One failure each: a build that failed, a folder without a record or without tests, a test
that crashed, timed out or broke its plan though no subtest of it failed, a skip without a reason.
Exits 1 on failures.
"""
import json
import os
import re
import sys
import xml.etree.ElementTree as ET


def subtests(folder):
    """Test -> [(subtest, outcome, reason)]: the JUnit record, written when all have run."""
    root = ET.parse(os.path.join(folder, "meson-logs", "testlog.junit.xml")).getroot()
    found = {}  # the class name is "project." and the test's name
    for case in root.iter("testcase"):
        outcome = ("failed" if case.find("failure") is not None or case.find("error") is not None
                   else "skipped" if case.find("skipped") is not None else "passed")
        found.setdefault(case.get("classname").partition(".")[2], []).append(
            (case.get("name"), outcome, case.findtext("system-out", "")))
    return found


def outcomes(folder):
    """Yields (name, outcome, reason) of all subtests, and of the tests that came to a bad end."""
    found = subtests(folder)
    with open(os.path.join(folder, "meson-logs", "testlog.json"), encoding="utf-8") as f:
        tests = [json.loads(line) for line in f]
    if not tests:
        yield "", "failed", "no test ran"
    for test in tests:
        cases = found.get(test["name"], [])
        name = test["name"].split(" / ")[-1]  # of "project:suite / name"
        for case, outcome, reason in cases:
            yield f"{name}: {case}", outcome, reason
        result = test["result"]
        if result not in ("OK", "SKIP", "EXPECTEDFAIL"):
            if not any(outcome == "failed" for _, outcome, _ in cases):
                yield name, "failed", f"{result} after {len(cases)} subtests"
        elif not cases:
            reason = re.search(r"^1\.\.0\s*#\s*skip\S*\s*(.*)", test["stdout"], re.I | re.M)
            yield name, "passed" if result == "OK" else "skipped", reason[1] if reason else ""


def main():
    count = {"passed": 0, "failed": int(sys.argv[1]), "skipped": 0}
    for folder in sys.argv[2:]:
        try:
            lines = list(outcomes(folder))
        except (OSError, ET.ParseError, ValueError, KeyError) as error:
            lines = [("", "failed", f"no record of its tests: {error!r}")]
        for name, outcome, reason in lines:
            if outcome == "skipped" and not reason:
                outcome, reason = "failed", "neither a result nor a reason for skipping it"
            count[outcome] += 1
            if outcome != "passed":
                print(f"{outcome.upper():7} {folder}: {name}" + (f": {reason}" if reason else ""))
    print(f"{count['passed']} passed, {count['failed']} failed"
          + (f", {count['skipped']} skipped" if count["skipped"] else ""))
    return 1 if count["failed"] else 0


sys.exit(main())
