# SPDX-License-Identifier: BSD-3-Clause
"""Debian's kernel for machines of QEMU, whose first program reports by lines "guest: ..."."""
import pathlib
import re
import subprocess
import threading
import time


def output_of(*command, **options):
    return subprocess.run([str(part) for part in command], check=True, capture_output=True,
                          text=True, **options).stdout


def kernel(directory):
    """Debian's, unpacked: the file and its version. It is fetched once."""
    images = sorted(directory.glob("boot/vmlinuz-*"))
    if not images:
        directory.mkdir(parents=True, exist_ok=True)
        depends = output_of("apt-cache", "depends", "linux-image-amd64")
        package = re.search(r"Depends: (linux-image-\S+)", depends)[1]
        output_of("apt-get", "-q", "download", package, cwd=directory)
        [archive] = directory.glob("*.deb")
        output_of("dpkg", "-x", archive, directory)
        archive.unlink()
        images = sorted(directory.glob("boot/vmlinuz-*"))
    version = images[-1].name.removeprefix("vmlinuz-")
    if not (directory / "lib/modules" / version / "modules.dep").exists():
        output_of("depmod", "-b", directory, version)
    return images[-1], version


def modules(directory, version, names):
    """Files, each after those that it needs."""
    found = []
    for name in names:
        text = output_of("modprobe", "-d", directory, "-S", version, "--show-depends", name)
        for path in re.findall(r"^insmod (\S+)", text, re.M):
            if path not in found:
                found.append(path)
    return found


def pack(root, archive):
    names = "\n".join(str(path.relative_to(root)) for path in root.rglob("*"))
    with archive.open("wb") as file:
        subprocess.run(["cpio", "--quiet", "-o", "-H", "newc"], input=names.encode(), cwd=root,
                       stdout=file, check=True)


def start(image, archive, words, *options):
    """A machine without disk or display; the words are for its kernel and its first program."""
    return subprocess.Popen(
        ["qemu-system-x86_64", "-M", "q35", "-cpu", "max", "-m", "2048", "-nodefaults",
         "-no-reboot", "-display", "none", "-serial", "stdio", "-kernel", image,
         "-initrd", archive, "-append", f"console=ttyS0 quiet panic=-1 {words}", *options],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        errors="replace", bufsize=1)


def start_board(build, socket):
    """The firmware as it is flashed, emulated, whose USB is redirected to the socket."""
    board = subprocess.Popen(
        ["node", build / "emulator/usb_redirect.mjs", build / "firmware/versavis.uf2", socket],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
    if board.stdout.readline().strip() != "listening":
        raise SystemExit("the emulated board does not start")
    return board


def with_board(socket):
    return ["-chardev", f"socket,id=board,path={socket}", "-device", "qemu-xhci",
            "-device", "usb-redir,chardev=board"]


def follow(guest, limit_s, do=None):
    """The checks that passed, until the guest has ended, or the limit is reached."""
    begun = time.monotonic()
    passed = []
    timer = threading.Timer(limit_s, guest.kill)
    timer.start()
    try:
        for line in guest.stdout:
            line = line.strip()
            if not line.startswith("guest: "):
                print(f"      {line}")
                continue
            text = line.removeprefix("guest: ")
            print(f"{time.monotonic() - begun:5.1f} {text}", flush=True)
            if text.startswith("do "):
                do(text.removeprefix("do "))
            if text.startswith("ok "):
                passed.append(text.removeprefix("ok "))
    finally:
        timer.cancel()
        guest.kill()
        guest.wait()
    return passed
