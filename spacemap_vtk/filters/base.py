"""What the filters share: what they are in a pipeline, and how Python runs and connects them."""

from __future__ import annotations

import math
import os
import threading
import weakref
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from numbers import Real
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

from vtkmodules.vtkCommonCore import vtkGarbageCollector, vtkInformation
from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet, vtkDataObject
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm

from spacemap_vtk.datasets.processes import Piece
from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.filters.algorithm import PIECE, UPDATE_TIME, Algorithm

if TYPE_CHECKING:
    from typing import Self  # Python 3.10, which some ParaViews bring, has none

    from spacemap_vtk.mechanics.response.cage_response import Motion

#: The roles that every scene has a stage of, in the order of its pipeline; a scene without a cage
#: has the first and the last alone. A stage can declare any other role, see `Stage.after`: a scene
#: has such a stage where it names the stage's section.
ROLES = ("source", "cage", "solver", "mover", "warp", "surface")

#: Held while a thread takes the stages of an update.
_taking = threading.Lock()


class Provided(NamedTuple):
    """An array that a stage adds to what it is given."""

    association: Literal["point", "cell", "field"]
    """What has a value each: points or cells, or the data as a whole."""
    unit: str = ""
    """SI unit of the numbers."""
    when: Mapping[str, Sequence[Any]] = MappingProxyType({})
    """For which values of parameters it is there; none listed: any that is not empty."""


