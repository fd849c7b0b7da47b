# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""A run of gnomon as a separate process, read while it runs.

The third argument of the script is the program; the environment's CLIENT_UNDER_TEST names another, as
one made with sanitizers.
"""
import os
import resource
import subprocess
import sys
import tempfile
import time

GNOMON = os.environ.get('CLIENT_UNDER_TEST') or sys.argv[3]
SANITIZERS = ('AddressSanitizer', 'LeakSanitizer', 'ThreadSanitizer', 'runtime error')


def server(daemon):
    return '--server=%s:%d' % daemon.address


class Run:
    """One run of gnomon. limit: bytes that a file of its may grow to."""

    def __init__(self, *arguments, limit=None):
        self.out, self.err = tempfile.TemporaryFile('w+'), tempfile.TemporaryFile('w+')

        def bound():
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        self.process = subprocess.Popen([GNOMON, *arguments], stdout=self.out, stderr=self.err,
                                        preexec_fn=bound if limit else None)

    @staticmethod
    def read(stream):
        """All of it so far. The process writes where the shared position is: it must not move."""
        return os.pread(stream.fileno(), 1 << 22, 0).decode('utf-8', 'replace')

    def wait_for(self, text, timeout=60):
        """Until the standard output has the text."""
        deadline = time.monotonic() + timeout
        while text not in self.read(self.out):
            assert self.process.poll() is None, 'ended: ' + self.read(self.err)
            assert time.monotonic() < deadline, 'never said %r' % text
            time.sleep(0.02)

    def end(self, timeout=120):
        """Exit status, standard output and standard error."""
        try:
            status = self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError('did not end: %s%s' % (self.read(self.out), self.read(self.err)))
        out, err = self.read(self.out), self.read(self.err)
        self.out.close()
        self.err.close()
        assert not any(word in err for word in SANITIZERS), err
        return status, out, err

    def succeed(self, *words):
        """It must end well and say nothing on standard error; its output, which has the words."""
        status, out, err = self.end()
        # A machine may be busy for as long as the start was put off; that is said, and is no fault.
        err = ''.join(l for l in err.splitlines(True) if 'the time to start was' not in l)
        assert status == 0 and err == '', 'status %d: %s%s' % (status, out, err)
        for word in words:
            assert word in out, '%r is not in %r' % (word, out)
        return out

    def fail(self, status, *words):
        """It must end with the status and one line on standard error that has the words; its output
        and that line."""
        got, out, err = self.end()
        assert got == status, 'status %d: %s%s' % (got, out, err)
        assert err.count('\n') == 1 and err.endswith('\n') and err.startswith('gnomon'), err
        for word in words:
            assert word in err, '%r is not in %r' % (word, err)
        return out, err
