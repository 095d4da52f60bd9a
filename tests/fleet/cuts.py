"""Three robots over Zenoh whose links are cut and heal at random; after each round all know the same.

python tests/fleet/cuts.py --rounds 100
"""

import argparse
import random
import time

from maipp.fleet.launch import free_ports
from tests.fleet import schedules
from tests.fleet.conftest import Team
from tests.fleet.proxy import Proxy
from tests.fleet.test_zenoh_fleet import Crew


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    told = parser.parse_args()
    rng, longest = random.Random(told.seed), 0.0
    pa, pb = free_ports(2)
    with Proxy(pa) as ab, Proxy(pa) as ac, Proxy(pb) as bc:
        addresses = [
            ([f"tcp/127.0.0.1:{pa}"], []),
            ([f"tcp/127.0.0.1:{pb}"], [ab.address]),
            ([], [ac.address, bc.address]),
        ]
        with Crew(Team(schedules.SCENARIO, ("greedy", {})), addresses) as crew:
            for number in range(told.rounds):
                end = time.monotonic() + rng.uniform(0.2, 4.0)
                while time.monotonic() < end:
                    if rng.random() < 0.05:
                        rng.choice([Proxy.swallow, Proxy.reset, Proxy.heal])(rng.choice([ab, ac, bc]))
                    for robot in crew.robots:
                        robot.work()
                    time.sleep(0.01)
                crew.measure(1)
                for proxy in (ab, ac, bc):
                    proxy.heal()
                begun = time.monotonic()
                crew.agree()
                longest = max(longest, time.monotonic() - begun)
                print(f"round {number + 1}: {len(crew.kept)} measurements, agreed", flush=True)
            assert not [line for line in crew.told if "refused" in line or "fork" in line]
    print(f"{told.rounds} rounds, nothing lost; all agreed within {longest:.1f} s of the last cut")


if __name__ == "__main__":
    main()
