"""What a survey took home: its map, its samples, its report and its numbers, from a journal or a record.

`read_taken` reads either, `write_result` writes the files. The map is the belief at the end, from what counts.
"""

from maipp.results.result_files import write_result
from maipp.results.sources import read_taken
from maipp.results.taken import Taken

__all__ = ["Taken", "read_taken", "write_result"]
