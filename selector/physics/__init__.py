"""How the machine works: equations of heat, drives, vibration and gauging; knows no statistics of recordings."""
