"""Which sensors: similarity, closure, groups and screening; plain arrays in, small frozen values out."""

from selector.sensors.fuzzy import (
    ClosureChain,
    closure_chain,
    max_min_composition,
    transitive_closure,
    transitive_closure_by_squaring,
)
from selector.sensors.groups import (
    Dendrogram,
    FStatistic,
    LambdaAxis,
    LambdaStep,
    Partition,
    chaining_findings,
    dendrogram,
    f_statistic,
    lambda_axis,
    lambda_cut,
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
    "f_statistic",
    "lambda_axis",
    "lambda_cut",
    "max_min_composition",
    "representatives",
    "screen",
    "sensor_names",
    "similarity_findings",
    "similarity_from_cross_products",
    "transitive_closure",
    "transitive_closure_by_squaring",
]
