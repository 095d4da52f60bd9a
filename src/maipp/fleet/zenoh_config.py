"""How Zenoh is set up for a robot: explicit addresses, nothing found by itself, bounds on what comes in."""

import json
import re
from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any

from maipp.errors import InputError
from maipp.fleet.security import Security, is_loopback

# Seconds without a sign after which a link counts as dead. Peers that are asked meanwhile are waited for in vain.
LEASE = 4.0
# Largest hint, question and answer, bytes. An answer may be a single line of a log (`log.LONGEST_LINE`) and its frame.
LARGEST_HINT, LARGEST_QUESTION, LARGEST_ANSWER = 1 << 15, 1 << 12, 3 << 19

_LINKS = 64  # at most
_HANDSHAKE = 5.0  # s; whoever opens a link and says nothing is closed
_ENDPOINT = re.compile(r"(tcp|tls)/([^\s/#?;\[\]:]+|\[[0-9A-Fa-f:.]+\]):(\d{1,5})")


def load_zenoh() -> ModuleType:
    """The library. Raises `InputError` where it is not installed."""
    try:
        import zenoh
    except ImportError:
        raise InputError("fleets over a network need eclipse-zenoh; pip install 'maipp[fleet]'") from None
    return zenoh


def check_endpoint(endpoint: str, flag: str, private: bool) -> None:
    """Raise `InputError` for an address that is none, that is open to others, or that keys are not for."""
    match = _ENDPOINT.fullmatch(endpoint)
    if match is None or not 0 < int(match[3]) < 1 << 16:
        raise InputError(f"{flag}: {endpoint!r:.80} is no address; give one such as tls/192.168.1.12:7447")
    if match[1] == "tls" and not private:
        raise InputError(f"{flag}: {endpoint} needs --keys; maipp fleet keys makes them")
    if match[1] == "tcp" and private:
        raise InputError(f"{flag}: {endpoint} has no use for --keys; give tls/..., or leave out the keys")
    if match[1] == "tcp" and not is_loopback(endpoint.partition("/")[2].rpartition(":")[0]):
        raise InputError(
            f"{flag}: {endpoint} is open to others; give tls/... and --keys (maipp fleet keys makes them), or an "
            "address of this computer alone, such as tcp/127.0.0.1:7447"
        )


def configuration(
    connect: Sequence[str], listen: Sequence[str], security: Security | None, lease: float = LEASE
) -> dict[str, Any]:
    """Zenoh's configuration. Raises `InputError` for an address that is none, or is open to others without keys."""
    for flag, endpoints in (("--connect", connect), ("--listen", listen)):
        for endpoint in endpoints:
            check_endpoint(endpoint, flag, security is not None)
    told: dict[str, Any] = {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # nobody is looked for, so the start need not wait
        "adminspace/enabled": False,
        "connect/endpoints": [*connect],
        "connect/timeout_ms": -1,  # go on trying, after the start
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 500, "period_max_ms": 2000, "period_increase_factor": 1.5},
        "open/return_conditions": {"connect_scouted": False, "declares": False},
        "listen/endpoints": [*listen],
        "listen/timeout_ms": 0,
        "listen/exit_on_failure": True,
        "transport/link/tx/lease": int(1000 * lease),
        "transport/link/protocols": ["tcp"] if security is None else ["tls"],
        # Pieces of what is larger are dropped as they come; the filter below counts payloads, this whole messages.
        "transport/link/rx/max_message_size": LARGEST_ANSWER + (1 << 16),
        "transport/unicast/max_sessions": _LINKS,
        "transport/unicast/open_timeout": int(1000 * _HANDSHAKE),
        "transport/unicast/accept_timeout": int(1000 * _HANDSHAKE),
        "transport/shared_memory/enabled": False,
        "low_pass_filter": [
            _largest("hints", ["put", "delete"], LARGEST_HINT),
            _largest("questions", ["query"], LARGEST_QUESTION),
            _largest("answers", ["reply"], LARGEST_ANSWER),
        ],
    }
    return told if security is None else told | security.zenoh()


def zenoh_config(values: Mapping[str, Any]) -> Any:
    """Zenoh's own object. Raises `InputError` for what it does not take."""
    zenoh = load_zenoh()
    config = zenoh.Config()
    for key, value in values.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise InputError(f"{key}: {reason(error)}") from None
    return config


def reason(error: Exception) -> str:
    """What Zenoh says, without the places in its source."""
    return re.sub(r"\]? at /\S*", "", str(error)).splitlines()[0][:200]


def _largest(name: str, messages: list[str], size: int) -> dict[str, Any]:
    return {"id": name, "flows": ["ingress"], "messages": messages, "key_exprs": ["**"], "size_limit": size}
