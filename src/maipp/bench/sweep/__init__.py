"""One executor for every sweep: `run_sweep` (`dealing`) deals jobs (`jobs`) to a crew, and keeps what they come to.

A crew is processes of this machine (`local`) or the workers of a cluster (`cluster`), which `cluster_worker` starts on
any machine that reaches the scheduler (`address`). Nothing here imports JAX until a process is on its core.
"""
