# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""A virtual machine with Debian's kernel and a virtual camera, in which programs of this one run.

Nothing of the host is needed but QEMU: the processor is emulated (no /dev/kvm, no root), the root
file system is the host's own, read only. 10.0.2.2 in the guest is the host's loopback.
"""
import os
import shlex
import shutil
import subprocess

from folder import make_folder

TOOLS = ('qemu-system-x86_64', 'busybox', 'v4l2-ctl')
# Drivers of cameras, and what makes each have one, /dev/video0.
DRIVERS = {'vivid': 'n_devs=1 node_types=0x1', 'v4l2loopback': 'video_nr=0 exclusive_caps=1'}

INIT = r"""#!/bin/busybox sh
/bin/busybox --install -s /bin
mount -t proc p /proc
mount -t sysfs s /sys
mount -t devtmpfs d /dev
while read module parameters; do
    insmod /modules/$module $parameters
done </modules/order
ip link set lo up
ip link set eth0 up
ip addr add 10.0.2.15/24 dev eth0
ip route add default via 10.0.2.2
opts=trans=virtio,version=9p2000.L,msize=524288
mount -t 9p -o $opts,ro,cache=loose root /host
for d in proc sys dev; do mount --bind /$d /host/$d; done
mount -t tmpfs t /host/run
mkdir /host/run/out
mount -t 9p -o $opts out /host/run/out
chroot /host /bin/sh /run/out/guest.sh
sync
poweroff -f
"""

# step NAME COMMAND...: its output, errors and status become files.
PRELUDE = r"""cd /run/out
step() { name=$1; shift; "$@" >"$name.out" 2>"$name.err" </dev/null; echo $? >"$name.rc"; }
"""


def find_missing(kernel, driver='vivid'):
    """Why no machine with this camera can be started here; None: it can."""
    for tool in TOOLS:
        if not shutil.which(tool):
            return tool + ' is not installed'
    if not os.path.exists(os.path.join(kernel, 'modules', 'order')):
        return 'no kernel in %s; tests/vm/fetch-kernel fetches it' % kernel
    if not os.path.exists(os.path.join(kernel, 'modules', driver + '.ko')):
        return 'no %s in %s; tests/vm/fetch-kernel fetches it' % (driver, kernel)
    return None


def pack(files):
    """An archive that the kernel unpacks at its start (cpio, new ASCII format): name, mode, data."""
    out = bytearray()
    for i, (name, mode, data) in enumerate(files + [('TRAILER!!!', 0, b'')]):
        fields = (i + 1, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(name) + 1, 0)
        out += b'070701' + b''.join(b'%08X' % field for field in fields) + name.encode() + b'\0'
        out += bytes(-len(out) % 4) + data
        out += bytes(-len(out) % 4)
    return bytes(out)


def read(path):
    with open(path, 'rb') as f:
        return f.read()


class Machine:
    """Runs one script of steps; what each said is then at hand. Files written to . are in path."""

    def __init__(self, kernel, driver='vivid'):
        self.kernel, self.driver = kernel, driver
        self.path = make_folder('machine')

    def at(self, name):
        return os.path.join(self.path, name)

    def make_initrd(self):
        modules = os.path.join(self.kernel, 'modules')
        files = [(name, 0o040755, b'') for name in
                 ('bin', 'dev', 'proc', 'sys', 'host', 'modules')]
        files += [('init', 0o100755, INIT.encode()),
                  ('bin/busybox', 0o100755, read(shutil.which('busybox')))]
        needed = read(os.path.join(modules, 'order')).decode().split()
        needed = [name for name in needed if name != 'vivid.ko'] + [self.driver + '.ko']
        files += [('modules/' + name, 0o100644, read(os.path.join(modules, name)))
                  for name in needed]
        order = '\n'.join(needed) + ' ' + DRIVERS[self.driver] + '\n'
        files += [('modules/order', 0o100644, order.encode())]
        with open(self.at('initrd'), 'wb') as out:
            out.write(pack(files))

    def run(self, script, timeout=500):
        """The guest's shell script: lines as step NAME COMMAND..."""
        self.make_initrd()
        out = self.at('out')
        os.mkdir(out)
        with open(os.path.join(out, 'guest.sh'), 'w') as f:
            f.write(PRELUDE + script + '\nstep end true\n')
        command = [
            'qemu-system-x86_64', '-M', 'q35', '-accel', 'tcg,thread=multi,tb-size=256',
            '-cpu', 'max', '-smp', '2', '-m', '512', '-display', 'none', '-no-reboot',
            '-nodefaults', '-serial', 'file:' + self.at('console'),
            '-kernel', os.path.join(self.kernel, 'vmlinux'), '-initrd', self.at('initrd'),
            '-append', 'console=ttyS0 panic=-1 mitigations=off nokaslr tsc=reliable '
                       'no_timer_check random.trust_cpu=1 rdinit=/init',
            '-virtfs', 'local,path=%s,mount_tag=out,security_model=none' % out,
            '-virtfs', 'local,path=/,mount_tag=root,security_model=none,readonly=on,'
                       'multidevs=remap',
            '-netdev', 'user,id=n', '-device', 'virtio-net-pci,netdev=n,romfile=']
        try:
            said = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, timeout=timeout).stdout
        except subprocess.TimeoutExpired:
            said = b'not within %d s' % timeout
        if not os.path.exists(os.path.join(out, 'end.rc')):
            raise AssertionError('the machine did not come to its end: %s\n%s' % (
                said.decode('utf-8', 'replace'),
                read(self.at('console')).decode('utf-8', 'replace')[-4000:]))

    def get(self, name):
        """Exit status, output and errors of a step."""
        base = os.path.join(self.path, 'out', name)
        return int(read(base + '.rc')), read(base + '.out').decode(), read(base + '.err').decode()

    def get_bytes(self, name):
        return read(os.path.join(self.path, 'out', name))


def quote(*words):
    return ' '.join(shlex.quote(str(word)) for word in words)
