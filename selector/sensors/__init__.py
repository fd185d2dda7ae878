"""Which sensors: similarity, closure, groups and screening; plain arrays in, small frozen values out."""

from selector.sensors.groups import (
    ClosureChain,
    Dendrogram,
    FStatistic,
    LambdaAxis,
    LambdaStep,
    Partition,
    chaining_findings,
    closure_chain,
    dendrogram,
    lambda_axis,
    lambda_cut,
    transitive_closure,
)
from selector.sensors.screening import Dropped, ScreeningRound, representatives, screen
from selector.sensors.similarity import (
    Similarity,
    constant_limit,
    correlation_similarity,
    sensor_names,
    similarity_findings,
    similarity_from_cross_products,
)

__all__ = [
    "ClosureChain",
    "Dendrogram",
    "Dropped",
    "FStatistic",
    "LambdaAxis",
    "LambdaStep",
    "Partition",
    "ScreeningRound",
    "Similarity",
    "chaining_findings",
    "closure_chain",
    "constant_limit",
    "correlation_similarity",
    "dendrogram",
    "lambda_axis",
    "lambda_cut",
    "representatives",
    "screen",
    "sensor_names",
    "similarity_findings",
    "similarity_from_cross_products",
    "transitive_closure",
]
