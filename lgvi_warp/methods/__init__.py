"""How time advances, as data: programs of sub-maps, tableaux, the time grid and stable steps."""
