"""State files of both kinds bring a pipeline back. Run with a folder to write to."""

import sys
from pathlib import Path

from paraview import simple, smstate
from pipeline import bounds, connected, executions

folder = Path(sys.argv[1])
proxies = connected(WarpDiameter="0.2 mm", WarpColor="#ff0000")
surface = proxies[-1]
surface.Subdivisions = 3
proxies[4].Outside = "clamp"
view = simple.CreateRenderView(ViewSize=[60, 40])
simple.Show(surface, view)
animation = simple.GetAnimationScene()
animation.UpdateAnimationUsingDataTimeSteps()
animation.AnimationTime = 0.02
simple.Render(view)
surface.UpdatePipeline(0.02)
expected = bounds(surface)
settings = [proxy.GetClientSideObject().settings for proxy in proxies]
simple.SaveState(str(folder / "fabric.pvsm"))
# 5.11's SaveState writes XML whatever the name; the window's File > Save State calls this.
(folder / "fabric.py").write_text(smstate.get_state())


def check() -> None:
    """Find the pipeline again, with every value and the picture's bounds."""
    names = ["WeaveSource1", "TetraCage1", "ModalSolver1", "ModalResponse1"]
    names += ["BarycentricWarp1", "PatchTessellator1"]
    found = [simple.FindSource(name) for name in names]
    assert all(found), list(simple.GetSources())
    found[-1].UpdatePipeline(0.02)
    assert bounds(found[-1]) == expected, (bounds(found[-1]), expected)
    again = [proxy.GetClientSideObject().settings for proxy in found]
    for old, new in zip(settings, again, strict=True):
        assert old == new, (old, new)
    assert executions(found)[:3] == [1, 1, 1]


simple.ResetSession()
simple.LoadState(str(folder / "fabric.pvsm"))
check()
simple.ResetSession()
exec((folder / "fabric.py").read_text(), {"__name__": "state"})
check()
print("both state files load")
