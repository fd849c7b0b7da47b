# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Folders of a test's own, gone when it ends: well or by a fault, by Ctrl-C, or by SIGTERM since its time
is over. With GN_KEEP in the environment they stay, and it says where."""
import atexit
import os
import shutil
import signal
import sys
import tempfile

TOP = []  # the folder that holds all of them, once there is one


def end():
    if os.environ.get('GN_KEEP'):
        print('# kept ' + TOP[0])
    else:
        shutil.rmtree(TOP[0], ignore_errors=True)


def make_folder(name):
    """A new one; returns its path."""
    if not TOP:
        script = os.path.splitext(os.path.basename(sys.argv[0]))[0]
        TOP.append(tempfile.mkdtemp(prefix='gnomon-%s-test.' % script))
        atexit.register(end)
        # As any other end: what runs for the test is ended, too.
        signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    return tempfile.mkdtemp(prefix=name + '.', dir=TOP[0])


class Folder:
    """One as a context; tests derive theirs and write into it what they need."""

    def __init__(self):
        self.path = make_folder('folder')

    def at(self, name):
        return os.path.join(self.path, name)

    def write(self, name, data):
        with open(self.at(name), 'wb') as out:
            out.write(data)
        return self.at(name)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass
