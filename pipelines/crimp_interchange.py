"""What a cloth does that is pulled along its warp, by its yarns alone, without a scene.

A plain weave narrows as its warp straightens: yarns keep their length and trade crimp. Run it with
``python pipelines/crimp_interchange.py``: for each extension it finds the width at which no yarn is
strained, slack or pressed, until the weft jams, and prints it beside what embedded yarns would do.
"""

import numpy as np

from spacemap_vtk.textile.crimp.interchange import Interchange
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads

threads = Threads(diameter=0.25e-3, spacing=0.5e-3)
crossings = Interchange(Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads))
everywhere = np.ones((2, *crossings.shape))

print("   warp      weft      h1/D     theta2   crimp of warp and weft   embedded: strain of warp")
for extension in np.linspace(0.0, 0.0525, 8):
    # the widest cloth whose crossings are not pressed
    low, high = 0.5, 1.1
    while high - low > 1e-12:
        width = 0.5 * (low + high)
        state = crossings.solve(everywhere * np.reshape([1.0 + extension, width], (2, 1, 1)))
        pressed = state.distance[0, 0] < 0.5e-3 * (1.0 - 1e-12)
        low, high = (low, width) if pressed else (width, high)
    warp, weft = state.crimp[:, 0, 0]
    print(
        f"{extension:8.3%} {width - 1.0:9.3%} {2.0 * state.height[0, 0, 0] / 0.5e-3:9.4f} "
        f"{np.degrees(state.theta[1, 0, 0]):9.3f}   {warp:8.3%} {weft:8.3%} {extension:15.3%}"
    )
    assert state.strain.max() < 1e-9
    assert not state.jammed.any()

jammed = crossings.solve(everywhere * np.reshape([1.052870, 0.8], (2, 1, 1)))
print(f"The weft jams at {jammed.stretch[1, 0, 0] - 1.0:.3%}: closer the warp cannot come.")
assert jammed.jammed[1].all()
