"""Errors of models on trips they were not fitted on: protocols, held-out runs, metrics, paired comparisons."""

from tripwatt.study.evaluation.folds import Execution
from tripwatt.study.evaluation.hold_outs import CarChoice, HoldOutChoice, Splitter
from tripwatt.study.evaluation.metrics import (
    ErrorSummary,
    PairedDifference,
    paired_difference,
    summarise_errors,
)
from tripwatt.study.evaluation.outside import AnyModel, WholeModel
from tripwatt.study.evaluation.protocol import EvaluationProtocol, choose_models
from tripwatt.study.evaluation.results import EvaluationRun, write_results
from tripwatt.study.evaluation.run import DEFAULT_PROTOCOL, PROTOCOLS, evaluate, find_protocol

__all__ = [
    "DEFAULT_PROTOCOL",
    "PROTOCOLS",
    "AnyModel",
    "CarChoice",
    "ErrorSummary",
    "EvaluationProtocol",
    "EvaluationRun",
    "Execution",
    "HoldOutChoice",
    "PairedDifference",
    "Splitter",
    "WholeModel",
    "choose_models",
    "evaluate",
    "find_protocol",
    "paired_difference",
    "summarise_errors",
    "write_results",
]
