"""Takes the place of torch and what else LeRobot imports and the tests do not use: any name is an empty class.

Installing torch for one import would cost gigabytes. Modules that are installed are not replaced.
"""

from __future__ import annotations

import abc
import importlib.util
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

ALWAYS = ("torch", "torchvision", "einops", "cv2")
IF_MISSING = (
    "accelerate", "av", "datasets", "diffusers", "gymnasium", "imageio", "jsonlines", "pandas", "PIL", "pyarrow",
    "pynput", "rerun", "torchcodec", "transformers", "wandb",
)  # fmt: skip
__version__ = "2.7.0"


class _Anything(abc.ABCMeta):
    def __getattr__(cls, name: str) -> Any:
        return _class(name)

    def __or__(cls, other: Any) -> Any:
        return type.__or__(cls, other)

    def __ror__(cls, other: Any) -> Any:
        return type.__ror__(cls, other)

    def __getitem__(cls, key: Any) -> Any:
        return cls

    def __iter__(cls) -> Any:
        return iter(())


def _class(name: str) -> Any:
    if name.startswith("__"):
        raise AttributeError(name)
    members = {
        "__init__": lambda self, *given, **named: None,
        "__call__": lambda self, function=None, *given, **named: function,
    }
    return _Anything(name, (), members)


class _Module(ModuleType):
    def __getattr__(self, name: str) -> Any:
        return _class(name)


class _Finder:
    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        found = name.split(".")[0] in self.names
        return ModuleSpec(name, self, is_package=True) if found else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return _Module(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        pass


missing = tuple(name for name in IF_MISSING if importlib.util.find_spec(name) is None)
sys.meta_path.insert(0, _Finder((*ALWAYS, *missing)))


def __getattr__(name: str) -> Any:
    return _class(name)
