"""For `pvbatch` under MPI: a draft that not every process finds stops all, and does no harm."""

from paraview import simple

weave = simple.WeaveSource(Ends=3, Picks=3)
cage = simple.TetraCage(Input=weave, Divisions=[2, 2, 1], Order=2)
modal = simple.ModalSolver(Input=cage)
warp = simple.BarycentricWarp(Input=weave, Cage=simple.ModalResponse(Input=modal))
surface = simple.PatchTessellator(Input=warp)


def runs() -> list[int]:
    """Return how many times each stage has run."""
    return [proxy.GetClientSideObject().executions for proxy in (weave, cage, modal, warp, surface)]


def cells() -> int:
    """Return the number of polygons of all processes."""
    return surface.GetDataInformation().GetNumberOfCells()


surface.UpdatePipeline(0.1)
good = cells()
weave.Draft = "draft.txt"
surface.UpdatePipeline(0.1)
assert cells() == good, (cells(), good)  # the last good state
weave.Draft = ""
weave.Ends = 4
surface.UpdatePipeline(0.1)
assert cells() > good
print("all stopped, and went on")