class Stage(Algorithm):
    """A VTK algorithm with declared parameters; base of all filters.

    A subclass declares the section of scene files that configures it, its place in a scene's
    pipeline (`role`, `after`), what it takes and makes (`takes`, `makes`, and VTK's types `inputs`,
    `output_type`), the arrays that it `provides`, and its parameters. It implements `run`, and
    where these apply `time_range` and `check`. Parameters that several stages share are in groups,
    classes without VTK that a stage inherits from beside this one. A scene finds the stage in the
    table `spacemap_vtk.FILTERS`.
    """

    #: The roles of stages that it cannot stand beside in a scene.
    excludes: ClassVar[tuple[str, ...]] = ()
    #: The arrays that it adds, by name; those of present parameters are `arrays`.
    provides: ClassVar[Mapping[str, Provided]] = MappingProxyType({})

    #: Set by a stage below that takes the stretch of turning out of a motion, for its own run.
    turned: bool = False
    #: How often any has been connected; and how often before this one was found to be in no ring.
    _connections: ClassVar[int] = 0
    _in_line: int = -1
    #: When this stage and those above it changed last, as they were found to be connected.
    _connected: int = -1
    #: This stage and those above it, then; Python may have let go of some since.
    _above: Sequence[weakref.ref[Stage]] = ()

    def SetInputConnection(self, *given: Any) -> None:
        """Connect an input, as VTK does."""
        Stage._connections += 1
        super().SetInputConnection(*given)

    def AddInputConnection(self, *given: Any) -> None:
        """Connect an input, too, as VTK does."""
        Stage._connections += 1
        super().AddInputConnection(*given)

    def _run_blocks(self, inputs: list[Any], output: Any, time: float) -> None:
        """Run with one object and one cage; blocks of an object that rides are moved each."""
        if not any(isinstance(data, vtkCompositeDataSet) for data in inputs):
            self.run(inputs, output, time)
            return
        from spacemap_vtk.io.reading import leaves, merged

        for port, data in enumerate(inputs):
            if not isinstance(data, vtkCompositeDataSet):
                continue
            kinds = [leaf.GetClassName() for leaf in leaves(data)]
            if "cage" in self.takes[port : port + 1]:
                if kinds != [self.inputs[port]]:
                    raise InputError(
                        f"the cage comes in blocks: {', '.join(kinds) or 'none'}",
                        allowed=f"one {self.inputs[port]}",
                        cure="Join those that have a volume, by pyvista's "
                        "combine(merge_points=True) or ParaView's Merge Blocks.",
                    )
                inputs[port] = next(leaves(data))
            elif self.makes == "cage":
                inputs[port] = merged(data, "the input")
        if not isinstance(inputs[0], vtkCompositeDataSet):
            self.run(inputs, output, time)
            return
        output.CopyStructure(inputs[0])
        place = inputs[0].NewIterator()
        place.InitTraversal()
        while not place.IsDoneWithTraversal():
            block = place.GetCurrentDataObject()
            if not block.IsA(self.inputs[0]):
                raise InputError(
                    f"a block is a {block.GetClassName()}",
                    allowed=self.inputs[0],
                    cure="Turn it into one, by pyvista's cast_to_unstructured_grid().",
                )
            made = block.NewInstance()
            self.run([block, *inputs[1:]], made, time)
            output.SetDataSet(place, made)
            place.GoToNextItem()

    @property
    def arrays(self) -> dict[str, Provided]:
        """The arrays that the next run adds, by name."""
        return {
            name: array
            for name, array in self.provides.items()
            if all(
                getattr(self, key) in values if values else bool(getattr(self, key))
                for key, values in array.when.items()
            )
        }

    @property
    def motion(self) -> Motion | None:
        """The motion of the cage as of the last update, where more than its present is known."""
        return None

    def check(self) -> None:
        """Check what can be checked without running; nothing by default.

        Raises
        ------
        SpacemapError
            If the next run would refuse its parameters.
        """

    @property
    def output(self) -> Any:
        """The data object that the last update made; where nothing has run yet, it is updated."""
        if not self._executions:
            self.update()
        return self.GetOutputDataObject(0)

    def GetOutput(self) -> Any:
        """Return what the last update made, as VTK's own algorithms do."""
        return self.GetOutputDataObject(0)

    def update(self, time: float | None = None, piece: Piece | None = None) -> Self:
        """Bring the output up to date: run this stage, and those above it, as far as needed.

        Parameters
        ----------
        time : float, optional
            Time in s. Without it the last requested time stays.
        piece : Piece, optional
            What part of the output is wanted. Without it the last requested piece stays.

        Returns
        -------
        Stage
            This one, for ``stage.update().output``.

        Raises
        ------
        Exception
            Whatever a stage raised, first of those above.
        SpacemapWarning
            If a filter of Python's `warnings` wants it as an error.
        InputError
            If an input is not connected, or the time is not a finite number.
        SpacemapError
            If another thread is updating a stage that this one needs.
        """
        if time is not None and not (isinstance(time, Real) and math.isfinite(time)):
            raise InputError(
                "not a time", key="time", value=time, allowed="a finite number of seconds"
            )
        executive = self.GetExecutive()
        if self._in_line != Stage._connections:
            _visit(self, [], ())  # VTK would go round a ring until it dies
            self._in_line = Stage._connections
        executive.UpdatePipelineMTime()  # the latest change of all above
        changed = executive.GetPipelineMTime()
        stages = [stage for known in self._above if (stage := known()) is not None]
        if changed != self._connected or len(stages) < len(self._above):
            above = list(self.upstream())
            for each in above:
                _check_connected(each)
            stages = [each for each in above if isinstance(each, Stage)]
            self._connected, self._above = changed, [weakref.ref(stage) for stage in stages]
        self._vtk_messages.clear()
        taken = _take(stages)
        # VTK's collector runs over the whole graph whenever Python lets go of a wrapper. It can be
        # deferred in the main thread only: elsewhere "pop" would never come to an end.
        deferred = threading.current_thread() is threading.main_thread()
        if deferred:
            vtkGarbageCollector.DeferredCollectionPush()
        try:
            # Not `UpdateTimeStep` nor `Update`: VTK lets go of Python's lock in these. Then its
            # collector, which holds a lock of all threads, may need Python's to free an array, and
            # a thread that has Python's waits for the collector's: both would stand for ever.
            wishes = vtkInformation()
            if time is not None:
                UPDATE_TIME.Set(wishes, float(time))
            for key, value in zip(PIECE, piece or self._requested(), strict=True):
                key.Set(wishes, value)
            done = self.Update(wishes)
        finally:
            if deferred:
                vtkGarbageCollector.DeferredCollectionPop()
            errors = [stage._error for stage in reversed(taken) if stage._error is not None]
            for stage in taken:
                stage._updated_by = stage._error = None
        if errors:
            raise errors[0]
        if done == 0 or self._vtk_messages:
            text = self._vtk_messages[-1] if self._vtk_messages else "VTK could not update it"
            raise SpacemapError(f"{type(self).__name__}: {text}")
        return self

    def __call__(self, *data: Any) -> Any:
        """Update, and return the output's data, which a later update leaves as they are."""
        _require_ports(self, len(data))
        for item in data:
            _require_data(item)
        former = []
        for port, item in enumerate(data):
            outputs = [
                self.GetInputConnection(port, index)
                for index in range(self.GetNumberOfInputConnections(port))
            ]
            # An output does not hold its producer.
            former.append([(output.GetProducer(), output.GetIndex()) for output in outputs])
            self.SetInputDataObject(port, item)
        try:
            made = self.update().output
        finally:
            for port, producers in enumerate(former):
                self.RemoveAllInputConnections(port)
                for producer, index in producers:
                    self.AddInputConnection(port, producer.GetOutputPort(index))
        copy = made.NewInstance()
        copy.ShallowCopy(made)
        return copy

    def __rrshift__(self, producers: Any) -> Any:
        # From 9.4 on VTK connects `a >> b`; a tuple all to one port, which no stage takes.
        if not hasattr(vtkAlgorithm, "__rshift__"):
            return NotImplemented
        if not _several(producers) or not producers:
            return super().__rrshift__(producers)
        from vtkmodules.util.execution_model import Pipeline, select_ports

        _require_ports(self, len(producers))
        for port, producer in reversed(list(enumerate(producers))):
            made = Pipeline(producer, select_ports(port, self) if port else self)
        return made

    def upstream(self) -> Iterator[vtkAlgorithm]:
        """Yield this stage and all above it, each once, consumers before producers.

        Yields
        ------
        vtkAlgorithm
            A stage or any other VTK algorithm.
        """
        seen: list[vtkAlgorithm] = []
        _visit(self, seen, ())
        yield from reversed(seen)


