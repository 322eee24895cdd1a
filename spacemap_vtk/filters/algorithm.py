"""A VTK algorithm in Python: it answers requests, counts its runs, and passes on errors and pieces.

Invariants:

- An exception never crosses VTK's C++ frames, which would print it and lose it. It is stored on the
  stage that raised it, the output is marked as not generated, and `Stage.update` raises it.
- A stage that is asked for a piece asks the stages above it for the same piece, so that no two
  consumers ask a stage for different pieces and run it twice. Data that cannot be divided (a cage)
  are whole in every piece, and marked as duplicates in all pieces but the first.
- No stage holds a reference to itself or to a stage above it, not even through an observer or a
  stored bound method: VTK 9.2 never frees such an object.
- Read values as `key.Get(info)`, not as `info.Get(key)`: Python has to choose the latter among so
  many overloads that it takes fifteen times as long, half the cost of a request.
- An attribute that a stage keeps for its next run, and that may hold VTK objects, must be declared
  as None in the class: before VTK 9.7 it is deleted with the last reference from Python.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import nan
from typing import Any, ClassVar, Literal

from vtkmodules.util.misc import calldata_type
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.util.vtkConstants import VTK_STRING
from vtkmodules.vtkCommonCore import vtkInformation, vtkInformationVector, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonExecutionModel import (
    vtkAlgorithm,
    vtkDemandDrivenPipeline,
    vtkStreamingDemandDrivenPipeline,
)

from spacemap_vtk import cancel
from spacemap_vtk.applicability import LIMITS, Finding, LimitWarning, key_of_warning
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.datasets.extent import mark_owner
from spacemap_vtk.datasets.processes import WHOLE, PeerError, Piece, Processes, is_first, world_size
from spacemap_vtk.errors import SpacemapError, warn_user
from spacemap_vtk.parameters import Parameterised

_DATA_OBJECT = vtkDemandDrivenPipeline.REQUEST_DATA_OBJECT()
_INFORMATION = vtkDemandDrivenPipeline.REQUEST_INFORMATION()
_UPDATE_EXTENT = vtkStreamingDemandDrivenPipeline.REQUEST_UPDATE_EXTENT()
_DATA = vtkDemandDrivenPipeline.REQUEST_DATA()
_OBJECT = vtkDataObject.DATA_OBJECT()
_DATA_TIME = vtkDataObject.DATA_TIME_STEP()
_TIME_RANGE = vtkStreamingDemandDrivenPipeline.TIME_RANGE()
_TIME_STEPS = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
UPDATE_TIME = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
PIECE = (
    vtkStreamingDemandDrivenPipeline.UPDATE_PIECE_NUMBER(),
    vtkStreamingDemandDrivenPipeline.UPDATE_NUMBER_OF_PIECES(),
    vtkStreamingDemandDrivenPipeline.UPDATE_NUMBER_OF_GHOST_LEVELS(),
)

#: The types of data that a pipeline passes from stage to stage.
Kind = Literal["object", "cage", "cell"]
#: The pipeline information of a request: one vector for each input port.
Inputs = tuple[vtkInformationVector, ...]
#: If Python deletes its reference to a stage that VTK still holds, VTK keeps the stage's attributes
#: until it deletes the stage. Before 9.7 it frees them while it iterates over its table of objects.
#: VTK objects among them corrupt the table, and the program crashes later.
_GHOSTS_ARE_FRAGILE = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) < (9, 7)

#: Value of `Stage.output_type`: the output has the type of the data on input port 0.
SAME_AS_INPUT = "vtkDataObject"


class Algorithm(Parameterised, VTKPythonAlgorithmBase):
    """The VTK side of a stage: it answers requests and counts its runs."""

    #: What each input port accepts, and what the output is. A scene connects its stages by these.
    #: A cage is whole in every piece of the data.
    takes: ClassVar[tuple[Kind, ...]] = ()
    makes: ClassVar[Kind] = "object"
    #: Required data type of each input port.
    inputs: ClassVar[tuple[str, ...]] = ()
    #: Name of each input port, for windows that ask for inputs by name.
    input_names: ClassVar[tuple[str, ...]] = ("Input",)
    #: Data type of the output.
    output_type: ClassVar[str] = "vtkUnstructuredGrid"
    #: Position in a scene's pipeline: one of `spacemap_vtk.filters.base.ROLES`, or a new role that
    #: directly follows the role `after`.
    role: ClassVar[str] = ""
    after: ClassVar[str] = ""
    #: Whether pieces of the output share no points and therefore need no ghosts.
    seamless: bool = False

    # VTKPythonAlgorithmBase sets these two on the instance; undeclared names would be refused.
    InputType: str = ""
    OutputType: str = ""

    _executions: int
    _warnings: list[str]
    _issued: set[str]
    _findings: dict[str, Finding]
    _vtk_messages: list[str]
    _error: BaseException | None
    #: Identifier of the thread that is updating this stage.
    _updated_by: int | None = None
    #: Whether the stage was changed during its last run. VTK would consider that run up to date.
    _changed_in_run: bool = False
    _piece: Piece = WHOLE
    _processes: Processes | None = None
    _deferred_error: BaseException | None = None
    #: Warnings about parameters that have no effect; None if they must be determined again.
    _unused_warnings: list[str] | None = None

    def __init__(self, /, **values: Any) -> None:
        VTKPythonAlgorithmBase.__init__(
            self, nInputPorts=len(self.inputs), nOutputPorts=1, outputType=self.output_type
        )
        self._executions = 0
        self._warnings = []
        self._issued = set()
        self._findings = {}
        self._error = None
        self._vtk_messages = []
        # VTK would print these errors; `update` raises them. The observer refers to the list only.
        observer = _make_collector(self._vtk_messages)
        self.AddObserver("ErrorEvent", observer)
        executive = self.GetExecutive()
        executive.AddObserver("ErrorEvent", observer)
        # Python's garbage collector cannot see VTK's references. If only garbage refers to a stage,
        # it clears the stage's attributes, although a pipeline still uses the stage. An observer
        # holds the attributes where the collector does not look.
        executive.AddObserver("NoEvent", partial(_keep_alive, self.__dict__, observer))
        Parameterised.__init__(self, **values)

    if _GHOSTS_ARE_FRAGILE:

        def __del__(self) -> None:
            values = self.__dict__
            for name in [name for name in values if getattr(type(self), name, name) is None]:
                del values[name]

    @property
    def executions(self) -> int:
        """Number of times that this stage has run."""
        return self._executions

    @property
    def warnings(self) -> tuple[str, ...]:
        """The last run's doubts about its result."""
        return tuple(self._warnings)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the last run found of the ranges in which its models are valid."""
        return tuple(self._findings.values())

    @property
    def replicated(self) -> bool:
        """Whether every piece contains the whole output."""
        return self.makes == "cage"

    @property
    def piece(self) -> Piece:
        """The piece of the output that was requested last."""
        return self._piece

    def run(self, inputs: list[Any], output: Any, time: float) -> None:
        """Fill the output from the inputs.

        Parameters
        ----------
        inputs : list of vtkDataObject
            The data on the first connection of each input port.
        output : vtkDataObject
            The data object to fill.
        time : float
            The requested time in s; 0 if none was requested.
        """
        raise NotImplementedError

    def time_range(self, inputs: list[vtkInformation]) -> tuple[float, float] | None:
        """Return the first and last time in s, or None for a stage without time.

        Parameters
        ----------
        inputs : list of vtkInformation
            Pipeline information of each input.

        Returns
        -------
        tuple of float or None
            By default the union of the inputs' ranges; VTK passes on only that of port 0.
        """
        ranges = [info.Get(_TIME_RANGE) for info in inputs if _TIME_RANGE.Has(info)]
        if not ranges:
            return None
        return min(r[0] for r in ranges), max(r[1] for r in ranges)

    def time_steps(self, inputs: list[vtkInformation]) -> list[float]:
        """Return the times in s for which data exist; empty if any time is possible.

        Parameters
        ----------
        inputs : list of vtkInformation
            Pipeline information of each input.

        Returns
        -------
        list of float
            By default the union of the inputs' steps, ascending.
        """
        return sorted(
            {step for info in inputs if _TIME_STEPS.Has(info) for step in info.Get(_TIME_STEPS)}
        )

    def report_progress(self, fraction: float, step: str = "") -> None:
        """Report the progress of the run, and stop the run if an observer asks for it.

        Parameters
        ----------
        fraction : float
            Share that is done, from 0 to 1; of the step, if the run has several.
        step : str, optional
            What is being done, in a word or two; it becomes VTK's progress text.

        Raises
        ------
        Cancelled
            If AbortExecute was set, or this thread's token was cancelled.
        """
        cancel.check()
        self.SetProgressText(step)
        self.UpdateProgress(fraction)
        if self.GetAbortExecute():
            raise Cancelled(f"{type(self).__name__} was cancelled")

    def warn(self, text: str) -> None:
        """Add a sentence to `warnings`. Call this from `run`.

        After the run each new sentence is also issued as a Python warning, a `SpacemapWarning`.

        Parameters
        ----------
        text : str
            One sentence.
        """
        self._warnings.append(text)

    def check_limit(self, key: str, value: float | None = None, **words: str) -> None:
        """Record the value of a limit's quantity; warn if it exceeds the limit. Call it from `run`.

        Parameters
        ----------
        key : str
            Name of an entry of `spacemap_vtk.applicability.LIMITS`.
        value : float, optional
            Value of its quantity, in SI; None if it is not known.
        **words : str
            What the warning says instead of the entry's ``found``, ``beyond`` and ``cure``.
        """
        finding = self._findings[key] = Finding(key, value)
        if value is not None and finding.is_valid is False:
            self.warn(LimitWarning(LIMITS[key].warning(value, **words), key, value))

    def FillInputPortInformation(self, port: int, info: vtkInformation) -> int:
        """Declare what an input port accepts, including composite data if VTK would fail on it."""
        kind = vtkAlgorithm.INPUT_REQUIRED_DATA_TYPE()
        info.Set(kind, self.inputs[port])
        # VTK would run the stage once per block. That would make a cage around each block, and
        # lose the times of the second input, so that the cage would not move.
        if len(self.inputs) > 1 or self.makes == "cage":
            info.Append(kind, "vtkCompositeDataSet")
        return 1

    def ProcessRequest(
        self, request: vtkInformation, in_info: Inputs, out_info: vtkInformationVector
    ) -> int:
        """Answer a request of the executive; an exception is stored for `update`."""
        if self._updated_by is not None and self._error is not None:
            # It has already failed in this update, for another consumer.
            return _refuse(out_info)
        try:
            if _DATA.Has(request):
                self._request_data(in_info, out_info)
            elif _UPDATE_EXTENT.Has(request):
                self._request_update_extent(in_info, out_info)
            elif _INFORMATION.Has(request):
                self._deferred_error = None
                self._request_information(in_info, out_info)
            elif _DATA_OBJECT.Has(request):
                self._request_data_object(in_info, out_info)
        except BaseException as error:  # also KeyboardInterrupt, which VTK would swallow
            if isinstance(error, SpacemapError):
                error.section = self.section
                parameter = self.parameters.get(error.key or "")
                if isinstance(error.value, float) and parameter is not None and parameter.unit:
                    error.value = parameter.format(error.value)  # with its unit
            if world_size() > 1 and not _DATA.Has(request):
                # The other processes would wait for this one for ever: raise it when all run.
                self._deferred_error = error
                return 1
            self._error = error
            return _refuse(out_info)
        return 1

    def _request_data_object(self, in_info: Inputs, out_info: vtkInformationVector) -> None:
        if self.output_type != SAME_AS_INPUT:
            return  # the executive makes an object of the declared type
        source = _OBJECT.Get(in_info[0].GetInformationObject(0))
        info = out_info.GetInformationObject(0)
        made = _OBJECT.Get(info)
        if made is None or made.GetClassName() != source.GetClassName():
            info.Set(vtkDataObject.DATA_OBJECT(), source.NewInstance())

    def _request_information(self, in_info: Inputs, out_info: vtkInformationVector) -> None:
        inputs = [vector.GetInformationObject(0) for vector in in_info]
        span = self.time_range(inputs)
        info = out_info.GetInformationObject(0)
        if span is None:
            info.Remove(_TIME_RANGE)
        else:
            info.Set(_TIME_RANGE, span, 2)
        if not self.inputs:
            info.Set(vtkAlgorithm.CAN_HANDLE_PIECE_REQUEST(), 1)
        steps = self.time_steps(inputs)
        if steps:
            info.Set(_TIME_STEPS, steps, len(steps))
        else:
            info.Remove(_TIME_STEPS)

    def _request_data(self, in_info: Inputs, out_info: vtkInformationVector) -> None:
        self._error = None
        self._warnings.clear()
        self._findings.clear()
        self._executions += 1
        changed = self.GetMTime()
        info = out_info.GetInformationObject(0)
        self._piece = _piece_of(info)
        self._processes = Processes.for_piece(self._piece)
        # Until a time is requested there is none.
        time = UPDATE_TIME.Get(info) if UPDATE_TIME.Has(info) else 0.0
        inputs = [_OBJECT.Get(vector.GetInformationObject(0)) for vector in in_info]
        output = _OBJECT.Get(info)
        if self._processes is None:
            self._run(inputs, output, time)
        else:
            try:
                self._run(inputs, output, time)
            except PeerError:
                raise
            except BaseException as error:
                self._processes.fail(error)
                raise
            self._warnings = self._processes.finish(self._warnings)
            self._issue_warnings()  # also warnings of the other processes
        self._changed_in_run = self.GetMTime() != changed
        if _TIME_RANGE.Has(info):
            made = time if UPDATE_TIME.Has(info) else self._own_time(in_info)
            for key in (_DATA_TIME, UPDATE_TIME):  # VTK 9.4 needs both
                output.GetInformation().Set(key, made)

    def _own_time(self, in_info: Inputs) -> float:
        """Return the time of an output for which no time was requested."""
        # VTK would trust the time that was copied with an input's arrays. If the inputs differ, the
        # result is nan, which equals no request. A mover runs at time 0.
        times = {0.0} if self.role == "mover" else set()
        for above in (vector.GetInformationObject(0) for vector in in_info):
            if _TIME_RANGE.Has(above):
                made = _OBJECT.Get(above).GetInformation()
                times.add(_DATA_TIME.Get(made) if _DATA_TIME.Has(made) else nan)
        return times.pop() if len(times) == 1 else nan

    def _issue_warnings(self) -> None:
        """Issue each new warning once; an animation would repeat it with every frame."""
        for text in self._warnings:
            key = key_of_warning(text)
            if not {key, str(text)} & self._issued:
                if self._processes is None or is_first():
                    self._issue_warning(text)
                self._issued |= {key, str(text)}

    def _issue_warning(self, text: str) -> None:
        """Issue a warning while the user's call is still on the stack. It may be raised."""
        warn_user(text)

    def _run(self, inputs: list[Any], output: Any, time: float) -> None:
        if self._deferred_error is not None:
            raise self._deferred_error
        self._run_blocks(inputs, output, time)
        if self._unused_warnings is None:
            self._unused_warnings = [
                f"{self.section}.{name} has no effect: {why}; it is used if "
                f"{self.parameter(name).condition}"
                for name, value in self.given_values.items()
                # A parameter that is zero or off contradicts nothing.
                if value and (why := self.disabled_by(name))
            ]
        self._warnings += self._unused_warnings
        if self.replicated and self._piece.total > 1:
            mark_owner(output, self._piece)
        self._issue_warnings()

    def _run_blocks(self, inputs: list[Any], output: Any, time: float) -> None:
        self.run(inputs, output, time)

    def _request_update_extent(self, in_info: Inputs, out_info: vtkInformationVector) -> None:
        """Ask the stages above for the same piece with ghosts, or for all data where needed."""
        piece = _piece_of(out_info.GetInformationObject(0))
        if piece.total == 1:
            return
        for port, vector in enumerate(in_info):
            for key, value in zip(PIECE, self.input_piece(port, piece), strict=True):
                key.Set(vector.GetInformationObject(0), value)

    def input_piece(self, port: int, piece: Piece) -> Piece:
        """Return the piece of an input that is needed for a piece of the output.

        Parameters
        ----------
        port : int
            Number of the input port.
        piece : Piece
            The piece of the output, one of several.

        Returns
        -------
        Piece
            The piece of the input. If neighbouring pieces share faces, it has a layer of ghost
            cells, which distinguishes a face between pieces from an outer one.
        """
        if self._comes_from(port, "replicated"):
            return piece
        if self.takes[port : port + 1] == ("cage",):
            return WHOLE
        if self._comes_from(port, "seamless"):
            return piece  # another number of ghosts would run the stages above once more
        return piece._replace(ghosts=max(piece.ghosts, 1))

    def _comes_from(self, port: int, kind: str) -> bool:
        """Return whether a stage with this property is above an input and passes it on."""
        waiting = [self.GetInputConnection(port, 0).GetProducer()]
        while waiting:
            stage = waiting.pop()
            if isinstance(stage, Algorithm) and getattr(stage, kind):
                return True
            for index in range(stage.GetNumberOfInputPorts()):
                for number in range(stage.GetNumberOfInputConnections(index)):
                    waiting.append(stage.GetInputConnection(index, number).GetProducer())
        return False

    def _requested(self) -> Piece:
        info = self.GetOutputInformation(0)
        return _piece_of(info) if PIECE[1].Has(info) else WHOLE

    def _parameter_changed(self) -> None:
        self._unused_warnings = None
        self._issued -= LIMITS.keys()  # other values are worth another warning
        self.Modified()


def _keep_alive(*_: Any) -> None:
    """Do nothing; the values bound to this callback live as long as its observer."""


def _refuse(out_info: vtkInformationVector) -> int:
    # Without this mark the next update would return the empty output as a valid one.
    out_info.GetInformationObject(0).Set(vtkDemandDrivenPipeline.DATA_NOT_GENERATED(), 1)
    return 0


def _piece_of(info: vtkInformation) -> Piece:
    # An Update() without a piece sets no number of pieces.
    if not PIECE[1].Has(info) or PIECE[1].Get(info) <= 1:
        return WHOLE
    return Piece(*(key.Get(info) for key in PIECE))


def _make_collector(messages: list[str]) -> Callable[[Any, str, str], None]:
    """Return an observer that appends VTK's message to a list instead of printing it."""

    @calldata_type(VTK_STRING)
    def collect(caller: Any, event: str, text: str) -> None:
        messages.append(" ".join(text.split()))

    return collect
