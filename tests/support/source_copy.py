# SPDX-License-Identifier: BSD-3-Clause
"""A copy of the sources, to change and to build."""
import subprocess


def tracked_files(root):
    """Paths of what git tracks, or would."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=root,
                            check=True, capture_output=True, text=True).stdout
    return [path for path in listed.split("\0") if path and (root / path).is_file()]


def write_changed(path, content, mode):
    """Leaves a file that is right already alone, so that it is not compiled again."""
    if path.is_file() and path.read_bytes() == content:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    path.chmod(mode)


def copy(root, target, rewrite=lambda path, content: content, files=None):
    """Makes target hold the sources of root as rewrite(path, content) says, and nothing else.
    Returns their paths."""
    files = set(tracked_files(root)) if files is None else files
    for old in target.rglob("*"):
        if old.is_file() and str(old.relative_to(target)) not in files:
            old.unlink()
    for path in sorted(files):
        content = rewrite(path, (root / path).read_bytes())
        write_changed(target / path, content, (root / path).stat().st_mode)
    return files