def _visit(stage: vtkAlgorithm, seen: list[vtkAlgorithm], below: tuple[vtkAlgorithm, ...]) -> None:
    """Add a stage to those seen, after all above it."""
    if stage in below:
        name = type(stage).__name__
        raise InputError(
            f"the pipeline is a ring: {name} is above itself",
            cure=f"Part it, as by RemoveAllInputConnections(0) of {name}.",
        )
    if stage not in seen:
        for port in range(stage.GetNumberOfInputPorts()):
            for index in range(stage.GetNumberOfInputConnections(port)):
                above = stage.GetInputConnection(port, index).GetProducer()
                _visit(above, seen, (*below, stage))
        seen.append(stage)


def connect(*stages: Any) -> Any:
    """Connect stages, or any algorithms of VTK, each to the next: `>>` for every VTK.

    Parameters
    ----------
    *stages : vtkAlgorithm, vtkDataObject, or sequence of these
        The output of each is the input of the one that follows; those of a sequence are the inputs
        on its ports, as in ``connect((weave, cage), warp, surface)``.

    Returns
    -------
    vtkAlgorithm
        The last, for ``connect(weave, surface).update()``.

    Raises
    ------
    InputError
        If there are none, or more inputs than input ports, or one is no stage.

    Examples
    --------
    >>> from spacemap_vtk import PatchTessellator, WeaveSource, connect
    >>> connect(WeaveSource(ends=1, picks=1), PatchTessellator()).update().executions
    1
    """
    if not stages:
        raise InputError("nothing to connect", cure="Write connect(source, stage, ...).")
    for before, stage in pairwise(stages):
        if not isinstance(stage, vtkAlgorithm):
            _require_data(stage)
            raise InputError(
                f"a {type(stage).__name__} takes no input",
                allowed="a vtkAlgorithm",
                cure="Data come first, as in connect(data, stage).",
            )
        inputs = before if _several(before) else (before,)
        _require_ports(stage, len(inputs))
        for port, item in enumerate(inputs):
            if isinstance(item, vtkAlgorithm):
                stage.SetInputConnection(port, item.GetOutputPort())
            else:
                _require_data(item)
                stage.SetInputDataObject(port, item)
    return stages[-1]


def _several(inputs: Any) -> bool:
    """Whether these are inputs of several ports; pyvista's MultiBlock is a sequence, too."""
    return isinstance(inputs, Sequence) and not isinstance(inputs, (vtkDataObject, str))


def _require_data(item: Any) -> None:
    if isinstance(item, type) and issubclass(item, vtkAlgorithm):
        name = item.__name__
        raise InputError(f"{name} is a class", cure=f"Make one of it: {name}().")
    if not isinstance(item, vtkDataObject):
        raise InputError(
            f"a {type(item).__name__} is no data of VTK's",
            allowed="a vtkDataObject, as pyvista's meshes are",
            cure="A file is read by pyvista.read(file), points are pyvista.PolyData(points).",
        )


def _require_ports(stage: vtkAlgorithm, count: int) -> None:
    if count > stage.GetNumberOfInputPorts():
        raise InputError(
            f"too many inputs for {type(stage).__name__}: {count}",
            allowed=str(stage.GetNumberOfInputPorts()),
        )


def written(file: Path | None) -> int:
    """Return when a file was last written.

    Parameters
    ----------
    file : Path or None
        Whether it is there or not.

    Returns
    -------
    int
        In ns; 0 where there is none.
    """
    return file.stat().st_mtime_ns if file is not None and os.path.isfile(file) else 0


def _take(stages: Sequence[Stage]) -> list[Stage]:
    """Mark stages as those that this thread updates; return those that it did not already."""
    own = threading.get_ident()
    with _taking:
        taken = [stage for stage in stages if stage._updated_by != own]
        for stage in taken:
            if stage._updated_by is not None:
                raise SpacemapError(
                    f"another thread is updating {type(stage).__name__}",
                    cure="Give each thread a pipeline of its own, or let threads take turns, with "
                    "a threading.Lock round the update and the use of what it makes.",
                )
        for stage in taken:
            stage._updated_by, stage._error, stage.turned = own, None, False
            if stage._is_late:
                stage.Modified()
    return taken


def _check_connected(stage: vtkAlgorithm) -> None:
    for port in range(stage.GetNumberOfInputPorts()):
        optional = stage.GetInputPortInformation(port).Get(vtkAlgorithm.INPUT_IS_OPTIONAL())
        if stage.GetNumberOfInputConnections(port) == 0 and not optional:
            raise InputError(
                f"{type(stage).__name__} has nothing connected to input port {port}",
                cure=f"Call SetInputConnection({port}, source.GetOutputPort()) first.",
            )
