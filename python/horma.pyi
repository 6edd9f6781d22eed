"""Tool paths for shoe lasts and other free-form parts turned on copying lathes, by virtual digitizing."""

from collections.abc import Mapping, Sequence
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

__version__: str

COLUMNS: tuple[str, ...]
"""Names of the columns that `digitize` gives: those of path.csv."""

def digitize(
    *,
    triangles: Optional[Array] = None,
    points: Union[Array, Sequence[Array], None] = None,
    cutter: Mapping[str, Any],
    motion: Mapping[str, Any],
    digitizing: Optional[Mapping[str, Any]] = None,
    threads: Optional[int] = None,
) -> Array: ...
