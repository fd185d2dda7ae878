"""True machines beside a model file of them that lacks an effect: simulations that can be run again."""
