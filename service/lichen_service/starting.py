"""How a worker comes up soon: what takes long and can go on beside the rest is begun first.

A decoder loads its libraries on another processor meanwhile; the others begin when it stands, since a first picture
needs one alone. The OpenCL runtime starts in a thread. Operations are loaded when they are first asked for, or by the
warm-up.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from lichen_service.decoding import processes
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
    threading.Thread(target=_start_device, name="device", daemon=True).start()
    from lichen_service import app

    return app.create_application(begun)


def _start_device() -> None:
    from lichen.opencl.device import default_device

    default_device()
