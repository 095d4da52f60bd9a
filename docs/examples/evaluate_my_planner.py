"""Register a planner of your own, run one survey with it, and compare it with a shipped one."""

import maipp

maipp.use_all_cores()  # before anything else that uses JAX

import jax  # noqa: E402
from my_planner import BestHeading  # noqa: E402


def compare(scenario: maipp.Scenario, *, instances: int, trials: int) -> dict[str, float]:
    """Mean Tr(P) of both planners on the same missions."""
    maipp.register("best-heading", BestHeading, summary="one step in the best direction")
    names = ("best-heading", "random")
    runs = {name: maipp.evaluate(scenario, name, instances=instances, trials=trials, timing=False) for name in names}
    return {name: run.summary["trace"].mean for name, run in runs.items()}


def survey(scenario: maipp.Scenario, seed: int = 0) -> jax.Array:
    """The routes (1, m, vertices, 2) of one survey."""
    planner = maipp.make_planner("best-heading", scenario, {"headings": 8})
    missions = maipp.draw_missions(scenario, seed=seed, instances=1, planner=planner)
    return maipp.run_missions(planner, missions, jax.random.key(seed)).route


if __name__ == "__main__":
    world = maipp.Scenario(agents=2, budget=2.0)
    for planner_name, trace in compare(world, instances=10, trials=2).items():
        print(f"{planner_name:<20} Tr(P) {trace:.1f}")
    print("a survey's routes:", survey(world).shape)
