"""Time, demand, two windows, and that all is freed in the end."""

import gc

from paraview import simple
from pipeline import bounds, connected, executions

from spacemap_vtk.filters.base import Stage

proxies = connected()
weave, cage, modal, response, warp, surface = proxies
assert executions(proxies) == [0] * 6

# The response reports its range to ParaView's clock.
surface.UpdatePipeline(0.0)
assert list(response.GetProperty("TimeRange")) == [0.0, 1.0]
rest = bounds(surface)
surface.UpdatePipeline(0.02)
assert bounds(surface)[4] < rest[4] - 1e-5, (bounds(surface), rest)
assert executions(proxies) == [1, 1, 1, 2, 2, 2], executions(proxies)
surface.UpdatePipeline(0.02)
assert executions(proxies) == [1, 1, 1, 2, 2, 2]

# A change runs its own stage and those below it.
for proxy, name, value, ran in (
    (surface, "Subdivisions", 2, [0, 0, 0, 0, 0, 1]),
    (warp, "Outside", "clamp", [0, 0, 0, 0, 1, 1]),
    (response, "Alpha", 5.0, [0, 0, 0, 1, 1, 1]),
    (modal, "YoungsModulus", 2e3, [0, 0, 1, 1, 1, 1]),
    (cage, "Divisions", [2, 2, 2], [0, 1, 1, 1, 1, 1]),
    (weave, "WarpCrimpHeight", 0.2e-3, [1, 1, 1, 1, 1, 1]),
    (weave, "WarpCrimpHeight", "", [1, 1, 1, 1, 1, 1]),
):
    before = executions(proxies)
    setattr(proxy, name, value)
    surface.UpdatePipeline(0.02)
    after = executions(proxies)
    assert [b - a for a, b in zip(before, after, strict=True)] == ran, (name, before, after)
assert weave.GetClientSideObject().warp_crimp_height is None

# A film in two windows: each frame runs the moving stages once, for both.
left = simple.CreateRenderView(ViewSize=[60, 40])
right = simple.CreateRenderView(ViewSize=[60, 40])
simple.Show(surface, left)
simple.Show(surface, right)
simple.Show(response, right)
scene = simple.GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
assert (scene.StartTime, scene.EndTime) == (0.0, 1.0), (scene.StartTime, scene.EndTime)
scene.PlayMode = "Sequence"
scene.NumberOfFrames = 5
scene.GoToFirst()
simple.RenderAllViews()
before = executions(proxies)
lows = []
for _ in range(4):
    scene.GoToNext()
    simple.RenderAllViews()
    lows.append(bounds(surface)[4])
assert len(set(lows)) == 4, lows
ran = [b - a for a, b in zip(before, executions(proxies), strict=True)]
assert ran == [0, 0, 0, 4, 4, 4], ran
scene.GoToFirst()
before = executions(proxies)
scene.Play()
ran = [b - a for a, b in zip(before, executions(proxies), strict=True)]
assert ran[:3] == [0, 0, 0], ran
assert ran[3] == ran[4] == ran[5] >= 4, ran

# Deleted in any order, nothing of it stays.
for view in (left, right):
    simple.Delete(view)
for proxy in proxies:
    simple.Delete(proxy)
del weave, cage, modal, response, warp, surface, proxies, proxy, left, right, view, scene
gc.collect()
stages = [type(thing).__name__ for thing in gc.get_objects() if isinstance(thing, Stage)]
assert stages == [], stages
print("time, demand, windows, no leaks")
