"""Base class of all filters, and functions to run and connect them from Python."""

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
    from typing import Self  # Python 3.10, which some ParaView releases include, lacks it

    from spacemap_vtk.mechanics.response.cage_response import Motion

#: Roles for which every scene has a stage, in the order of its pipeline; a scene without a cage has
#: only the first and the last. A stage may declare another role, see `Stage.after`; a scene has
#: that stage if it has the stage's section.
ROLES = ("source", "cage", "solver", "mover", "warp", "surface")

#: Lock that a thread holds while it claims the stages of its update.
_claim_lock = threading.Lock()


class ProvidedArray(NamedTuple):
    """Declaration of an array that a stage adds to its input."""

    association: Literal["point", "cell", "field"]
    """What has a value each: points or cells, or the data as a whole."""
    unit: str = ""
    """SI unit of the numbers."""
    when: Mapping[str, Sequence[Any]] = MappingProxyType({})
    """For which values of parameters it is there; none listed: any that is not empty."""


class Stage(Algorithm):
    """A VTK algorithm with declared parameters; base of all filters.

    A subclass declares the section of scene files that configures it, its position in a scene's
    pipeline (`role`, `after`), what it accepts and makes (`takes`, `makes`, and VTK's types
    `inputs`, `output_type`), the arrays that it `provides`, and its parameters. It implements `run`
    and, where they apply, `time_range` and `check`. Parameters that several stages share are in
    groups: classes without VTK, from which a stage inherits in addition to this one. A scene finds
    the stage in the table `spacemap_vtk.FILTERS`.
    """

    #: Roles of stages that cannot be in the same scene as this one.
    excludes: ClassVar[tuple[str, ...]] = ()
    #: The arrays that it can add, by name. Those for the present parameters are `arrays`.
    provides: ClassVar[Mapping[str, ProvidedArray]] = MappingProxyType({})

    #: Set by a stage further down that removes the artificial stretch of rotations; for one run.
    rotation_removed: bool = False
    #: Number of connections that all stages have made so far, and that number when this stage was
    #: last found not to be part of a ring.
    _connections: ClassVar[int] = 0
    _checked_connections: int = -1
    #: Time of the last change of this stage or one above it, when all were found to be connected.
    _connected_time: int = -1
    #: This stage and those above it at that time; some may have been deleted since.
    _upstream: Sequence[weakref.ref[Stage]] = ()

    def SetInputConnection(self, *given: Any) -> None:
        """Connect an input, as VTK does."""
        Stage._connections += 1
        super().SetInputConnection(*given)

    def AddInputConnection(self, *given: Any) -> None:
        """Add an input connection, as VTK does."""
        Stage._connections += 1
        super().AddInputConnection(*given)

    def _run_blocks(self, inputs: list[Any], output: Any, time: float) -> None:
        """Run with one object and one cage, which moves each block of a composite object."""
        if not any(isinstance(data, vtkCompositeDataSet) for data in inputs):
            self.run(inputs, output, time)
            return
        from spacemap_vtk.io.reading import leaf_blocks, merge_blocks

        for port, data in enumerate(inputs):
            if not isinstance(data, vtkCompositeDataSet):
                continue
            kinds = [leaf.GetClassName() for leaf in leaf_blocks(data)]
            if "cage" in self.takes[port : port + 1]:
                if kinds != [self.inputs[port]]:
                    raise InputError(
                        f"the cage must be one block, not {', '.join(kinds) or 'none'}",
                        allowed=f"one {self.inputs[port]}",
                        cure="Join the blocks with a volume with pyvista's "
                        "combine(merge_points=True) or ParaView's Merge Blocks.",
                    )
                inputs[port] = next(leaf_blocks(data))
            elif self.makes == "cage":
                inputs[port] = merge_blocks(data, "the input")
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
                    cure="Convert it, for example with pyvista's cast_to_unstructured_grid().",
                )
            made = block.NewInstance()
            self.run([block, *inputs[1:]], made, time)
            output.SetDataSet(place, made)
            place.GoToNextItem()

    def __repr__(self) -> str:
        given = [
            f"{name}={self._values[name]!r}" for name in self.parameters if name in self._values
        ]
        return f"{type(self).__name__}({', '.join(given)})"

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the parameters; the copy is not connected."""
        return _make_stage, (type(self), dict(self._values))

    @property
    def arrays(self) -> dict[str, ProvidedArray]:
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
        """The cage's motion as of the last update; None if it is known at one time only."""
        return None

    def check(self) -> None:
        """Check what can be checked without running. Does nothing by default.

        Raises
        ------
        SpacemapError
            If the next run would refuse its parameters.
        """

    @property
    def output(self) -> Any:
        """The data object of the last update; the first access updates the stage."""
        if not self._executions:
            self.update()
        return self.GetOutputDataObject(0)

    def GetOutput(self) -> Any:
        """Return the data object of the last update, as VTK's algorithms do."""
        return self.GetOutputDataObject(0)

    def update(self, time: float | None = None, piece: Piece | None = None) -> Self:
        """Update the output: run this stage and those above it where needed.

        Parameters
        ----------
        time : float, optional
            Time in s; by default the last requested time.
        piece : Piece, optional
            Part of the output that is wanted; by default the last requested piece.

        Returns
        -------
        Stage
            This stage, for ``stage.update().output``.

        Raises
        ------
        Exception
            The first exception that a stage raised, starting with those furthest up.
        SpacemapWarning
            If a filter of Python's `warnings` turns it into an error.
        InputError
            If an input is not connected, or the time is not a finite number.
        SpacemapError
            If another thread is updating a stage that this one needs.
        """
        if time is not None and not (isinstance(time, Real) and math.isfinite(time)):
            raise InputError(
                "must be a time", key="time", value=time, allowed="a finite number of seconds"
            )
        executive = self.GetExecutive()
        if self._checked_connections != Stage._connections:
            _collect_upstream(self, [], ())  # VTK would follow a ring until it crashes
            self._checked_connections = Stage._connections
        executive.UpdatePipelineMTime()  # the latest change of this stage or any above
        changed = executive.GetPipelineMTime()
        stages = [stage for known in self._upstream if (stage := known()) is not None]
        if changed != self._connected_time or len(stages) < len(self._upstream):
            above = list(self.upstream())
            for each in above:
                _check_connected(each)
            stages = [each for each in above if isinstance(each, Stage)]
            self._connected_time, self._upstream = changed, [weakref.ref(stage) for stage in stages]
        self._vtk_messages.clear()
        claimed = _claim(stages)
        # VTK's garbage collector scans the whole graph whenever Python deletes a wrapper. It can be
        # deferred in the main thread only; in another thread "Pop" would never return.
        deferred = threading.current_thread() is threading.main_thread()
        if deferred:
            vtkGarbageCollector.DeferredCollectionPush()
        try:
            # Not `UpdateTimeStep` or `Update`: VTK releases Python's lock in these. Then VTK's
            # collector, which holds a lock of all threads, may need Python's lock to free an array,
            # while a thread that has Python's lock waits for the collector's: a deadlock.
            wishes = vtkInformation()
            if time is not None:
                UPDATE_TIME.Set(wishes, float(time))
            for key, value in zip(PIECE, piece or self._requested(), strict=True):
                key.Set(wishes, value)
            done = self.Update(wishes)
        finally:
            if deferred:
                vtkGarbageCollector.DeferredCollectionPop()
            errors = [stage._error for stage in reversed(claimed) if stage._error is not None]
            for stage in claimed:
                stage._updated_by = stage._error = None
        if errors:
            raise errors[0]
        if done == 0 or self._vtk_messages:
            text = (
                self._vtk_messages[-1] if self._vtk_messages else "VTK could not update the stage"
            )
            raise SpacemapError(f"{type(self).__name__}: {text}")
        return self

    def __call__(self, *data: Any) -> Any:
        """Update the stage with these data and return a copy that later updates do not change."""
        _require_ports(self, len(data))
        for item in data:
            _require_data(item)
        former = []
        for port, item in enumerate(data):
            outputs = [
                self.GetInputConnection(port, index)
                for index in range(self.GetNumberOfInputConnections(port))
            ]
            # A reference to an output does not keep its producer alive; keep the producer.
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
        # Since 9.4 VTK connects `a >> b`. It connects a whole tuple to one port, which fails here.
        if not hasattr(vtkAlgorithm, "__rshift__"):
            return NotImplemented
        if not _is_several(producers) or not producers:
            return super().__rrshift__(producers)
        from vtkmodules.util.execution_model import Pipeline, select_ports

        _require_ports(self, len(producers))
        for port, producer in reversed(list(enumerate(producers))):
            made = Pipeline(producer, select_ports(port, self) if port else self)
        return made

    def upstream(self) -> Iterator[vtkAlgorithm]:
        """Yield this stage and all stages above it, each once, consumers before producers.

        Yields
        ------
        vtkAlgorithm
            A stage or any other VTK algorithm.
        """
        seen: list[vtkAlgorithm] = []
        _collect_upstream(self, seen, ())
        yield from reversed(seen)


