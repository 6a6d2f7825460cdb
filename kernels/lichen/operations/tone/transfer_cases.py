from lichen.operation import HardCase
CASES: tuple[HardCase, ...] = ()
