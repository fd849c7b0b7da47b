# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Reads the tables that error_time writes."""
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from page import read  # noqa: E402, F401

BASELINE = ("seed", "paper")  # the paper's literal partition, in our renderer and in its own
