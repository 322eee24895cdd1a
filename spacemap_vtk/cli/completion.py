"""The command ``completion``."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

Shell = Literal["bash", "zsh", "fish"]


def completion(shell: Annotated[Shell, Parameter(help="The shell.")], /) -> None:
    """Print what makes bash, zsh or fish complete words: commands, options, scenes, keys, files.

    bash: spacemap completion bash > ~/.local/share/bash-completion/completions/spacemap;
    zsh: spacemap completion zsh > _cyclopts_spacemap, in a folder of $fpath;
    fish: spacemap completion fish > ~/.config/fish/completions/spacemap.fish.
    """
    from spacemap_vtk.cli.main import app

    print(app.generate_completion(shell=shell))
