"""The page to watch a fleet on: a `Board` between the one who watches and a server with a thread of its own."""

from maipp.fleet.dashboard.board import Board as Board
from maipp.fleet.dashboard.follow import Follower as Follower
from maipp.fleet.dashboard.saved import save_page as save_page
from maipp.fleet.dashboard.server import Dashboard as Dashboard
from maipp.fleet.dashboard.server import serve as serve
