"""The table of all keys of a training configuration, for docs/training.md.

`python -m maipp.training.config_table PAGE` writes it between the page's two `keys` markers.
"""

import sys
from pathlib import Path

from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.training.config import NAMED
from maipp.training.config_io import config_to_dict

START, END = "<!-- keys -->\n", "<!-- /keys -->"

MEANINGS = {
    "policy": "what is trained: `ti` (with intents; for `di`, `ti`, `ti-star`) or `sga-catnipp` (without)",
    "seed": "of everything random: first weights, worlds, steps, shuffling",
    "agents": "robots that there is room for",
    "team": "`[fewest, most]` robots that take part, drawn for each mission; none: all `agents`",
    "budget": "each mission's budget is drawn uniformly from this range, domain units",
    "length_scale": "length scale of the belief's kernel, domain units; this and the next six: a number, or "
    "`[low, high]`, from which each mission's is drawn uniformly",
    "threshold": "of the high-interest area, normalised field units",
    "beta": "weight of the uncertainty in its upper confidence bound",
    "noise": "variance of the measurement noise",
    "measurement_interval": "distance between measurements, domain units",
    "speed": "domain units per unit of time; drawn for each robot",
    "comm_range": "farthest distance at which robots hear each other, domain units; none: any. Of a range such as "
    "`[0.3, none]` the inverse is drawn uniformly",
    "bank": "teams of roadmaps drawn beforehand; each is met in the 8 symmetries of the square",
    "shards": "parts that the missions are split into; devices and processes share them evenly",
    "missions": "missions that each shard steps together",
    "events": "decisions of each mission per update",
    "epochs": "passes over an update's decisions",
    "minibatch": "decisions of each shard per gradient step; divides missions x events",
    "paths": "trajectories sampled for the intent at each decision (a)",
    "steps": "nodes of each (j)",
    "share": "the intent is fitted to all `samples`, or to the `best` of them",
    "start": "weights to begin with: a shipped name or a `.safetensors` file; empty: random ones",
    "imitation": "updates at the beginning that imitate the teacher",
    "search": "updates at the end that learn from the policy's own search",
    "search_paths": "paths sampled for it at each decision",
    "elites": "the best of them, which are made likelier",
    "updates": "updates in all; those between are PPO",
    "reward": "`log-trace`: fall of log Tr(P); `paper`: as in Yang et al. 2023, Sec. IV-C",
    "discount": "of later rewards",
    "trace_decay": "lambda of generalised advantage estimation",
    "clip": "how far PPO lets the probability ratio of a choice move from 1",
    "entropy": "weight of the entropy bonus",
    "value": "weight of the squared error of the value",
    "learning_rate": "of Adam, at the beginning",
    "search_rate": "likewise, at the beginning of the search",
    "schedule": "of the learning rate: `cosine` (to 2 %), `steps` (times 0.96 every 32 updates), `constant`",
    "gradient_norm": "gradients are scaled down to at most this norm",
    "evaluate_every": "updates between two held-out evaluations",
    "evaluate_instances": "held-out worlds",
    "evaluate_budget": "their budget, domain units",
    "checkpoint_seconds": "least time between two checkpoints, seconds",
}


def config_table() -> str:
    """Markdown: every key with its value in each named configuration; a value left empty is the default's."""
    columns = {name: config_to_dict(config) for name, config in NAMED.items()}
    rows = [["Key", *(f"`{name}`" for name in columns), "Meaning"], ["---"] * (len(columns) + 2)]
    default = columns["default"]
    for key, value in default.items():
        others = [f"`{other[key]}`" if other[key] != value else "" for other in list(columns.values())[1:]]
        rows.append([f"`{key}`", f"`{value}`", *others, MEANINGS.get(key, "")])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def with_config_table(page: str) -> str:
    """The page with what is between its two markers replaced by the table."""
    before, start, rest = page.partition(START)
    _, end, after = rest.partition(END)
    if not end:
        raise InputError(f"the page has no place for the table; give {START.strip()} and {END} lines")
    return f"{before}{start}\n{config_table()}\n\n{end}{after}"


if __name__ == "__main__":
    path = Path(sys.argv[1])
    write_atomic(path, with_config_table(path.read_text(encoding="utf-8")))
