"""Yarns show their own colours, numbers go through a colour map. Run with a folder for pictures."""

import gc
import sys

from paraview import simple
from paraview.modules.vtkRemotingViews import vtkSMTransferFunctionManager
from pipeline import connected

warp, surface = connected()[-2:]
clip = simple.Clip(Input=surface, Crinkleclip=1)
ball = simple.Sphere()
view = simple.CreateRenderView(ViewSize=[300, 200], OrientationAxesVisibility=0)
display = simple.Show(surface, view)
simple.GetAnimationScene().AnimationTime = 0.02
simple.ResetCamera(view)


def legends() -> list[int]:
    """Return which legends are visible after what ParaView's button Apply does."""
    manager = vtkSMTransferFunctionManager()
    manager.UpdateScalarBars(view.SMProxy, manager.SHOW_USED_SCALAR_BARS)
    bars = [shown for shown in view.Representations if "ScalarBar" in shown.GetXMLName()]
    return [shown.Visibility for shown in bars]


def photograph(name: str, mapped: int) -> None:
    """Write what the window shows."""
    gc.collect()  # which must not take what watches the window
    assert display.MapScalars == mapped, (name, display.MapScalars)
    simple.SaveScreenshot(f"{sys.argv[1]}/{name}.png", view)


def hides() -> bool:
    """Return whether ParaView knows that nothing shines through the surface."""
    shown = display.SMProxy.GetClientSideObject().GetActiveRepresentation()
    return bool(shown.GetActor().GetForceOpaque())


photograph("shown", mapped=0)
assert hides()
display.Opacity = 0.5
assert not hides()
display.Opacity = 1.0
assert hides()
# Own colours have no legend, though one is asked for; numbers have one.
assert legends() == [0]
display.SetScalarBarVisibility(view, True)
assert legends() == [0]
simple.ColorBy(display, ("POINTS", "displacement"))
display.RescaleTransferFunctionToDataRange()
photograph("displacement", mapped=1)
assert not hides()
assert legends() == [0, 1]
display.SetScalarBarVisibility(view, False)
simple.ColorBy(display, ("CELLS", "color"))
photograph("again", mapped=0)
display.MapScalars = 1  # a user's own choice stays
simple.Render(view)
photograph("map", mapped=1)
assert legends()[0] == 1
# What ParaView's own filters make of it keeps its colours; other data know nothing of all this.
assert simple.Show(clip, view).MapScalars == 0
patches = simple.Show(warp, view)
assert (list(patches.ColorArrayName), patches.MapScalars) == (["POINTS", "color"], 0)
assert simple.Show(ball, view).MapScalars == 1
print("yarns in their own colours")
