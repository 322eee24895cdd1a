"""Exchange data between MPI processes, each of which makes one piece of a data set.

VTK's global controller exchanges the data; ParaView's pvbatch and pvserver have one under MPI. In a
single process nothing is exchanged.

Invariants, without which processes would wait for each other for ever:

- A run is collective if each process makes the piece of its rank. Then every process runs the same
  stages in the same order, and each run ends with `Processes.finish` or `Processes.fail`.
- Every exchange inside a run comes after `Processes.check_peers`. A process that fails earlier
  sends its error there, and all other processes stop too.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkParallelCore import vtkCommunicator, vtkMultiProcessController

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.ndarrays import Floats


class Piece(NamedTuple):
    """A requested piece of a data set."""

    number: int = 0
    total: int = 1
    ghosts: int = 0
    """Number of layers of cells around the piece that other pieces own."""


#: The whole data set as a single piece.
WHOLE = Piece()


class PeerError(SpacemapError, RuntimeError):
    """Another process has failed."""


def world_size() -> int:
    """Return the number of processes; 1 without MPI."""
    controller = vtkMultiProcessController.GetGlobalController()
    return 1 if controller is None else int(controller.GetNumberOfProcesses())


def is_first() -> bool:
    """Test whether this process has rank 0, which reports for all."""
    controller = vtkMultiProcessController.GetGlobalController()
    return controller is None or controller.GetLocalProcessId() == 0


class Processes:
    """All processes during one run of a stage."""

    def __init__(self, controller: Any) -> None:
        self._controller = controller
        self.rank, self.size = controller.GetLocalProcessId(), controller.GetNumberOfProcesses()
        self._all_informed = False

    @classmethod
    def for_piece(cls, piece: Piece) -> Processes | None:
        """Return the processes of a collective run; None if this process works alone."""
        if piece.total == 1:
            return None
        controller = vtkMultiProcessController.GetGlobalController()
        if controller is None:
            return None
        processes = cls(controller)
        is_own_piece = (piece.number, piece.total) == (processes.rank, processes.size)
        return processes if is_own_piece else None

    def check_peers(self) -> None:
        """Raise PeerError if another process has failed."""
        self._exchange()

    def finish(self, warnings: Sequence[str]) -> list[str]:
        """End a run that succeeded here; return the warnings of all processes."""
        messages = self._exchange(warnings=list(warnings))
        return list(dict.fromkeys(text for item in messages for text in item.get("warnings", [])))

    def fail(self, error: BaseException) -> None:
        """End a run that failed here, and send the error unless all processes know of it."""
        if not self._all_informed:
            self._exchange(error=str(error) or type(error).__name__)

    def maximum(self, values: ArrayLike) -> Floats:
        """Return the elementwise maximum of the values of all processes."""
        self.check_peers()
        return self._largest(values)

    def make_in_first(self, make: Callable[[], Sequence[Floats]]) -> list[Floats]:
        """Make arrays in the first process only, and send them to all."""
        self.check_peers()
        arrays: list[Floats] = []
        shapes: list[list[int]] = []
        if self.rank == 0:
            try:
                arrays = [np.ascontiguousarray(a, dtype=np.float64) for a in make()]
            except BaseException as error:
                self.fail(error)
                raise
            shapes = [list(array.shape) for array in arrays]
        shapes = self._exchange(shapes=shapes)[0].get("shapes", [])
        if self.rank != 0:
            arrays = [np.empty(shape) for shape in shapes]
        for array in arrays:
            if array.size:
                self._controller.Broadcast(numpy_to_vtk(array.reshape(-1)), 0)
        return arrays

    def _exchange(self, **facts: Any) -> list[dict[str, Any]]:
        """Return the facts that each process sends; raise PeerError if another one has failed."""
        facts = {key: value for key, value in facts.items() if value}
        payload = np.frombuffer(json.dumps(facts).encode() if facts else b"", dtype=np.uint8)
        length = int(self._largest([len(payload)])[0])
        if length == 0:
            return [{}] * self.size
        padded = np.full(length, ord(" "), dtype=np.uint8)
        padded[: len(payload)] = payload
        rows = self._gather(padded).reshape(self.size, length)
        messages = [json.loads(row.tobytes().strip() or b"{}") for row in rows]
        failed = [rank for rank, item in enumerate(messages) if "error" in item]
        if failed:
            self._all_informed = True
            if self.rank not in failed:
                where = ", ".join(str(rank) for rank in failed)
                raise PeerError(
                    f"rank {where} of {self.size} has failed: {messages[failed[0]]['error']}"
                )
        return messages

    def _largest(self, values: ArrayLike) -> Floats:
        own = np.ascontiguousarray(values, dtype=np.float64)
        result = np.empty_like(own)
        self._controller.AllReduce(numpy_to_vtk(own), numpy_to_vtk(result), vtkCommunicator.MAX_OP)
        return result

    def _gather(self, values: NDArray[Any]) -> NDArray[Any]:
        result = np.empty(self.size * len(values), dtype=values.dtype)
        if len(values):
            target = numpy_to_vtk(result)
            self._controller.AllGather(numpy_to_vtk(values), target)
            result = vtk_to_numpy(target)
        return result
