"""Ways of fitting by name: what settings each has, and what fits with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from frametwin.errors import InputError
from frametwin.fitting import settings as splat_settings
from frametwin.fitting.fast import FastFitter
from frametwin.fitting.fast_settings import FastSettings
from frametwin.fitting.part_fit import Fitter

Settings = FastSettings | splat_settings.FitSettings


@dataclass(frozen=True)
class Preset:
    """A way of fitting.

    Attributes
    ----------
    settings : callable
        Makes its settings, with changes by name.
    fitter : callable
        Makes what fits with such settings.
    """

    settings: Callable[..., Settings]
    fitter: Callable[[Any], Fitter]


def _fast_settings(**changes: Any) -> FastSettings:
    return FastSettings().replace(**changes)


def _splat_fitter(settings: splat_settings.FitSettings) -> Fitter:
    from frametwin.fitting.splat_fit import SplatFitter  # which takes seconds to import torch

    return SplatFitter(settings)


_PRESETS: Mapping[str, Preset] = {
    "fast": Preset(_fast_settings, FastFitter),
    **{name: Preset(partial(splat_settings.preset, name), _splat_fitter) for name in splat_settings.PRESETS},
}

PRESETS: tuple[str, ...] = tuple(_PRESETS)


def settings_of(preset: str, seed: int = 0, changes: Mapping[str, Any] | None = None) -> Settings:
    """Settings by the preset's name, with changes.

    Raises
    ------
    InputError
        If the preset or a setting is unknown or a value out of range.
    """
    return _preset(preset).settings(**{"seed": seed, **(changes or {})})


def fitter_of(preset: str, seed: int = 0, changes: Mapping[str, Any] | None = None) -> Fitter:
    """What fits by a preset, with changes of its settings.

    Raises
    ------
    InputError
        As `settings_of`.
    """
    return _preset(preset).fitter(settings_of(preset, seed, changes))


def _preset(name: str) -> Preset:
    if name not in _PRESETS:
        raise InputError.at("settings", "preset", f"{name!r} is unknown", f"give one of {', '.join(PRESETS)}")
    return _PRESETS[name]
