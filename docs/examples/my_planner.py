"""A planner in one file: try some headings, take the step that would lower the uncertainty most."""

import jax.numpy as jnp

from maipp import Decision, InputError, Observation, Planner, extend, option, predicted_trace


class BestHeading(Planner):
    """One straight step in the direction with the lowest predicted Tr(P), counting the others' steps as measured."""

    headings: int = option(16, meaning="directions tried")
    step: float = option(0.2, meaning="how far to go before deciding again, domain units")

    def check(self) -> None:
        """Refuse options that make no sense, in one line."""
        if self.headings < 4:
            raise InputError(f"headings: {self.headings} are too few to leave a corner; give a whole number >= 4")
        if not 0 < self.step <= min(self.scenario.extent) / 2:
            raise InputError(f"step: {self.step} is no step; give a length > 0 and up to half the domain's side")

    def empty_message(self):
        """Where the agent is heading; NaN before its first decision."""
        return jnp.full(2, jnp.nan)

    def decide(self, key, observation: Observation, memory) -> Decision:
        """The end of the best step, which is also what the others are told."""
        told = observation.heard & jnp.isfinite(observation.messages[:, 0])  # (m,) whose next position is known
        belief = extend(observation.belief, jnp.where(told[:, None], observation.messages, 0.0), told)

        angle = jnp.arange(self.headings) * (2 * jnp.pi / self.headings)
        ends = observation.position + self.step * jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)  # (c, 2)
        within = jnp.all((ends >= 0) & (ends <= jnp.asarray(self.scenario.extent)), axis=-1)
        # One measurement per candidate, at its end.
        score = predicted_trace(belief, self.interest, observation.inside, ends[:, None, :], within[:, None])
        best = ends[jnp.argmin(jnp.where(within, score, jnp.inf))]
        return Decision(best[None], best, memory)
