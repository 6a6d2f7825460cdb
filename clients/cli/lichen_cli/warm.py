"""`lichen warm`: runs every operation, and each of its methods, once on something small, which compiles the kernels.

For container images and first starts: what is compiled lies in the runtime's cache folder (`POCL_CACHE_DIR`).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from lichen_cli.main import FAILED, Parser


def main(arguments: Sequence[str]) -> int:
    parser = Parser(prog="lichen warm", description="Compile all kernels and keep them.", allow_abbrev=False)
    parser.parse_args(arguments)

    from lichen.opencl.device import default_device, status
    from lichen_service.readiness import warm_up

    if default_device() is None:
        print(f"there is no device to compile for: {status().reason}", file=sys.stderr)
        return FAILED
    failed = ran = 0
    for operation, method, wrong in warm_up("opencl"):
        ran += 1
        if wrong is not None:
            failed += 1
            print(f"{operation} {method}: {wrong}", file=sys.stderr)
    print(f"the kernels of {ran - failed} runs are kept in {status().cache}")
    return FAILED if failed else 0
