"""What arrays are called: the names of shapes and kinds that every signature uses."""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]  #: One number a row: ndarray of shape (n,).
Matrix = NDArray[np.float64]  #: Rows and columns: ndarray of shape (n, m).
Array = NDArray[np.float64]  #: Numbers in any shape, which the docstring says.
Complex = NDArray[np.complex128]
ComplexMatrix = NDArray[np.complex128]

Mask = NDArray[np.bool_]  #: True where a row or an entry counts.
Indices = NDArray[np.int64]  #: Positions in another array.
