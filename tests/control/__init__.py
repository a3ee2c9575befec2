"""Controllers: parts against their twins, closed loops, analytic answers."""
