"""The flags of commands that train something into a folder."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from maipp.training.config_io import ConfigKind, find_config, load_config, override
from maipp.training.run_folder import CONFIG


@dataclass(frozen=True)
class RunFlags:
    """The folder of a run, and how it is configured."""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """folder of the run; made if need be"""

    config: Annotated[str | None, tyro.conf.arg(metavar="NAME|FILE", help_behavior_hint="(default: default)")] = None
    """a configuration that comes with maipp (docs/training.md), or a YAML file; with --resume, the run's own if left
    out"""

    settings: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="set", metavar="KEY=VALUE [KEY=VALUE ...]"),
    ] = ()
    """keys of the configuration to change, such as seed=1"""

    resume: bool = False
    """go on from the newest checkpoint in the folder; start if there is none"""

    def configuration(self, kind: ConfigKind) -> Any:
        """The configuration that the flags name. Raises `InputError` where there is no such thing."""
        if self.config is None and self.resume and (self.out / CONFIG).is_file():
            config = load_config(self.out / CONFIG, kind)
        else:
            config = find_config(self.config or "default", kind)
        return override(config, (item for group in self.settings for item in group))
