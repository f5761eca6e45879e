"""How well a model predicts trips that it has never seen: protocols, held-out runs, metrics, paired comparisons."""

from tripwatt.evaluation.metrics import ErrorSummary, PairedDifference, paired_difference, summarise_errors
from tripwatt.evaluation.protocols import MODEL_NAMES, PROTOCOLS, ModelSpec, protocol_models
from tripwatt.evaluation.results import EvaluationRun, write_results
from tripwatt.evaluation.run import evaluate

__all__ = [
    "MODEL_NAMES",
    "PROTOCOLS",
    "ErrorSummary",
    "EvaluationRun",
    "ModelSpec",
    "PairedDifference",
    "evaluate",
    "paired_difference",
    "protocol_models",
    "summarise_errors",
    "write_results",
]
