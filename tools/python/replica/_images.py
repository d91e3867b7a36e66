"""Sweeps as images for a network, and the classes of the points from its scores."""

import json
from collections.abc import Iterable, Iterator
from itertools import takewhile
from os import PathLike

import numpy as np

from . import _native
from ._layouts import dtypes
from ._messages import Message


class SweepImages:
    """The work of the stage ``infer`` around a network on range images, with the settings of a model file.

    In a stage::

        def setup(self):
            self.images = replica.SweepImages(self.context.resolve(self.settings["model"]))

        def step(self, inputs, outputs):
            for submap in inputs["submap"]:
                sweeps = self.images.project(submap)
                out = outputs.loan("class", like=submap)
                out.header["model_digest"] = self.images.digest
                out[:] = sweeps.classes(self.network(images) for images in sweeps.images())
                outputs.publish(out)

    The network maps float32 ``[n, channels, rows, columns]`` to scores before the softmax, ``[n, outputs, rows, columns]``:

    - ``fold`` neighboring columns of the range image are one column of the network. Feature ``f`` of range image column ``c`` is in
      channel ``c % fold * len(features) + f`` of column ``c // fold``, the score of class ``k`` in ``c % fold * len(classes) + k``.
    - Columns are the angles of a revolution: beyond the left and right edge, a convolution takes the opposite edge.
    - Row 0 is the highest ring. Above and below the image, a convolution takes zeros. Rows of zeros at the bottom make the number of
      rows a multiple of what the network of the model file halves.
    - Pixels without a point are zero in all channels.
    """

    def __init__(
        self,
        model: str | PathLike[str],
        *,
        every: int = 1,
        intensity: str = "auto",
        rough_ground: bool = True,
        vehicle_shape: bool = True,
        driven_is_road: bool = True,
    ):
        """A model file of a network on images. Its weights are not used. The other arguments are settings of ``infer``."""
        self._native = _native.SweepImages(model, every, intensity, rough_ground, vehicle_shape, driven_is_road)
        #: The settings of the model file: ``classes``, ``columns``, ``fold``, ``network``.
        self.settings: dict = json.loads(self._native.settings())
        #: Identifies the model file in the header of ``class``.
        self.digest: int = self._native.digest

    def project(self, submap: Message, *, color: Message | None = None, spectra: Message | None = None) -> "SubmapImages":
        """The sweeps of a submap, with the columns that the model reads. The messages are not referenced afterwards."""
        columns = (message and _bytes(message) for message in (color, spectra))
        return SubmapImages(self._native.project(_bytes(submap), *columns), self.settings["network"]["outputs"])


class SubmapImages:
    """The sweeps of a submap for a network. ``len`` is their number."""

    def __init__(self, native: _native.SubmapImages, n_outputs: int):
        self._native, self._n_outputs = native, n_outputs
        self._sizes = native.sizes()

    def __len__(self) -> int:
        return len(self._sizes)

    def images(self, batch: int = 1) -> Iterator[np.ndarray]:
        """The images of all sweeps in order, ``[n, channels, rows, columns]``, up to ``batch`` of one size at a time."""
        first = 0
        while first < len(self):
            size = self._sizes[first]
            n = len(list(takewhile(size.__eq__, self._sizes[first : first + batch])))
            yield np.frombuffer(self._native.images(first, n), "f4").reshape(n, *size)
            first += n

    def classes(self, scores: Iterable[np.ndarray]) -> np.ndarray:
        """The rows of ``class`` from the scores of the network, ``[n, outputs, rows, columns]``, in the order of the images.

        ``scores`` may be a generator: then only the images of one batch are in memory.
        """
        sweep = 0
        for of_batch in scores:
            for of_sweep in np.asarray(of_batch, "f4"):
                expected = (self._n_outputs, *self._sizes[sweep][1:]) if sweep < len(self) else None
                if of_sweep.shape != expected:
                    raise ValueError(f"scores of sweep {sweep} of {len(self)}: shape {of_sweep.shape}, expected {expected}")
                self._native.vote(sweep, of_sweep)
                sweep += 1
        if sweep != len(self):
            raise ValueError(f"scores of {sweep} sweeps; the submap has {len(self)}")
        return np.frombuffer(self._native.classes(), dtypes("class")[1])


def _bytes(message: Message) -> tuple[bytes, np.ndarray]:
    return message.header.tobytes(), message.rows.view("u1")
