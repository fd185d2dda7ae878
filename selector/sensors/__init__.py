"""Which sensors: similarity, closure, groups and screening; plain arrays in, small frozen values out."""

from selector.sensors.groups import ClosureChain as ClosureChain
from selector.sensors.groups import Dendrogram as Dendrogram
from selector.sensors.groups import FStatistic as FStatistic
from selector.sensors.groups import LambdaAxis as LambdaAxis
from selector.sensors.groups import LambdaStep as LambdaStep
from selector.sensors.groups import Partition as Partition
from selector.sensors.groups import chaining_findings as chaining_findings
from selector.sensors.groups import closure_chain as closure_chain
from selector.sensors.groups import dendrogram as dendrogram
from selector.sensors.groups import lambda_axis as lambda_axis
from selector.sensors.groups import lambda_cut as lambda_cut
from selector.sensors.groups import transitive_closure as transitive_closure
from selector.sensors.screening import Dropped as Dropped
from selector.sensors.screening import ScreeningRound as ScreeningRound
from selector.sensors.screening import representatives as representatives
from selector.sensors.screening import screen as screen
from selector.sensors.similarity import Similarity as Similarity
from selector.sensors.similarity import constant_limit as constant_limit
from selector.sensors.similarity import correlation_similarity as correlation_similarity
from selector.sensors.similarity import sensor_names as sensor_names
from selector.sensors.similarity import similarity_findings as similarity_findings
from selector.sensors.similarity import similarity_from_cross_products as similarity_from_cross_products
