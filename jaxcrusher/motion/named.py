"""Results by name."""

import abc
from collections.abc import Iterable, Mapping
from typing import Any

from jaxtyping import Array


class AbstractNamed(abc.ABC):
    """Arrays by name: `result.x` or `result["x"]`, for every x of `values`.

    What was not asked for raises AttributeError or KeyError, which say so.
    """

    values: Mapping[str, Any]  # a field of the module that inherits

    @abc.abstractmethod
    def could_hold(self) -> Iterable[str]:
        """The names that may be asked for."""

    def __getitem__(self, name: str) -> Any:
        if name not in self.values:
            raise KeyError(self._missing(name))
        return self.values[name]

    def __getattr__(self, name: str) -> Array:
        # `values` is missing while an object is being made, unpickled or copied.
        if name.startswith("__") or name == "values":
            raise AttributeError(name)
        if name not in self.values:
            raise AttributeError(self._missing(name))
        return self.values[name]

    def __dir__(self):
        return [*super().__dir__(), *self.values]

    def _missing(self, name: str) -> str:
        if name in self.could_hold():
            return f"`{name}` was not asked for: name it in `outputs`."
        return f"There is no `{name}`, but {', '.join(self.values)}."
