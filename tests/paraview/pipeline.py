"""The six filters connected as ParaView's own proxies; shared by the scripts beside it."""

from typing import Any

from paraview import simple


def connected(**weave: Any) -> list[Any]:
    """Return the proxies from source to surface, two layers in the cage: nothing to warn of."""
    source = simple.WeaveSource(Ends=3, Picks=4, **weave)
    cage = simple.TetraCage(Input=source, Divisions=[3, 3, 1], Order=2)
    modal = simple.ModalSolver(Input=cage, Modes=20, YoungsModulus=1e3)
    response = simple.ModalResponse(Input=modal, Gravity=[0.0, 0.0, -10.0], Duration=1.0)
    warp = simple.BarycentricWarp(Input=source, Cage=response)
    return [source, cage, modal, response, warp, simple.PatchTessellator(Input=warp)]


def executions(proxies: list[Any]) -> list[int]:
    """Return how many times each stage has run."""
    return [proxy.GetClientSideObject().executions for proxy in proxies]


def bounds(proxy: Any) -> tuple[float, ...]:
    """Return the bounds of a proxy's output."""
    return proxy.GetDataInformation().GetBounds()
