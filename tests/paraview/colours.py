"""Yarns show their own colours, numbers go through a colour map. Run with a folder for pictures."""

import gc
import sys

from paraview import simple
from pipeline import connected

surface = connected()[-1]
clip = simple.Clip(Input=surface, Crinkleclip=1)
ball = simple.Sphere()
view = simple.CreateRenderView(ViewSize=[300, 200], OrientationAxesVisibility=0)
display = simple.Show(surface, view)
simple.GetAnimationScene().AnimationTime = 0.02
simple.ResetCamera(view)


def photograph(name: str, mapped: int) -> None:
    """Write what the window shows."""
    gc.collect()  # which must not take what watches the window
    assert display.MapScalars == mapped, (name, display.MapScalars)
    simple.SaveScreenshot(f"{sys.argv[1]}/{name}.png", view)


photograph("shown", mapped=0)
simple.ColorBy(display, ("POINTS", "displacement"))
display.RescaleTransferFunctionToDataRange()
photograph("displacement", mapped=1)
simple.ColorBy(display, ("CELLS", "color"))
photograph("again", mapped=0)
display.MapScalars = 1  # a user's own choice stays
simple.Render(view)
photograph("map", mapped=1)
# What ParaView's own filters make of it keeps its colours; other data know nothing of all this.
assert simple.Show(clip, view).MapScalars == 0
assert simple.Show(ball, view).MapScalars == 1
print("yarns in their own colours")
