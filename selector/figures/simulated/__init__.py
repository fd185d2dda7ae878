"""Pictures of what was simulated: heat, drives, vibration, gauging, and the machine itself."""
