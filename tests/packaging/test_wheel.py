"""A wheel holds all that the program needs: it runs without the checkout, and without the packages of any extra."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from selector.cli.shared.running import EXTRAS

ROOT = Path(__file__).resolve().parents[2]

BLOCKER = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocked())
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """The program in an environment of its own, which borrows the packages of the base from this one."""
    pytest.importorskip("hatchling", reason="wheels are built with hatchling, which is not installed")
    place = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", str(place), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    (wheel,) = place.glob("selector-*.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place / "env")], check=True)
    scripts = place / "env" / ("Scripts" if os.name == "nt" else "bin")
    python = scripts / Path(sys.executable).name
    install = [*pip, "--python", str(python), "install", "--no-compile", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    where = "import sysconfig; print(sysconfig.get_path('purelib'))"
    own = Path(subprocess.run([python, "-c", where], check=True, capture_output=True, text=True).stdout.strip())
    (own / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    # machine code that the checkout has compiled from the same sources; Numba knows a source by its size and age
    for compiled in (ROOT / "selector").rglob("__pycache__/*.nb[ci]"):
        folder = own / compiled.parent.relative_to(ROOT)
        folder.mkdir(exist_ok=True)
        shutil.copy(compiled, folder)
    for source in (ROOT / "selector").rglob("*.py"):
        shutil.copystat(source, own / source.relative_to(ROOT))
    names = sorted({name for modules in EXTRAS.values() for name in modules.split()})
    (own / "sitecustomize.py").write_text(BLOCKER.format(names=names), encoding="utf-8")
    return scripts


def run(installed: Path, *words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return subprocess.run(
        [installed / "selector", *words],
        cwd=cwd, env={**environment, "PYTHONUTF8": "1"}, capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip


def test_the_demo_runs_without_checkout_and_extras(installed, tmp_path):
    done = run(installed, "demo", "--out", "demo", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.rstrip().splitlines()[-1]) == Path("demo") / "report.html"
    assert (tmp_path / "demo" / "report.html").stat().st_size > 1_000_000
    assert (tmp_path / "demo" / "spindle46" / "model.json").exists()
    # a terminal of 40 lines holds both studies and the patent
    assert len(done.stdout.splitlines()) <= 40


def test_what_is_missing_is_named_with_the_extra_that_brings_it(installed, tmp_path):
    done = run(installed, "workbench", "--no-browser", cwd=tmp_path)
    assert done.returncode == 2
    assert 'pip install ".[workbench]"' in done.stderr
    assert "Traceback" not in done.stderr
