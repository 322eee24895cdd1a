"""Type aliases for signatures: arrays by their element type, and callbacks for progress."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
#: Single precision.
Singles = NDArray[np.float32]
#: Pixels and colours.
Bytes = NDArray[np.uint8]
#: Single or double precision.
AnyFloats = NDArray[np.floating[Any]]
#: Any width.
AnyInts = NDArray[np.integer[Any]]

#: Receives the share of work that is done, 0 to 1; may raise to stop the work.
Progress = Callable[[float], object]
#: Receives the number of steps done and their total; may raise to stop the work.
StepProgress = Callable[[int, int], object]
#: Receives a message.
MessageCallback = Callable[[str], object]
