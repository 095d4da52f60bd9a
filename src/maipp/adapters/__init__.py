"""maipp as an environment of other libraries: `maipp.adapters.pettingzoo` (needs `pip install 'maipp[rl]'`)."""
