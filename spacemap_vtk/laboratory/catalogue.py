"""The tests of the laboratory in one list: commands, help, window and documentation read it.

A test is one module of this package, named as the test, with a function ``measure(fabric,
progress)`` that returns a `spacemap_vtk.laboratory.records.Measurement`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from spacemap_vtk.errors import InputError

if TYPE_CHECKING:
    from spacemap_vtk.laboratory.fabric import Fabric
    from spacemap_vtk.laboratory.records import Measurement
    from spacemap_vtk.ndarrays import Progress


class LaboratoryTest(NamedTuple):
    """A standard test."""

    name: str
    """Name on the command line, and of its module."""
    title: str
    instrument: str
    """Instruments and standards."""
    specimen: str
    """Specimen, grips and stroke in a sentence."""
    prints: str
    """Symbols that it prints."""

    def measure(self, fabric: Fabric, progress: Progress | None = None) -> Measurement:
        """Run the test.

        Parameters
        ----------
        fabric : Fabric
            The cloth.
        progress : callable, optional
            Called with the share that is done, 0 to 1; may raise to stop.

        Returns
        -------
        Measurement
            Figures, curves and states.

        Raises
        ------
        InputError
            The fabric lacks something that this test needs.
        """
        module = import_module(f"{__package__}.{self.name}")
        found: Measurement = module.measure(fabric, progress or (lambda share: None))
        return found


#: All tests in the order of the data sheet.
TESTS = (
    LaboratoryTest(
        "tensile",
        "Tension",
        "KES-FB1, FAST-3",
        "20 cm x 5 cm between clamps 5 cm apart, with free sides, pulled to 500 gf/cm; for FAST "
        "5 cm x 10 cm between clamps 10 cm apart.",
        "EMT, LT, WT, RT, E5, E20, E100",
    ),
    LaboratoryTest(
        "biaxial",
        "Biaxial tension",
        "KES-G2",
        "A square is pulled to 500 gf/cm: along warp and weft alike, and along one of them while "
        "the other keeps its width.",
        "EMT, LT, WT, RT",
    ),
    LaboratoryTest(
        "shear",
        "Shear",
        "KES-FB1",
        "20 cm x 5 cm, between clamps 5 cm apart, under 10 gf/cm, sheared by ±8°.",
        "G, 2HG, 2HG5",
    ),
    LaboratoryTest(
        "bias",
        "Bias extension",
        "FAST-3",
        "10 cm x 5 cm between clamps, cut at 45°, pulled by 14 %.",
        "EB5, G, γ",
    ),
    LaboratoryTest(
        "frame",
        "Picture frame",
        "picture frame",
        "A square of 20 cm, clamped along its yarns in a hinged frame, is sheared to 45°.",
        "Fs",
    ),
    LaboratoryTest(
        "bending",
        "Pure bending",
        "KES-FB2",
        "20 cm x 1 cm, between clamps 1 cm apart, bent to ±2.5 per cm.",
        "B, B_rigid, 2HB",
    ),
    LaboratoryTest(
        "cantilever",
        "Cantilever",
        "FAST-2, ASTM D1388, ISO 9073-7",
        "A strip of 2.5 cm is pushed over an edge until its chord slopes by 41.5°.",
        "c, B",
    ),
    LaboratoryTest(
        "drape",
        "Drape",
        "Cusick's drapemeter, ISO 9073-9",
        "A round cloth of 30 cm, held between discs of 18 cm, hangs over their edge.",
        "DC, nodes",
    ),
    LaboratoryTest(
        "compression",
        "Compression",
        "KES-FB3",
        "A disc of 2 cm² presses the cloth from 0.5 to 50 gf/cm².",
        "T0, Tm, LC, WC, RC",
    ),
)


def find_test(name: str) -> LaboratoryTest:
    """Return a test by its name.

    Parameters
    ----------
    name : str
        Name of one of `TESTS`.

    Returns
    -------
    LaboratoryTest
        The test.

    Raises
    ------
    InputError
        There is no such test.

    Examples
    --------
    >>> find_test("bending").instrument
    'KES-FB2'
    """
    names = [test.name for test in TESTS]
    if name not in names:
        from spacemap_vtk.parameters import suggestion  # imports NumPy, which no help needs

        raise InputError(
            "there is no such test",
            key="test",
            value=name,
            allowed=", ".join(names),
            cure=suggestion(name, names),
        )
    return TESTS[names.index(name)]
