"""Reeds and sleying: how many ends go through each dent for a sett."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from spacemap_vtk.units import UNITS

_INCH = UNITS["1/m"]["/in"]
#: Common reeds in dents per metre: 20/10 to 120/10 (dents in 10 cm), as in Scandinavia.
METRIC_REEDS = tuple(
    10.0 * dents for dents in (20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 90, 100, 120)
)
#: Common reeds in dents per metre: 5 to 24 dents in an inch.
IMPERIAL_REEDS = tuple(dents * _INCH for dents in (5, 6, 8, 10, 12, 14, 15, 16, 18, 20, 24))
#: Most dents after which a sleying repeats; longer ones are easily mistaken.
_MOST_DENTS = 4
#: Most ends in a dent that do not cling together or leave marks.
_MOST_ENDS = 4.0
#: What each further dent of a sleying costs, as an error of the sett.
_IRREGULAR = 0.01
#: What each end more or less than two in a dent costs, likewise.
_UNUSUAL = 0.004


@dataclass(frozen=True)
class Sleying:
    """A reed, and the numbers of ends in its dents."""

    #: Dents per metre.
    reed: float
    #: Ends in each dent, repeated over the reed.
    pattern: tuple[int, ...]

    @property
    def sett(self) -> float:
        """Mean number of ends per metre."""
        return self.reed * sum(self.pattern) / len(self.pattern)

    @property
    def text(self) -> str:
        """The pattern as weavers write it, for example "1-1-2"."""
        return "-".join(map(str, self.pattern))

    def error(self, sett: float) -> float:
        """Return the sett over a wanted one, minus 1.

        Parameters
        ----------
        sett : float
            Wanted ends per metre.

        Returns
        -------
        float
            Positive if the ends are closer than wanted.
        """
        return self.sett / sett - 1.0

    def dents(self, ends: int) -> int:
        """Return the number of dents that some ends need.

        Parameters
        ----------
        ends : int
            Number of ends.

        Returns
        -------
        int
            The last dent may not be full.
        """
        rounds, rest = divmod(ends, sum(self.pattern))
        used = rounds * len(self.pattern)
        for count in self.pattern:
            if rest <= 0:
                break
            rest -= count
            used += 1
        return used


def sley(sett: float, reed: float) -> Sleying:
    """Find the sleying whose sett is nearest to a given one; prefer the shortest pattern."""
    found = []
    for dents in range(1, _MOST_DENTS + 1):
        ends = max(round(sett / reed * dents), 1)
        pattern = tuple((n + 1) * ends // dents - n * ends // dents for n in range(dents))
        found.append(Sleying(reed, pattern))
    return min(found, key=lambda each: (round(abs(each.error(sett)), 6), len(each.pattern)))


def choose_sleying(sett: float, reeds: Iterable[float]) -> list[Sleying]:
    """Rank the reeds for a sett.

    Parameters
    ----------
    sett : float
        Ends per metre.
    reeds : iterable of float
        Dents per metre of each reed.

    Returns
    -------
    list of Sleying
        The best first: a small error of the sett, an even sleying, about two ends in a dent.
    """

    def cost(each: Sleying) -> float:
        ends = sum(each.pattern) / len(each.pattern)
        crowded = max(ends - _MOST_ENDS, 0.0)
        return (
            abs(each.error(sett))
            + _IRREGULAR * (len(each.pattern) - 1)
            + _UNUSUAL * abs(ends - 2.0)
            + crowded
        )

    return sorted((sley(sett, reed) for reed in reeds), key=cost)
