"""Errors of models on trips they were not fitted on: protocols, held-out runs, metrics, paired comparisons."""

from tripwatt.evaluation.folds import Execution
from tripwatt.evaluation.hold_outs import CarChoice, HoldOutChoice, Splitter
from tripwatt.evaluation.metrics import ErrorSummary, PairedDifference, paired_difference, summarise_errors
from tripwatt.evaluation.outside import AnyModel, WholeModel
from tripwatt.evaluation.protocol import EvaluationProtocol, choose_models
from tripwatt.evaluation.results import EvaluationRun, write_results
from tripwatt.evaluation.run import DEFAULT_PROTOCOL, PROTOCOLS, evaluate, find_protocol

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
