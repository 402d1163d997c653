"""A Debian kernel with CAN in QEMU, without KVM: this machine's own files read-only, vcan0 up, one program run in it.

The kernel and a static busybox come as Debian packages into a folder of their own; nothing is installed. The guest's
clock counts instructions (`-icount`), `INSTRUCTIONS_A_SECOND` to its second, so what it measures does not depend on how
fast or busy the host is.
"""

import gzip
import io
import os
import platform
import re
import shlex
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

EMULATOR = "qemu-system-x86_64"
INSTRUCTIONS_A_SECOND = 8e9
MODULES = ("virtio_pci", "9pnet_virtio", "9p", "can_raw", "vcan")
_FOLDER, _PROGRAM, _LINK = 0o40755, 0o100755, "TRAILER!!!"
_INIT = """#!/bin/busybox sh
b=/bin/busybox
$b mkdir -p /proc /sys /host
$b mount -t proc proc /proc
$b mount -t sysfs sys /sys
$b mount -t devtmpfs dev /dev
for module in $($b cat /modules/order); do $b insmod /modules/$module.ko; done
$b ip link set lo up
$b ip link add dev vcan0 type vcan && $b ip link set vcan0 up
$b mount -t 9p -o trans=virtio,version=9p2000.L,ro,cache=loose,msize=262144 host /host
$b mount -t tmpfs scratch /host/tmp
$b mkdir -p /host$WORK
$b mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144 work /host$WORK
for folder in dev proc sys; do $b mount --bind /$folder /host/$folder; done
$b hostname $NODE
$b cp /bin/busybox /host/tmp/busybox
$b chroot /host /bin/sh $WORK/story.sh
echo "guest ended with $?"
$b poweroff -f
"""


class NoGuestError(Exception):
    """Why there is no guest to be had here."""


@dataclass(frozen=True)
class Guest:
    """A kernel image and an initial file system to boot."""

    kernel: Path
    initial: Path


COVERED = ("/tmp", "/dev", "/proc", "/sys")
"""Folders over which the guest mounts its own."""


def covered(places: Sequence[Path]) -> str:
    """Why the guest cannot see one of `places`, "" where it sees all."""
    for place in places:
        over = next((folder for folder in COVERED if place.resolve().is_relative_to(folder)), None)
        if over is not None:
            return f"checkout and Python must lie outside of {', '.join(COVERED)}, which the guest covers; got {place}"
    return ""


def prepare(folder: Path) -> Guest:
    """Fetch what is missing in `folder` and build the initial file system. Raises NoGuestError with the reason."""
    if shutil.which(EMULATOR) is None:
        raise NoGuestError(f"{EMULATOR} must be installed (Debian package qemu-system-x86)")
    if shutil.which("apt-get") is None or platform.machine() != "x86_64":
        raise NoGuestError("needs apt-get on x86_64 for Debian's kernel")
    root = folder / "root"
    if not list(root.glob("boot/vmlinuz-*")):
        folder.mkdir(parents=True, exist_ok=True)
        _unpack(folder, root, (_kernel_package(), "busybox-static"))
    initial = folder / "initrd"
    initial.write_bytes(gzip.compress(_initial(root), 1))
    return Guest(next(root.glob("boot/vmlinuz-*")), initial)


def run_in(guest: Guest, work: Path, command: Sequence[str], environment: Mapping[str, str], timeout_s: float) -> str:
    """Boot, run `command` in `work`, which alone is shared for writing, and give what the console said."""
    exports = "".join(f"export {name}={shlex.quote(value)}\n" for name, value in environment.items())
    (work / "story.sh").write_text(f"{exports}cd {shlex.quote(os.getcwd())}\n{shlex.join(command)}\n")
    kernel = (
        f"console=ttyS0 quiet panic=-1 mitigations=off tsc=reliable tsc_early_khz={INSTRUCTIONS_A_SECOND / 1e3:.0f}"
    )
    qemu = [
        EMULATOR,
        "-accel",
        "tcg",
        "-cpu",
        "max",
        "-machine",
        "pc,hpet=off",
        "-m",
        "3072",
        "-icount",
        "shift=0,sleep=off",
    ]
    qemu += ["-nodefaults", "-nographic", "-no-reboot", "-serial", "stdio", "-kernel", str(guest.kernel)]
    qemu += ["-initrd", str(guest.initial), "-append", f"{kernel} WORK={work} NODE={platform.node()}"]
    qemu += ["-virtfs", "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap"]
    qemu += ["-virtfs", f"local,path={work},mount_tag=work,security_model=none"]
    done = subprocess.run(
        qemu, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s, check=False
    )
    return done.stdout + done.stderr


def _kernel_package() -> str:
    """The package that Debian's newest kernel for this machine is in."""
    said = _apt(["apt-cache", "depends", "linux-image-amd64"], Path("/"))
    found = re.search(r"Depends: (linux-image-\S+)", said)
    if found is None:
        raise NoGuestError("apt-cache must know linux-image-amd64; run apt-get update")
    return found[1]


def _unpack(folder: Path, root: Path, packages: Sequence[str]) -> None:
    _apt(["apt-get", "download", "-qq", *packages], folder)
    for package in folder.glob("*.deb"):
        subprocess.run(["dpkg", "-x", str(package), str(root)], check=True)
        package.unlink()


def _apt(command: Sequence[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NoGuestError(f"{' '.join(command[:2])} must work; got: {' '.join(done.stderr.split())[:200]}")
    return done.stdout


def _initial(root: Path) -> bytes:
    """The initial file system as a cpio archive: busybox, the modules in the order of their needs, and what is done
    with them.
    """
    places = {path.stem.replace("-", "_"): path for path in root.glob("lib/modules/*/kernel/**/*.ko")}
    order: list[str] = []

    def need(name: str) -> None:
        wants = re.search(rb"\0depends=([^\0]*)\0", b"\0" + places[name].read_bytes())
        for other in wants[1].decode().split(",") if wants and wants[1] else ():
            need(other.replace("-", "_"))
        if name not in order:
            order.append(name)

    for name in MODULES:
        need(name)
    files = [(name, _FOLDER, b"") for name in ("bin", "dev", "modules")]
    files += [("bin/busybox", _PROGRAM, (root / "bin/busybox").read_bytes()), ("init", _PROGRAM, _INIT.encode())]
    files += [(f"modules/{name}.ko", _PROGRAM, places[name].read_bytes()) for name in order]
    return _archive([*files, ("modules/order", _PROGRAM, "\n".join(order).encode()), (_LINK, 0, b"")])


def _archive(files: Sequence[tuple[str, int, bytes]]) -> bytes:
    """A cpio archive of the kind that the kernel reads ("newc"): name, mode, contents."""
    out = io.BytesIO()
    for number, (name, mode, data) in enumerate(files, 1):
        words = (number, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(name) + 1, 0)
        out.write(b"070701" + b"".join(b"%08x" % word for word in words) + name.encode() + b"\0")
        out.write(b"\0" * (-out.tell() % 4) + data)
        out.write(b"\0" * (-out.tell() % 4))
    return out.getvalue()
