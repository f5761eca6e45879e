"""Errors of models on trips they were not fitted on: protocols, held-out runs, metrics, paired comparisons."""

from tripwatt.study.evaluation.folds import Execution
from tripwatt.study.evaluation.hold_outs import CarChoice
from tripwatt.study.evaluation.metrics import paired_difference
from tripwatt.study.evaluation.protocol import EvaluationProtocol, choose_models
from tripwatt.study.evaluation.results import EvaluationRun, write_results
from tripwatt.study.evaluation.run import DEFAULT_PROTOCOL, PROTOCOLS, evaluate, find_protocol

__all__ = [
    "DEFAULT_PROTOCOL",
    "PROTOCOLS",
    "CarChoice",
    "EvaluationProtocol",
    "EvaluationRun",
    "Execution",
    "choose_models",
    "evaluate",
    "find_protocol",
    "paired_difference",
    "write_results",
]
