"""The command ``completion``."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

Shell = Literal["bash", "zsh", "fish"]


def completion(shell: Annotated[Shell, Parameter(help="Shell.")], /) -> None:
    """Print the completion script for bash, zsh or fish.

    It completes commands, options, scenes, keys and file names. To install it (for zsh, in a
    folder of $fpath):

        spacemap completion bash > ~/.local/share/bash-completion/completions/spacemap
        spacemap completion zsh > _cyclopts_spacemap
        spacemap completion fish > ~/.config/fish/completions/spacemap.fish
    """
    from spacemap_vtk.cli.main import app

    print(app.generate_completion(shell=shell))
