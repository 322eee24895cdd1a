"""Photograph ParaView's real window: the fabric, and the panel made from the declarations.

xvfb-run -a -s "-screen 0 1200x900x24 -noreset" \
    python tests/paraview/photograph.py docs/paraview.png
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import ImageChops, ImageGrab

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from spacemap_vtk.paraview import environment

HERE = Path(__file__).resolve().parent
PATIENCE = 120.0
#: Pixels of the view that the fabric lies in: of it there are more than 256 colours.
MIDDLE = (400, 250, 1100, 750)


def main() -> None:
    """Start ParaView, wait for its script, take the picture, end it."""
    with tempfile.TemporaryDirectory() as home:
        ready = Path(home) / "ready"
        surroundings = {
            **environment.process_environment(),
            "HOME": home,  # nobody's settings, old windows or recent files
            "XDG_RUNTIME_DIR": home,
            "SPACEMAP_ROOT": str(HERE.parents[1]),
            "SPACEMAP_READY": str(ready),
        }
        version = subprocess.run(["paraview", "--version"], capture_output=True, text=True)
        settings = Path(home) / ".config" / "ParaView"
        settings.mkdir(parents=True)
        # The welcome dialog would stop the script, and stand before the picture.
        (settings / f"ParaView{version.stdout.split()[-1]}.ini").write_text(
            "[General]\nGeneralSettings.ShowWelcomeDialog=false\n"
        )
        command = ["paraview", "-qwindowgeometry", "1200x900+0+0", f"--script={HERE / 'window.py'}"]
        with open(Path(home) / "log", "w+") as log:
            window = subprocess.Popen(command, env=surroundings, stdout=log, stderr=log)
            try:
                deadline = time.monotonic() + PATIENCE
                while not ready.exists():
                    if window.poll() is not None or time.monotonic() > deadline:
                        log.seek(0)
                        sys.exit(f"ParaView's script did not end well:\n{log.read()}")
                    time.sleep(0.5)
                # The panel is laid out when the window is idle: nothing changes any more. On a busy
                # machine that may be so before anything is painted.
                picture, before = ImageGrab.grab(xdisplay=os.environ["DISPLAY"]), None
                while (
                    before is None
                    or ImageChops.difference(picture, before).getbbox()
                    or (picture.crop(MIDDLE).getcolors(256) and time.monotonic() < deadline)
                ):
                    time.sleep(1.0)
                    picture, before = ImageGrab.grab(xdisplay=os.environ["DISPLAY"]), picture
                picture.save(sys.argv[1], optimize=True)
            finally:
                window.kill()
                window.wait()


if __name__ == "__main__":
    main()
