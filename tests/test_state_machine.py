"""After any changes, a pipeline has the results of a new one, and has run only what it must.

A model records for each stage its last change, its connections and the requested time, and predicts
the stages that an update must run. Their results are compared, bit by bit, with those of new
stages.

The long walk takes ``SPACEMAP_STEPS`` steps, from the seed ``SPACEMAP_SEED`` on.
"""

from __future__ import annotations

import ctypes
import datetime
import gc
import itertools
import os
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest
from fresh import (
    SMALL,
    STAGES,
    Content,
    Made,
    digest,
    error_text,
    fresh,
    key,
    values_of,
    write_inputs,
    wrong_values,
)
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from vtkmodules.vtkCommonCore import vtkObject, vtkObjectBase

from spacemap_vtk.errors import InputError, SpacemapError, SpacemapWarning
from spacemap_vtk.filters.algorithm import UPDATE_TIME

TIMES = (None, 0.0, -1.0, 1e-4, 3e-4, 1e-3)
#: Most stages, longest chain of stages, most copies.
MOST, DEEPEST, COPIES = 16, 9, 6
#: Stages that move a cage.
MOVERS = [name for name, stage in STAGES.items() if stage.role == "mover"]


class Copy:
    """Copied data, and their content at that time."""

    moves, depth, connected, time = False, 0, True, None

    def __init__(self, number: int, data: Any, of: Node) -> None:
        assert of.content is not None
        self.number, self.data, self.makes = number, data, of.makes
        self.state, self.content = (number,), ("copy", (), None, (of.content,))
        self.digest = digest(data)

    def closure(self) -> Iterator[Any]:
        yield self

    def ask(self, time: float | None) -> None:
        """Data have no time."""

    def plan(self, into: dict[Any, Any]) -> Any:
        return self.content


class Node:
    """The model's record of a stage."""

    def __init__(self, number: int, kind: str) -> None:
        self.number, self.kind, self.cls = number, kind, STAGES[kind]
        self.stage: Any = self.cls(**SMALL.get(kind, {}))
        self.settings, self.makes = self.stage.settings, self.cls.makes
        self.inputs: list[Node | Copy | None] = [None] * len(self.cls.inputs)
        self.version = self.runs = 0
        #: The last requested time; time, state and content of the last run.
        self.asked: float | None = None
        self.time: float | None = None
        self.ran: Any = None
        self.content: Content | None = None

    @property
    def above(self) -> list[Any]:
        return [each for each in self.inputs if each is not None]

    @property
    def state(self) -> Any:
        """Its own version and those of all stages above it."""
        return self.number, self.version, *(each.state for each in self.above)

    @property
    def moves(self) -> bool:
        own = self.cls.role == "mover" and self.settings.get("file", True) is not None
        return own or any(each.moves for each in self.above)

    @property
    def connected(self) -> bool:
        return None not in self.inputs and all(each.connected for each in self.above)

    @property
    def depth(self) -> int:
        return 1 + max((each.depth for each in self.above), default=0)

    def closure(self) -> Iterator[Any]:
        for each in self.above:
            yield from each.closure()
        yield self

    @property
    def needed(self) -> bool:
        """Whether an update must run it: it, a stage above, or the time has changed."""
        late = self.moves and self.asked is not None and self.asked != self.time
        return self.ran != self.state or late

    def ask(self, time: float | None) -> None:
        """Pass a time to the stages above that must run."""
        self.asked = self.asked if time is None else time
        if self.needed:
            for each in self.above:
                each.ask(self.asked)

    def plan(self, into: dict[Node, Content]) -> Content:
        """Add the stages that must run, with their content; return the content of this one."""
        if self not in into and self.needed:
            inputs = tuple(each.plan(into) for each in self.above)
            usual = {name: parameter.default for name, parameter in self.cls.parameters.items()}
            values = tuple((n, v) for n, v in self.settings.items() if v != usual[n])
            into[self] = self.kind, values, self.asked if self.moves else None, inputs
        return into.get(self, self.content)  # type: ignore[return-value]

    def done(self, content: Content) -> None:
        times = {each.time for each in self.above if each.moves}
        times |= {0.0} if self.cls.role == "mover" else set()
        if self.asked is not None:
            times = {self.asked}
        self.time = times.pop() if len(times) == 1 else None
        self.ran, self.content = self.state, content


def pick(data: Any, among: list[Any]) -> Any:
    """Draw an item by its index, because Hypothesis keeps a label of each list it draws from."""
    return among[data.draw(st.integers(0, len(among) - 1))]


