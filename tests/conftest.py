"""What holds in every test: time that Hypothesis may take, what is collected as garbage, who compiles, what begins."""

from __future__ import annotations

import gc
import hashlib
import importlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

from tests.patience import alone, shared_folder

ROOT = Path(__file__).resolve().parents[1]

# What the import of all tests makes is not visited on the way: 2.9 s of 14 s in every process.
gc.disable()

# No test depends on how quick the machine is.
settings.register_profile(
    "unhurried", deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow]
)  # fmt: skip
settings.load_profile("unhurried")


# Browsers, servers and a control: of 730 s in one process, on a busy machine, they and their browser computed 170.
WAITING = ("tests/workbench/", "tests/live/", "tests/controllers/test_linuxcnc")
LONGEST = ("tests/docs/test_site.py",)


def pytest_collection(session: pytest.Session) -> None:
    """Every process begins with a part of the files of its own: what one of them has compiled, the others read.

    In a fresh checkout all compiled all 507 files and their assertions at the same time: 16 s of CPU each, now 10.
    """
    config = session.config
    worker = getattr(config, "workerinput", None)
    if worker is None:
        return
    asked = [(config.invocation_params.dir / name.partition("::")[0]).resolve() for name in config.args]
    files = sorted(file for path in asked for file in ([path] if path.is_file() else path.rglob("test_*.py")))
    number, count = int(worker["workerid"].removeprefix("gw")), int(worker["workercount"])
    for file in files[number * len(files) // count : (number + 1) * len(files) // count]:
        # what cannot be imported, or skips, is told when it is collected
        with suppress(Exception, pytest.skip.Exception):
            importlib.import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What waits begins, in one process beside others that compute, and the longest test: at the end they were alone.

    Folders stay whole, and in their order: `--dist worksteal` deals the first part to the first process, from whose
    end the others then take.
    """
    items.sort(key=lambda item: not item.nodeid.startswith(WAITING + LONGEST))


def pytest_collection_finish() -> None:
    """Some 650 000 objects of modules and tests live to the end: without this every full collection visits them."""
    gc.enable()
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000)


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """One process compiles a kernel for the first time, the others wait for it and read it from numba's cache."""
    folder, compiled = shared_folder(tmp_path_factory), Dispatcher.compile

    def alone_compiled(self: Any, signature: Any) -> Any:
        name = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
        # the lock of the threads first, as numba takes it
        with global_compiler_lock, alone(folder / f"compiled-{hashlib.sha256(name.encode()).hexdigest()}"):
            return compiled(self, signature)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dispatcher, "compile", alone_compiled)
        yield
