"""Threads: right results each from its own pipeline, and of two at one pipeline one is refused.

The long run takes ``SPACEMAP_ROUNDS`` rounds, from the seed ``SPACEMAP_SEED`` on.
"""

from __future__ import annotations

import datetime
import faulthandler
import os
import threading
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random
from time import sleep
from typing import Any

import pytest
from fresh import (
    SMALL,
    STAGES,
    Content,
    Made,
    build,
    digest,
    error_text,
    fresh,
    key,
    values_of,
    write_inputs,
)

from spacemap_vtk.errors import SpacemapError

MOVERS = [name for name, stage in STAGES.items() if stage.role == "mover"]
THREADS, TIMES = 4, (0.0, -1.0, 1e-4, 1e-3)


def pipeline(chance: Random, files: dict[str, list[Any]]) -> Content:
    """Return what a pipeline holds that is put together, and set, at random."""
    time = chance.choice(TIMES)

    def stage(kind: str, *inputs: Content, time: float | None = None) -> Content:
        cls, values = STAGES[kind], dict(SMALL.get(kind, {}))
        if kind in ("ObjectSource", "MotionReader"):
            values["file"] = files[kind][0]
        for name in chance.choices(sorted(cls.parameters), k=2):
            if some := values_of(cls.parameters[name], files.get(kind, [])):
                values[name] = chance.choice(some)
        made = cls(**values)  # as the model of the walk has it: checked, and none that is usual
        usual = {name: parameter.default for name, parameter in cls.parameters.items()}
        given = tuple((n, v) for n, v in made.settings.items() if v != usual[n])
        return kind, given, time, inputs

    source = stage(chance.choice(["WeaveSource", "ObjectSource"]))
    mover = chance.choice(MOVERS)
    above = [] if mover == "MotionReader" else [stage("ModalSolver", stage("TetraCage", source))]
    cage = stage(mover, *above, time=time)
    if mover != "TransientResponse" and chance.random() < 0.5:
        cage = stage("RotationStrain", cage, time=time)
    if source[0] == "WeaveSource" and chance.random() < 0.5:
        source = stage("CrimpInterchange", source, cage, time=time)
    return stage("PatchTessellator", stage("BarycentricWarp", source, cage, time=time), time=time)


def check(last: Any, content: Content, expected: Made) -> None:
    """Update a stage; it holds what a fresh one did, or refuses what that did."""
    results, errors = expected
    if errors:
        with pytest.raises(SpacemapError) as caught:
            last.update(content[2])
        assert error_text(caught.value) in errors.values()
    else:
        last.update(content[2])
        assert (digest(last.output), last.warnings) == results[key(content)]


def together(work: Callable[[int], None]) -> None:
    """Let threads begin at once, and raise what one of them raised."""
    gate = threading.Barrier(THREADS)

    def begin(number: int) -> None:
        gate.wait(60.0)
        work(number)

    with ThreadPoolExecutor(THREADS) as threads:
        for done in [threads.submit(begin, number) for number in range(THREADS)]:
            done.result()


def each_its_own(chance: Random, files: dict[str, list[Any]]) -> Counter[str]:
    """Let each thread update pipelines of its own, some of them the same as another's."""
    contents = [pipeline(chance, files) for _ in range(3)]
    expected = [fresh(content, {}) for content in contents]
    orders = [chance.sample(range(3), 3) for _ in range(THREADS)]

    def work(thread: int) -> None:
        for number in orders[thread]:
            made: dict[Content, Any] = {}
            last = build(contents[number], made)
            check(last, contents[number], expected[number])
            again = [stage.executions for stage in made.values()]
            check(last, contents[number], expected[number])
            if not expected[number][1]:
                assert [stage.executions for stage in made.values()] == again

    together(work)
    return Counter({"own": 3 * THREADS})


def at_one(chance: Random, files: dict[str, list[Any]]) -> Counter[str]:
    """Let all threads update, and change, one pipeline: some are refused, and none spoils it."""
    content = pipeline(chance, files)
    expected = fresh(content, {})
    made: dict[Content, Any] = {}
    last = build(content, made)
    stages = list(made.values())
    lock, counts = threading.Lock(), Counter[str]()
    orders = [[chance.randrange(8) for _ in range(6)] for _ in range(THREADS)]

    def work(thread: int) -> None:
        for choice in orders[thread]:
            stage = stages[-1 - choice % min(3, len(stages))]
            if choice == 0:
                stage.Modified()
            stated = ""
            try:
                stage.update(content[2])
            except SpacemapError as error:
                stated = error_text(error)
            refused = "another thread is updating" in stated
            assert refused or stated in {"", *expected[1].values()}
            if refused:
                sleep(0.01)  # or it would try in vain until the first is done
            with lock:
                counts["refused" if refused else "done"] += 1

    together(work)
    check(last, content, expected)
    # With a lock round the update and the use of what it made, all are right.
    turns = threading.Lock()

    def in_turn(thread: int) -> None:
        for _ in range(3):
            with turns:
                stages[thread % len(stages)].Modified()
                check(last, content, expected)

    together(in_turn)
    return counts


def rounds(count: int, first: int, folder: Path) -> Counter[str]:
    files, counts = write_inputs(folder), Counter[str]()
    for number in range(first, first + count):
        faulthandler.dump_traceback_later(300.0, exit=True)  # two threads that wait for each other
        counts += each_its_own(Random(number), files) + at_one(Random(number), files)
        faulthandler.cancel_dump_traceback_later()
        print(number, dict(counts), flush=True)
    return counts


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore::spacemap_vtk.errors.SpacemapWarning")
def test_threads_survive_some_rounds(tmp_path: Path) -> None:
    assert rounds(3, 1, tmp_path)["own"] == 9 * THREADS


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore::spacemap_vtk.errors.SpacemapWarning")
def test_threads_survive_many_rounds(tmp_path: Path) -> None:
    first = int(os.environ.get("SPACEMAP_SEED", datetime.date.today().toordinal()))
    counts = rounds(int(os.environ.get("SPACEMAP_ROUNDS", 50)), first, tmp_path)
    assert counts["refused"] > 0 < counts["done"]