class Machine(RuleBasedStateMachine):
    """Random actions of a user on pipelines."""

    files: ClassVar[dict[str, list[Any]]] = {}
    known: ClassVar[dict[str, Made]] = {}
    counts: ClassVar[Counter[str]] = Counter()
    numbers: ClassVar[Iterator[int]] = itertools.count()
    #: Stages and copies that VTK has not deleted, with the observers of their deletion.
    alive: ClassVar[dict[int, Any]] = {}

    def __init__(self) -> None:
        super().__init__()
        self.nodes: list[Node] = []
        self.copies: list[Copy] = []
        #: Includes released copies that a stage still uses.
        self.kept: set[Copy] = set()
        self.alive.clear()

    @property
    def held(self) -> list[Node]:
        """Stages that Python refers to; others are kept alive by the stages below them."""
        return [node for node in self.nodes if node.stage is not None]

    @property
    def users(self) -> list[Node]:
        return [node for node in self.held if node.inputs]

    def watch_deletion(self, number: int, thing: vtkObject) -> int:
        # Kept here too: Python may collect it before VTK calls it.
        def gone(*_: Any) -> None:
            self.alive[number] = None

        self.alive[number] = gone
        thing.AddObserver("DeleteEvent", gone)
        return number

    def find_stages(self, node: Node, stage: Any, into: dict[Node, Any]) -> dict[Node, Any]:
        """Return the stages of a node and those above it, connected as the model says."""
        into[node] = stage
        assert type(stage) is node.cls
        for port, above in enumerate(node.inputs):
            assert stage.GetNumberOfInputConnections(port) == (above is not None)
            if isinstance(above, Copy):
                assert stage.GetInputDataObject(port, 0) is above.data
            elif above is not None:
                self.find_stages(above, stage.GetInputConnection(port, 0).GetProducer(), into)
        return into

    def add(self, kind: str) -> Node:
        node = Node(next(self.numbers), kind)
        self.watch_deletion(node.number, node.stage)
        if kind in ("ObjectSource", "MotionReader"):
            self.assign(node, "file", self.files[kind][0])
        self.nodes.append(node)
        return node

    def possible_producers(self, node: Node, producers: list[Any]) -> list[Any]:
        """Return producers that a stage can use without a cycle or too long a chain."""

        def below(stage: Node) -> int:
            return 1 + max((below(n) for n in self.nodes if stage in n.above), default=0)

        room = DEEPEST - below(node)
        return [p for p in producers if p.depth <= room and node not in p.closure()]

    def join(self, node: Node, port: int, chosen: Any) -> None:
        node.version += chosen is not node.inputs[port]
        node.inputs[port] = chosen
        if isinstance(chosen, Copy):
            node.stage.SetInputDataObject(port, chosen.data)
        else:
            node.stage.SetInputConnection(port, chosen.stage.GetOutputPort())

    @precondition(lambda self: len(self.nodes) + 8 <= MOST)
    @rule(data=st.data())
    def line(self, data: Any) -> None:
        """Make a complete pipeline like that of a scene."""
        self.counts["step: make a line"] += 1
        source = pick(data, ["WeaveSource", "ObjectSource"])
        some, mover = st.booleans(), pick(data, MOVERS)
        kinds = [source, *["TetraCage", "ModalSolver"] * (mover != "MotionReader"), mover]
        kinds += ["RotationStrain"] * (mover != "TransientResponse" and data.draw(some))
        kinds += ["CrimpInterchange"] * (source == "WeaveSource" and data.draw(some))
        last: dict[str, Node] = {}
        for kind in (*kinds, "BarycentricWarp", "PatchTessellator"):
            node = self.add(kind)
            for port, takes in enumerate(node.cls.takes):
                self.join(node, port, last[takes])
            last[node.makes] = node

    @precondition(lambda self: 0 < len(self.nodes) < MOST)
    @rule(kind=st.sampled_from(sorted(STAGES)), data=st.data())
    def make(self, kind: str, data: Any) -> None:
        self.counts["step: make a stage"] += 1
        node = self.add(kind)
        for port, takes in enumerate(node.cls.takes):
            if possible_producers := self.possible_producers(
                node, [n for n in self.held if n.makes == takes]
            ):
                self.join(node, port, pick(data, possible_producers))

    @precondition(lambda self: len(self.held) > 2)
    @rule(data=st.data(), how=st.sampled_from(["connect", "disconnect", "delete", "take"]))
    def part(self, data: Any, how: str) -> None:
        """Connect, disconnect or release a stage, or take one again from a pipeline."""
        self.counts[f"step: {how}"] += 1
        used = [(n, p) for n in self.users for p, each in enumerate(n.inputs) if each is not None]
        lost = [n for n in self.nodes if n.stage is None]
        if how == "connect" and self.users:
            node = pick(data, self.users)
            port = data.draw(st.integers(0, len(node.inputs) - 1))
            kinds = [node.cls.takes[port]]
            kinds += ["object", "cage"] * (data.draw(st.integers(0, 9)) == 0)
            given = [each for each in [*self.held, *self.copies] if each.makes in kinds]
            if possible_producers := self.possible_producers(node, given):
                self.join(node, port, pick(data, possible_producers))
        elif how == "disconnect" and used:
            node, port = pick(data, used)
            node.stage.RemoveAllInputConnections(port)
            node.inputs[port] = None
            node.version += 1
        elif how == "delete":
            pick(data, self.held).stage = None
        elif how == "take" and lost:
            node = pick(data, lost)
            below = next(n for n in self.held if node in n.closure())
            node.stage = self.find_stages(below, below.stage, {})[node]

    @precondition(lambda self: self.held)
    @rule(data=st.data(), back=st.integers(0, 3))
    def change(self, data: Any, back: int) -> None:
        self.counts["step: set"] += 1
        node = pick(data, self.held)
        usual = {name: parameter.default for name, parameter in node.cls.parameters.items()}
        if back == 0:  # or most would soon be refused
            for name, value in (usual | SMALL.get(node.kind, {})).items():
                if name != "file":
                    self.assign(node, name, value)
            return
        possible_producers = {
            name: values_of(parameter, self.files.get(node.kind, []))
            for name, parameter in node.cls.parameters.items()
        }
        name = pick(data, [name for name, values in possible_producers.items() if values])
        self.assign(node, name, pick(data, possible_producers[name]))

    def assign(self, node: Node, name: str, value: Any) -> None:
        changed, before = node.stage.GetMTime(), node.settings[name]
        setattr(node.stage, name, value)
        node.settings = node.stage.settings
        same = node.settings[name] == before
        assert (node.stage.GetMTime() == changed) == same
        node.version += not same

    @precondition(lambda self: self.held)
    @rule(data=st.data(), how=st.sampled_from(["alone", "with others", "misspelt"]))
    def refuse(self, data: Any, how: str) -> None:
        self.counts["step: refuse"] += 1
        node = pick(data, self.held)
        name = pick(data, list(node.settings))
        value = pick(data, wrong_values(node.cls.parameters[name]))
        changed = node.stage.GetMTime()
        values = {**node.cls().settings, name: value} if how == "with others" else {name: value}
        if how == "misspelt":
            values = {f"{name}_": value}
        with pytest.raises(InputError, match=name):
            node.stage.configure(**values)
        assert node.stage.settings == node.settings
        assert node.stage.GetMTime() == changed

    @precondition(lambda self: self.held)
    @rule(data=st.data(), time=st.sampled_from(TIMES))
    def update(self, data: Any, time: float | None) -> None:
        self.check_update(pick(data, self.held), time)

    @precondition(lambda self: self.held)
    @rule(data=st.data(), time=st.sampled_from(TIMES))
    def update_end(self, data: Any, time: float | None) -> None:
        ends = [node for node in self.held if not any(node in n.above for n in self.nodes)]
        self.check_update(pick(data, ends or self.held), time)

    def check_update(self, node: Node, time: float | None) -> None:
        """Update a stage; check which stages ran, once, and compare with new ones."""
        self.counts["step: update"] += 1
        stages = self.find_stages(node, node.stage, {})
        if time is None and node.asked is None and len({n.asked for n in stages} - {None}) > 1:
            time = 0.0  # which of those above would win?
        assert {n: stage.executions for n, stage in stages.items()} == {n: n.runs for n in stages}
        if not node.connected:
            with pytest.raises(InputError, match=r"input port \d of \w+ is not connected"):
                node.stage.update(time)
            assert [n.runs for n in stages] == [stage.executions for stage in stages.values()]
            return
        node.ask(time)
        plan: dict[Node, Content] = {}
        content = node.plan(plan)
        results, errors = fresh(content, self.known)
        if errors:
            self.counts["refused updates"] += 1
            with pytest.raises(SpacemapError) as caught:
                node.stage.update(time)
            assert error_text(caught.value) in errors.values()
        else:
            assert node.stage.update(time) is node.stage
        runs = {n: stage.executions - n.runs for n, stage in stages.items()}
        for each in [*plan, *(n for n in stages if n not in plan)]:  # from above
            stage = stages[each]
            where = each.kind, plan.get(each), runs[each], time, each.asked, each.time
            assert runs[each] <= (each in plan), where
            each.runs = stage.executions
            if errors:  # who knows how far a time was passed on?
                info = stage.GetOutputInformation(0)
                each.asked = info.Get(UPDATE_TIME) if info.Has(UPDATE_TIME) else None
            if runs[each] and key(plan[each]) in errors:
                each.ran = None
            elif runs[each]:
                each.done(plan[each])
                self.counts[each.kind] += 1
            if each in plan and not errors:
                assert runs[each] == 1, where
                made, printed = results[key(plan[each])]
                assert digest(stage.GetOutputDataObject(0)) == made, where
                assert stage.warnings == printed, where
        if not errors:
            assert digest(node.stage.GetOutputDataObject(0)) == results[key(content)][0]

    @precondition(lambda self: any(n.ran == n.state for n in self.held))
    @rule(data=st.data(), deep=st.booleans())
    def copy(self, data: Any, deep: bool) -> None:
        """Copy the data of a stage; release copies, whose data must be unchanged."""
        self.counts["step: copy"] += 1
        node = pick(data, [n for n in self.held if n.ran == n.state])
        made = node.stage.GetOutputDataObject(0)
        copied = made.NewInstance()
        copied.DeepCopy(made) if deep else copied.ShallowCopy(made)
        self.copies.append(Copy(self.watch_deletion(next(self.numbers), copied), copied, node))
        self.kept.add(self.copies[-1])
        assert self.copies[-1].digest == digest(made)
        if len(self.copies) > data.draw(st.integers(0, COPIES)):
            self.let_go(pick(data, self.copies))

    def let_go(self, copy: Copy) -> None:
        assert digest(copy.data) == copy.digest
        self.copies.remove(copy)

    @invariant()
    def check_alive(self) -> None:
        """VTK keeps the stages that Python refers to and those above; all others are deleted."""
        living = {*self.copies, *(each for node in self.held for each in node.closure())}
        self.nodes = [node for node in self.nodes if node in living]
        for copy in self.kept - living:
            copy.data = None  # Hypothesis holds what was drawn
        self.kept &= living
        expected = sorted(each.number for each in living)
        if sorted(n for n, gone in self.alive.items() if gone) != expected:
            gc.collect()  # what the traceback of an error holds
            assert sorted(n for n, gone in self.alive.items() if gone) == expected
        for number in [n for n, gone in self.alive.items() if not gone]:
            del self.alive[number]

    def teardown(self) -> None:
        for copy in [*self.copies]:
            self.let_go(copy)
        for node in self.nodes:
            node.stage = None
        self.check_alive()


