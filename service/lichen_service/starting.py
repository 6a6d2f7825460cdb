"""How a worker comes up soon: what takes long and can go on beside the rest is begun first.

A decoder loads its libraries on another processor meanwhile; the others begin when it stands, since a first picture
needs one alone. The OpenCL runtime starts in a thread, which then runs what every picture of 8 bits needs. Other
operations are loaded when they are first asked for, or by the warm-up.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from lichen_service.decoding import processes
from lichen_service.logs import log
from lichen_service.settings import Settings

if TYPE_CHECKING:
    from lichen_service.app import Service


def prepare() -> None:
    """For a worker that is to stand in for one that dies: loads everything, begins nothing."""
    from lichen_service import app

    app.prepare()


def create_application() -> Service:
    """As `lichen_service.app.create_application`."""
    settings = Settings.load()
    begun = [processes.begin(settings.decoder_memory)] if settings.decoders else []
    tried = Trial()
    tried.start()
    from lichen_service import app

    return app.create_application(begun, tried=tried)


class Trial(threading.Thread):
    """Starts the device and takes a tiny picture to light on it; `passed` says that it came back. The way from light is
    mostly part of other kernels, and building one that a first picture does not need holds that one up."""

    def __init__(self) -> None:
        super().__init__(name="device", daemon=True)
        self.passed = False

    def run(self) -> None:
        from lichen.opencl.device import default_device

        default_device()
        import numpy as np

        from lichen import engine
        from lichen.errors import LichenError
        from lichen.image import Image, Space, Storage

        grey = Image(np.full((8, 8, 3), 0.5, np.float32), Space.SRGB, storage=Storage.UINT8)
        try:
            engine.run("transfer", grey, curve="srgb", direction="decode", storage=Storage.UINT8)
        except LichenError as failed:
            log.error("warm-up failed", operation="transfer", reason=str(failed))
        else:
            self.passed = True
