# SPDX-License-Identifier: BSD-3-Clause
"""Debian's kernel for machines of QEMU, whose first program reports by lines "guest: ..."."""
import contextlib
import pathlib
import re
import shutil
import subprocess
import tempfile
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
FILES_MODULES = ["virtio_pci", "9pnet_virtio", "9p", "overlay"]


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


def make_root(root, init, directory, version, names):
    """What the machine begins with: its first program, busybox, and these modules of the kernel."""
    for folder in ("bin", "modules"):
        (root / folder).mkdir(parents=True)
    shutil.copy(init, root / "init")
    shutil.copy("/bin/busybox", root / "bin")
    files = [pathlib.Path(file) for file in modules(directory, version, names)]
    for file in files:
        shutil.copy(file, root / "modules")
    (root / "modules/order").write_text("".join(f"{file.name}\n" for file in files))


def check_in_guest(build, program, limit_s, words="", board=False):
    """Runs a program of sh in a machine that sees the files of this system, and keeps changes in
    memory; with a board at its USB, if wanted. Says which of the program's checks failed; returns
    the exit code."""
    directory = build / "linux"
    image, version = kernel(directory)
    checks = re.findall(r"^check '([^']+)'", program.read_text(), re.M)
    with tempfile.TemporaryDirectory() as temporary, contextlib.ExitStack() as stack:
        work = pathlib.Path(temporary)
        make_root(work / "root", HERE / "guest_overlay_init", directory, version,
                  FILES_MODULES + (["xhci_pci"] if board else []))
        pack(work / "root", work / "root.cpio")
        options = ["-smp", "2", "-virtfs",
                   "local,path=/,mount_tag=below,security_model=none,readonly=on,multidevs=remap"]
        if board:
            emulated = start_board(build, work / "board")
            stack.callback(emulated.wait)
            stack.callback(emulated.kill)
            options += with_board(work / "board")
        guest = start(image, work / "root.cpio", f"{words} run={program} build={build}", *options)
        passed = follow(guest, limit_s)
    missing = [check for check in checks if check not in passed]
    for check in missing:
        print(f"FAILED: {check}")
    print(f"{len(checks) - len(missing)} of {len(checks)} checks passed on Linux {version}")
    return 1 if missing else 0


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
