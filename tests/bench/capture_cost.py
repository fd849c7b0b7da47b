# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What a GigE Vision picture of 640x480 costs the client: processor time of all its threads,
receiving and converting, and copies.

usage: capture_cost.py FAKE_GIGE GIGE_TOOL
"""
import json
import os
import subprocess
import sys

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import own_network  # noqa: E402

FAKE, TOOL = sys.argv[1:3]
CASES = [('Mono12', 'deep', []), ('Mono12p', 'deep', []), ('BayerRG12p', 'deep', []),
         ('RGB8', '8', []), ('BayerRG8', '8', []), ('Mono12', 'deep', own_network.NO_RIGHTS)]


def main():
    own_network.enter()
    camera = subprocess.Popen([FAKE, '--width', '640', '--height', '480'],
                              stdout=subprocess.PIPE, text=True)
    try:
        assert camera.stdout.readline() == 'ready\n'
        print('| format | received by | ms a picture | copies | incomplete of 90 |\n'
              '| --- | --- | ---: | ---: | ---: |')
        for name, depth, before in CASES:
            out = subprocess.run([*before, TOOL, '127.0.0.1', name, '0', '0', '30', '90', depth],
                                 stdout=subprocess.PIPE, text=True, check=True).stdout
            got = json.loads(out.splitlines()[-1])
            print('| %s%s | %s | %.2f | %.0f | %d |' % (
                name, ' to RGB8' if depth == '8' else '', 'socket' if before else 'AF_PACKET',
                got['cpu_ms'], got['copies'], got['incomplete']))
    finally:
        camera.terminate()
        camera.communicate()


main()
