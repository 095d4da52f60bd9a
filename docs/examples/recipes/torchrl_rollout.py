"""TorchRL on surveys: the specs checked, and a rollout of a team in turns and of robots in parallel.

pip install 'maipp[rl]' torchrl
"""

from typing import Any

from torchrl.envs import GymWrapper, PettingZooWrapper
from torchrl.envs.utils import check_env_specs

import maipp
from maipp.adapters.gymnasium import SurveyEnv
from maipp.adapters.pettingzoo import parallel_env

SCENARIO = maipp.Scenario(agents=3, budget=2.0, grid=15, nodes=60, neighbours=10)


def environments(scenario: maipp.Scenario) -> dict[str, Any]:
    """A team as one learner, and robots that learn apart; the masks of the latter are part of what they see."""
    return {
        "team": GymWrapper(SurveyEnv(scenario, observations="box")),
        "robots": PettingZooWrapper(parallel_env(scenario), use_mask=True),
    }


def main() -> None:
    for name, env in environments(SCENARIO).items():
        check_env_specs(env)
        print(name, env.rollout(50))


if __name__ == "__main__":
    main()
