"""How robots come to know all logs: whoever meets asks what the other has, and fetches what is missing.

Nothing depends on a message that may be lost: a round is repeated on contact, when somebody has more, and every few
seconds. Every robot serves every log that it knows, so that two that never meet learn of each other through a third.
"""

import time
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

from maipp.fleet.frame import MOST_ORIGINS, decode, decode_heads, decode_part, encode, encode_heads, encode_part
from maipp.fleet.log import ForkError, Head, Origin, read_origin
from maipp.fleet.logs import Logs, LogSegment
from maipp.fleet.transport import Transport

HAVE, LOG, LINE = "have", "log", "line"
# Bytes of a log that are fetched at once, unpacked: at most, and where a link is slow or loses much.
PART, SMALL_PART = 1 << 19, 1 << 12
_MOST_PARTS = 10_000  # of one log in one round
_REPEATS = 3  # beats in a row that say how far a log goes, once it goes farther
_LONGEST_PAUSE = 10  # of who does not bring what it says to have: times that was waited for it
_TOLD_AFTER = 5  # failures in a row


class News(NamedTuple):
    """What a robot says of itself with what it has."""

    heads: dict[Origin, Head]
    status: dict[str, Any]
    whole: bool = True  # False: there may be logs that it has not told of


class Pause(NamedTuple):
    """For how long somebody is asked for nothing, since it did not bring what it says to have."""

    until: float
    failures: int  # in a row


