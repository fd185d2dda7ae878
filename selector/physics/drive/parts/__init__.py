"""What a feed axis is made of: mechanics, catalogue parts and their stiffness, damping, servo and sensing."""
