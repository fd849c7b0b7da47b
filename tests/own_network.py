# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""A network of one's own, with nothing but loopback: cameras answer on fixed ports, and to whoever
searches, so two tests must not share one."""
import fcntl
import os
import socket
import struct
import subprocess
import sys

SIOCSIFFLAGS, IFF_UP, IFF_RUNNING = 0x8914, 0x1, 0x40
# For running a program as an ordinary user does: without raw sockets, for one.
NO_RIGHTS = ['setpriv', '--bounding-set', '-all', '--inh-caps', '-all']


def enter():
    """Runs the script again in such a network, once; where none can be made it is skipped (TAP)."""
    if 'GN_OWN_NETWORK' not in os.environ:
        for how in (['unshare', '--net'], ['unshare', '--user', '--map-root-user', '--net']):
            if subprocess.run(how + ['true'], stderr=subprocess.DEVNULL).returncode == 0:
                os.environ['GN_OWN_NETWORK'] = '1'
                os.execvp(how[0], how + [sys.executable] + sys.argv)
        print('1..0 # SKIP no network namespace may be made here (unshare --net)')
        sys.exit(0)
    with socket.socket() as s:
        fcntl.ioctl(s, SIOCSIFFLAGS, struct.pack('16sH14x', b'lo', IFF_UP | IFF_RUNNING))
