# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Commands that a page gives, run as a reader runs them."""
import os
import re
import signal
import subprocess
import tempfile
import time


def get_blocks(text):
    """The commands of a Markdown text: its ```sh blocks."""
    return [block.strip() for block in re.findall(r"^```sh\n(.*?)^```", text, re.S | re.M)]


def run(block, folder, env, until=None, timeout_s=None):
    """Runs the block in a session of its own, to its end or until until() and Ctrl-C, and ends what it left
    in the background. Returns what it printed."""
    deadline = time.monotonic() + timeout_s if timeout_s else float("inf")
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as log:
        shell = subprocess.Popen(["sh", "-e", "-c", block], cwd=folder, env=env, stdout=log,
                                 stderr=subprocess.STDOUT, start_new_session=True)
        is_interrupted = is_late = False
        try:
            while shell.poll() is None and not is_interrupted and not is_late:
                time.sleep(0.05)
                is_late = time.monotonic() > deadline
                is_interrupted = until is not None and until()
            if is_interrupted and shell.poll() is None:
                os.killpg(shell.pid, signal.SIGINT)
                shell.wait(60)
        finally:
            try:
                os.killpg(shell.pid, signal.SIGTERM)
            except ProcessLookupError:
                pass
        status = shell.wait()
        log.seek(0)
        text = log.read()
    for line in text.splitlines():
        print("# " + line)
    if is_late:
        raise RuntimeError(f"it does not end within {timeout_s} s")
    if status and not is_interrupted:
        raise RuntimeError(f"exit status {status}")
    return text