def resident() -> float:
    """Return the memory of this process in MiB, without freed memory."""
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):  # glibc's: a heap keeps holes, more or less of them by chance
        libc.malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text("utf-8").split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 2**20


def walk(steps: int, first: int, folder: Path, length: int = 100) -> list[tuple[int, float, int]]:
    """Take steps from a seed; return the steps, memory in MiB and number of VTK objects on the way.

    Each seed is of a thousand steps: what Hypothesis keeps of all that it has drawn would grow.
    """
    Machine.files = write_inputs(folder)
    Machine.counts.clear()
    along: list[tuple[int, float, int]] = []
    some = settings(
        max_examples=min(10, -(-steps // length)),
        stateful_step_count=length,
        deadline=None,
        database=None,
        phases=[Phase.generate],  # the seed tells where; to shrink takes minutes
        suppress_health_check=list(HealthCheck),
    )
    for number in itertools.count(first):
        print(f"seed {number}", dict(Machine.counts), flush=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SpacemapWarning)
            run_state_machine_as_test(seed(number)(Machine), settings=some)
        gc.collect()
        taken = sum(n for what, n in Machine.counts.items() if what.startswith("step"))
        things = sum(isinstance(thing, vtkObjectBase) for thing in gc.get_objects())
        along.append((taken, resident(), things))
        print(*along[-1], flush=True)
        if taken >= steps:
            return along
    raise AssertionError


def test_a_short_random_walk_finds_no_fault(tmp_path: Path) -> None:
    walk(60, 1, tmp_path, 60)


@pytest.mark.nightly
def test_a_long_random_walk_keeps_memory_constant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPACEMAP_COMPILED", "never")  # numba takes 110 MB once, whenever that is
    first = int(os.environ.get("SPACEMAP_SEED", datetime.date.today().toordinal()))
    along = walk(int(os.environ.get("SPACEMAP_STEPS", 10_000)), first, tmp_path)
    warm, half, end = along[len(along) // 4], along[len(along) // 2], along[-1]
    assert end[1] < warm[1] + 20.0
    assert end[1] < half[1] + 5.0  # by then caches are full: what grows still is a leak
    assert end[2] <= along[0][2]
