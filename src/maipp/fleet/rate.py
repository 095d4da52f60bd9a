"""How much is read of each that speaks."""


class Rates:
    """Of each name so many things a second, and so many at once after a silence (token buckets)."""

    def __init__(self, per_second: float, at_once: float, most_names: int = 1000) -> None:
        self._per_second, self._at_once, self._most = per_second, at_once, most_names
        self._left: dict[str, tuple[float, float]] = {}  # what may come at once, and as of when
        self._over = set[str]()

    def allows(self, name: str, now: float) -> bool:
        """Whether one more is read now; nothing is of names beyond the most that are kept."""
        if name not in self._left and len(self._left) >= self._most:
            return False
        left, then = self._left.get(name, (self._at_once, now))
        left = min(left + (now - then) * self._per_second, self._at_once)
        self._left[name] = (left - 1.0 if left >= 1.0 else left, now)
        if left >= self._at_once - 1.0:
            self._over.discard(name)
        return left >= 1.0

    def is_new(self, name: str) -> bool:
        """Whether a name that is over its rate has not been so since it was silent; then it has."""
        if name in self._over or len(self._over) >= self._most:
            return False
        self._over.add(name)
        return True
