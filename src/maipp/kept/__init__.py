"""Compiled programs that outlast the process: a function decorated with `kept` is traced and compiled once a machine.

JAX's own cache spares a process the compilation, not the tracing and lowering, which take longer than to read the
program. Here a program is found by what it was made of: maipp's source, the versions of what traces and compiles,
JAX's options, the machine, and the arguments' shapes and static parts (`names`, `surroundings`); it is kept as a file
(`store`). What cannot be named for certain is compiled as ever (`program`).
"""

from maipp.kept.program import kept

__all__ = ["kept"]
