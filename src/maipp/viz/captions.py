"""The words on the pictures."""

from maipp.engine.episode import Episode


def headline(episode: Episode) -> str:
    """Planner, team and budget."""
    scenario = episode.scenario
    team = f"{scenario.agents} agent{'s' if scenario.agents > 1 else ''}"
    budgets = sorted(set(scenario.budgets))
    budget = f"{budgets[0]:g}" if len(budgets) == 1 else f"{budgets[0]:g} to {budgets[-1]:g}"
    return f"{episode.planner}, {team}, budget {budget}"


def numbers_line(episode: Episode) -> str:
    """Tr(P), RMSE (file units where there are any) and how many measurements and prior samples gave them."""
    metrics = episode.metrics
    count = sum(len(agent.measurement_y) for agent in episode.agents)
    prior = "" if episode.prior is None else f", {len(episode.prior.y)} prior samples"
    error = float(episode.drawn.to_user_std(metrics.rmse))
    return f"Tr(P) = {metrics.trace:.3g}   RMSE = {error:.3g}   {count} measurements{prior}"
