"""What hammer taps tell of the joints: measured compliances, their modes, and stiffness and ψ fitted to them."""
