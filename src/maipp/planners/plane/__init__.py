"""Ways in the plane that keep out of no-go zones: legs, rows of a sweep, random trees, ways to what is far away."""
