# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Reads the tables that error_time writes."""
import csv
import os

BASELINE = ("seed", "paper")  # the paper's literal partition, in our renderer and in its own


def read(folder, name):
    with open(os.path.join(folder, name), newline="", encoding="utf-8") as f:
        rows = list(csv.DictReader(f))
    for row in rows:
        for key, value in row.items():
            try:
                row[key] = float(value)
            except ValueError:
                pass
    return rows
