"""A robot's end of a network of Zenoh peers (the extra `maipp[fleet]`): explicit addresses, nothing found by itself.

Only channels are used, never callbacks: a callback keeps the process alive after an error in another thread. What
waits to be read is bounded, so that a flood takes no memory, and what is read of one robot too, so that it takes no
time. Zenoh's own times are never used.

Keys are maipp/MISSION/ROBOT/say/TOPIC, .../ask/TOPIC and .../alive; with keys (`Security`) the network lets a robot
write only under its own name.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Collection, Sequence
from typing import Any

from maipp.errors import InputError
from maipp.fleet.log import check_name, is_name
from maipp.fleet.rate import Rates
from maipp.fleet.reach import Scout
from maipp.fleet.security import Security
from maipp.fleet.transport import Answer, Hint
from maipp.fleet.zenoh_config import LARGEST_HINT, LEASE, configuration, load_zenoh, reason, zenoh_config

ROOT = "maipp"
_HINTS, _QUESTIONS, _ANSWERS, _TOKENS = 1024, 256, 64, 1024  # that wait, at most
_HINTS_PER_SECOND, _HINTS_AT_ONCE = 500.0, 1000.0  # of one robot, that are read
_QUESTIONS_PER_SECOND, _QUESTIONS_AT_ONCE = 200.0, 400.0  # that are answered, of each topic
_BUSY, _IDLE = 0.002, 0.01  # s between two looks for questions, in the second after one and else
_LISTEN = 2.0  # s, in which a robot that was started again waits for its address
_CLOSE = 0.8  # s, that the network may take to say goodbye


def _note(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


class ZenohLink:
    """A `Transport` over Zenoh. Close it, or use it in a `with` block."""

    def __init__(
        self,
        name: str,
        mission: str,
        *,
        connect: Sequence[str] = (),
        listen: Sequence[str] = (),
        security: Security | None = None,
        lease: float = LEASE,
        tell: Callable[[str], None] | None = None,
    ) -> None:
        """Listen, and connect to others as they come. Raises `InputError` where that cannot be.

        Without `tell`, notes go to standard error: standard output may be a vehicle's.
        """
        zenoh = load_zenoh()
        self.name, self._zenoh, self._tell = check_name(name, "name"), zenoh, tell or _note
        self._base, self._closed = f"{ROOT}/{mission[:16]}", threading.Event()
        told = configuration(connect, listen, security, lease)
        self._session = self._open(zenoh_config(told), listen)
        self._scout = Scout(connect, told.get("transport/link/tls"))
        self._security, self._strangers, self._look = security, set[str](), 0.0
        self._there, self._lock = set[str](), threading.Lock()
        self._rates = Rates(_HINTS_PER_SECOND, _HINTS_AT_ONCE)
        self._answering: list[threading.Thread] = []
        ring = zenoh.handlers.RingChannel
        remote = zenoh.Locality.REMOTE
        try:
            self._hints = self._session.declare_subscriber(f"{self._base}/*/say/*", ring(_HINTS), allowed_origin=remote)
            self._tokens = self._session.liveliness().declare_subscriber(
                f"{self._base}/*/alive", ring(_TOKENS), history=True
            )
            self._token = self._session.liveliness().declare_token(f"{self._base}/{self.name}/alive")
        except BaseException:
            self._session.close()
            raise

    def publish(self, topic: str, payload: bytes) -> None:
        """As the protocol has it; dropped where the network is full, and where it would be too large for a hint."""
        if self._closed.is_set() or len(payload) > LARGEST_HINT:
            return
        with contextlib.suppress(self._zenoh.ZError):  # closed meanwhile
            self._session.put(
                f"{self._base}/{self.name}/say/{topic}",
                payload,
                congestion_control=self._zenoh.CongestionControl.DROP,
                priority=self._zenoh.Priority.INTERACTIVE_HIGH,  # overtakes the answers, which may be long
                allowed_destination=self._zenoh.Locality.REMOTE,
            )

    def receive(self) -> list[Hint]:
        """As the protocol has it; of who sends too much the rest is not read."""
        hints, now = [], time.monotonic()
        self.peers()
        self._look_at_links(now)
        for _ in range(_HINTS):
            sample = self._next(self._hints)
            if sample is None:
                break
            name, topic = self._named(sample)
            if not name or sample.kind != self._zenoh.SampleKind.PUT or not self._let_in(name, now):
                continue
            hints.append(Hint(name, topic, sample.payload.to_bytes()))
        return hints

    def ask(self, topic: str, payload: bytes, timeout: float, to: str | None = None) -> dict[str, bytes]:
        """As the protocol has it; waits no longer than until all that are known to be there have answered."""
        if self._closed.is_set():
            return {}
        zenoh, answers, end = self._zenoh, dict[str, bytes](), time.monotonic() + timeout
        expected = {*self.peers()} if to is None else {to}
        try:
            # A channel that drops the oldest loses what is in it at the end; this one makes the sender wait.
            replies = self._session.get(
                f"{self._base}/{to or '*'}/ask/{topic}",
                zenoh.handlers.FifoChannel(_ANSWERS),
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=timeout,
                payload=payload,
                allowed_destination=zenoh.Locality.REMOTE,
            )
        except zenoh.ZError:  # closed meanwhile
            return {}
        while time.monotonic() < end and not self._closed.is_set():
            try:
                reply = replies.try_recv()
            except zenoh.ZError:  # all have answered that will
                break
            if reply is None:
                if expected and not expected - {*answers}:
                    break
                time.sleep(0.001)
            elif reply.ok is not None:
                name, _ = self._named(reply.ok)
                if name and to in (None, name):
                    answers[name] = reply.ok.payload.to_bytes()
        return answers

    def serve(self, topic: str, answer: Answer) -> None:
        """As the protocol has it."""
        key = f"{self._base}/{self.name}/ask/{topic}"
        queryable = self._session.declare_queryable(
            key, self._zenoh.handlers.RingChannel(_QUESTIONS), allowed_origin=self._zenoh.Locality.REMOTE
        )
        thread = threading.Thread(target=self._serve, args=(queryable, key, answer), name=f"serve {topic}", daemon=True)
        self._answering.append(thread)
        thread.start()

    def peers(self) -> Collection[str]:
        """As the protocol has it."""
        with self._lock:
            while (sample := self._next(self._tokens)) is not None:
                name, _ = self._named(sample)
                if sample.kind != self._zenoh.SampleKind.PUT:
                    self._there.discard(name)
                elif name and len(self._there) < _TOKENS:
                    self._there.add(name)
            return {*self._there}

    def close(self) -> None:
        """As the protocol has it, within a second."""
        if self._closed.is_set():
            return
        self._closed.set()
        # In a thread: it waits for a link that has fallen silent.
        closing = threading.Thread(target=self._session.close, name="close", daemon=True)
        closing.start()
        end = time.monotonic() + _CLOSE
        for thread in (closing, *self._answering):
            thread.join(timeout=max(end - time.monotonic(), 0.0))

    def __enter__(self) -> "ZenohLink":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self, config: Any, listen: Sequence[str]) -> Any:
        """A session; a robot that was started again at once waits until its address is free."""
        end = time.monotonic() + _LISTEN
        while True:
            try:
                return self._zenoh.open(config)
            except self._zenoh.ZError as error:
                if "in use" in str(error) and time.monotonic() < end:
                    time.sleep(0.1)
                    continue
                where = ", ".join(listen) or "no address"
                raise InputError(f"--listen: cannot listen at {where}: {reason(error)}") from None

    def _next(self, entity: Any) -> Any:
        """What waits first; None: nothing does."""
        if self._closed.is_set():
            return None
        try:
            return entity.try_recv()
        except self._zenoh.ZError:
            return None

    def _named(self, sample: Any) -> tuple[str, str]:
        """The robot of a key, and its last part; no name for one's own, and for what could mean several."""
        parts = str(sample.key_expr).split("/")
        name = parts[2] if len(parts) > 3 else ""
        return (name if is_name(name) and name != self.name else ""), parts[-1]

    def _let_in(self, name: str, now: float) -> bool:
        allowed = self._rates.allows(name, now)
        if not allowed and self._rates.is_new(name):
            self._tell(f"{name} sends more than {_HINTS_PER_SECOND:.0f} messages a second; the rest is not read")
        return allowed

    def _look_at_links(self, now: float) -> None:
        """Tell of who has a certificate of the fleet's authority, but is not known here; and why nobody is reached."""
        if now < self._look or self._closed.is_set():
            return
        self._look, links = now + 1.0, self._session.info.links()
        for line in self._scout.look(bool(links), now):
            self._tell(line)
        for link in links if self._security is not None else ():
            name = link.auth_identifier or "somebody without a name"
            known = self._security.known if self._security is not None else frozenset()
            if name not in known and name not in self._strangers and len(self._strangers) < 100:
                self._strangers.add(name)
                self._tell(f"refused: {name!r:.60} ({link.dst}) has no certificate in peers/; nothing of it is read")

    def _serve(self, queryable: Any, key: str, answer: Answer) -> None:
        """Answer questions until the end."""
        last = 0.0
        rates = Rates(_QUESTIONS_PER_SECOND, _QUESTIONS_AT_ONCE)
        while not self._closed.is_set():
            now, query = time.monotonic(), self._next(queryable)
            if query is None:
                self._closed.wait(_BUSY if now - last < 1.0 else _IDLE)
                continue
            last, payload = now, query.payload
            with contextlib.suppress(self._zenoh.ZError), query:
                told = answer(b"" if payload is None else payload.to_bytes())
                if told is not None:
                    query.reply(key, told)
            if not rates.allows("", now):
                self._closed.wait(1.0 / _QUESTIONS_PER_SECOND)
