"""How tool and workpiece move, how far at most, and what that leaves on the part."""