class Exchange:
    """Fetches and serves logs over a transport."""

    def __init__(
        self,
        logs: Logs,
        transport: Transport,
        status: Callable[[], dict[str, Any]],
        taken: Callable[[Origin, list[dict[str, Any]]], None],
        tell: Callable[[str], None],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`status` is what to say of oneself; `taken` gets new records once they are in the logs."""
        self._monotonic = monotonic
        self._said: dict[Origin, tuple[Head, int]] = {}  # in beats, and how often
        self._beats, self._pauses = 0, dict[str, Pause]()
        self._failed = Counter[tuple[str, Origin]]()  # questions in a row for a log that somebody did not bring
        self.logs, self.transport, self._status, self._taken, self._tell = logs, transport, status, taken, tell
        self.news: dict[str, News] = {}  # what each robot said last
        self._missing: set[str] = set()
        self._size: dict[str, int] = {}  # of the parts that are fetched from each
        self.refused, self._refusals = 0, Counter[str]()  # messages that were not right, of all and of each
        transport.serve(HAVE, self._have)
        transport.serve(LOG, self._log)

    def announce(self, part: LogSegment) -> None:
        """Tell whoever hears it a line of one's own log."""
        self.transport.publish(LINE, encode_part(part))

    def beat(self) -> None:
        """Tell whoever hears it how far those of one's logs go that have grown; at first, and if asked, of all."""
        heads = {}
        whole, self._beats = self._beats < _REPEATS, self._beats + 1
        for origin, head in self.logs.heads().items():
            said, times = self._said.get(origin, (None, 0))
            times = times + 1 if said == head else 1
            self._said[origin] = head, times
            if times <= _REPEATS:
                heads[origin] = head
        self.transport.publish(HAVE, self._news(None if whole else heads))

    def round(self, timeout: float, to: str | None = None) -> set[str]:
        """Ask all within reach, or one, what they have, and fetch what is missing; names of those that answered."""
        heard = set()
        for name, frame in self.transport.ask(HAVE, b"", timeout, to).items():
            if self.hear_news(name, frame):
                heard.add(name)
                self._missing.discard(name)
        sources: dict[Origin, list[tuple[int, str]]] = {}
        for name in heard:
            for origin, head in self.news[name].heads.items():
                self._compare(name, origin, head, timeout)
                if self._lacks(name, origin, head):
                    sources.setdefault(origin, []).append((head.length, name))
        # What did not come the last time comes last: it must not keep back the others.
        failed = {origin: min(self._failed[each, origin] for _, each in offers) for origin, offers in sources.items()}
        for origin, offers in sorted(sources.items(), key=lambda item: (failed[item[0]], item[0])):
            # Who has most of it first; of several the robot itself, which surely has it right.
            for length, name in sorted(offers, key=lambda offer: (-offer[0], offer[1] != origin.robot, offer[1])):
                if self.logs.length(origin) < length and not self._rests(name):
                    self._fetch(name, origin, length, timeout)
        return heard

    def hear_news(self, sender: str, frame: bytes) -> bool:
        """Take note of what somebody has; False where that is not right."""
        try:
            header, _ = decode(frame)
            status = header.get("status")
            heads, whole, known = decode_heads(header.get("heads")), "some" not in header, self.news.get(sender)
            if not whole and known is not None:
                heads, whole = known.heads | heads, known.whole
            if len(heads) > MOST_ORIGINS:
                raise ValueError(f"heads of {len(heads)} logs")
            self.news[sender] = News(heads, status if isinstance(status, dict) else {}, whole)
        except ValueError as error:
            return self.refuse(sender, error)
        return True

    def hear_line(self, sender: str, frame: bytes) -> bool:
        """Take over a line that somebody published, if it is the next one; False where lines before it are missing."""
        try:
            part = decode_part(frame)
            if part.origin.robot != sender:
                raise ValueError(f"a line of {part.origin} from {sender}")
            if part.start > self.logs.length(part.origin):
                return False
            self._extend(part)
        except ValueError as error:
            self.refuse(sender, error)
        return True

    def behind(self, sender: str) -> bool:
        """Whether somebody said to have more of a log than there is here, or did not say yet what it has."""
        news = self.news.get(sender)
        return sender in self._missing or (
            news is not None and (not news.whole or any(self._lacks(sender, *each) for each in news.heads.items()))
        )

    def _lacks(self, name: str, origin: Origin, head: Head) -> bool:
        """Whether somebody is to be asked for more of a log."""
        own = origin == self.logs.origin or origin in self.logs.forked
        return not own and head.length > self.logs.length(origin) and not self._rests(name)

    def _rests(self, name: str) -> bool:
        pause = self._pauses.get(name)
        return pause is not None and pause.until > self._monotonic()

    def expect(self, sender: str) -> None:
        """Somebody has more than there is here, as one of its lines has shown."""
        self._missing.add(sender)

    def _fetch(self, name: str, origin: Origin, length: int, timeout: float) -> None:
        """Fetch a log up to a length from somebody, as far as answers come."""
        for _ in range(_MOST_PARTS):
            start = self.logs.length(origin)
            if start >= length:
                return
            try:
                size = self._size.get(name, PART)
                begun = self._monotonic()
                part = self._ask_part(name, origin, start, size, timeout)
                self._note_answer(name, origin, begun, part is not None)
                # What a link cannot bring in time it cannot bring the next time either, but a smaller part it may.
                self._size[name] = max(size // 4, SMALL_PART) if part is None else min(size + size // 8, PART)
                if part is None:
                    return
                self._extend(part)
            except ValueError as error:
                self.refuse(name, error)
                return

    def _note_answer(self, name: str, origin: Origin, begun: float, came: bool) -> None:
        """Ask who does not bring what it says to have less often, the more often that happens in a row."""
        if came:
            self._pauses.pop(name, None)
            del self._failed[name, origin]
            return
        self._failed[name, origin] += 1
        now, failures = self._monotonic(), 1 + (self._pauses[name].failures if name in self._pauses else 0)
        rest = (now - begun) * min(2 ** min(failures - 1, 10) - 1, _LONGEST_PAUSE)
        self._pauses[name] = Pause(now + rest, failures)
        if failures == _TOLD_AFTER:
            self._tell(f"{name} does not bring what it says to have of {origin}; it is asked less often")

    def _ask_part(self, name: str, origin: Origin, start: int, most: int, timeout: float) -> LogSegment | None:
        """Lines of a log from somebody, if an answer comes. Raises `ValueError` for one that is not right."""
        question = encode({"origin": str(origin), "from": start, "most": most})
        frame = self.transport.ask(LOG, question, timeout, name).get(name)
        if frame is None:
            return None
        part = decode_part(frame)
        if part.origin != origin or part.start != start:
            raise ValueError(f"an answer that was not asked for: {part.origin} from {part.start}")
        return part

    def _extend(self, part: LogSegment) -> None:
        new = part.origin not in self.logs.forked
        try:
            records = self.logs.extend(part)
        except ForkError as error:
            if new:
                self._tell(f"fork: {error}; what follows is not taken over")
            raise
        if records:
            self._taken(part.origin, records)

    def _compare(self, name: str, origin: Origin, head: Head, timeout: float) -> None:
        """Tell of a log that somebody has otherwise, if its robot has signed that."""
        own = origin == self.logs.origin and head.length > self.logs.length(origin)
        if origin in self.logs.forked or (not own and self.logs.agrees(origin, head)):
            return
        try:
            part = self._ask_part(name, origin, head.length - 1, 1, timeout)
        except ValueError as error:
            self.refuse(name, error)
            return
        if part is not None and self.logs.proves_fork(part):
            self.logs.forked.add(origin)
            self._tell(f"fork: {name} has another log of {origin}, line {head.length}; ours is kept")
        elif part is not None:
            self.refuse(name, ValueError(f"says it has another log of {origin}, which {origin.robot} has not signed"))

    def refuse(self, sender: str, error: ValueError) -> bool:
        """Count, and tell now and then, what somebody sent that is not right."""
        self.refused += 1
        self._refusals[sender] += 1
        if self._refusals[sender] <= 20 or self._refusals[sender] % 1000 == 0:
            self._tell(f"refused from {sender}: {error}")
        return False

    def _news(self, some: dict[Origin, Head] | None = None) -> bytes:
        """What there is here: of all logs, or only of some."""
        heads = encode_heads(self.logs.heads() if some is None else some)
        return encode({"heads": heads, "status": self._status()} | ({} if some is None else {"some": True}))

    def _have(self, question: bytes) -> bytes:
        return self._news()

    def _log(self, question: bytes) -> bytes | None:
        try:
            header, _ = decode(question)
            origin, start, most = read_origin(str(header.get("origin"))), header.get("from"), header.get("most")
            if not (isinstance(start, int) and isinstance(most, int)):
                return None
        except ValueError:
            return None
        part = self.logs.part(origin, start, min(max(most, 1), PART))
        return None if part is None else encode_part(part)
