"""For `pvbatch` under MPI: a scene and a weave, as proxies; counts and files.

mpirun -np 3 pvbatch tests/mpi/proxies.py FOLDER ...

Each folder has a scene.toml, and gets its files.
"""

import sys

from paraview import simple

for folder in sys.argv[1:]:
    scene_file = f"{folder}/scene.toml"
    scene = simple.SceneReader(FileName=scene_file)
    scene.UpdatePipeline(0.05)
    simple.SaveData(f"{folder}/surface.pvtp", scene)
    patches = simple.SceneReader(FileName=scene_file, Show="patches")
    patches.UpdatePipeline(0.05)
    simple.SaveData(f"{folder}/patches.pvtu", patches)

    # A cage from the scene moves a weave from a proxy.
    cage = simple.SceneReader(FileName=scene_file, Show="cage")
    weave = simple.WeaveSource(Ends=1, Picks=1)
    warp = simple.BarycentricWarp(Input=weave, Cage=cage)
    surface = simple.PatchTessellator(Input=warp)
    surface.UpdatePipeline(0.05)
    print([proxy.GetClientSideObject().executions for proxy in (weave, cage, warp, surface)])