def _make_stage(kind: type[Stage], values: Mapping[str, Any]) -> Stage:
    return kind(**values)


def _collect_upstream(
    stage: vtkAlgorithm, seen: list[vtkAlgorithm], below: tuple[vtkAlgorithm, ...]
) -> None:
    """Append a stage to `seen`, after all stages above it; refuse a ring."""
    if stage in below:
        name = type(stage).__name__
        raise InputError(
            f"the pipeline is a loop: {name} is upstream of itself",
            cure=f"Break the loop, for example with RemoveAllInputConnections(0) of {name}.",
        )
    if stage not in seen:
        for port in range(stage.GetNumberOfInputPorts()):
            for index in range(stage.GetNumberOfInputConnections(port)):
                above = stage.GetInputConnection(port, index).GetProducer()
                _collect_upstream(above, seen, (*below, stage))
        seen.append(stage)


def connect(*stages: Any) -> Any:
    """Connect stages, or any VTK algorithms, each to the next: `>>` for every version of VTK.

    Parameters
    ----------
    *stages : vtkAlgorithm, vtkDataObject, or sequence of these
        The output of each is the input of the next. The items of a sequence are connected to
        successive input ports, as in ``connect((weave, cage), warp, surface)``.

    Returns
    -------
    vtkAlgorithm
        The last stage, for ``connect(weave, surface).update()``.

    Raises
    ------
    InputError
        If there are no stages, more inputs than input ports, or an item that is not a stage.

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
                f"a {type(stage).__name__} cannot have an input",
                allowed="a vtkAlgorithm",
                cure="Put data first, as in connect(data, stage).",
            )
        inputs = before if _is_several(before) else (before,)
        _require_ports(stage, len(inputs))
        for port, item in enumerate(inputs):
            if isinstance(item, vtkAlgorithm):
                stage.SetInputConnection(port, item.GetOutputPort())
            else:
                _require_data(item)
                stage.SetInputDataObject(port, item)
    return stages[-1]


def _is_several(inputs: Any) -> bool:
    """Return whether these are inputs for several ports; a MultiBlock is also a sequence."""
    return isinstance(inputs, Sequence) and not isinstance(inputs, (vtkDataObject, str))


def _require_data(item: Any) -> None:
    if isinstance(item, type) and issubclass(item, vtkAlgorithm):
        name = item.__name__
        raise InputError(f"{name} is a class", cure=f"Make an instance: {name}().")
    if not isinstance(item, vtkDataObject):
        raise InputError(
            f"a {type(item).__name__} is not a VTK data object",
            allowed="a vtkDataObject, such as a pyvista mesh",
            cure="Read a file with pyvista.read(file); convert points with "
            "pyvista.PolyData(points).",
        )


def _require_ports(stage: vtkAlgorithm, count: int) -> None:
    if count > stage.GetNumberOfInputPorts():
        raise InputError(
            f"too many inputs for {type(stage).__name__}: {count}",
            allowed=str(stage.GetNumberOfInputPorts()),
        )


def modification_time(file: Path | None) -> int:
    """Return the time at which a file was last written.

    Parameters
    ----------
    file : Path or None
        The file, which need not exist.

    Returns
    -------
    int
        Time in ns; 0 if there is no file.
    """
    return file.stat().st_mtime_ns if file is not None and os.path.isfile(file) else 0


def _claim(stages: Sequence[Stage]) -> list[Stage]:
    """Claim stages for an update by this thread; return those that it had not claimed before."""
    own = threading.get_ident()
    with _claim_lock:
        claimed = [stage for stage in stages if stage._updated_by != own]
        for stage in claimed:
            if stage._updated_by is not None:
                raise SpacemapError(
                    f"another thread is updating {type(stage).__name__}",
                    cure="Give each thread its own pipeline, or protect the update and the use of "
                    "its output with a threading.Lock.",
                )
        for stage in claimed:
            stage._updated_by, stage._error, stage.rotation_removed = own, None, False
            if stage._changed_in_run:
                stage.Modified()
    return claimed


def _check_connected(stage: vtkAlgorithm) -> None:
    for port in range(stage.GetNumberOfInputPorts()):
        optional = stage.GetInputPortInformation(port).Get(vtkAlgorithm.INPUT_IS_OPTIONAL())
        if stage.GetNumberOfInputConnections(port) == 0 and not optional:
            raise InputError(
                f"input port {port} of {type(stage).__name__} is not connected",
                cure=f"Call SetInputConnection({port}, source.GetOutputPort()) first.",
            )
