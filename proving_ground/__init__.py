"""The blind proof: recordings in which an effect is concealed, sealed answers, rivals, and the score."""
