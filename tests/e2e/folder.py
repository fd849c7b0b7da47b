# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""A folder of a test's own, gone when it ends."""
import os
import shutil
import sys
import tempfile


class Folder:
    """As a context; tests derive theirs and write into it what they need."""

    def __init__(self):
        name = os.path.splitext(os.path.basename(sys.argv[0]))[0]
        self.path = tempfile.mkdtemp(prefix='gnomon-%s-test.' % name)

    def at(self, name):
        return os.path.join(self.path, name)

    def write(self, name, data):
        with open(self.at(name), 'wb') as out:
            out.write(data)
        return self.at(name)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        shutil.rmtree(self.path)
