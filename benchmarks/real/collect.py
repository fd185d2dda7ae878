"""Files of the bench from clones of their repositories: a folder for every rig.

python -m benchmarks.real.collect FOLDER CLONES

CLONES holds a clone, or a bare repository, of each: `owner+name`, `owner/name` or `name`, or a folder `repo`, `.git`
or `repo/.git` inside of it. What is there already is not written again.
"""

from __future__ import annotations

import argparse
import subprocess
from pathlib import Path

from benchmarks.real.sources import EVERY, Source


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("clones", type=Path)
    options = parser.parse_args()
    for source in EVERY:
        clone = clone_of(source, options.clones)
        if clone is None:
            print(f"{source.rig:16s} no clone; {source.published}")
            continue
        taken, absent = collected(source, clone, options.folder / source.rig)
        print(f"{source.rig:16s} {taken} files" + (f"; not in the clone: {', '.join(absent)}" if absent else ""))


def clone_of(source: Source, clones: Path) -> Path | None:
    """The git folder of a repository among the clones."""
    owner, name = source.repository.split("/")
    for folder in (clones / f"{owner}+{name}", clones / owner / name, clones / name):
        for git in (folder / "repo" / ".git", folder / "repo", folder / ".git", folder):
            if (git / "HEAD").is_file():
                return git
    return None


def collected(source: Source, clone: Path, folder: Path) -> tuple[int, list[str]]:
    """Number of files that stand in the folder now, and the paths of which the clone has no content, or the commit."""
    absent, taken = [], 0
    try:
        _git(clone, "cat-file", "-e", f"{source.commit}^{{tree}}")
    except subprocess.CalledProcessError:
        return 0, [f"commit {source.commit}"]
    listed = _git(clone, "ls-tree", "-r", "-z", "--name-only", source.commit).decode().split("\0")
    for path in filter(source.holds, filter(None, listed)):
        target = folder / path
        if not target.is_file():
            try:
                content = _git(clone, "show", f"{source.commit}:{path}")
            except subprocess.CalledProcessError:
                absent.append(path)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        taken += 1
    return taken, absent


def _git(clone: Path, *words: str) -> bytes:
    return subprocess.run(["git", "-C", str(clone), *words], capture_output=True, check=True).stdout


if __name__ == "__main__":
    main()
