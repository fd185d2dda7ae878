"""The grinding that a gauge stops: one part step by step, and batches."""
