"""Where recording and simulation differ: windows, regimes, frequencies; structure that has no name."""
