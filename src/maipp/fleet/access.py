"""What Zenoh lets through between those that have certificates: each writes under its own name and nowhere else.

A rule holds for messages that come in (ingress) or go out (egress) over the links of somebody, by the name in the
certificate. What no rule allows is dropped. Keys of rules leave the mission open: the same certificates serve several.
"""

from collections.abc import Mapping
from typing import Any

from maipp.fleet.certificates import ROBOT

_WRITE = ["put", "reply", "declare_queryable"]
_BE_THERE = ["liveliness_token"]
_ASK = ["query"]
_LISTEN = ["declare_subscriber"]
_LOOK = ["declare_liveliness_subscriber", "liveliness_query"]


def access_control(name: str, roles: Mapping[str, str]) -> dict[str, Any]:
    """Zenoh's access control for somebody among those of these roles, which include its own."""
    others = sorted({*roles} - {name})
    rules = [
        # What anybody known may ask and listen to, of this one; and this one of them.
        *(_rule(f"ask {flow}", flow, _ASK, "maipp/*/*/ask/*") for flow in ("ingress", "egress")),
        *(_rule(f"listen {flow}", flow, _LISTEN, "maipp/*/*/say/*") for flow in ("ingress", "egress")),
        *(_rule(f"look {flow}", flow, _LOOK, "maipp/*/*/alive") for flow in ("ingress", "egress")),
        *_voice(name, roles[name], "egress"),
    ]
    common = [rule["id"] for rule in rules]
    policies = []
    for other in others:
        voice = _voice(other, roles[other], "ingress")
        rules += voice
        policies.append({"rules": [*common, *(rule["id"] for rule in voice)], "subjects": [other]})
    subjects = [{"id": other, "cert_common_names": [other]} for other in others]
    if not others:  # Zenoh takes no empty lists, and one that knows nobody lets nothing through
        subjects = [{"id": "nobody", "cert_common_names": [name]}]
        policies = [{"rules": common, "subjects": ["nobody"]}]
    told = {"rules": rules, "subjects": subjects, "policies": policies}
    return {"enabled": True, "default_permission": "deny"} | told


def _voice(name: str, role: str, flow: str) -> list[dict[str, Any]]:
    """Under its own name a robot says, answers, and shows that it is there; a watcher only the last."""
    there = _rule(f"{name} is there", flow, _BE_THERE, f"maipp/*/{name}/alive")
    return [there, _rule(f"{name} writes", flow, _WRITE, f"maipp/*/{name}/**")] if role == ROBOT else [there]


def _rule(name: str, flow: str, messages: list[str], key: str) -> dict[str, Any]:
    return {"id": name, "flows": [flow], "messages": messages, "permission": "allow", "key_exprs": [key]}
