# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Adds up the JUnit records that `meson test` left in the build folders.

usage: count.py FAILED_BUILDS BUILD_DIR...
Prints each failure and each reason for a skip, then "N passed, M failed[, K skipped]" as the last
line. A build that failed, or a folder without a record, counts as one failure. Exits 1 on failures.
"""
import os
import sys
import xml.etree.ElementTree as ET


def main():
    failed = int(sys.argv[1])
    passed = skipped = 0
    for folder in sys.argv[2:]:
        path = os.path.join(folder, "meson-logs", "testlog.junit.xml")
        try:
            root = ET.parse(path).getroot()
        except (OSError, ET.ParseError) as error:
            print(f"count: {path}: {error}")
            failed += 1
            continue
        cases = 0
        for suite in root.iter("testsuite"):
            for case in suite.iter("testcase"):
                cases += 1
                name = f"{folder}: {suite.get('name')}: {case.get('name')}"
                if case.find("failure") is not None or case.find("error") is not None:
                    failed += 1
                    print(f"FAILED  {name}")
                elif case.find("skipped") is not None:
                    skipped += 1
                    print(f"skipped {name}")
                else:
                    passed += 1
            # A test that died before its first result leaves a suite without cases.
            if suite.find("testcase") is None:
                failed += 1
                print(f"FAILED  {folder}: {suite.get('name')}: no result")
        if cases == 0:
            print(f"count: {path}: no test ran")
            failed += 1
    print(f"{passed} passed, {failed} failed" + (f", {skipped} skipped" if skipped else ""))
    return 1 if failed else 0


sys.exit(main())
