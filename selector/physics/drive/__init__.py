"""Feed drives: mechanics and their stiffness, servo, friction, transmission, time-varying simulation, ball-bar."""
