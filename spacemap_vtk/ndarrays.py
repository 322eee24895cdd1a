"""Names of what signatures speak of: arrays by their type, and who is told how far work is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
#: In single precision.
Singles = NDArray[np.float32]
#: Of pixels and colours.
Bytes = NDArray[np.uint8]
#: In single or double precision.
AnyFloats = NDArray[np.floating[Any]]
#: Of any width.
AnyInts = NDArray[np.integer[Any]]

#: Is told the share that is done, 0 to 1; may raise to stop.
Progress = Callable[[float], object]
#: Is told how many steps are done, and of how many; may raise to stop.
Tell = Callable[[int, int], object]
#: Is told a sentence.
Say = Callable[[str], object]
