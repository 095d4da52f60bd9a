import sys
from pathlib import Path

# The harness is a script of a few files beside this one, not a package.
sys.path.insert(0, str(Path(__file__).parent))
