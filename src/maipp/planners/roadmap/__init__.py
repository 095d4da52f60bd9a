"""An agent on its roadmap: the edges that it may take, and shortest ways along them."""
