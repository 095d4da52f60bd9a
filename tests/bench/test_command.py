"""What made a page: commands say what differs, machines are told once."""

from maipp.bench.command import command, footer, machines, made_on


def test_the_command_has_the_flags_that_are_not_as_usual():
    usual = {"seed": 0, "budget": 3.0, "planners": ["a", "b"], "quick": False}
    assert command("latency", "my dir", usual, usual) == "maipp benchmark latency --out 'my dir'"
    given = {"seed": 2, "budget": 0.6, "planners": ["a"], "quick": True, "reference": "b", "page": None}
    typed = "maipp benchmark latency --out run --seed 2 --budget 0.6 --planners a --quick --reference b"
    assert command("latency", "run", given, usual) == typed
    assert footer(typed, [], "time")[::2] == [f"```sh\n{typed}\n```", "time"]


def test_machines_are_told_once():
    machine = {"cpu": "A processor", "cores": 1, "backend": "cpu", "devices": 2, "precision": "float32"}
    versions = {"maipp": "0.1.0", "jax": "0.10.2", "python": "3.11.7"}
    words = "{}, 1 core, JAX on cpu (2 devices), float32, maipp 0.1.0, jax 0.10.2, Python 3.11.7"
    assert machines((machine, versions), (machine, versions)) == words.format("A processor")
    both = machines((machine, versions), (machine | {"cpu": "Another"}, versions))
    assert both == f"{words.format('A processor')}; and on {words.format('Another')}"
    assert made_on((machine, versions)) == f"Made on {words.format('A processor')}."
