"""The compiled simulation of an axis; its slow, plain twin stands beside its tests."""
